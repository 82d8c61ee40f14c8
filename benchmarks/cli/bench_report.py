"""``fusion bench report``: the results of a suite as one HTML page."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.cli.suite_arguments import stored_results, suite_options
from benchmarks.metrics.catalogue import RANKED_BY, require_lower_is_better
from benchmarks.report.figure_panel import without_targets
from benchmarks.report.report import as_page, report
from benchmarks.report.report_data import ReportData
from benchmarks.runner.results import require_metric
from benchmarks.runner.store import Store
from fusion.output.figures import require_matplotlib
from fusion.output.files import write


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
    data = ReportData(suite, results, Store(arguments.store), arguments.metric)
    targets = {}
    if arguments.markdown:
        targets[arguments.markdown] = without_targets(report(data, limit=arguments.limit)).encode()
    if arguments.html or not arguments.markdown:
        targets[arguments.html or Path(f"{suite.name}.html")] = as_page(data, limit=arguments.limit)
    for path, content in targets.items():
        write(path, content)
        sys.stdout.write(f"{path}\n")
    return 0
