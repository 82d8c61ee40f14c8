"""``fusion review``: see a run and what every estimator made of it."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import fusion
from benchmarks.bench import check
from benchmarks.cell import Cell, cached_run, score_lane
from benchmarks.lane import run_lane
from benchmarks.picture import has_display, open_viewer, render, require_rerun
from benchmarks.scene import write_scene
from fusion import ViewerError

NO_DISPLAY = "there is no display to open the viewer on; give --png OUT.png for a picture, or --save OUT.rrd for a file"


def review(
    run: Path,
    *,
    estimators: Sequence[str] | None = None,
    save: Path | None = None,
    png: Path | None = None,
    at_s: float | None = None,
    seed: int = 0,
) -> Path:
    """Run the estimators (None: all installed) over ``run`` and draw them: into the Rerun file ``save``, the picture
    ``png`` (time cursor at ``at_s``, None: the end), or, given neither, the viewer. Answers the Rerun file's place.

    Raises `LogError`, `PluginError`, or `ViewerError` when there is nothing to draw with or on.
    """
    if save is None and png is None and not has_display():
        raise ViewerError(NO_DISPLAY)
    require_rerun()
    names = tuple(dict.fromkeys(fusion.names() if estimators is None else estimators))
    check([run], names, {})
    if save is not None:
        return _draw(run, names, save, png, at_s, seed)
    if png is not None:
        with tempfile.TemporaryDirectory(prefix="fusion-review-") as folder:
            return _draw(run, names, Path(folder, "review.rrd"), png, at_s, seed)
    # The viewer goes on reading after this program has ended, so its file has to stay.
    scene = _draw(run, names, Path(tempfile.mkdtemp(prefix="fusion-review-"), "review.rrd"), None, None, seed)
    open_viewer(scene)
    return scene


def _draw(run: Path, names: Sequence[str], scene: Path, png: Path | None, at_s: float | None, seed: int) -> Path:
    recorded = cached_run(run)
    lanes = [run_lane(recorded, name, {}, seed) for name in names]
    scores = [score_lane(Cell(run, lane.name, {}, seed), recorded, lane) for lane in lanes]
    (scene,) = write_scene(scene, recorded, lanes, scores)
    if png is not None:
        render(scene, png, at_s=at_s)
    return scene


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion review``."""
    parser.add_argument("run", type=Path, metavar="RUN", help="an MCAP log")
    parser.add_argument("--estimators", metavar="A,B", help="names, separated by commas; all installed by default")
    parser.add_argument("--save", type=Path, metavar="OUT.rrd", help="write a file for the Rerun viewer")
    parser.add_argument("--png", type=Path, metavar="OUT.png", help="write a picture; needs no display")
    parser.add_argument("--at", type=float, metavar="S", help="time cursor of the picture [s]; the end by default")
    parser.add_argument("--seed", type=int, default=0, help="of the estimators that draw random numbers")


def run(arguments: argparse.Namespace) -> int:
    """Draw, and say where to."""
    chosen = arguments.estimators.split(",") if arguments.estimators else None
    review(
        arguments.run,
        estimators=chosen,
        save=arguments.save,
        png=arguments.png,
        at_s=arguments.at,
        seed=arguments.seed,
    )
    for written in (arguments.save, arguments.png):
        if written is not None:
            sys.stdout.write(f"{written}\n")
    return 0
