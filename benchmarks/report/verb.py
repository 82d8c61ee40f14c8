"""``fusion bench report``: the results of a suite as one page that a reviewer would accept."""

from __future__ import annotations

import argparse
import platform
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import fusion
from benchmarks.metrics.credibility import LEAST_SEEDS
from benchmarks.output import write
from benchmarks.page import as_html, inline_png
from benchmarks.plotting import as_png, require_matplotlib
from benchmarks.report import tables
from benchmarks.report.figures import FIGURES
from benchmarks.report.material import Material
from benchmarks.report.worst import worst_moments
from benchmarks.runner.compare_verb import sheet, stored_results
from benchmarks.runner.plan_verb import suite_options
from benchmarks.runner.results import RANKED_BY
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
    "cost": "Measured alone on one machine by `fusion bench time`. Lower left is better.",
}


def report(material: Material, command: str, *, limit: bool = False) -> str:
    """The page as Markdown with its figures in it; with ``limit`` also how far from the physical limit all are."""
    suite = material.suite
    about = (
        f"{len(suite.runs)} runs, {len(material.contestants)} estimators, {len(suite.faults)} fault sets, "
        f"{suite.seeds} seeds: {len(material.results)} cells. Errors are horizontal distances to the truth, raw: "
        "nothing is aligned. An instant without a valid answer counts as infinite."
    )
    parts = [f"# {suite.name}", *_verdicts(material), about, *map(as_markdown, _sheets(material, limit=limit))]
    if material.scored_runs:
        for name, draw in FIGURES.items():
            if name == "cost" and not material.timing:
                continue
            parts.append(f"![{name}]({inline_png(as_png(draw(material)))})\n\n{EXPLAINED[name]}")
    return "\n\n".join([*parts, *_provenance(material, command)]) + "\n"


def _verdicts(material: Material) -> Iterator[str]:
    """The best against every other, in sentences."""
    if material.comparison is None:
        yield "Nothing can be compared here: give at least two estimators, and runs with truth."
        return
    best = material.contestants[0]
    told = [verdict.sentence for verdict in material.comparison.verdicts if best in (verdict.first, verdict.second)]
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
        yield sheet(material.comparison)
    if limit and material.scored_runs:
        yield tables.limits(material)
        yield tables.fixes(material)
    if len(material.suite.faults) > 1:
        yield tables.faults(material)
        if (outages := tables.outages(material)).rows:
            yield outages
        if material.suite.seeds >= LEAST_SEEDS and material.scored_runs:
            yield tables.credibility(material)
    if found := worst_moments(material):
        yield tables.moments(found, material.suite.folder)
    if (lost := tables.lost(material.results)).rows:
        yield lost


def _provenance(material: Material, command: str) -> Iterator[str]:
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
    material = Material(suite, results, Store(arguments.store), arguments.metric)
    page = report(material, f"fusion bench run {arguments.suite.name}", limit=arguments.limit)
    targets = [(arguments.markdown, page.encode())]
    if arguments.html or not arguments.markdown:
        targets.append((arguments.html or Path(f"{suite.name}.html"), as_html(suite.name, page)))
    for path, content in targets:
        if path is not None:
            write(path, content)
            sys.stdout.write(f"{path}\n")
    return 0
