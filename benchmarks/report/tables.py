"""The tables of a report."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.metrics.bound import eff_crlb
from benchmarks.metrics.credibility import credibility_metrics
from benchmarks.metrics.posterior import eff_pcrlb, posterior_bound
from benchmarks.metrics.score import quantile
from benchmarks.metrics.track import Floats
from benchmarks.report.material import Material
from benchmarks.report.worst import Moment
from benchmarks.runner.definition import CLEAN
from benchmarks.runner.results import ALIVE, Result, by_contestant, median_metrics, score_matrix
from benchmarks.sheet import Sheet
from benchmarks.statistics.statistics import mean_interval
from benchmarks.table import COLUMNS, Column, as_text


def leaderboard(material: Material) -> Sheet:
    """The best first, with the letters that say who cannot be told apart, and the worst run beside the median."""
    shown = [column for column in COLUMNS if column.key != "cpu_per_measurement_s"]
    grouped = by_contestant(material.results)
    letters = material.comparison.letters if material.comparison else {}
    rows = []
    for name in material.contestants:
        own = grouped[name]
        medians, alive = median_metrics(own), sum(result.status in ALIVE for result in own)
        scores = np.median(score_matrix(own, material.metric), axis=1)
        worst = f"{100.0 * scores.max():.1f}" if np.isfinite(scores.max()) else "∞"
        numbers = (as_text(column, medians) for column in shown)
        rows.append((name, letters.get(name, "–"), f"{alive}/{len(own)}", _interval_cm(scores), worst, *numbers))
    titles = (column.title.replace("\n", " ") for column in shown)
    over_runs = (f"{material.metric} over runs, cm [95 %]", f"worst run, {material.metric} cm")
    head = ("estimator", "alike", "cells ok", *over_runs, *titles)
    return Sheet("Leaderboard: medians over cells without faults", head, tuple(rows))


def _interval_cm(scores: Floats) -> str:
    """Geometric mean over runs with its t interval; the runs that were lost are not in it, and are counted."""
    alive = scores[np.isfinite(scores) & (scores > 0.0)]
    if len(alive) < 2:
        return "–"
    found = mean_interval(np.log(alive))
    mean, low, high = (100.0 * math.exp(min(float(value), 50.0)) for value in found[:3])
    gone = f" ({len(scores) - len(alive)} lost)" if len(alive) < len(scores) else ""
    return f"{mean:.0f} [{low:.0f}, {high:.0f}]{gone}"


def faults(material: Material) -> Sheet:
    """How much worse each fault makes each contestant: the median over runs of faulty over clean."""
    rows = []
    for name in material.contestants:
        cells = []
        for fault in material.suite.faults[1:]:
            own = by_contestant(material.results, fault.id)[name]
            lost = sum(result.status not in ALIVE for result in own)
            cells.append(_over_clean(material, name, own) + (f" ({lost} lost)" if lost else ""))
        rows.append((name, *cells))
    head = ("estimator", *(fault.id for fault in material.suite.faults if fault.id != CLEAN))
    return Sheet(f"Faults: {material.metric} as a multiple of the clean run's, median over runs", head, tuple(rows))


def outages(material: Material) -> Sheet:
    """What each fault with windows did while it lasted, and how soon after that was over; no rows without such."""
    rows = []
    for fault in material.suite.faults[1:]:
        grouped = by_contestant(material.results, fault.id)
        for name in material.contestants:
            medians = median_metrics(grouped[name])
            numbers = [as_text(column, medians) for column in OUTAGE_COLUMNS]
            if set(numbers) != {"–"}:
                rows.append((fault.id, name, *numbers, _over_clean(material, name, grouped[name])))
    head = ("fault", "estimator", *(column.title for column in OUTAGE_COLUMNS), f"{material.metric} over clean")
    return Sheet("While a fault lasts: medians over cells, the worst of its windows", head, tuple(rows))


OUTAGE_COLUMNS = (
    Column("fault_availability", "available inside, %", 100.0, 1),
    Column("fault_max_in_outage", "greatest error inside, cm", 100.0, 1),
    Column("fault_growth", "growth inside, cm/s", 100.0, 2),
    Column("fault_t_recover", "below 1 m again after, s", 1.0, 1),
)


def _over_clean(material: Material, name: str, faulty: Sequence[Result]) -> str:
    """The ranking metric of a contestant's ``faulty`` cells over that of its clean ones, median over runs."""
    clean = by_contestant(material.results)[name]
    ratios = (np.median(score_matrix(own, material.metric), axis=1) for own in (faulty, clean))
    return _times(quantile(np.divide(*ratios), 0.5))


