"""Consistency of estimators: NEES of their answers, NIS of the readings they expected.

Every mean has its own band, which counts how many independent samples it is of.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from benchmarks.metrics.innovations import NAMES, Banded
from benchmarks.report.figure_panel import Panel, height_of
from benchmarks.report.innovations import nis_of_cells
from benchmarks.report.report_data import ReportData
from benchmarks.runner.results import Result, by_estimator
from fusion.arrays import Floats
from fusion.output.figures import plain_colour

BAND = ("anees", "anees_band_low", "anees_band_high")

Judged = tuple[Result, Banded]
"""A cell, and the mean of what is judged of it."""


def consistency(data: ReportData) -> Iterator[Panel]:
    """NEES of every cell without faults, and the NIS of every sensor in the runs that are shown."""
    cells, nis = by_estimator(data.results), nis_of_cells(data)
    nees = {name: [_nees(result) for result in cells[name]] for name in data.estimators}
    yield from _drawn(data, "ANEES", "Answers: ANEES", nees)
    for sensor in NAMES:
        judged = {name: list(_nis(data, nis, name, sensor)) for name in data.estimators}
        yield from _drawn(data, f"mean NIS of {sensor}", f"Readings of {sensor}: mean NIS", judged)


def _nees(result: Result) -> Judged:
    return result, Banded(*(result.metrics.get(key, np.nan) for key in BAND))


def _nis(
    data: ReportData, nis: Mapping[tuple[str, str], Mapping[str, Banded]], name: str, sensor: str
) -> Iterator[Judged]:
    for (run_id, own), by_sensor in nis.items():
        if own == name and sensor in by_sensor:
            yield data.series[run_id, own].result, by_sensor[sensor]


def _drawn(data: ReportData, what: str, title: str, judged: Mapping[str, Sequence[Judged]]) -> Iterator[Panel]:
    """A row for each estimator that has any."""
    known = {name: [one for one in own if np.isfinite(one[1].mean)] for name, own in judged.items()}
    shown = {name: own for name, own in known.items() if own}
    if not shown:
        return
    panel = Panel(title, "1 is honest, right of it surer than right", "", height_of(len(shown)))
    panel.axes.axvline(1.0, color="0.5", linewidth=1, zorder=1)
    for row, (name, own) in enumerate(shown.items()):
        places = row + np.linspace(-0.3, 0.3, len(own) + 2)[1:-1]
        _draw(panel, plain_colour(data.use(name)), places, [one for _, one in own])
        for place, (result, one) in zip(places, own, strict=True):
            caption = f"{name}, {result.cell.run.id}: {what} {one.mean:.2f} [{one.low:.2f}, {one.high:.2f}]"
            panel.lead(one.mean, place, data.anchor(result), caption)
    panel.rows(list(shown))
    panel.log("x")
    yield panel


def _draw(panel: Panel, colour: tuple[float, float, float], places: Floats, own: Sequence[Banded]) -> None:
    """Dots inside their bands, crosses outside: distinct without colour."""
    mean, low, high = np.array(own).T
    inside = np.array([one.is_inside for one in own])
    panel.axes.hlines(places, low, high, color="0.8", linewidth=3, zorder=1)
    panel.axes.scatter(mean[inside], places[inside], color=colour, s=24, zorder=2)
    panel.axes.scatter(mean[~inside], places[~inside], color=colour, s=32, marker="x", linewidth=2, zorder=2)
