"""Several estimators on one timeline, estimates when asked for and failures by name."""

import gc
import math
import weakref

import pytest
from hypothesis import given

from fusion import Estimate, ParameterError, PluginError, Update, build, digest
from fusion.fold import Fold
from fusion.timeline import Timeline
from fusion.tracker import Tracker
from tests.fusion.streams import (
    CLOSED_S,
    LATE,
    LONG,
    PRIOR,
    SCANS_MS,
    SECOND,
    STREAM,
    WORLD,
    CountingWorld,
    Ledger,
    last_words,
    late_streams,
    odometry,
    ranges,
    updates_of,
)


def folded(timeline, folds, measurements):
    """The updates of every fold over one timeline."""
    updates = [[] for _ in folds]
    for measurement in measurements:
        for moment in timeline.push(measurement):
            for fold, mine in zip(folds, updates, strict=True):
                mine.append(fold.take(moment))
    return updates


# --- one timeline, several folds -------------------------------------------------------------------------------------


def test_folds_on_one_timeline_are_given_the_very_same_motion():
    folds = [Fold(Ledger(), PRIOR, seed) for seed in range(3)]
    folded(Timeline(WORLD, 0), folds, STREAM + LONG[4:])
    first, *others = (fold.particles() for fold in folds)
    assert len(first) == len(SCANS_MS) + 2
    for state in others:
        assert all(mine is theirs for (mine, _), (theirs, _) in zip(first, state, strict=True))
        assert all(mine is theirs for (_, mine), (_, theirs) in zip(first, state, strict=True))


@pytest.mark.parametrize("count", [1, 5])
def test_measurements_are_screened_and_integrated_once_whatever_the_number_of_estimators(count):
    world = CountingWorld(WORLD)
    folded(Timeline(world, 0), [Fold(Ledger(), PRIOR) for _ in range(count)], STREAM)
    assert world.asked == dict.fromkeys("abc", len(SCANS_MS))


def test_fold_beside_others_is_the_fold_alone():
    names = ("ekf", "particle", "bayes_weight")
    together = folded(Timeline(WORLD, 0), [Fold(build(name, WORLD), PRIOR, 3) for name in names], STREAM)
    for name, updates in zip(names, together, strict=True):
        assert digest(updates) == digest(updates_of(build(name, WORLD), STREAM, seed=3))


def test_every_epoch_is_stepped_once_and_again_only_where_late_data_revise_it():
    estimator = Ledger()
    updates_of(estimator, STREAM)
    assert estimator.stepped == len(SCANS_MS)
    updates = updates_of(estimator := Ledger(), LATE)
    assert estimator.stepped == len(SCANS_MS) + 1
    assert [update.measurement for update in updates if update.revised] == [
        m for m in STREAM if 2.0 < m.time_ns / SECOND < 3.34
    ]


