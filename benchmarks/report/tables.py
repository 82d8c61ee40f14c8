"""The tables of a report. Their numbers lead to the cells they come from."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from benchmarks.cell import ALIVE
from benchmarks.limits.fix_bound import eff_crlb
from benchmarks.limits.posterior_bound import eff_pcrlb, posterior_bound
from benchmarks.metrics.catalogue import COLUMNS, Column, Unit, as_text
from benchmarks.metrics.credibility import credibility_metrics
from benchmarks.metrics.score import quantile
from benchmarks.report.cell_links import link, link_all, nearest, nearest_to
from benchmarks.report.report_data import Material
from benchmarks.report.worst import command, worst_moments
from benchmarks.runner.results import Result, by_contestant, by_run, median_metrics, score_matrix
from benchmarks.runner.suite import CLEAN
from benchmarks.statistics.paired_tests import mean_interval
from fusion.arrays import Floats
from fusion.output.tables import Sheet, as_code

OUTAGE_COLUMNS = (
    Column("fault_availability", "available inside, %", 100.0, 1),
    Column("fault_max_in_outage", "greatest error inside, cm", 100.0, 1),
    Column("fault_growth", "growth inside, cm/s", 100.0, 2),
    Column("fault_t_recover", "below 1 m again after, s", 1.0, 1),
)


def leaderboard(material: Material) -> Sheet:
    """The best first, with the letters that say who cannot be told apart, and the worst run beside the median."""
    shown = [column for column in COLUMNS if column.key != "cpu_per_measurement_s"]
    grouped, unit = by_contestant(material.results), material.unit
    letters = material.comparison.letters if material.comparison else {}
    rows = []
    for name in material.contestants:
        own = grouped[name]
        medians, alive = median_metrics(own), sum(result.status in ALIVE for result in own)
        scores = np.median(score_matrix(own, material.metric), axis=1)
        worst = unit.number(scores.max()) if material.scored_runs else "–"
        worst = link(material, worst, nearest(own, material.metric, scores.max()))
        head = (letters.get(name, "–"), link_all(material, f"{alive}/{len(own)}", name))
        over_runs = link_all(material, _interval(scores, unit), name)
        numbers = (
            link(material, as_text(column, medians), nearest(own, column.key, medians.get(column.key, math.inf)))
            for column in shown
        )
        rows.append((name, *head, over_runs, worst, *numbers))
    titles = (column.title.replace("\n", " ") for column in shown)
    metric = f"{material.metric} {unit.name}".rstrip()
    titled = ("estimator", "alike", "cells ok", f"{metric} over runs [95 %]", f"worst run, {metric}", *titles)
    return Sheet("Leaderboard: medians over cells without faults", titled, tuple(rows))


def _interval(scores: Floats, unit: Unit) -> str:
    """Geometric mean over runs with its t interval; the runs that were lost are not in it, and are counted."""
    alive = scores[np.isfinite(scores) & (scores > 0.0)]
    if len(alive) < 2:
        return "–"
    found = mean_interval(np.log(alive))
    mean, low, high = (unit.number(math.exp(min(float(value), 50.0))) for value in found[:3])
    gone = f" ({len(scores) - len(alive)} lost)" if len(alive) < len(scores) else ""
    return f"{mean} [{low}, {high}]{gone}"


def faults(material: Material) -> Sheet:
    """How much worse each fault makes each contestant: the median over runs of faulty over clean."""
    clean, struck = by_contestant(material.results), material.suite.faults[1:]
    rows = [
        (name, *(_under(material, name, clean[name], fault.id) for fault in struck)) for name in material.contestants
    ]
    head = ("estimator", *(fault.id for fault in material.suite.faults if fault.id != CLEAN))
    return Sheet(f"Faults: {material.metric} as a multiple of the clean run's, median over runs", head, tuple(rows))


def _under(material: Material, name: str, clean: Sequence[Result], fault: str) -> str:
    """One contestant under one fault, over its ``clean`` cells; leads to the run that stands in the middle."""
    own = by_contestant(material.results, fault)[name]
    base, scores = (np.median(score_matrix(cells, material.metric), axis=1) for cells in (clean, own))
    ratios = np.where(np.isfinite(base), scores / base, np.inf)
    ratio = quantile(ratios, 0.5)
    lost = sum(result.status not in ALIVE for result in own)
    row = nearest_to(ratios.tolist(), ratio)
    text = _times(ratio) + (f" ({lost} lost)" if lost else "")
    return link(material, text, nearest(list(by_run(own).values())[row], material.metric, scores[row]))


def outages(material: Material) -> Sheet:
    """What each fault with windows did while it lasted, and how soon after that was over; no rows without such."""
    rows, clean = [], by_contestant(material.results)
    for fault in material.suite.faults[1:]:
        grouped = by_contestant(material.results, fault.id)
        for name in material.contestants:
            medians = median_metrics(grouped[name])
            numbers = [as_text(column, medians) for column in OUTAGE_COLUMNS]
            if set(numbers) != {"–"}:
                rows.append((fault.id, name, *numbers, _under(material, name, clean[name], fault.id)))
    head = ("fault", "estimator", *(column.title for column in OUTAGE_COLUMNS), f"{material.metric} over clean")
    return Sheet("While a fault lasts: medians over cells, the worst of its windows", head, tuple(rows))


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
            if series is None or not series.is_scored or not np.array_equal(series.instants.time_ns, bound.time_ns):
                cells.append("–")
                continue
            ratio = eff_pcrlb(series.error_m[None], bound.error_m[None])
            cells.append("–" if math.isnan(ratio) else link(material, f"{ratio:.2f}×", series.result))
        rows.append((name, *cells))
    title = "Times the physical limit: RMSE over the posterior Cramér-Rao bound of the run (0.89 is perfect in one run)"
    return Sheet(title, ("estimator", *bounds), tuple(rows))


def fixes(material: Material) -> Sheet:
    """What one perfect fix from a reading of every anchor would err, over what each contestant errs (`eff_crlb`)."""
    rows = []
    for name in material.contestants:
        series = [material.series.get((run_id, name)) for run_id in material.scored_runs]
        found = [
            math.nan if one is None or not one.is_scored else eff_crlb(one.error_m, material.fix_bound_m(one))
            for one in series
        ]
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


def moments(material: Material) -> Sheet:
    """Where to look first."""
    rows = tuple(
        (
            one.cell.run.id,
            one.cell.contestant.id,
            f"{one.worst_at_s:.1f}",
            link(material, f"{100.0 * one.metrics['pos_max']:.0f}", one),
            f"`{command(one, material.words)}`",
        )
        for one in worst_moments(material.results)
    )
    return Sheet("Worst moments", ("run", "estimator", "time, s", "error, cm", "command"), rows, prose=True)


def lost(material: Material) -> Sheet:
    """Every cell that did not survive, and why."""
    rows = tuple(
        (link(material, str(result.cell), result), result.status, as_code(result.error or result.status))
        for result in material.results
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
    """What was run under each name, and on which runs its parameters were chosen."""
    rows = tuple(
        (
            one.id,
            one.use,
            ", ".join(one.tuned_on) or "–",
            ", ".join(f"{key} = {value}" for key, value in one.params.items()) or "defaults",
        )
        for one in material.suite.contestants
    )
    return Sheet("Estimators", ("id", "estimator", "tuned on", "parameters"), rows, prose=True)


def damage(material: Material) -> Sheet:
    """What each fault does, as the suite has it; no rows without any."""
    rows = tuple(
        (fault.id, "; ".join(", ".join(f"{key} = {value}" for key, value in one.items()) for one in fault.apply))
        for fault in material.suite.faults
        if fault.id != CLEAN
    )
    return Sheet("Damage", ("fault", "what it does"), rows, prose=True)
