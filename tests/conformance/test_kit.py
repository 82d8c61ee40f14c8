"""The kit is held against one correct estimator and against small changes of it, each of which it must notice."""

import json
import math
from typing import NamedTuple

import numpy as np
import pytest

import fusion
from fusion import (
    ConformanceError,
    Covariance,
    Decision,
    Estimate,
    Fate,
    ParameterError,
    Particles,
    PluginError,
    Pose,
    Ranges,
    Reason,
    Tag,
    compose,
    radio_readings,
    registered,
    wrap_angle,
)
from fusion.belief import HEADING_KNOWN_STD, starting_belief
from fusion.cli import check as verb
from fusion.cli.main import main
from fusion.conformance.checks import PROMISES, Check, Outcome, checks, run_checks, verdict


class State(NamedTuple):
    time_ns: int
    seed: int
    pose: Pose
    covariance: Covariance


class Correct:
    """A gated extended Kalman filter over the pose."""

    summary = "reference"
    tags = frozenset()
    gate = 10.8

    def __init__(self, world):
        self.world = world

    def start(self, prior, seed):
        return State(prior.time_ns, seed, *starting_belief(self.world, prior))

    def step(self, state, motion, scan):
        moved = self.move(state, motion)
        return (moved, ()) if scan is None else self.see(moved, scan)

    def move(self, state, motion):
        pose, covariance = compose(state.pose, state.covariance, motion)
        return state._replace(time_ns=motion.time_ns, pose=pose, covariance=covariance)

    def see(self, state, scan):
        mean, p = np.array(state.pose), np.array(state.covariance.matrix)
        before, p_before, fates = mean, p, []
        for reading in radio_readings(self.world, scan):
            expected = reading.expect(*before, self.world.robot.antenna_m)
            row = np.array([expected.by_x, expected.by_y, expected.by_heading])
            variance = reading.variance + reading.model.bias_std**2
            innovation, spread = reading.value - expected.value, float(row @ p_before @ row) + variance
            nis = innovation**2 / spread
            used = nis <= self.gate
            if used:
                gain = p @ row / (row @ p @ row + variance)
                mean = mean + gain * (innovation - row @ (mean - before))
                p = p - np.outer(gain, row @ p)
            verdict = (Decision.USED, Reason.OK, 1.0) if used else (Decision.REJECTED, Reason.GATE, 0.0)
            who = (scan.time_ns, scan.sensor, scan.seq, reading.anchor.id)
            fates.append(Fate(*who, *verdict, innovation, spread, nis))
        x, y, heading = mean.tolist()
        spread = Covariance(p[0, 0], p[0, 1], p[0, 2], p[1, 1], p[1, 2], p[2, 2])
        return State(scan.time_ns, state.seed, Pose(x, y, wrap_angle(heading)), spread), tuple(fates)

    def estimate(self, state, motion, time_ns):
        _, _, pose, covariance = self.move(state, motion)
        return Estimate(time_ns, pose, covariance, heading_known=covariance.hh < HEADING_KNOWN_STD**2)


class GlobalDice(Correct):
    def move(self, state, motion):
        moved = super().move(state, motion)
        jitter = np.random.random() * 1e-9  # noqa: NPY002 - that is the fault
        return moved._replace(pose=moved.pose._replace(x=moved.pose.x + jitter))


class SecretSeed(Correct):
    def start(self, prior, seed):
        first = super().start(prior, seed)
        return first._replace(pose=first.pose._replace(x=first.pose.x + 1e-3 * seed))


class CountsInItself(Correct):
    steps = 0

    def move(self, state, motion):
        self.steps += 1
        moved = super().move(state, motion)
        return moved._replace(pose=moved.pose._replace(x=moved.pose.x + 1e-9 * self.steps))


class WritesIntoState(Correct):
    """Keeps its pose in an array and adds to it in place."""

    def start(self, prior, seed):
        return np.array(prior.pose)

    def step(self, state, motion, scan):
        state[0] += motion.x
        return state, ()

    def estimate(self, state, motion, time_ns):
        return Estimate(time_ns, Pose(*state.tolist()), Covariance.from_std(1.0, 1.0, 0.1))