def _times(ratio: float) -> str:
    return "∞" if not math.isfinite(ratio) else f"{ratio:.2f}×"


def limits(material: Material) -> Sheet:
    """How many times the posterior Cramér-Rao bound of the run each contestant errs, over the shown runs."""
    bounds = {run_id: posterior_bound(material.run(run_id)) for run_id in material.scored_runs}
    rows = []
    for name in material.contestants:
        cells = []
        for run_id, bound in bounds.items():
            series = material.series.get((run_id, name))
            same = series is not None and np.array_equal(series.instants.time_ns, bound.time_ns)
            ratio = eff_pcrlb(series.error_m[None], bound.error_m[None]) if series is not None and same else math.nan
            cells.append("–" if math.isnan(ratio) else f"{ratio:.2f}×")
        rows.append((name, *cells))
    title = "Times the physical limit: RMSE over the posterior Cramér-Rao bound of the run (0.89 is perfect in one run)"
    return Sheet(title, ("estimator", *bounds), tuple(rows))


def fixes(material: Material) -> Sheet:
    """What one perfect fix from a reading of every anchor would err, over what each contestant errs (`eff_crlb`)."""
    rows = []
    for name in material.contestants:
        series = [material.series.get((run_id, name)) for run_id in material.scored_runs]
        found = [math.nan if one is None else eff_crlb(one.error_m, material.fix_bound_m(one)) for one in series]
        rows.append((name, *("–" if math.isnan(ratio) else f"{100.0 * ratio:.0f} %" for ratio in found)))
    title = "One perfect fix: its Cramér-Rao bound over the RMSE (only motion or a prior brings more than 100 %)"
    return Sheet(title, ("estimator", *material.scored_runs), tuple(rows))


def credibility(material: Material) -> Sheet:
    """Claimed against actual errors over the seeds, under each set of faults.

    Without faults the seeds share every reading, and an error that all of them share would count as the actual one.
    """
    faults = [fault.id for fault in material.suite.faults if fault.id != CLEAN]
    rows = []
    for name in material.contestants:
        found = [credibility_metrics(material.seeds(name, fault)) for fault in faults]
        rows.append((name, *(_decibels(scores) for scores in found)))
    title = "Credibility over the seeds: nci, and incl in brackets, dB (0 is credible, incl above 0 too certain)"
    return Sheet(title, ("estimator", *faults), tuple(rows))


def _decibels(scores: dict[str, float]) -> str:
    return "–" if math.isnan(scores["nci"]) else f"{scores['nci']:.1f} ({scores['incl']:+.1f})"


def moments(found: Sequence[Moment], folder: Path) -> Sheet:
    """Where to look first, for a suite in ``folder``."""
    rows = tuple(
        (one.run.id, one.contestant.id, f"{one.at_s:.1f}", f"{100.0 * one.error_m:.0f}", one.command(folder))
        for one in found
    )
    return Sheet("Worst moments", ("run", "estimator", "time, s", "error, cm", "command"), rows, prose=True)


def lost(results: Sequence[Result]) -> Sheet:
    """Every cell that did not survive, and why."""
    rows = tuple(
        (str(result.cell), result.status, result.error or "fewer than half of its answers were valid")
        for result in results
        if result.status not in ALIVE
    )
    return Sheet("Lost cells", ("cell", "status", "why"), rows, prose=True)


def provenance(material: Material) -> Sheet:
    """What every run and estimator of the suite is, down to the hash."""
    runs = [
        (run.id, run.mcap or f"{run.scenario}, seed {run.seed}", run.split, _content(material, run.id))
        for run in material.suite.runs
    ]
    return Sheet("Runs", ("run", "source", "split", "content"), tuple(runs), prose=True)


def _content(material: Material, run_id: str) -> str:
    return next(result.cell.content.measured[:16] for result in material.results if result.cell.run.id == run_id)


def contestants(material: Material) -> Sheet:
    """What was run under each name."""
    rows = tuple(
        (one.id, one.use, ", ".join(f"{key} = {value}" for key, value in one.params.items()) or "defaults")
        for one in material.suite.contestants
    )
    return Sheet("Estimators", ("id", "estimator", "parameters"), rows, prose=True)
