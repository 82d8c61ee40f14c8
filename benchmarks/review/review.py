"""``fusion review``: see a run and what every estimator made of it, and where to look first."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import fusion
from benchmarks.arguments import at_least_one, not_negative, since_start
from benchmarks.bench import Settings, parse_settings, require_estimators, require_settings
from benchmarks.cell import Score
from benchmarks.lane import Lane
from benchmarks.output import require_place
from benchmarks.review.counterfactual import counterfactuals, require_within
from benchmarks.review.drawing import drawings
from benchmarks.review.folding import fold
from benchmarks.review.frame import Frame
from benchmarks.review.listing import told
from benchmarks.review.moments import Moment, worst_moments
from benchmarks.review.picture import render
from benchmarks.review.scene import SUFFIX, write_scene
from benchmarks.review.subject import own_log, remarks, subject, subject_options, words
from benchmarks.review.viewer import require_rerun
from benchmarks.review.window import has_display, open_viewer, serve_web
from fusion import ParameterError, ViewerError
from fusion.plugins import left_out
from logs.run import Run

NO_DISPLAY = (
    "there is no display to open the viewer on; give --png OUT.png for a picture, --save OUT.rrd for a file, or --web "
    "for a browser on this machine"
)

PREFIX, SCENE = "fusion-review-", "review.rrd"


class Review(NamedTuple):
    """What a review left behind: its Rerun files, to be opened together, and the worst moments of each estimator."""

    files: list[Path]
    moments: list[Moment]


def review(
    run: Path | Run,
    *,
    estimators: Sequence[str] | None = None,
    settings: Settings | None = None,
    save: Path | None = None,
    png: Path | None = None,
    at_s: float | None = None,
    worst: int = 0,
    without: Sequence[str] = (),
    reject_s: Sequence[float] = (),
    seed: int = 0,
) -> Review:
    """Run the estimators (None: all available), with the parameters ``settings``, over ``run`` (a log of ours, or what
    was read from anything else) and draw them: into
    ``save`` (one file ``OUT.rrd``, or a folder of layers), into the picture ``png``, or, given neither and no
    ``worst``, in the viewer. The time cursor of picture and viewer stands ``at_s`` after the start (None: at the end).

    ``worst``: how many of the worst moments of each estimator are looked for. ``without`` an anchor, ``reject_s`` the
    radio measurement nearest to a time: each adds what every estimator would have made of that, as a ghost.

    Raises `LogError`, `PluginError`, `ParameterError`, `ViewerError` when there is nothing to draw with or on, or
    `FusionError` for a picture that has no place.
    """
    opens = save is None and png is None and not worst
    if opens and not has_display():
        raise ViewerError(NO_DISPLAY)
    if opens or save is not None or png is not None:
        require_rerun()
    if png is not None:
        require_place(png)
    names = tuple(dict.fromkeys(fusion.available() if estimators is None else estimators))
    settings = settings or {}
    require_estimators(names)
    recorded = run if isinstance(run, Run) else own_log(run)
    require_settings(settings, names, recorded.world)
    if worst and recorded.truth is None:
        told = f"{recorded.path} holds no ground truth, so no moment is worse than another; leave it out"
        raise ParameterError(f"--worst: {told}")
    if at_s is not None:
        require_within(recorded, at_s, "--at")
    chosen = {name: settings.get(name, {}) for name in names}
    lanes, scores = fold(recorded, chosen, seed, instead=counterfactuals(recorded, without, reject_s))
    files: list[Path] = []
    if save is not None or opens:
        # The viewer goes on reading after this program has ended, so its file has to stay.
        files = write_scene(save or Path(tempfile.mkdtemp(prefix=PREFIX), SCENE), recorded, lanes, scores)
    if png is not None:
        with tempfile.TemporaryDirectory(prefix=PREFIX) as folder:
            render(files or write_scene(Path(folder, SCENE), recorded, lanes, scores), png, at_s=at_s)
    if opens:
        open_viewer(files, at_s=at_s)
    return Review(files, _worst(recorded, lanes, scores, worst) if worst else [])


def _worst(run: Run, lanes: Sequence[Lane], scores: Sequence[Score], count: int) -> list[Moment]:
    """Of every estimator, the best first; ghosts are compared, not searched."""
    start_ns, drawn, found = Frame.around(run).start_ns, drawings(run, lanes, scores), []
    for drawing in drawn:
        if not drawing.ghost:
            ghosts = [other for other in drawn if other.lane.ghost_of == drawing.name]
            found += worst_moments(run, drawing, start_ns, count, ghosts)
    return found


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion review``."""
    subject_options(parser)
    parser.add_argument("--estimators", metavar="A,B", help="names, separated by commas; all installed by default")
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME.KEY=VALUE", help="a parameter of an estimator; repeatable"
    )
    parser.add_argument(
        "--save", type=Path, metavar="OUT", help="write OUT.rrd for the Rerun viewer, or a folder of one file a layer"
    )
    parser.add_argument("--png", type=Path, metavar="OUT.png", help="write a picture; needs no display")
    parser.add_argument("--web", action="store_true", help="show it in a browser on this machine, until interrupted")
    parser.add_argument("--at", type=since_start, metavar="S", help="time cursor, since the start; the end by default")
    parser.add_argument(
        "--worst", type=at_least_one, default=0, metavar="K", help="list the K worst moments of each estimator"
    )
    parser.add_argument(
        "--without", action="append", default=[], metavar="ANCHOR", help="what if it had never been heard; repeatable"
    )
    parser.add_argument(
        "--reject",
        action="append",
        type=since_start,
        default=[],
        metavar="S",
        help="what if the radio measurement nearest to that time had been refused; repeatable",
    )
    parser.add_argument("--seed", type=not_negative, default=0, help="of the estimators that draw random numbers")