class EstimateAdvances(Correct):
    shift = 0.0

    def estimate(self, state, motion, time_ns):
        self.shift += 1e-9
        found = super().estimate(state, motion, time_ns)
        return found._replace(pose=found.pose._replace(x=found.pose.x + self.shift))


class Unpicklable(Correct):
    def start(self, prior, seed):
        return super().start(prior, lambda: seed)


class SurerLater(Correct):
    def estimate(self, state, motion, time_ns):
        found = super().estimate(state, motion, time_ns)
        shrunk = math.exp(-motion.duration_s)
        return found._replace(covariance=Covariance(*(shrunk * number for number in found.covariance)))


class SilentAnchor(Correct):
    def see(self, state, scan):
        after, fates = super().see(state, scan)
        return after, fates[1:]


class HeavyWeight(Correct):
    def see(self, state, scan):
        after, fates = super().see(state, scan)
        return after, tuple(fate._replace(weight=1.7) for fate in fates)


class NisWithoutSquare(Correct):
    def see(self, state, scan):
        after, fates = super().see(state, scan)
        return after, tuple(fate._replace(nis=abs(fate.innovation) / fate.innovation_variance) for fate in fates)


class LostBeyondDoubt(Correct):
    def estimate(self, state, motion, time_ns):
        return super().estimate(state, motion, time_ns)._replace(p_lost=1.5)


class NegativeVariance(Correct):
    def estimate(self, state, motion, time_ns):
        found = super().estimate(state, motion, time_ns)
        return found._replace(covariance=found.covariance._replace(yy=-0.01))


class InventedCovariance(Correct):
    tags = frozenset({Tag.NO_COVARIANCE})


class UnwrappedHeading(Correct):
    def estimate(self, state, motion, time_ns):
        found = super().estimate(state, motion, time_ns)
        return found._replace(pose=found.pose._replace(heading=found.pose.heading + math.tau))


class NeedsWifi(Correct):
    """Gives up without Wi-Fi: after a while its pose is not a number."""

    def start(self, prior, seed):
        return super().start(prior, prior.time_ns)

    def see(self, state, scan):
        number = state.seed if isinstance(scan, Ranges) else scan.time_ns
        after, fates = super().see(state, scan)
        return after._replace(seed=number), fates

    def estimate(self, state, motion, time_ns):
        found = super().estimate(state, motion, time_ns)
        silent = time_ns - state.seed > 5_000_000_000
        return found._replace(pose=Pose(math.nan, 0.0, 0.0)) if silent else found


class AveragesHeadings(Correct):
    """Smooths its heading as if it were a length."""

    def move(self, state, motion):
        moved = super().move(state, motion)
        heading = 0.5 * state.pose.heading + 0.5 * moved.pose.heading + 0.5 * motion.heading
        return moved._replace(pose=moved.pose._replace(heading=heading))


class RemembersTheNewest(Correct):
    """Never lets its time run back, not even when the host goes back to an older state."""

    newest_ns = 0

    def step(self, state, motion, scan):
        late, self.newest_ns = motion.time_ns < self.newest_ns, max(self.newest_ns, motion.time_ns)
        return (state, ()) if late else super().step(state, motion, scan)


class HardCodedRoom(Correct):
    def see(self, state, scan):
        after, fates = super().see(state, scan)
        return after._replace(pose=after.pose._replace(x=min(max(after.pose.x, 0.0), 10.0))), fates


class OrderOfNames(Correct):
    """Believes the first anchor twice."""

    def see(self, state, scan):
        first = type(scan)(scan.time_ns, scan.sensor, scan.seq, scan.readings[:1])
        return super().see(super().see(state, first)[0], scan)


class NoGate(Correct):
    gate = math.inf


class Backwards(Correct):
    def move(self, state, motion):
        return super().move(state, motion._replace(x=-motion.x, y=-motion.y))


class ConstantCovariance(Correct):
    def estimate(self, state, motion, time_ns):
        return super().estimate(state, motion, time_ns)._replace(covariance=Covariance.from_std(0.3, 0.3, 0.1))


class GuessesByTheBits(Correct):
    """Adds an error that is as good as random, and the same for the same motion to the last bit."""

    def step(self, state, motion, scan):
        after, fates = super().step(state, motion, scan)
        error_m = hash(motion) % 1000 * 1e-4
        return after._replace(pose=after.pose._replace(x=after.pose.x + error_m)), fates


