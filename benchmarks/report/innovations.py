"""Innovations of each estimator: the mean NIS of every sensor, with its band."""

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
    head = ("estimator", "sensor", "inside 95 %, median", *data.scored_runs)
    title = "Innovations: mean NIS [band of an honest filter, 95 %]; above: surer of its readings than right"
    return Table(title, head, tuple(_rows(data, nis_of_cells(data))))


def _rows(data: ReportData, nis: dict[tuple[str, str], dict[str, Banded]]) -> Iterator[tuple[str, ...]]:
    grouped = by_estimator(data.results)
    for name in data.estimators:
        medians = median_metrics(grouped[name])
        of_runs = {run_id: nis.get((run_id, name), {}) for run_id in data.scored_runs}
        for sensor in NAMES:
            if any(sensor in known for known in of_runs.values()):
                share = medians.get(f"nis95_{sensor}", np.nan)
                cells = (_cell(data, run_id, name, known.get(sensor)) for run_id, known in of_runs.items())
                yield (name, sensor, "–" if np.isnan(share) else f"{100.0 * share:.0f} %", *cells)


def _cell(data: ReportData, run_id: str, name: str, nis: Banded | None) -> str:
    if nis is None:
        return "–"
    number = link(data, f"{nis.mean:.2f}", data.series[run_id, name].result)
    return f"{number if nis.is_inside else f'**{number}**'} [{nis.low:.2f}, {nis.high:.2f}]"