def run(arguments: argparse.Namespace) -> int:
    """Draw, and say where to; list the worst moments."""
    if arguments.web and arguments.save is not None and arguments.save.suffix != SUFFIX:
        # The web viewer forgets the layout when a second file follows the one that brings it.
        raise ParameterError(f"--web shows one file, not a folder of layers; give --save {arguments.save}{SUFFIX}")
    settings, recorded = parse_settings(arguments.set), subject(arguments)
    for remark in (*remarks(recorded), *(left_out() if arguments.estimators is None else ())):
        sys.stderr.write(f"fusion review: {remark}\n")
    with tempfile.TemporaryDirectory(prefix=PREFIX) as folder:
        made = review(
            recorded,
            estimators=None if arguments.estimators is None else arguments.estimators.split(","),
            settings=settings,
            save=arguments.save or (Path(folder, SCENE) if arguments.web else None),
            png=arguments.png,
            at_s=arguments.at,
            worst=arguments.worst,
            without=arguments.without,
            reject_s=arguments.reject,
            seed=arguments.seed,
        )
        for written in ([] if arguments.save is None else made.files) + [arguments.png] * (arguments.png is not None):
            sys.stdout.write(f"{written}\n")
        sys.stdout.writelines(told(made.moments, [*words(arguments)], settings, arguments.seed))
        if arguments.web:
            _serve(made.files, arguments.at)
    return 0


def _serve(files: Sequence[Path], at_s: float | None) -> None:
    """Until the server ends, or the user ends it."""
    with serve_web(files) as served:
        sys.stdout.write(f"{served.address}\n")
        sys.stdout.flush()
        if at_s is not None:
            # The web viewer takes no time from outside.
            sys.stderr.write(f"fusion review: the page opens at the start; move its time cursor to {at_s:g} s\n")
        sys.stderr.write("fusion review: serving that page until interrupted (Ctrl-C)\n")
        try:
            served.process.wait()
        except KeyboardInterrupt:
            return