class NoisePerStep(Correct):
    def move(self, state, motion):
        moved = super().move(state, motion)
        p = moved.covariance
        return moved._replace(covariance=p._replace(xx=p.xx + 1e-3, yy=p.yy + 1e-3, hh=p.hh + 1e-3))


class ForgetsClosedStretches(Correct):
    def step(self, state, motion, scan):
        return (state, ()) if scan is None else super().step(state, motion, scan)


class FatesOfNoScan(Correct):
    """Reports a closed stretch as if it were a scan that could not be used."""

    def step(self, state, motion, scan):
        after, fates = super().step(state, motion, scan)
        closed = Fate(motion.time_ns, "", 0, "", Decision.UNUSABLE, Reason.KIND_NOT_CONSUMED, 0.0)
        return after, (closed,) if scan is None else fates


class SureOfItsHeading(Correct):
    def estimate(self, state, motion, time_ns):
        return super().estimate(state, motion, time_ns)._replace(heading_known=True)


class StartsNowhere(Correct):
    """Claims to start anywhere, and takes the prior's position at its word."""

    tags = frozenset({Tag.GLOBAL_START})
    gate = 0.5

    def start(self, prior, seed):
        return State(prior.time_ns, seed, prior.pose, prior.covariance)


class TooFar(Correct):
    def estimate(self, state, motion, time_ns):
        found = super().estimate(state, motion, time_ns)
        return found._replace(pose=found.pose._replace(x=found.pose.x + 0.6))


class WithParticles(Correct):
    """Shows its belief as four points, which have its mean."""

    def particles(self, state):
        dx, dy = math.sqrt(state.covariance.xx), math.sqrt(state.covariance.yy)
        cross = np.array([[dx, 0.0], [-dx, 0.0], [0.0, dy], [0.0, -dy]])
        return Particles(np.array(state.pose[:2]) + cross, np.full(4, 0.25))


class HeavyParticles(WithParticles):
    def particles(self, state):
        shown = super().particles(state)
        return shown._replace(weights=4.0 * shown.weights)


class ParticlesElsewhere(WithParticles):
    def particles(self, state):
        shown = super().particles(state)
        return shown._replace(positions=shown.positions[:, ::-1])


class ParticlesWithoutAPlace(WithParticles):
    def particles(self, state):
        shown = super().particles(state)
        return shown._replace(positions=shown.positions[:3])


class ParticlesThatAreNoNumbers(WithParticles):
    def particles(self, state):
        shown = super().particles(state)
        return shown._replace(positions=shown.positions * math.nan)


class MovedByBeingSeen(WithParticles):
    shift = 0.0

    def particles(self, state):
        self.shift += 1e-9
        return super().particles(state)

    def estimate(self, state, motion, time_ns):
        found = super().estimate(state, motion, time_ns)
        return found._replace(pose=found.pose._replace(x=found.pose.x + self.shift))


BROKEN = {
    GlobalDice: "same-bytes",
    SecretSeed: "no-hidden-dice",
    CountsInItself: "step-is-pure",
    WritesIntoState: "state-is-kept",
    EstimateAdvances: "estimate-is-pure",
    Unpicklable: "state-pickles",
    SurerLater: "later-not-surer",
    SilentAnchor: "every-fate",
    HeavyWeight: "fate-numbers",
    NisWithoutSquare: "fate-numbers",
    LostBeyondDoubt: "honest-form",
    NegativeVariance: "covariance",
    InventedCovariance: "covariance",
    UnwrappedHeading: "heading-range",
    NeedsWifi: "any-sensor-out",
    AveragesHeadings: "no-jump-at-pi",
    RemembersTheNewest: "order-of-arrival",
    TooFar: "small-error",
    HardCodedRoom: "world-turns",
    OrderOfNames: "names-mean-nothing",
    NoGate: "outlier-is-bounded",
    Backwards: "forward-is-forward",
    ConstantCovariance: "radio-silence",
    GuessesByTheBits: "rate-means-nothing",
    NoisePerStep: "closing-changes-little",
    ForgetsClosedStretches: "closing-changes-little",
    FatesOfNoScan: "closing-changes-little",
    SureOfItsHeading: "unknown-heading",
    StartsNowhere: "global-start",
    HeavyParticles: "particles",
    ParticlesElsewhere: "particles",
    ParticlesWithoutAPlace: "particles",
    ParticlesThatAreNoNumbers: "particles",
    MovedByBeingSeen: "particles",
}


