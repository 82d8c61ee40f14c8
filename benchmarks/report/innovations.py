"""Whether readings came as far off as each estimator expected: the mean NIS of every sensor, with its band."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.metrics.innovations import NAMES, Banded, mean_nis
from benchmarks.report.cell_links import link
from benchmarks.report.report_data import ReportData
from benchmarks.runner.results import by_estimator, median_metrics
from fusion.output.tables import Table


def nis_of_cells(data: ReportData) -> dict[tuple[str, str], dict[str, Banded]]:
    """Of the cells that are shown and were not lost, by run and estimator."""
    return {key: mean_nis(series.fates) for key, series in data.series.items() if series.is_scored}


def innovations(data: ReportData) -> Table:
    """One row for each estimator and sensor, one column for each shown run: a mean outside its band is bold."""
    found = nis_of_cells(data)
    head = ("estimator", "sensor", "inside 95 %, median", *data.scored_runs)
    title = "Innovations: mean NIS [band of an honest filter, 95 %]; above: surer of its readings than right"
    return Table(title, head, tuple(_rows(data, found)))


def _rows(data: ReportData, found: dict[tuple[str, str], dict[str, Banded]]) -> Iterator[tuple[str, ...]]:
    grouped = by_estimator(data.results)
    for name in data.estimators:
        medians = median_metrics(grouped[name])
        of_runs = {run_id: found.get((run_id, name), {}) for run_id in data.scored_runs}
        for sensor in NAMES:
            if any(sensor in told for told in of_runs.values()):
                share = medians.get(f"nis95_{sensor}", np.nan)
                cells = (_cell(data, run_id, name, told.get(sensor)) for run_id, told in of_runs.items())
                yield (name, sensor, "–" if np.isnan(share) else f"{100.0 * share:.0f} %", *cells)


def _cell(data: ReportData, run_id: str, name: str, told: Banded | None) -> str:
    if told is None:
        return "–"
    number = link(data, f"{told.mean:.2f}", data.series[run_id, name].result)
    return f"{number if told.is_inside else f'**{number}**'} [{told.low:.2f}, {told.high:.2f}]"
