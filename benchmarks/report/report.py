"""``fusion bench report``: the results of a suite as one page that a reviewer would accept."""

from __future__ import annotations

import platform
import shlex
from collections.abc import Callable, Iterator, Mapping

import numpy as np

import fusion
from benchmarks.metrics.credibility import LEAST_SEEDS
from benchmarks.report import tables
from benchmarks.report.accuracy_figures import accuracy, cost, over_time
from benchmarks.report.cell_links import SCRIPT, counted, entries
from benchmarks.report.consistency import consistency
from benchmarks.report.figure_panel import POINTING, Panel, group
from benchmarks.report.innovations import innovations
from benchmarks.report.maps import maps
from benchmarks.report.pairs import deciding, pairs, run_by_run
from benchmarks.report.report_data import ReportData
from benchmarks.report.sensitivity import advice, curves, sensitivity, sweeps
from benchmarks.runner.results import judged, record, warnings
from benchmarks.runner.suite import CLEAN, TUNE
from benchmarks.statistics.block_bootstrap import LEAST_INSTANTS, within_run
from fusion.output.figures import require_matplotlib
from fusion.output.html import as_html
from fusion.output.tables import Table, as_code, as_markdown

WITHIN_RUN = ("pos_p75", 0.75)
"""The quantile that is compared within one run; its instants have no other score."""

ABOUT = (
    "Errors are horizontal distances to the truth, raw: nothing is aligned. An instant without a valid answer counts "
    "as infinite. Every number that is a link, and every point of a figure, leads to the cell it comes from, with the "
    "command that opens Rerun where that cell erred most; a point of a curve or a track to that of its own moment."
)


def report(data: ReportData, *, limit: bool = False) -> str:
    """The page as Markdown with its figures in it; with ``limit`` also how far from the physical limit all are."""
    suite = data.suite
    counts = ((len(suite.runs), "run"), (len(data.estimators), "estimator"), (len(suite.faults) - 1, "fault"))
    made = ", ".join(counted(*count) for count in (*counts, (suite.seeds, "seed")))
    parts = [
        f"# {suite.name}",
        *_verdicts(data),
        f"{made}: {counted(len(data.results), 'cell')}. {ABOUT}",
        *_about_runs(data),
        *_sections(data, limit=limit),
        *_sensitivity(data),
        *_provenance(data),
        "**Cells**",
        entries(data),
    ]
    return "\n\n".join(parts) + "\n"


def _about_runs(data: ReportData) -> Iterator[str]:
    """Warnings of runs, and those that do not count, with the reason."""
    yield from (f"**Warning**: {as_code(warning)}" for warning in warnings(data.results))
    if blind := sorted({result.cell.run.id for result in data.results if not result.cell.content.truth}):
        yield f"Without ground truth, and so without an error: {', '.join(blind)}."
    counting = {result.cell.run.id for result in judged(data.results)}
    if data.scored_runs and (len(counting) > len(data.scored_runs) or data.suite.seeds > 1):
        named = ", ".join(data.scored_runs)
        yield f"Curves over instants, maps and mean NIS are of the first seed of the first runs that count: {named}."
    tune = [run.id for run in data.suite.runs if run.split == TUNE]
    if len(tune) == len(data.suite.runs):
        yield "**All runs are for tuning**: parameters may have been chosen on what they are scored on here."
    elif tune:
        named = ", ".join(tune)
        yield f"Only for tuning, and in no number but those of the parameters and of their own cells: {named}."


def as_page(data: ReportData, *, limit: bool = False) -> bytes:
    """The report as one HTML file, with the numbers that make it a baseline for `fusion bench gate`; raises
    `FusionError` without matplotlib or markdown-it.
    """
    require_matplotlib()
    clean = [result for result in data.results if result.cell.fault.id == CLEAN]
    page = report(data, limit=limit)
    return as_html(data.suite.name, page, SCRIPT + POINTING, record(data.suite, clean))


def _verdicts(data: ReportData) -> Iterator[str]:
    """The best against every other, in sentences."""
    if data.comparison is None:
        yield "Nothing can be compared here: give at least two estimators, and runs with truth."
        return
    best = data.estimators[0]
    sentences = [
        f"{verdict.sentence} ([where](#{data.anchor(deciding(data, verdict))}))"
        for verdict in data.comparison.verdicts
        if best in (verdict.first, verdict.second)
    ]
    yield "\n".join(f"- {sentence}" for sentence in sentences + _within_the_run(data))


def _within_the_run(data: ReportData) -> list[str]:
    """Sentences within a single run, where that is all there is: of the best against every other."""
    if len(data.scored_runs) != 1:
        return []
    errors = {name: series.error_m for (_, name), series in data.series.items()}
    best, *others = (name for name in data.estimators if name in errors)
    if len(errors[best]) < LEAST_INSTANTS:
        return []
    return [within_run(best, other, errors, *WITHIN_RUN).sentence for other in others]


def _sections(data: ReportData, *, limit: bool) -> Iterator[str]:
    """Verdicts, consistency, errors over time and floor, cost, and faults."""
    yield _table(tables.leaderboard(data), "leaderboard")
    if data.comparison is not None:
        yield _table(pairs(data, data.comparison), "pairs")
    yield from _figure(data, "accuracy")
    if data.comparison is not None:
        yield as_markdown(run_by_run(data))
    yield from _figure(data, "consistency")
    yield from _known(innovations(data), "innovations")
    yield from _figure(data, "over_time")
    yield from _figure(data, "maps")
    yield from _known(tables.moments(data))
    yield from _known(tables.lost(data))
    yield from _figure(data, "cost")
    if limit and data.scored_runs:
        yield as_markdown(tables.limits(data))
        yield as_markdown(tables.fixes(data))
    if len(data.suite.faults) > 1:
        yield from _under_faults(data)


