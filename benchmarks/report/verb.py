"""``fusion bench report``: the results of a suite as one page that a reviewer would accept."""

from __future__ import annotations

import argparse
import platform
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import fusion
from benchmarks.metrics.credibility import LEAST_SEEDS
from benchmarks.output import write
from benchmarks.page import as_html
from benchmarks.plotting import require_matplotlib
from benchmarks.report import tables
from benchmarks.report.cells import SCRIPT, counted, entries
from benchmarks.report.figures import FIGURES
from benchmarks.report.innovations import innovations
from benchmarks.report.material import Material
from benchmarks.report.notes import NOTES
from benchmarks.report.pairs import deciding, pairs, run_by_run
from benchmarks.report.panel import POINTING, group, without_targets
from benchmarks.report.sensitivity import advice, curves, sensitivity, sweeps
from benchmarks.runner.compare_verb import stored_results
from benchmarks.runner.definition import CLEAN, TUNE
from benchmarks.runner.plan_verb import suite_options
from benchmarks.runner.results import RANKED_BY, judged, record, require_lower_is_better, require_metric, warnings
from benchmarks.runner.store import Store
from benchmarks.sheet import Sheet, as_code, as_markdown
from benchmarks.statistics.within_run import LEAST_INSTANTS, within_run

WITHIN_RUN = ("pos_p75", 0.75)
"""The quantile that is compared within one run; its instants have no other score."""

ABOUT = (
    "Errors are horizontal distances to the truth, raw: nothing is aligned. An instant without a valid answer counts "
    "as infinite. Every number that is a link, and every point of a figure, leads to the cell it comes from, with the "
    "command that opens Rerun where that cell erred most; a point of a curve or a track to that of its own moment."
)


def report(material: Material, *, limit: bool = False) -> str:
    """The page as Markdown with its figures in it; with ``limit`` also how far from the physical limit all are."""
    suite = material.suite
    counts = ((len(suite.runs), "run"), (len(material.contestants), "estimator"), (len(suite.faults) - 1, "fault"))
    made = ", ".join(counted(*count) for count in (*counts, (suite.seeds, "seed")))
    parts = [
        f"# {suite.name}",
        *_verdicts(material),
        f"{made}: {counted(len(material.results), 'cell')}. {ABOUT}",
        *_about_runs(material),
        *_sections(material, limit=limit),
        *_sensitivity(material),
        *_provenance(material),
        "**Cells**",
        entries(material),
    ]
    return "\n\n".join(parts) + "\n"


def _about_runs(material: Material) -> Iterator[str]:
    """What is wrong with runs, and which do not count, and why."""
    yield from (f"**Warning**: {as_code(warning)}" for warning in warnings(material.results))
    if blind := sorted({result.cell.run.id for result in material.results if not result.cell.content.truth}):
        yield f"Without ground truth, and so without an error: {', '.join(blind)}."
    counting = {result.cell.run.id for result in judged(material.results)}
    if material.scored_runs and (len(counting) > len(material.scored_runs) or material.suite.seeds > 1):
        named = ", ".join(material.scored_runs)
        yield f"Curves over instants, maps and mean NIS are of the first seed of the first runs that count: {named}."
    tune = [run.id for run in material.suite.runs if run.split == TUNE]
    if len(tune) == len(material.suite.runs):
        yield "**All runs are for tuning**: parameters may have been chosen on what they are scored on here."
    elif tune:
        named = ", ".join(tune)
        yield f"Only for tuning, and in no number but those of the parameters and of their own cells: {named}."


def as_page(material: Material, *, limit: bool = False) -> bytes:
    """The report as one HTML file, with the numbers that make it a baseline for `fusion bench gate`; raises
    `FusionError` without matplotlib or markdown-it.
    """
    require_matplotlib()
    clean = [result for result in material.results if result.cell.fault.id == CLEAN]
    page = report(material, limit=limit)
    return as_html(material.suite.name, page, SCRIPT + POINTING, record(material.suite, clean))


def _verdicts(material: Material) -> Iterator[str]:
    """The best against every other, in sentences."""
    if material.comparison is None:
        yield "Nothing can be compared here: give at least two estimators, and runs with truth."
        return
    best = material.contestants[0]
    told = [
        f"{verdict.sentence} ([where](#{material.anchor(deciding(material, verdict))}))"
        for verdict in material.comparison.verdicts
        if best in (verdict.first, verdict.second)
    ]
    yield "\n".join(f"- {sentence}" for sentence in told + _within_the_run(material))


