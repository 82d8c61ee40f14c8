"""The tables of a report. Their numbers lead to the cells they come from."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from benchmarks.limits.fix_bound import eff_crlb
from benchmarks.limits.posterior_bound import eff_pcrlb, posterior_bound
from benchmarks.metrics.catalogue import COLUMNS, column
from benchmarks.metrics.credibility import credibility_metrics
from benchmarks.metrics.metric import Unit
from benchmarks.metrics.score import quantile
from benchmarks.report.cell_links import link, link_all, nearest, nearest_to
from benchmarks.report.report_data import ReportData
from benchmarks.report.worst import command, worst_moments
from benchmarks.runner.results import Result, by_estimator, by_run, median_metrics, score_matrix
from benchmarks.runner.scoring import ALIVE
from benchmarks.runner.suite import CLEAN
from benchmarks.statistics.paired_tests import mean_interval
from fusion.arrays import Floats
from fusion.output.tables import Table, as_code

OUTAGE_COLUMNS = (
    column("fault_availability", "available inside", separator=", "),
    column("fault_max_in_outage", "greatest error inside", separator=", "),
    column("fault_growth", "growth inside", separator=", "),
    column("fault_t_recover", "below 1 m again after", separator=", ", decimals=1),
)


def leaderboard(data: ReportData) -> Table:
    """The best first, with a letter for those that cannot be distinguished, and the worst run beside the median."""
    grouped, unit = by_estimator(data.results), data.unit
    letters = data.comparison.letters if data.comparison else {}
    rows = []
    for name in data.estimators:
        own = grouped[name]
        medians, alive = median_metrics(own), sum(result.status in ALIVE for result in own)
        scores = np.median(score_matrix(own, data.metric), axis=1)
        worst = unit.number(scores.max()) if data.scored_runs else "–"
        worst = link(data, worst, nearest(own, data.metric, scores.max()))
        head = (letters.get(name, "–"), link_all(data, f"{alive}/{len(own)}", name))
        over_runs = link_all(data, _interval(scores, unit), name)
        numbers = (
            link(data, one.text(medians), nearest(own, one.key, medians.get(one.key, math.inf))) for one in COLUMNS
        )
        rows.append((name, *head, over_runs, worst, *numbers))
    titles = (one.title.replace("\n", " ") for one in COLUMNS)
    metric = f"{data.metric} {unit.name}".rstrip()
    titled = ("estimator", "alike", "cells ok", f"{metric} over runs [95 %]", f"worst run, {metric}", *titles)
    return Table("Leaderboard: medians over cells without faults", titled, tuple(rows))


def _interval(scores: Floats, unit: Unit) -> str:
    """Geometric mean over runs with its t interval; the runs that were lost are not in it, and are counted."""
    alive = scores[np.isfinite(scores) & (scores > 0.0)]
    if len(alive) < 2:
        return "–"
    interval = mean_interval(np.log(alive))
    mean, low, high = (unit.number(math.exp(min(float(value), 50.0))) for value in interval[:3])
    gone = f" ({len(scores) - len(alive)} lost)" if len(alive) < len(scores) else ""
    return f"{mean} [{low}, {high}]{gone}"


def faults(data: ReportData) -> Table:
    """Effect of each fault on each estimator: the median over runs of faulty over clean."""
    clean, applied = by_estimator(data.results), data.suite.faults[1:]
    rows = [(name, *(_under(data, name, clean[name], fault.id) for fault in applied)) for name in data.estimators]
    head = ("estimator", *(fault.id for fault in data.suite.faults if fault.id != CLEAN))
    return Table(f"Faults: {data.metric} as a multiple of the clean run's, median over runs", head, tuple(rows))


def _under(data: ReportData, name: str, clean: Sequence[Result], fault: str) -> str:
    """One estimator under one fault, over its ``clean`` cells; leads to the run that stands in the middle."""
    own = by_estimator(data.results, fault)[name]
    base, scores = (np.median(score_matrix(cells, data.metric), axis=1) for cells in (clean, own))
    ratios = np.where(np.isfinite(base), scores / base, np.inf)
    ratio = quantile(ratios, 0.5)
    lost = sum(result.status not in ALIVE for result in own)
    row = nearest_to(ratios.tolist(), ratio)
    text = _times(ratio) + (f" ({lost} lost)" if lost else "")
    return link(data, text, nearest(list(by_run(own).values())[row], data.metric, scores[row]))


def outages(data: ReportData) -> Table:
    """Errors while each fault with windows lasted, and the recovery after it; no rows without such."""
    rows, clean = [], by_estimator(data.results)
    for fault in data.suite.faults[1:]:
        grouped = by_estimator(data.results, fault.id)
        for name in data.estimators:
            medians = median_metrics(grouped[name])
            numbers = [one.text(medians) for one in OUTAGE_COLUMNS]
            if set(numbers) != {"–"}:
                rows.append((fault.id, name, *numbers, _under(data, name, clean[name], fault.id)))
    head = ("fault", "estimator", *(one.title for one in OUTAGE_COLUMNS), f"{data.metric} over clean")
    return Table("While a fault lasts: medians over cells, the worst of its windows", head, tuple(rows))


def _times(ratio: float) -> str:
    return "∞" if not math.isfinite(ratio) else f"{ratio:.2f}×"


def limits(data: ReportData) -> Table:
    """Ratio of each estimator's error to the posterior Cramér-Rao bound of the run, over the shown runs."""
    bounds = {run_id: posterior_bound(data.run(run_id)) for run_id in data.scored_runs}
    rows = []
    for name in data.estimators:
        cells = []
        for run_id, bound in bounds.items():
            series = data.series.get((run_id, name))
            if series is None or not series.is_scored or not np.array_equal(series.instants.time_ns, bound.time_ns):
                cells.append("–")
                continue
            ratio = eff_pcrlb(series.error_m[None], bound.error_m[None])
            cells.append("–" if math.isnan(ratio) else link(data, f"{ratio:.2f}×", series.result))
        rows.append((name, *cells))
    title = "Times the physical limit: RMSE over the posterior Cramér-Rao bound of the run (0.89 is perfect in one run)"
    return Table(title, ("estimator", *bounds), tuple(rows))


