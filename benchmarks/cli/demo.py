"""``fusion demo``: the whole promise in one command."""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import fusion
from benchmarks.report.report import as_page
from benchmarks.report.report_data import ReportData
from benchmarks.review.folding import Reviewed, fold
from benchmarks.review.picture import render
from benchmarks.review.plain_picture import draw_plainly
from benchmarks.review.reviewed_run import own_log
from benchmarks.review.scene import write_scene
from benchmarks.review.window import has_display, open_viewer
from benchmarks.runner.adhoc_suite import bench, remarks, tables, write_records
from benchmarks.runner.results import Result
from benchmarks.runner.run_suite import run_suite
from benchmarks.runner.store import Store
from benchmarks.runner.suite_file import load_suite
from fusion import FusionError, ViewerError
from fusion.cli.arguments import not_negative
from fusion.output.files import write
from fusion.output.tables import print_tables
from fusion.plugins import left_out
from logs.run import Run
from sensors.simulation.simulate import simulate

SCENARIO = "office"
SUITE = Path("quick")


class Drawn(NamedTuple):
    """The review of a demo, as far as this machine can make one: ``scene`` is None without Rerun, ``picture`` where
    matplotlib is missing, too. ``rendered``: the picture is Rerun's.
    """

    scene: Path | None
    picture: Path | None
    rendered: bool


class Demo(NamedTuple):
    """Results of a demo. ``page`` is None where figures cannot be drawn."""

    log: Path
    records: Path
    results: list[Result]
    drawn: Drawn
    suite: Path
    page: Path | None


def demo(
    folder: Path = Path("fusion-demo"),
    *,
    seed: int = 0,
    duration_s: float | None = None,
    suite: Path = SUITE,
    workers: int | None = None,
) -> Demo:
    """Simulate the office, record it, score every available estimator on the record, and draw all that into
    ``folder``: ``run.mcap``, ``scores.json``, ``review.rrd``, ``review.png``, which is by matplotlib where Rerun cannot
    draw. ``duration_s`` cuts the run short. Then compare a few estimators over several runs: ``suite``, its results in
    ``bench``, as ``report.html``.

    Progress and whatever could not be drawn are reported on stderr.
    """
    _print_progress(f"simulating a robot in the {SCENARIO}")
    folder.mkdir(parents=True, exist_ok=True)
    log = simulate(SCENARIO, folder / "run.mcap", seed=seed, duration_s=duration_s)
    _print_progress("running every estimator on the same record")
    results = bench([log], seed=seed, workers=workers)
    for remark in (*left_out(), *remarks(results)):
        _print_progress(remark)
    records = folder / "scores.json"
    write_records(results, records)
    drawn = _draw(own_log(log), folder, seed)
    return Demo(log, records, results, drawn, suite, _report(suite, folder, workers))


def _draw(run: Run, folder: Path, seed: int) -> Drawn:
    """The review and its picture; the scores of the demo do not depend on them."""
    _print_progress("drawing the review")
    reviewed = fold(run, {name: {} for name in fusion.available()}, seed)
    scene, picture = None, folder / "review.png"
    try:
        (scene,) = write_scene(folder / "review.rrd", run, reviewed)
        return Drawn(scene, render([scene], picture), rendered=True)
    except ViewerError as error:
        return Drawn(scene, _draw_instead(run, reviewed, picture, error), rendered=False)


def _draw_instead(run: Run, reviewed: Sequence[Reviewed], picture: Path, why: ViewerError) -> Path | None:
    try:
        draw_plainly(run, reviewed, picture)
    except FusionError as error:
        _print_progress(f"no picture: {why}; {error}")
        return None
    _print_progress(f"{picture} is by matplotlib, not by Rerun: {why}")
    return picture


def _report(suite: Path, folder: Path, workers: int | None) -> Path | None:
    """The page of a suite, of which only what is missing is computed."""
    loaded, store, page = load_suite(suite), Store(folder / "bench"), folder / "report.html"
    _print_progress(f"running the suite {loaded.name}: several runs, and a fault")
    data = ReportData(loaded, run_suite(loaded, store, workers=workers), store)
    try:
        _print_progress("writing its report")
        write(page, as_page(data))
    except FusionError as error:
        _print_progress(f"no report: {error}")
        return None
    return page


def _print_progress(progress: str) -> None:
    sys.stderr.write(f"fusion demo: {progress}\n")


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion demo``."""
    parser.add_argument("-o", "--output", type=Path, default=Path("fusion-demo"), metavar="FOLDER", help="%(default)s")
    parser.add_argument("--seed", type=not_negative, default=0, help="another seed, another run")
    parser.add_argument("--no-view", action="store_true", help="do not open the viewer")


def run(arguments: argparse.Namespace) -> int:
    """Make the demo, print its table and commands to try next, show it. Exit code 1 when no estimator survived."""
    made = demo(arguments.output, seed=arguments.seed)
    print_tables(tables(made.results))
    for path in (made.log, made.records, made.drawn.scene, made.drawn.picture, made.page):
        if path is not None:
            sys.stdout.write(f"{path}\n")
    window = has_display() and (made.drawn.rendered if arguments.no_view else _show(made.drawn.scene))
    sys.stdout.write("\nTry next:\n")
    sys.stdout.writelines(f"  {command}\n" for command in next_commands(made, window=window))
    return 1 if all(result.status == "crashed" for result in made.results) else 0


def _show(scene: Path | None) -> bool:
    """Open the viewer; answers True where it is open now."""
    if scene is None:
        return False
    try:
        open_viewer([scene])
    except ViewerError as error:
        _print_progress(f"no window: {error}")
        return False
    return True


def next_commands(made: Demo, *, window: bool) -> list[str]:
    """Commands to try next, for a shell in this folder; ``window``: whether a viewer can be opened."""
    review, bench = ["review", str(made.log)], ["bench", str(made.log), "--estimators", "ekf"]
    if not window:
        picture = ["--estimators", "ekf,particle", "--png", str(made.log.with_name("two.png"))]
        review += picture if made.drawn.rendered else ["--estimators", "ekf", "--worst", "3"]
    bench += ["--set", "ekf.gate_probability=0.99"]
    compare = ["bench", "compare", str(made.suite), "--store", str(made.log.with_name("bench"))]
    return [shlex.join([program(), *words]) for words in (review, bench, compare)]


def program() -> str:
    """The word that starts this program: ``fusion`` where a shell finds it by that name, else its path."""
    running = Path(sys.argv[0])
    if running.stem != "fusion":
        running = Path(sys.executable).with_name("fusion")
    installed = shutil.which("fusion")
    if not running.is_file() or (installed is not None and os.path.samefile(installed, running)):
        return "fusion"
    return str(running)