def _within_the_run(material: Material) -> list[str]:
    """Where one run is all there is: what it says of itself, of the best against every other."""
    if len(material.scored_runs) != 1:
        return []
    errors = {name: series.error_m for (_, name), series in material.series.items()}
    best, *others = (name for name in material.contestants if name in errors)
    if len(errors[best]) < LEAST_INSTANTS:
        return []
    return [within_run(best, other, errors, *WITHIN_RUN).sentence for other in others]


def _sections(material: Material, *, limit: bool) -> Iterator[str]:
    """Who is better, how honest all are, where and when they err, what it costs, and what breaks them."""
    yield _table(tables.leaderboard(material), "leaderboard")
    if material.comparison is not None:
        yield _table(pairs(material, material.comparison), "pairs")
    yield from _figure(material, "accuracy")
    if material.comparison is not None:
        yield as_markdown(run_by_run(material))
    yield from _figure(material, "consistency")
    yield from _known(innovations(material), "innovations")
    yield from _figure(material, "over_time")
    yield from _figure(material, "maps")
    yield from _known(tables.moments(material))
    yield from _known(tables.lost(material))
    yield from _figure(material, "cost")
    if limit and material.scored_runs:
        yield as_markdown(tables.limits(material))
        yield as_markdown(tables.fixes(material))
    if len(material.suite.faults) > 1:
        yield from _under_faults(material)


def _under_faults(material: Material) -> Iterator[str]:
    yield _table(tables.faults(material), "faults")
    yield from _known(tables.outages(material), "outages")
    if material.suite.seeds >= LEAST_SEEDS and material.scored_runs:
        yield _table(tables.credibility(material), "credibility")


def _table(sheet: Sheet, name: str = "") -> str:
    """A table with what there is to know of it."""
    return as_markdown(sheet) + (f"\n\n{NOTES[name]}" if name else "")


def _known(sheet: Sheet, name: str = "") -> Iterator[str]:
    """The same, where it has rows."""
    if sheet.rows:
        yield _table(sheet, name)


def _figure(material: Material, name: str) -> Iterator[str]:
    """Its panels, where there is anything to draw."""
    if material.has_errors and (panels := list(FIGURES[name](material))):
        yield f"{group(panels)}\n\n{NOTES[name]}"


def _sensitivity(material: Material) -> Iterator[str]:
    """Nothing without a grid, or where nothing was scored."""
    found = sweeps(material) if material.has_errors else []
    if found:
        yield as_markdown(sensitivity(material, found))
        yield "\n".join(f"- {sentence}" for sentence in advice(found))
        yield f"{group(curves(material, found))}\n\n{NOTES['parameters']}"


def _provenance(material: Material) -> Iterator[str]:
    command = shlex.join(["fusion", "bench", "run", *material.words])
    yield as_markdown(tables.provenance(material))
    yield as_markdown(tables.contestants(material))
    if material.suite.left_out:
        yield f"Left out: {'; '.join(material.suite.left_out)}."
    yield from _known(tables.damage(material))
    yield (
        f"fusion {fusion.__version__}, numpy {np.__version__}, Python {platform.python_version()}. Every cell is made "
        f"again by `{command}`; `fusion bench verify` computes a sample anew and compares it to the bit."
    )


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion bench report``."""
    suite_options(parser)
    parser.add_argument("--html", type=Path, metavar="F", help="one file, no network (needs the extra `plots`)")
    parser.add_argument("--markdown", type=Path, metavar="F", help="the same as Markdown, figures in it")
    parser.add_argument("--limit", action="store_true", help="compare with the physical limits of each run; slower")
    parser.add_argument("--metric", default=RANKED_BY, help="what is compared; lower is better (%(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Write the page."""
    require_matplotlib()
    suite, results = stored_results(arguments)
    require_metric(arguments.metric, results)
    require_lower_is_better(arguments.metric)
    material = Material(suite, results, Store(arguments.store), arguments.metric)
    targets = {}
    if arguments.markdown:
        targets[arguments.markdown] = without_targets(report(material, limit=arguments.limit)).encode()
    if arguments.html or not arguments.markdown:
        targets[arguments.html or Path(f"{suite.name}.html")] = as_page(material, limit=arguments.limit)
    for path, content in targets.items():
        write(path, content)
        sys.stdout.write(f"{path}\n")
    return 0