def fixes(data: ReportData) -> Table:
    """Error of one perfect fix from a reading of every anchor over that of each estimator (`eff_crlb`)."""
    rows = []
    for name in data.estimators:
        series = [data.series.get((run_id, name)) for run_id in data.scored_runs]
        ratios = [
            math.nan if one is None or not one.is_scored else eff_crlb(one.error_m, data.fix_bound_m(one))
            for one in series
        ]
        rows.append((name, *("–" if math.isnan(ratio) else f"{100.0 * ratio:.0f} %" for ratio in ratios)))
    title = "One perfect fix: its Cramér-Rao bound over the RMSE (only motion or a prior brings more than 100 %)"
    return Table(title, ("estimator", *data.scored_runs), tuple(rows))


def credibility(data: ReportData) -> Table:
    """Claimed against actual errors over the seeds, under each set of faults.

    Without faults the seeds share every reading, and an error that all of them share would count as the actual one.
    """
    faults = [fault.id for fault in data.suite.faults if fault.id != CLEAN]
    rows = []
    for name in data.estimators:
        by_fault = [credibility_metrics(data.seeds(name, fault)) for fault in faults]
        rows.append((name, *(_decibels(scores) for scores in by_fault)))
    title = "Credibility over the seeds: nci, and incl in brackets, dB (0 is credible, incl above 0 too certain)"
    return Table(title, ("estimator", *faults), tuple(rows))


def _decibels(scores: dict[str, float]) -> str:
    return "–" if math.isnan(scores["nci"]) else f"{scores['nci']:.1f} ({scores['incl']:+.1f})"


def moments(data: ReportData) -> Table:
    """The worst moments, each with its command."""
    rows = tuple(
        (
            one.cell.run.id,
            one.cell.estimator.id,
            f"{one.worst_at_s:.1f}",
            link(data, f"{100.0 * one.metrics['pos_max']:.0f}", one),
            f"`{command(one, data.words)}`",
        )
        for one in worst_moments(data.results)
    )
    return Table("Worst moments", ("run", "estimator", "time, s", "error, cm", "command"), rows, prose=True)


def lost(data: ReportData) -> Table:
    """Every cell that did not survive, and why."""
    rows = tuple(
        (link(data, str(result.cell), result), result.status, as_code(result.error or result.status))
        for result in data.results
        if result.status not in ALIVE
    )
    return Table("Lost cells", ("cell", "status", "why"), rows, prose=True)


def provenance(data: ReportData) -> Table:
    """Source and content hash of every run of the suite."""
    runs = [
        (run.id, run.mcap or f"{run.scenario}, seed {run.seed}", run.split, _content(data, run.id))
        for run in data.suite.runs
    ]
    return Table("Runs", ("run", "source", "split", "content"), tuple(runs), prose=True)


def _content(data: ReportData, run_id: str) -> str:
    return next(result.cell.content.measured[:16] for result in data.results if result.cell.run.id == run_id)


def estimators(data: ReportData) -> Table:
    """Estimator and parameters of each name, and the runs on which they were chosen."""
    rows = tuple(
        (
            one.id,
            one.use,
            ", ".join(one.tuned_on) or "–",
            ", ".join(f"{key} = {value}" for key, value in one.params.items()) or "defaults",
        )
        for one in data.suite.estimators
    )
    return Table("Estimators", ("id", "estimator", "tuned on", "parameters"), rows, prose=True)


def damage(data: ReportData) -> Table:
    """Definition of each fault, as the suite has it; no rows without any."""
    rows = tuple(
        (fault.id, "; ".join(", ".join(f"{key} = {value}" for key, value in one.items()) for one in fault.apply))
        for fault in data.suite.faults
        if fault.id != CLEAN
    )
    return Table("Damage", ("fault", "what it does"), rows, prose=True)
