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
from benchmarks.page import as_html, figure
from benchmarks.plotting import as_png, require_matplotlib
from benchmarks.report import tables
from benchmarks.report.cells import SCRIPT, counted, entries
from benchmarks.report.figures import FIGURES
from benchmarks.report.innovations import innovations
from benchmarks.report.material import Material
from benchmarks.report.pairs import deciding, pairs, run_by_run
from benchmarks.report.sensitivity import advice, curves, sensitivity, sweeps
from benchmarks.runner.compare_verb import stored_results
from benchmarks.runner.definition import CLEAN, TUNE
from benchmarks.runner.plan_verb import suite_options
from benchmarks.runner.results import RANKED_BY, record, require_metric
from benchmarks.runner.store import Store
from benchmarks.sheet import Sheet, as_markdown
from benchmarks.statistics.within_run import LEAST_INSTANTS, within_run

WITHIN_RUN = ("pos_p75", 0.75)
"""The quantile that is compared within one run; its instants have no other score."""

EXPLAINED = {
    "summary": (
        "Left: a curve ends at the availability, since an instant without a valid answer is never reached. Middle: "
        "verdicts rest on what happens along the grey lines, one per run. Right: an honest dot lies on its grey line "
        "with 95 %; at 10 errors are three times what the covariance claims."
    ),
    "over_time": "Gaps are instants without a valid answer.",
    "maps": "The best estimator's track, coloured by its error, over the true path; triangles are anchors, "
    "contours the least error of a fix from one reading of each (Cramér-Rao).",
    "parameters": "Below 1 is better than the default. A grey line is a run, dashed where it is for tuning; bars are "
    "the 95 % interval over the test runs.",
    "cost": "Measured alone on one machine by `fusion bench time`. Lower left is better.",
}


def report(material: Material, *, limit: bool = False) -> str:
    """The page as Markdown with its figures in it; with ``limit`` also how far from the physical limit all are."""
    suite = material.suite
    counts = ((len(suite.runs), "run"), (len(material.contestants), "estimator"), (len(suite.faults) - 1, "fault"))
    made = ", ".join(counted(*count) for count in (*counts, (suite.seeds, "seed")))
    about = (
        f"{made}: {counted(len(material.results), 'cell')}. Errors are horizontal distances to the truth, raw: nothing "
        "is aligned. An instant without a valid answer counts as infinite. Every number that is a link leads to the "
        "cell it comes from, and to the command that opens Rerun where that cell erred most."
    )
    parts = [
        f"# {suite.name}",
        *_verdicts(material),
        about,
        *_about_runs(material),
        *map(as_markdown, _sheets(material, limit=limit)),
    ]
    if material.has_errors:
        for name, draw in FIGURES.items():
            if name == "cost" and not material.timing:
                continue
            parts.append(f"{figure(name, as_png(draw(material)))}\n\n{EXPLAINED[name]}")
    parts += _sensitivity(material)
    return "\n\n".join([*parts, *_provenance(material), "**Cells**", entries(material)]) + "\n"


def _about_runs(material: Material) -> Iterator[str]:
    """Which runs do not count, and why."""
    if blind := sorted({result.cell.run.id for result in material.results if not result.cell.content.truth}):
        yield f"Without ground truth, and so without an error: {', '.join(blind)}."
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
    return as_html(material.suite.name, page, SCRIPT, record(material.suite, clean))


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


def _sheets(material: Material, *, limit: bool) -> Iterator[Sheet]:
    yield tables.leaderboard(material)
    if material.comparison is not None:
        yield pairs(material, material.comparison)
        yield run_by_run(material)
    predicted = innovations(material)
    if predicted.rows:
        yield predicted
    if limit and material.scored_runs:
        yield tables.limits(material)
        yield tables.fixes(material)
    if len(material.suite.faults) > 1:
        yield tables.faults(material)
        if (outages := tables.outages(material)).rows:
            yield outages
        if material.suite.seeds >= LEAST_SEEDS and material.scored_runs:
            yield tables.credibility(material)
    for found in (tables.moments(material), tables.lost(material)):
        if found.rows:
            yield found


def _sensitivity(material: Material) -> Iterator[str]:
    """Nothing without a grid, or where nothing was scored."""
    found = sweeps(material) if material.has_errors else []
    if found:
        yield as_markdown(sensitivity(material, found))
        yield "\n".join(f"- {sentence}" for sentence in advice(found))
        yield f"{figure('parameters', as_png(curves(material, found)))}\n\n{EXPLAINED['parameters']}"


def _provenance(material: Material) -> Iterator[str]:
    command = shlex.join(["fusion", "bench", "run", *material.words])
    yield as_markdown(tables.provenance(material))
    yield as_markdown(tables.contestants(material))
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
    material = Material(suite, results, Store(arguments.store), arguments.metric)
    targets = {}
    if arguments.markdown:
        targets[arguments.markdown] = report(material, limit=arguments.limit).encode()
    if arguments.html or not arguments.markdown:
        targets[arguments.html or Path(f"{suite.name}.html")] = as_page(material, limit=arguments.limit)
    for path, content in targets.items():
        write(path, content)
        sys.stdout.write(f"{path}\n")
    return 0
