"""One run and its estimators as a Rerun recording: the map, the tracks, errors, weights and readings over time.

Whole columns go into the recording, never single rows, which costs two orders of magnitude less. Nothing but drawing
happens here: the numbers are those of the bench.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.blueprint import blueprint
from benchmarks.cell import Score
from benchmarks.instants import Floats, Stamps, evaluation_instants
from benchmarks.lane import Lane
from benchmarks.score import CHI_SQUARE_95
from benchmarks.table import COLUMNS, as_text, ranked
from fusion import Estimate, FusionError, WifiScan
from fusion.values import Ranges, RssiReading, seconds
from logs.run import Run

if TYPE_CHECKING:
    import rerun as rr

APPLICATION = "fusion"
TIMELINE = "t"
"""Time since the run's first message."""
MOST_POSES = 6000
"""Poses of one drawn track: more cost the viewer time and show nothing. Scores are never thinned."""

Colour = tuple[int, int, int]

WHITE, GREY, WALL, ANCHOR = (230, 230, 230), (150, 150, 150), (96, 104, 116), (240, 228, 66)
SKY, VERMILLION, ORANGE = (86, 180, 233), (213, 94, 0), (230, 159, 0)
PURPLE, BLUE, GREEN = (204, 121, 167), (0, 114, 178), (0, 158, 115)
PALETTE: tuple[Colour, ...] = (SKY, VERMILLION, ORANGE, PURPLE, BLUE, GREEN, ANCHOR)
"""Colours told apart by colour-blind people too (Okabe & Ito 2008)."""
COLOURS: Mapping[str, Colour] = {
    "dead_reckoning": GREY,
    "radio_only": ORANGE,
    "dynamic_weight": PURPLE,
    "bayes_weight": GREEN,
    "ekf": SKY,
    "filterpy_ekf": (140, 205, 245),
    "filterpy_ukf": (120, 150, 235),
    "particle": VERMILLION,
    "bayes_grid": BLUE,
}


def colour_of(estimator: str) -> Colour:
    """The same colour for an estimator in every picture; strangers get one by their name."""
    return COLOURS.get(estimator) or PALETTE[zlib.crc32(estimator.encode()) % len(PALETTE)]


class Track(NamedTuple):
    """What is drawn of estimates, all (n,): valid ones only."""

    time_ns: Stamps
    xy: Floats
    estimates: Sequence[Estimate]


def track_of(lane: Lane) -> Track:
    """The valid estimates of a lane in time order, thinned to `MOST_POSES`."""
    said = [update.estimate for update in lane.final if update.estimate.valid]
    sound = [estimate for estimate in said if np.isfinite(estimate.pose[:2]).all()]
    chosen = sound[:: len(sound) // MOST_POSES + 1]
    time_ns = np.array([estimate.time_ns for estimate in chosen], dtype=np.int64)
    return Track(time_ns, np.array([estimate.pose[:2] for estimate in chosen]).reshape(-1, 2), chosen)


def write_scene(output: Path, run: Run, lanes: Sequence[Lane], scores: Sequence[Score]) -> Path:
    """Write the review of ``run`` as a Rerun file with its own layout; ``scores`` belong to ``lanes`` one by one.

    Raises `ViewerError` where Rerun is not installed, `FusionError` where the file cannot be written.
    """
    from benchmarks.picture import require_rerun

    rr = require_rerun()
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        output.touch()
    except OSError as error:
        raise FusionError(f"{output}: the review cannot be written ({error.strerror}); give another place") from error
    recording = rr.RecordingStream(APPLICATION, recording_id=f"{run.name}-{run.world.hash[:12]}")
    recording.save(output, default_blueprint=blueprint(run, [lane.name for lane in lanes], duration_s(run)))
    recording.send_recording_name(run.name)
    canvas = Canvas(recording, _start_ns(run))
    _draw_floor(canvas, run)
    _draw_truth(canvas, run)
    _draw_readings(canvas, run)
    for lane, score in zip(lanes, scores, strict=True):
        _draw_track(canvas, lane)
        _draw_errors(canvas, run, lane, score)
        _draw_fates(canvas, lane)
    canvas.style("scores", rr.TextDocument(markdown(run, scores), media_type="text/markdown"))
    recording.flush()
    recording.disconnect()
    return output


def _start_ns(run: Run) -> int:
    stamps = [m.time_ns for m in run.measurements] + ([] if run.truth is None else run.truth.time_ns[:1].tolist())
    return min(stamps, default=0)


def duration_s(run: Run) -> float:
    """From the first message of the run to its last [s]."""
    stamps = [m.time_ns for m in run.measurements] + ([] if run.truth is None else run.truth.time_ns[-1:].tolist())
    return seconds(max(stamps, default=0) - _start_ns(run))