@pytest.mark.parametrize("check", list(checks(WithParticles)), ids=lambda check: check.id)
def test_correct_estimator_keeps_every_promise(check):
    check.run()


@pytest.mark.parametrize(
    ("broken", "promise_id"),
    [pytest.param(*pair, id=f"{pair[0].__name__}-{pair[1]}") for pair in BROKEN.items()],
)
def test_broken_estimator_fails_its_named_check(broken, promise_id):
    (check,) = (check for check in checks(broken) if check.id == promise_id)
    with pytest.raises(AttributeError if broken is Unpicklable else ConformanceError):
        check.run()


def test_every_promise_has_an_estimator_that_breaks_it():
    assert {promise.id for promise in PROMISES} == set(BROKEN.values())


def test_ids_are_unique_and_every_promise_states_its_reason():
    assert len({promise.id for promise in PROMISES}) == len(PROMISES)
    assert all(promise.reason.endswith(".") for promise in PROMISES)


def verdict_on(estimator, promise_id, excuse=None):
    """What `run_checks` makes of one promise, without the others."""
    (promise,) = (promise for promise in PROMISES if promise.id == promise_id)
    return verdict(Check(promise, estimator), excuse)


def test_verdicts_distinguish_broken_excused_and_skipped():
    broken = verdict_on(NoGate, "outlier-is-bounded")
    excused = verdict_on(NoGate, "outlier-is-bounded", "it has no gate")
    skipped = verdict_on(type("Quiet", (Correct,), {"tags": {Tag.NO_RADIO}}), "outlier-is-bounded")
    assert broken.outcome is Outcome.BROKEN
    assert "moves the pose" in broken.detail
    assert excused.outcome is Outcome.EXCUSED
    assert skipped.outcome is Outcome.SKIPPED
    assert "no_radio" in skipped.detail


def test_particles_are_asked_only_of_who_offers_them():
    skipped = verdict_on(Correct, "particles")
    assert skipped.outcome is Outcome.SKIPPED
    assert "ParticleEstimator" in skipped.detail


def test_excuse_that_is_not_needed_counts_as_broken_and_excuses_nothing_else():
    with registered("no_gate", NoGate):
        by_id = {each.id: each for each in run_checks("no_gate", {"same-bytes": "for no reason"})}
    assert by_id["same-bytes"].outcome is Outcome.BROKEN
    assert "take away the excuse" in by_id["same-bytes"].detail
    assert by_id["outlier-is-bounded"].outcome is Outcome.BROKEN


def test_unknown_promise_and_unknown_estimator_are_answered_with_a_hint():
    with pytest.raises(ParameterError, match="did you mean 'same-bytes'"):
        run_checks("ekf", {"same-byte": "?"})
    with pytest.raises(PluginError, match=r"did you mean|known"):
        run_checks("no_such_filter")


def test_estimator_that_raises_is_a_verdict_not_a_traceback():
    class Raises(Correct):
        def see(self, state, scan):
            raise ZeroDivisionError("a fault of its own")

    with registered("raises", Raises):
        broken = [verdict for verdict in run_checks("raises") if verdict.outcome is Outcome.BROKEN]
    assert broken
    assert all("a fault of its own" in verdict.detail for verdict in broken)


@pytest.mark.parametrize(("estimator", "code"), [(Correct, 0), (HeavyWeight, 1)])
def test_verb_prints_a_line_for_each_promise_and_exits_by_the_result(estimator, code, monkeypatch, capsys):
    with registered("held", estimator):
        verdicts = run_checks("held")
        monkeypatch.setattr(verb, "run_checks", {"held": verdicts}.__getitem__)
        assert main(["check", "held"]) == code
        text = capsys.readouterr().out
        assert main(["check", "held", "--json"]) == code
        rows = json.loads(capsys.readouterr().out)
    assert all(promise.id in text for promise in PROMISES)
    assert [row["id"] for row in rows] == [promise.id for promise in PROMISES]
    assert ("broken" in {row["outcome"] for row in rows}) == bool(code)
    assert fusion.names() == tuple(name for name in fusion.names() if name != "held")
