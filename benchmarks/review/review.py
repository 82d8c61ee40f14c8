"""``fusion review``: see a run and what every estimator made of it, and where to look first."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import fusion
from benchmarks.review.counterfactual import counterfactuals, require_within
from benchmarks.review.drawing import drawings
from benchmarks.review.folding import Reviewed, fold
from benchmarks.review.frame import Frame
from benchmarks.review.moments import Moment, worst_moments
from benchmarks.review.picture import render
from benchmarks.review.reviewed_run import own_log
from benchmarks.review.scene import write_scene
from benchmarks.review.viewer import require_rerun
from benchmarks.review.window import has_display, open_viewer
from fusion import ParameterError, ViewerError
from fusion.cli.options import Settings, require_estimators, require_settings
from fusion.output.files import require_place
from logs.run import Run

NO_DISPLAY = (
    "there is no display to open the viewer on; give --png OUT.png for a picture, --save OUT.rrd for a file, or --web "
    "for a browser on this machine"
)

PREFIX, SCENE = "fusion-review-", "review.rrd"


class Review(NamedTuple):
    """Results of a review: its Rerun files, to be opened together, and the worst moments of each estimator."""

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
    """Run the estimators (None: all available), with the parameters ``settings``, over ``run`` (a log of ours, or
    the run that was read from anything else) and draw them: into ``save`` (one file ``OUT.rrd``, or a folder of
    layers), into the picture ``png``, or, given neither and no ``worst``, in the viewer. The time cursor of picture and
    viewer stands ``at_s`` after the start (None: at the end).

    ``worst``: how many of the worst moments of each estimator are looked for. ``without`` an anchor, ``reject_s`` the
    radio measurement nearest to a time: each adds what every estimator would have made of that, as a counterfactual.

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
        raise ParameterError(
            f"--worst: {recorded.path} holds no ground truth, so no moment is worse than another; leave it out"
        )
    if at_s is not None:
        require_within(recorded, at_s, "--at")
    chosen = {name: settings.get(name, {}) for name in names}
    reviewed = fold(recorded, chosen, seed, instead=counterfactuals(recorded, without, reject_s))
    files: list[Path] = []
    if save is not None or opens:
        # The viewer goes on reading after this program has ended, so its file has to stay.
        files = write_scene(save or Path(tempfile.mkdtemp(prefix=PREFIX), SCENE), recorded, reviewed)
    if png is not None:
        with tempfile.TemporaryDirectory(prefix=PREFIX) as folder:
            render(files or write_scene(Path(folder, SCENE), recorded, reviewed), png, at_s=at_s)
    if opens:
        open_viewer(files, at_s=at_s)
    return Review(files, _worst(recorded, reviewed, worst) if worst else [])


def _worst(run: Run, reviewed: Sequence[Reviewed], count: int) -> list[Moment]:
    """Of every estimator, the best first; counterfactuals are compared, not searched."""
    start_ns, drawn, moments = Frame.around(run).start_ns, drawings(run, reviewed), []
    for drawing in drawn:
        if not drawing.is_counterfactual:
            others = [other for other in drawn if other.reviewed.counterfactual_of == drawing.name]
            moments += worst_moments(run, drawing, start_ns, count, others)
    return moments
