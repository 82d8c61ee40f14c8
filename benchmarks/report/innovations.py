"""Whether readings came as far off as each estimator expected: the mean NIS of every sensor, with its band."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.metrics.innovations import NAMES, Banded, mean_nis
from benchmarks.report.cell_links import link
from benchmarks.report.report_data import Material
from benchmarks.runner.results import by_contestant, median_metrics
from fusion.output.tables import Sheet


def nis_of_cells(material: Material) -> dict[tuple[str, str], dict[str, Banded]]:
    """Of the cells that are shown and were not lost, by run and contestant."""
    return {key: mean_nis(series.fates) for key, series in material.series.items() if series.is_scored}


def innovations(material: Material) -> Sheet:
    """One row for each estimator and sensor, one column for each shown run: a mean outside its band is bold."""
    found = nis_of_cells(material)
    head = ("estimator", "sensor", "inside 95 %, median", *material.scored_runs)
    title = "Innovations: mean NIS [band of an honest filter, 95 %]; above: surer of its readings than right"
    return Sheet(title, head, tuple(_rows(material, found)))


def _rows(material: Material, found: dict[tuple[str, str], dict[str, Banded]]) -> Iterator[tuple[str, ...]]:
    grouped = by_contestant(material.results)
    for name in material.contestants:
        medians = median_metrics(grouped[name])
        of_runs = {run_id: found.get((run_id, name), {}) for run_id in material.scored_runs}
        for sensor in NAMES:
            if any(sensor in told for told in of_runs.values()):
                share = medians.get(f"nis95_{sensor}", np.nan)
                cells = (_cell(material, run_id, name, told.get(sensor)) for run_id, told in of_runs.items())
                yield (name, sensor, "–" if np.isnan(share) else f"{100.0 * share:.0f} %", *cells)


def _cell(material: Material, run_id: str, name: str, told: Banded | None) -> str:
    if told is None:
        return "–"
    number = link(material, f"{told.mean:.2f}", material.series[run_id, name].result)
    return f"{number if told.is_inside else f'**{number}**'} [{told.low:.2f}, {told.high:.2f}]"
