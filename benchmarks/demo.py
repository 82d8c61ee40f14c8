"""``fusion demo``: the whole promise in one command."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import NamedTuple

from benchmarks.arguments import not_negative
from benchmarks.bench import bench, pooled, remarks, write_records
from benchmarks.cell import Score
from benchmarks.output import write
from benchmarks.report.material import Material
from benchmarks.report.verb import as_page
from benchmarks.review.picture import render
from benchmarks.review.review import review
from benchmarks.review.viewer import has_display, open_viewer
from benchmarks.runner.definition import load_suite
from benchmarks.runner.run_verb import run_suite
from benchmarks.runner.store import Store
from benchmarks.table import print_tables
from fusion import FusionError, ViewerError
from fusion.plugins import left_out
from sensors.simulation.simulate import simulate

SCENARIO = "office"
SUITE = Path("quick")


class Demo(NamedTuple):
    """What a demo leaves behind. ``scene`` and ``picture`` are None where Rerun cannot be used, ``page`` where figures
    cannot be drawn.
    """

    log: Path
    records: Path
    scores: list[Score]
    scene: Path | None
    picture: Path | None
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
    ``folder``: ``run.mcap``, ``scores.json``, ``review.rrd``, ``review.png``. ``duration_s`` cuts the run short. Then
    compare a few estimators over several runs: ``suite``, its results in ``bench``, as ``report.html``.

    Progress and what could not be drawn are told on stderr.
    """
    _tell(f"simulating a robot in the {SCENARIO}")
    folder.mkdir(parents=True, exist_ok=True)
    log = simulate(SCENARIO, folder / "run.mcap", seed=seed, duration_s=duration_s)
    _tell("running every estimator on the same record")
    scores = bench([log], seed=seed, workers=workers)
    for remark in (*left_out(), *remarks(scores)):
        _tell(remark)
    records = folder / "scores.json"
    write_records(scores, records)
    scene, picture = _draw(log, folder, seed)
    return Demo(log, records, scores, scene, picture, _report(suite, folder, workers))


def _draw(log: Path, folder: Path, seed: int) -> tuple[Path | None, Path | None]:
    """The review and its picture, as far as this machine can make them; the scores do not depend on it."""
    scene: Path | None = None
    try:
        _tell("drawing the review")
        (scene,) = review(log, save=folder / "review.rrd", seed=seed).files
        return scene, render([scene], folder / "review.png")
    except ViewerError as error:
        _tell(f"no {'picture' if scene else 'review'}: {error}")
        return scene, None


def _report(suite: Path, folder: Path, workers: int | None) -> Path | None:
    """The page of a suite, of which only what is missing is computed."""
    loaded, store, page = load_suite(suite), Store(folder / "bench"), folder / "report.html"
    _tell(f"running the suite {loaded.name}: several runs, and a fault")
    material = Material(loaded, run_suite(loaded, store, workers=workers), store)
    try:
        _tell("writing its report")
        write(page, as_page(material))
    except FusionError as error:
        _tell(f"no report: {error}")
        return None
    return page


def _tell(progress: str) -> None:
    sys.stderr.write(f"fusion demo: {progress}\n")


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion demo``."""
    parser.add_argument("-o", "--output", type=Path, default=Path("fusion-demo"), metavar="FOLDER", help="%(default)s")
    parser.add_argument("--seed", type=not_negative, default=0, help="another seed, another run")
    parser.add_argument("--no-view", action="store_true", help="do not open the viewer")


def run(arguments: argparse.Namespace) -> int:
    """Make the demo, print its table, show it, and say what to try next. Exit code 1 when no estimator survived."""
    made = demo(arguments.output, seed=arguments.seed)
    print_tables(made.scores, pooled(made.scores))
    for path in (made.log, made.records, made.scene, made.picture, made.page):
        if path is not None:
            sys.stdout.write(f"{path}\n")
    if made.scene is not None and not arguments.no_view and has_display():
        open_viewer([made.scene])
    sys.stdout.write(_next(made))
    return 1 if all(score.status == "crashed" for score in made.scores) else 0


def _next(made: Demo) -> str:
    view = f"fusion review {made.log}"
    if not has_display():
        view += f" --estimators ekf,particle --png {made.log.with_name('two.png')}"
    return (
        "\nTry next:\n"
        f"  {view}\n"
        f"  fusion bench {made.log} --estimators ekf --set ekf.gate_probability=0.99\n"
        f"  fusion bench compare {SUITE} --store {made.log.with_name('bench')}\n"
    )
