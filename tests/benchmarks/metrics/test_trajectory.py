"""Relative errors, speed, jumps and length against closed forms and against the definition, pose by pose."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.metrics.errors import errors
from benchmarks.metrics.relative_pose import Poses, relative_errors, trajectory_metrics
from fusion import Pose
from logs.truth import ahead

ANGLES, PLACES = st.floats(-3.0, 3.0), st.floats(-20.0, 20.0)
POSES = st.lists(st.builds(Pose, PLACES, PLACES, ANGLES), min_size=2, max_size=2)


@pytest.fixture
def straight(instants_of, answers_of):
    """Along x at 10 Hz; what is said is the truth but for a heading that is given."""

    def run(n=600, speed=0.5, heading=None):
        t = 0.1 * np.arange(n)
        x, zero = speed * t, np.zeros(n)
        return instants_of(t, x, zero, zero), answers_of(x, zero, zero if heading is None else heading)

    return run


@settings(derandomize=True, max_examples=60)
@given(POSES, POSES)
def test_relative_error_is_that_of_the_definition(instants_of, answers_of, true, said):
    columns = [np.array(column) for column in zip(*true, strict=True)]
    answers = answers_of(*[np.array(column) for column in zip(*said, strict=True)])
    poses = Poses.of(errors(instants_of([0.0, 1.0], *columns), answers))
    (translation,), (rotation,) = relative_errors(poses, slice(1), np.array([1]))
    expected = true[0].inverse().compose(true[1]).inverse().compose(said[0].inverse().compose(said[1]))
    assert translation == pytest.approx(math.hypot(expected.x, expected.y), abs=1e-9)
    assert rotation == pytest.approx(abs(expected.heading), abs=1e-9)


def test_an_estimate_that_is_moved_and_turned_as_a_whole_has_no_relative_error(straight, answers_of):
    instants, _ = straight()
    yaw = 0.7
    said = answers_of(3.0 + np.cos(yaw) * instants.x, -2.0 + np.sin(yaw) * instants.x, np.full(600, yaw))
    scores = trajectory_metrics(errors(instants, said))
    assert scores["rpe_d_5m_rmse"] == pytest.approx(0.0, abs=1e-12)
    assert scores["rpe_t_10s_rot_rmse"] == pytest.approx(0.0, abs=1e-12)


def test_odometry_that_is_two_percent_long_errs_by_two_percent_of_the_distance(straight):
    instants, answers = straight()
    scores = trajectory_metrics(errors(instants, answers._replace(x=1.02 * answers.x)))
    for reach in (1, 5, 10):
        assert scores[f"rpe_d_{reach}m_rmse"] == pytest.approx(0.02 * reach, rel=1e-9)
        assert scores[f"rpe_d_{reach}m_median"] == pytest.approx(0.02 * reach, rel=1e-9)


def test_pairs_follow_the_true_path_and_end_where_it_is_long_enough():
    along = np.array([0.0, 0.4, 0.8, 1.0, 1.2])
    start, end = ahead(along, 1.0)
    assert (list(range(5))[start], end.tolist()) == ([0], [3])
    start, end = ahead(along, 0.4 - 1e-9)
    assert (list(range(5))[start], end.tolist()) == ([0, 1, 2], [1, 2, 4])


def test_a_pair_that_reaches_over_a_gap_is_none():
    start, end = ahead(np.array([0.0, 1.0, 9.0, 10.0]), 1.0)
    assert (start.tolist(), end.tolist()) == ([0, 2], [1, 3])


def test_pairs_without_an_answer_at_both_ends_do_not_count(straight):
    instants, answers = straight()
    valid = np.ones(600, dtype=bool)
    valid[100] = False
    scores = trajectory_metrics(errors(instants, answers._replace(valid=valid)))
    assert scores["rpe_t_1s_n"] == 590.0 - 2.0


def test_relative_errors_need_headings_and_velocities_do_not(straight):
    instants, answers = straight(heading=np.full(600, np.nan))
    measured = errors(instants, answers)
    assert trajectory_metrics(measured)["rpe_d_1m_n"] == 0.0
    assert math.isnan(trajectory_metrics(measured)["rpe_d_1m_rmse"])
    assert trajectory_metrics(measured)["vel_err"] == 0.0


def test_a_pair_needs_a_heading_at_both_ends(straight):
    heading = np.zeros(600)
    heading[100] = np.nan
    scores = trajectory_metrics(errors(*straight(heading=heading)))
    assert scores["rpe_t_1s_n"] == 590.0 - 2.0
    assert scores["rpe_t_1s_rot_rmse"] == scores["rpe_t_1s_rot_median"] == 0.0


def test_velocity_error_of_a_drift_is_the_drift(straight):
    instants, answers = straight()
    drifting = answers._replace(x=answers.x + 0.03 * np.arange(600) / 10.0, y=answers.y - 0.04 * np.arange(600) / 10.0)
    scores = trajectory_metrics(errors(instants, drifting))
    assert scores["vel_err"] == pytest.approx(0.05, rel=1e-9)
    assert scores["vel_err_p95"] == pytest.approx(0.05, rel=1e-9)


def test_one_step_aside_and_back_is_two_jumps(straight):
    instants, answers = straight(n=601)
    answers.y[300] += 1.0
    scores = trajectory_metrics(errors(instants, answers))
    assert scores["jump_rate"] == pytest.approx(2.0, rel=1e-9)
    assert scores["path_ratio"] == pytest.approx((30.0 - 0.1 + 2.0 * math.hypot(1.0, 0.05)) / 30.0, rel=1e-9)


def test_a_step_is_a_jump_only_beyond_what_the_speed_allows(straight):
    instants, answers = straight(speed=1.9)
    assert trajectory_metrics(errors(instants, answers))["jump_rate"] == 0.0
    assert trajectory_metrics(errors(instants, answers), top_speed_m_s=0.5)["jump_rate"] == pytest.approx(600.0)


def test_an_estimate_held_for_a_second_does_not_jump_when_the_next_one_comes(straight):
    instants, answers = straight(speed=1.5)
    held = np.arange(600) // 10 * 10
    answers = answers._replace(x=answers.x[held], age_s=(np.arange(600) - held) / 10.0)
    assert trajectory_metrics(errors(instants, answers))["jump_rate"] == 0.0
    assert trajectory_metrics(errors(instants, answers._replace(age_s=np.zeros(600))))["jump_rate"] > 0.0


def test_frames_may_be_paired_instead_of_times(oracle_a):
    poses = Poses.of(errors(*oracle_a))
    by_frame, _ = relative_errors(poses, slice(990), np.arange(10, 1000))
    assert np.sqrt(np.mean(by_frame**2)) == pytest.approx(0.0837788095342, rel=1e-9)
