"""The start of a run and the prior there: one for inspection, calibration, benchmarks and review."""

import math
from typing import ClassVar

import numpy as np
import pytest

import fusion
from benchmarks.review.frame import Frame
from benchmarks.runner.estimator_run import run_estimator
from estimators.dead_reckoning import DeadReckoning
from fusion import Covariance, Odometry, Pose, Prior, RssiReading, Truth, WifiScan
from fusion.belief import UNKNOWN_HEADING_STD
from logs.cli.info import describe
from logs.prior import begin_ns, prior_from_truth, starting_prior
from logs.reader import read_run
from logs.usability import usability
from logs.writer import RunWriter
from sensors.calibration.segments import read_segments
from tests.worlds import anchored_world

SECOND = 1_000_000_000
TENTH = SECOND // 10
START = 5 * SECOND
"""The first odometry increment begins here; its message is stamped a tenth of a second later."""
BOUNDS = {"x_min": 0.0, "x_max": 12.0, "y_min": 0.0, "y_max": 6.0}
WORLD = anchored_world({"a": (1.0, 1.0)}, name="hall", bounds=BOUNDS)
KNOWN = Prior(START, Pose(1.0, 2.0, 0.5), Covariance.from_std(0.3, 0.2, 0.1))


def odometry():
    """Two seconds straight on at 1 m/s."""
    return [Odometry(START + (k + 1) * TENTH, "wheels", k, START + k * TENTH, 0.1, 0.0) for k in range(20)]


def truths(first_ns, *, heading=0.0, step_ns=SECOND // 2):
    """The robot stands at (2, 3) until the start, and then drives along x."""
    times = range(first_ns, START + 2 * SECOND, step_ns)
    return [Truth(t, 2.0 + max(t - START, 0) / SECOND, 3.0, heading) for t in times]


def written(path, *, truth=(), prior=None):
    with RunWriter(path, WORLD, name="run", prior=prior) as log:
        for measurement in [*odometry(), WifiScan(START + SECOND, "wifi", 0, (RssiReading("a", -40.0),))]:
            log.write(measurement)
        for pose in truth:
            log.write_truth(pose)
    return path


def test_run_whose_truth_begins_early_has_one_start_everywhere(tmp_path):
    path = written(tmp_path / "run.mcap", truth=truths(0))
    run = read_run(path)
    assert begin_ns(run.measurements) == START
    assert Frame.around(run).start_ns == START
    assert starting_prior(run).time_ns == START
    assert prior_from_truth(run.measurements, truths(0))[0].time_ns == START
    (by_hand := tmp_path / "segments.csv").write_text("from_s,until_s,distance_m,turn_rad\n0.0,1.0,1.0,\n")
    assert read_segments(by_hand, run, 0)[0].from_ns == START
    assert describe(path)["duration_s"] == 2.0
    wheels = describe(path)["channels"][0]
    assert (wheels["kind"], wheels["longest_gap_at_s"]) == ("Odometry", 0.1)


class Recorded(DeadReckoning):
    """Dead reckoning that keeps the priors it was started with."""

    priors: ClassVar[list[Prior]] = []

    def start(self, prior, seed):
        self.priors.append(prior)
        return super().start(prior, seed)


@pytest.mark.parametrize(
    "given",
    [
        {"prior": KNOWN, "truth": truths(0)},
        {"truth": truths(0)},
        {"truth": truths(START + 7 * TENTH // 3)},
        {"truth": truths(0, heading=None)},
        {},
    ],
    ids=["prior", "truth before the start", "truth after it", "truth without heading", "nothing"],
)
def test_info_judges_the_very_prior_that_bench_gives(tmp_path, given):
    run = read_run(written(tmp_path / "run.mcap", **given))
    Recorded.priors.clear()
    with fusion.registered("recorded", Recorded):
        usability(run)
        run_estimator(run, "recorded")
    judged, benched = Recorded.priors
    assert judged == benched == starting_prior(run)


def test_truth_gives_the_last_pose_up_to_the_start(tmp_path):
    moving = [Truth(k * SECOND + TENTH, float(k), 3.0, 0.5 * k) for k in range(8)]
    prior = starting_prior(read_run(written(tmp_path / "run.mcap", truth=moving)))
    assert (prior.time_ns, prior.pose) == (4 * SECOND + TENTH, Pose(4.0, 3.0, 2.0))
    assert prior.covariance == Covariance.from_std(0.05, 0.05, 0.05)


def test_import_and_bench_take_one_true_pose(tmp_path):
    """Where an import wrote no prior, bench gives the one it would have written, but for a heading from motion."""
    for first_ns in (0, START, START + 3 * TENTH):
        run = read_run(written(tmp_path / "run.mcap", truth=truths(first_ns)))
        assert prior_from_truth(run.measurements, truths(first_ns))[0] == starting_prior(run)
    imported, how = prior_from_truth(run.measurements, truths(0, heading=None, step_ns=TENTH))
    assert (imported.pose, imported.heading_known) == (Pose(2.0, 3.0, 0.0), True)
    assert "motion" in how


def test_poses_without_a_position_start_no_run():
    nowhere = [Truth(0, math.nan, math.nan, 0.0), Truth(SECOND, 2.0, 3.0, None)]
    prior, how = prior_from_truth([], nowhere)
    assert (prior.time_ns, prior.heading_known, how) == (SECOND, False, "true position at the start, heading unknown")
    assert prior.covariance.hh == pytest.approx(UNKNOWN_HEADING_STD**2)
    assert prior_from_truth([], nowhere[:1]) == (None, "no truth: start unknown")


def test_without_truth_the_prior_is_uniform_over_the_floor(tmp_path):
    prior = starting_prior(read_run(written(tmp_path / "run.mcap")))
    assert (prior.time_ns, prior.pose[:2]) == (START, (6.0, 3.0))
    assert (prior.position_known, prior.heading_known) == (False, False)
    assert np.diag(prior.covariance.matrix) == pytest.approx([12.0**2 / 12.0, 6.0**2 / 12.0, UNKNOWN_HEADING_STD**2])