def _under_faults(data: ReportData) -> Iterator[str]:
    yield _table(tables.faults(data), "faults")
    yield from _known(tables.outages(data), "outages")
    if data.suite.seeds >= LEAST_SEEDS and data.scored_runs:
        yield _table(tables.credibility(data), "credibility")


def _table(table: Table, name: str = "") -> str:
    """A table with what there is to know of it."""
    return as_markdown(table) + (f"\n\n{NOTES[name]}" if name else "")


def _known(table: Table, name: str = "") -> Iterator[str]:
    """The same, where it has rows."""
    if table.rows:
        yield _table(table, name)


def _figure(data: ReportData, name: str) -> Iterator[str]:
    """Its panels, where there is anything to draw."""
    if data.has_errors and (panels := list(FIGURES[name](data))):
        yield f"{group(panels)}\n\n{NOTES[name]}"


def _sensitivity(data: ReportData) -> Iterator[str]:
    """Nothing without a grid, or where nothing was scored."""
    swept = sweeps(data) if data.has_errors else []
    if swept:
        yield as_markdown(sensitivity(data, swept))
        yield "\n".join(f"- {sentence}" for sentence in advice(swept))
        yield f"{group(curves(data, swept))}\n\n{NOTES['parameters']}"


def _provenance(data: ReportData) -> Iterator[str]:
    command = shlex.join(["fusion", "bench", "run", *data.words])
    yield as_markdown(tables.provenance(data))
    yield as_markdown(tables.estimators(data))
    if data.suite.left_out:
        yield f"Left out: {'; '.join(data.suite.left_out)}."
    yield from _known(tables.damage(data))
    yield (
        f"fusion {fusion.__version__}, numpy {np.__version__}, Python {platform.python_version()}. Every cell is made "
        f"again by `{command}`; `fusion bench verify` computes a sample anew and compares it to the bit."
    )


NOTES: Mapping[str, str] = {
    "leaderboard": (
        "Estimators that share a letter under `alike` cannot be distinguished. Over runs: geometric mean with its 95 % "
        "t interval. Worst run: the highest score of all. All other numbers are medians over cells. p75: three "
        "quarters of the instants err less. Quantiles count every instant; RMSE, mean and max only those with a valid "
        "answer, so read them with the availability, the share of such instants; heading errors only those whose true "
        "heading is known (`head_n` of the exported numbers)."
    ),
    "pairs": (
        "Ratio of the first to the second: geometric mean over runs with its 95 % t interval, below 1 where the first "
        "is better. `p, Holm` decides, at 5 %; it is the p of that mean, or of the signed ranks where one of the two "
        "was lost in a run, corrected for the number of pairs. Intervals and `p, signed ranks` are of each pair alone. "
        "The runs that a verdict needs, and the differences that so many runs show, are those that four of five such "
        "suites would find."
    ),
    "innovations": (
        "NIS: squared innovation of a reading over its predicted variance; refused readings count too. Inside 95 %: "
        "share of readings below the 95 % point of chi-square, median over cells. Bold lies outside its band."
    ),
    "faults": (
        "Every estimator meets the same damage. ∞: no finite score in at least half of the runs. Below 1 is no "
        "mistake: a reading that is missing cannot mislead, and what is drawn anew may fall better."
    ),
    "outages": (
        "Growth: slope of the error over time. Below 1 m again: from the end of the window until the error stays below "
        "1 m for 5 s; ∞ where the run ends before that, in at least half of the cells."
    ),
    "credibility": (
        "nci: mean of 10 |log₁₀(ν / ν*)|, incl the same without the bars; ν is the squared error over the claimed "
        "covariance, ν* over the actual mean square of the seeds' errors (Li & Zhao 2006)."
    ),
    "accuracy": (
        "Curves: of all instants of the shown runs the share that errs less; they end at the availability, for an "
        "instant without a valid answer is below no error. Verdicts rest on what happens along the grey lines, one per "
        "run."
    ),
    "consistency": (
        "A dot lies inside its grey band, a cross outside; an honest filter's mean lies inside with 95 %. The band "
        "takes as many independent samples as those of the mean are worth, which correlate in time; it is "
        "approximate. ANEES: squared error of the pose over its claimed covariance, per dimension, in every cell "
        "without faults. An estimator that claims no covariance, or predicts no readings, has no row. At 10 errors "
        "are about three times what was claimed, at 0.1 a third of it."
    ),
    "over_time": (
        "Lines are named below the first panel, and below any where they are pointed at. Gaps are instants without a "
        "valid answer; errors below 1 cm are not shown, unless all are small. Where a line has more points than can "
        "be drawn, the greatest of neighbours stands for all of them."
    ),
    "maps": (
        "The best estimator's track, coloured by its error, over the true path; triangles are anchors, contours the "
        "least error of a fix from one reading of each (Cramér-Rao)."
    ),
    "parameters": (
        "Below 1 is better than the default. A grey line is a run, dashed where it is for tuning; bars are the 95 % "
        "interval over the test runs."
    ),
    "cost": "Measured alone on one machine by `fusion bench time`. Lower left is better.",
}


FIGURES: Mapping[str, Callable[[ReportData], Iterator[Panel]]] = {
    "accuracy": accuracy,
    "consistency": consistency,
    "over_time": over_time,
    "maps": maps,
    "cost": cost,
}
