"""What it costs to write the review of a long run: a synthetic one, its estimates made up beforehand.

Run it from the top folder: ``python tests/benchmarks/review/long_review.py [POSES] [ESTIMATORS]``.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import fusion
from benchmarks.review.folding import Reviewed
from benchmarks.review.particle_clouds import CloudWatch
from benchmarks.review.scene import write_scene
from benchmarks.runner.estimator_run import EstimatorRun
from fusion import (
    Covariance,
    Decision,
    Estimate,
    Fate,
    Moment,
    Odometry,
    Particles,
    Pose,
    RangeReading,
    Ranges,
    Reason,
    Truth,
    Update,
)
from fusion.values import NANOSECONDS
from logs.run import Run
from logs.truth import TruthTrack

RATE_HZ = 50
STEPS_PER_SCAN = 10
START_NS = 1_700_000_000 * NANOSECONDS
WITH_PARTICLES = 2
"""So many of the estimators show particles: ours are two of ten."""
ANCHORS = [("a", 0.0, 0.0), ("b", 20.0, 0.0), ("c", 20.0, 15.0), ("d", 0.0, 15.0)]
WORLD = fusion.World.from_table(
    {"name": "hall", "anchors": [{"id": name, "position_m": [x, y]} for name, x, y in ANCHORS]}
)


def long_run(poses: int) -> Run:
    """Circles in a hall, in Unix time: odometry and truth at 50 Hz, ranges to four anchors at 5 Hz."""
    step_ns = NANOSECONDS // RATE_HZ
    truths, measurements = [], []
    for k in range(1, poses + 1):
        now, angle = START_NS + k * step_ns, 0.1 * k / RATE_HZ
        truths.append(Truth(now, 10.0 + 5.0 * np.cos(angle), 7.0 + 5.0 * np.sin(angle), angle))
        measurements.append(Odometry(now, "wheels", k, now - step_ns, 0.5 / RATE_HZ, 0.1 / RATE_HZ))
        if k % STEPS_PER_SCAN == 0:
            x, y = truths[-1].x, truths[-1].y
            readings = (RangeReading(name, float(np.hypot(x - ax, y - ay))) for name, ax, ay in ANCHORS)
            measurements.append(Ranges(now, "uwb", k, tuple(readings)))
    return Run(Path("long.mcap"), "long", WORLD, None, {}, tuple(measurements), TruthTrack.from_truths(truths), (), {})


class MadeUpFold:
    """Shows a new cloud of a thousand particles whenever it is asked."""

    def __init__(self) -> None:
        self._random = np.random.default_rng(1)

    def particles(self) -> Particles:
        weights = self._random.exponential(size=1000)
        return Particles(self._random.normal(10.0, 2.0, (1000, 2)), weights / weights.sum())


def watched(run: Run) -> CloudWatch:
    """The clouds of an estimator that has particles."""
    watch, fold = CloudWatch(run), MadeUpFold()
    for measurement in run.measurements:
        watch(fold, Moment(measurement, (), 0, (), measurement.time_ns, 0, False, None, 0))
    return watch


def made_up_run(run: Run, number: int) -> Reviewed:
    """Half a metre beside the truth; every twentieth reading is rejected."""
    covariance, updates = Covariance(0.25, 0.05, 0.0, 0.25, 0.0, 0.01), []
    for k, measurement in enumerate(run.measurements):
        angle = 0.1 * (measurement.time_ns - START_NS) / 1e9
        pose = Pose(10.5 + 5.0 * np.cos(angle), 7.0 + 5.0 * np.sin(angle), float(fusion.wrap_angle(angle)))
        fates = ()
        if isinstance(measurement, Ranges):
            head = measurement.time_ns, measurement.sensor, measurement.seq
            good, bad = (Decision.USED, Reason.OK, 1.0), (Decision.REJECTED, Reason.GATE, 0.0)
            judged = [bad if (k + i) % 20 == 0 else good for i in range(len(ANCHORS))]
            nis = 0.5 + (k % 7)
            fates = tuple(
                Fate(*head, r.anchor, *what, 0.1, 0.04, nis)
                for r, what in zip(measurement.readings, judged, strict=True)
            )
        updates.append(Update(measurement, Estimate(measurement.time_ns, pose, covariance), fates))
    clouds = watched(run).clouds() if number < WITH_PARTICLES else None
    return Reviewed.of(run, EstimatorRun(f"estimator {number}", tuple(updates)), clouds)


def cost_s(poses: int, estimators: int, output: Path) -> float:
    """Processor seconds of the writing alone."""
    run = long_run(poses)
    reviewed = [made_up_run(run, number) for number in range(estimators)]
    started_s = time.process_time()
    write_scene(output, run, reviewed)
    return time.process_time() - started_s


if __name__ == "__main__":
    poses, estimators = (int(word) for word in (*sys.argv[1:], *("100000", "8")[len(sys.argv) - 1 :]))
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder, "long.rrd")
        sys.stdout.write(f"{poses} poses, {estimators} estimators: {cost_s(poses, estimators, scene):.2f} CPU s, ")
        sys.stdout.write(f"{scene.stat().st_size / 1e6:.1f} MB\n")