def test_states_that_late_data_can_no_longer_ask_for_are_let_go():
    """A scan every tenth of a second for 20 s: the states of the last two seconds are kept."""

    class State:
        pass

    alive, most = weakref.WeakSet(), 0

    class Counted(Ledger):
        def start(self, prior, seed):
            alive.add(state := State())
            return state

        def step(self, state, motion, scan):
            return self.start(None, 0), ()

    tracker = Tracker(Counted(), WORLD, PRIOR)
    for k in range(1, 201):
        for measurement in (odometry(k), ranges(k * SECOND // 10, k)):
            tracker.push(measurement)
        most = max(most, len(alive))
    gc.collect()
    assert 20 <= len(alive) <= most <= 23


# --- estimates when asked for ----------------------------------------------------------------------------------------


def test_estimate_of_an_update_is_computed_once_and_only_when_asked_for():
    estimator = Ledger()
    updates = updates_of(estimator, STREAM)
    assert estimator.asked == 0
    once = updates[5].estimate
    assert updates[5].estimate is once
    assert estimator.asked == 1


def test_update_made_of_an_estimate_has_that_estimate():
    estimate = Estimate(SECOND, PRIOR.pose, None)
    update = Update(odometry(1), estimate, ())
    assert update.estimate is estimate
    assert (update.epochs, update.revised, update.fates) == ((), False, ())


def test_estimate_asked_for_late_is_that_of_its_own_moment():
    """After the run, backwards, and though late data revised what followed."""
    at_once, tracker = [], Tracker(Ledger(), WORLD, PRIOR)
    for measurement in LATE:
        at_once += [(update.measurement, update.estimate) for update in tracker.push(measurement)]
    afterwards = [(update.measurement, update.estimate) for update in reversed(updates_of(Ledger(), LATE))]
    assert repr(afterwards[::-1]) == repr(at_once)


@given(late_streams())
def test_asking_for_estimates_in_between_changes_nothing(stream):
    asked, updates = Tracker(Ledger(), WORLD, PRIOR), []
    for measurement in stream[1]:
        updates += asked.push(measurement)
        assert updates[-1].estimate.time_ns == asked.time_ns
        for ahead_ns in (0, 1, SECOND, 40 * SECOND):
            asked.estimate(asked.time_ns + ahead_ns)
    alone = updates_of(Ledger(), stream[1])
    assert digest(updates) == digest(alone)
    assert repr(last_words(updates)) == repr(last_words(alone))


def test_estimate_of_a_tracker_is_held_on_the_last_twist_and_never_of_the_past():
    tracker = Tracker(Ledger(), WORLD, PRIOR)
    for measurement in STREAM:
        (update,) = tracker.push(measurement)
        assert tracker.estimate(measurement.time_ns) == update.estimate
    ahead, past = tracker.estimate(4 * SECOND + SECOND // 5), tracker.estimate(0)
    assert math.dist(ahead.pose[:2], past.pose[:2]) == pytest.approx(0.1, rel=1e-3)
    assert (ahead.time_ns, past.time_ns) == (4 * SECOND + SECOND // 5, 4 * SECOND)


# --- failures --------------------------------------------------------------------------------------------------------


class FailsToStep(Ledger):
    def step(self, state, motion, scan):
        if motion.time_ns >= 2 * SECOND:
            raise ZeroDivisionError("no such weight")
        return super().step(state, motion, scan)


class FailsToEstimate(Ledger):
    def estimate(self, state, motion, time_ns):
        if time_ns >= 2 * SECOND:
            raise IndexError("no such cell")
        return super().estimate(state, motion, time_ns)


class FailsToStart(Ledger):
    def start(self, prior, seed):
        raise KeyError("no such place")


class FailsToShow(Ledger):
    def particles(self, state):
        raise IndexError("no such point")


def test_estimator_that_fails_to_start_is_named():
    with pytest.raises(PluginError, match=r"FailsToStart failed at its start: .*no such place.*--estimators"):
        Tracker(FailsToStart(), WORLD, PRIOR)


def test_estimator_that_fails_to_show_its_particles_is_named():
    with pytest.raises(PluginError, match=r"FailsToShow failed when asked for its particles: .*no such point"):
        Tracker(FailsToShow(), WORLD, PRIOR).particles()


def test_step_that_answers_no_pair_is_a_failure_of_the_estimator():
    class Forgets(Ledger):
        def step(self, state, motion, scan):
            pass

    with pytest.raises(PluginError, match=r"Forgets failed on Ranges of 'uwb' at .*cannot unpack"):
        updates_of(Forgets(), STREAM)


def test_estimator_that_fails_on_a_scan_is_named_with_its_time_and_sensor():
    with pytest.raises(PluginError, match=r"FailsToStep failed on Ranges of 'uwb' at 2000000000 ns: .*no such weight"):
        updates_of(FailsToStep(), STREAM)


def test_estimator_that_fails_on_motion_alone_is_named_with_its_time():
    with pytest.raises(
        PluginError, match=rf"FailsToStep failed on motion alone at {CLOSED_S * SECOND} ns: .*no such weight"
    ):
        updates_of(FailsToStep(), LONG)


def test_estimator_that_fails_when_asked_is_named_with_the_time_and_only_then():
    updates = updates_of(FailsToEstimate(), STREAM)
    early, late = (next(u for u in updates if u.measurement.time_ns == s * SECOND) for s in (1, 2))
    assert early.estimate.valid
    for _ in range(2):
        with pytest.raises(PluginError, match=r"FailsToEstimate failed .* at 2000000000 ns: .*no such cell"):
            late.estimate  # noqa: B018 - the asking is what fails
    with pytest.raises(PluginError, match="7000000000 ns"):
        Tracker(FailsToEstimate(), WORLD, PRIOR).estimate(7 * SECOND)


def test_failure_states_the_remedy():
    with pytest.raises(PluginError, match=r"--estimators.*author"):
        updates_of(FailsToStep(), STREAM)


def test_error_of_our_own_passes_as_it_is():
    class RefusesToStart(Ledger):
        def start(self, prior, seed):
            raise ParameterError("give another seed")

    class Refuses(Ledger):
        def step(self, state, motion, scan):
            raise ParameterError("give another number")

        def estimate(self, state, motion, time_ns):
            raise ParameterError("give another time")

    with pytest.raises(ParameterError, match="give another seed"):
        Tracker(RefusesToStart(), WORLD, PRIOR)
    with pytest.raises(ParameterError, match="give another number"):
        updates_of(Refuses(), STREAM)
    with pytest.raises(ParameterError, match="give another time"):
        Tracker(Refuses(), WORLD, PRIOR).estimate(0)
