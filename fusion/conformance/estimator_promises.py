"""What every estimator promises, each promise a small function that looks for a counter-example.

They are kept on the drives of `fusion.conformance.synthetic_run`, whose truth is known, and through the same host that
real runs go through. Each has an id that stays the same, so that it can be excused by name, and a sentence that says
why it matters. `fusion.conformance.checks` runs them.
"""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from fusion.certificate import digest
from fusion.conformance.synthetic_run import Drive, with_outlier, without
from fusion.epochs import LONGEST, Epoch, Longest
from fusion.errors import ConformanceError
from fusion.estimator import Estimator, ParticleEstimator, Particles, Tag
from fusion.fold import Update
from fusion.geometry import Pose, wrap_angle
from fusion.motion import Increment
from fusion.timeline import Timeline
from fusion.tracker import Tracker, final, track
from fusion.values import (
    NANOSECONDS,
    Estimate,
    Gyro,
    Measurement,
    Odometry,
    Prior,
    Ranges,
    WifiScan,
    nanoseconds,
    seconds,
)

Kind: TypeAlias = type[Any]
"""An estimator class; it is built with the world alone."""

SEED = 1
EXACT_M = 1e-6
"""Poses that differ by rounding alone are closer than this [m, rad]."""
NEAR_M = 0.5
"""Error [m] that no estimator of noiseless data may pass once it has settled."""
NEAR_RAD = 0.3
"""The same for a heading [rad]."""
NEAR_SHARE = 0.1
"""How far the mean of particles may be from the estimate, as a share of their spread: the motion since the last reading
may have moved each by itself, and the estimate as one.
"""
SETTLED_NS = nanoseconds(5.0)
"""Time in which an estimator settles."""
NEAR_CLOSED = 0.01
"""How far a pose may move [m, rad] where stretches of motion are closed early: what first order leaves out."""
SHORT = Longest(duration_s=0.25)
"""Several stretches to a scan."""
NOISY = Drive(noisy=True, duration_s=12.0)
NOISELESS = Drive()


class Promise(NamedTuple):
    """What must hold: ``test`` raises `ConformanceError` with a counter-example.

    ``unless`` excuses estimators with any of these tags, ``needs`` those without any of these, ``offers`` those that
    are not of this kind.
    """

    id: str
    reason: str
    test: Callable[[Kind], None]
    unless: frozenset[Tag]
    needs: frozenset[Tag]
    offers: Kind

    def excuse(self, made: Kind) -> str:
        """Why the promise does not apply to the class ``made``; "" where it does."""
        tags: frozenset[Tag] = getattr(made, "tags", frozenset())
        if not issubclass(made, self.offers):
            return f"asked only of a {self.offers.__name__}"
        if barred := self.unless & tags:
            return f"not asked of an estimator tagged {', '.join(sorted(tag.value for tag in barred))}"
        if self.needs and not self.needs & tags:
            return f"asked only of an estimator tagged {', '.join(sorted(tag.value for tag in self.needs))}"
        return ""


PROMISES: list[Promise] = []


def _promise(
    promise_id: str, reason: str, *, unless: Sequence[Tag] = (), needs: Sequence[Tag] = (), offers: Kind = object
) -> Callable[[Callable[[Kind], None]], Callable[[Kind], None]]:
    def enlist(test: Callable[[Kind], None]) -> Callable[[Kind], None]:
        PROMISES.append(Promise(promise_id, reason, test, frozenset(unless), frozenset(needs), offers))
        return test

    return enlist


def _require(condition: object, counter_example: str) -> None:
    if not condition:
        raise ConformanceError(counter_example)


def _updates(
    made: Kind,
    drive: Drive,
    measurements: Sequence[Measurement] | None = None,
    prior: Prior | None = None,
    seed: int = SEED,
) -> list[Update]:
    """The whole fold over a drive."""
    world = drive.world()
    given = drive.measurements() if measurements is None else measurements
    return list(track(made(world), world, given, prior or drive.prior(), seed=seed))


def _epochs(drive: Drive, longest: Longest = LONGEST) -> Iterator[Epoch]:
    """The epochs of a drive, whose measurements are in order."""
    timeline = Timeline(drive.world(), drive.prior().time_ns, longest=longest)
    for measurement in drive.measurements():
        for moment in timeline.push(measurement):
            yield from moment.epochs


def _states(made: Kind, drive: Drive, longest: Longest = LONGEST) -> Iterator[tuple[Estimator[Any], Any, Epoch]]:
    """The bare fold, every state with the epoch that comes next."""
    estimator = made(drive.world())
    state = estimator.start(drive.prior(), SEED)
    for epoch in _epochs(drive, longest):
        yield estimator, state, epoch
        state, _ = estimator.step(state, epoch.motion, epoch.scan)


def _stepped(estimator: Estimator[Any], state: Any, epoch: Epoch) -> Update:  # noqa: ANN401 - a state is opaque
    """One step of the bare fold, and the belief right after it."""
    after, fates = estimator.step(state, epoch.motion, epoch.scan)
    still = Increment(time_ns=epoch.time_ns)
    gyro = Gyro(epoch.time_ns, "", 0, 0.0)
    return Update(epoch.scan or gyro, estimator.estimate(after, still, epoch.time_ns), fates, epochs=(epoch,))


def _same(one: Sequence[Update], other: Sequence[Update], meaning: str) -> None:
    for first, second in zip(one, other, strict=True):
        what = first.measurement
        _require(
            digest([first]) == digest([second]),
            f"{meaning}: at {type(what).__name__} {what.sensor!r} {what.seq}, {seconds(what.time_ns)} s, first "
            f"{_brief(first.estimate)}, then {_brief(second.estimate)}, or their fates differ",
        )


def _brief(estimate: Estimate) -> str:
    return f"({', '.join(f'{number:.9g}' for number in estimate.pose)})"


def _at(update: Update) -> str:
    return f"at {seconds(update.estimate.time_ns)} s"


def _apart(one: Pose, other: Pose, *, heading: bool = True) -> float:
    turned = abs(wrap_angle(one.heading - other.heading)) if heading else 0.0
    return max(math.hypot(one.x - other.x, one.y - other.y), turned)


@_promise("same-bytes", "Same input, same bytes: without that a replay proves nothing.")
def _same_bytes(made: Kind) -> None:
    _same(_updates(made, NOISY), _updates(made, NOISY), "two runs over the same measurements differ")


@_promise(
    "no-hidden-dice", "Chance is declared: without the tag another seed changes nothing.", unless=[Tag.STOCHASTIC]
)
def _no_hidden_dice(made: Kind) -> None:
    _same(_updates(made, NOISY), _updates(made, NOISY, seed=SEED + 1), "another seed gives another answer")


@_promise("step-is-pure", "One state stepped twice gives one answer: the host goes back to old states.")
def _step_is_pure(made: Kind) -> None:
    for estimator, state, epoch in _states(made, NOISY):
        once, again = (_stepped(estimator, state, epoch) for _ in range(2))
        _same([once], [again], "the same state stepped twice gives two answers")


@_promise("state-is-kept", "A step leaves the state it was given as it was: old states are the host's memory.")
def _state_is_kept(made: Kind) -> None:
    for estimator, state, epoch in _states(made, NOISY):
        before = pickle.dumps(state)
        _stepped(estimator, state, epoch)
        _require(
            pickle.dumps(state) == before,
            f"step or estimate wrote into the state it was given, at {seconds(epoch.time_ns)} s",
        )


@_promise("estimate-is-pure", "Asking changes nothing: a display may ask as often as it likes.")
def _estimate_is_pure(made: Kind) -> None:
    world = NOISY.world()
    tracker = Tracker(made(world), world, NOISY.prior(), seed=SEED)
    asked: list[Update] = []
    for measurement in NOISY.measurements():
        asked += tracker.push(measurement)
        tracker.estimate(measurement.time_ns + NANOSECONDS)
    _same(_updates(made, NOISY), asked, "asking for estimates in between changed the answer")


@_promise("state-pickles", "A state survives being stored: warm starts and other processes need it.")
def _state_pickles(made: Kind) -> None:
    for estimator, state, epoch in _states(made, NOISY):
        stored = pickle.loads(pickle.dumps(state))  # noqa: S301 - our own bytes, a moment old
        once, again = (_stepped(estimator, given, epoch) for given in (state, stored))
        _same([once], [again], "a state that was pickled and brought back goes on differently")


@_promise("later-not-surer", "A later estimate is never more certain.", unless=[Tag.NO_COVARIANCE])
def _later_not_surer(made: Kind) -> None:
    noise = NOISY.world().robot.noise
    for estimator, state, epoch in _states(made, NOISY):
        later_ns = epoch.time_ns + 5 * NANOSECONDS
        blind = Odometry(later_ns, "", 0, epoch.time_ns, 0.0, 0.0, measured=False)
        now = estimator.estimate(state, epoch.motion, epoch.time_ns)
        later = estimator.estimate(state, epoch.motion.extend(blind, noise), later_ns)
        if now.covariance is None or later.covariance is None or not later.valid:
            continue
        for name, before, after in zip(now.covariance._fields, now.covariance, later.covariance, strict=True):
            _require(
                name not in ("xx", "yy", "hh") or after >= before * (1.0 - 1e-9),
                f"variance {name} falls from {before:.6g} to {after:.6g} by looking 5 s ahead "
                f"from {seconds(epoch.time_ns)} s",
            )


@_promise("every-fate", "Every reading has one Fate that says what became of it.")
def _every_fate(made: Kind) -> None:
    for update in _updates(made, NOISY):
        what = update.measurement
        if not isinstance(what, WifiScan | Ranges):
            continue
        heard, told = sorted(r.anchor for r in what.readings), sorted(fate.anchor for fate in update.fates)
        _require(heard == told, f"{_at(update)} anchors {heard} were heard, but fates tell of {told}")
        for fate in update.fates:
            who = (fate.time_ns, fate.sensor, fate.seq)
            _require(
                who == (what.time_ns, what.sensor, what.seq),
                f"{_at(update)} a fate is signed {who}, its scan {(what.time_ns, what.sensor, what.seq)}",
            )


@_promise("fate-numbers", "A weight is a share, and a NIS is innovation² over its variance.")
def _fate_numbers(made: Kind) -> None:
    for update in _updates(made, NOISY):
        for fate in update.fates:
            whose = f"{_at(update)} the fate of {fate.anchor or fate.sensor!r}"
            _require(0.0 <= fate.weight <= 1.0, f"{whose} has weight {fate.weight}")
            if fate.nis is None:
                continue
            innovation, variance = fate.innovation, fate.innovation_variance
            _require(
                innovation is not None and variance is not None and variance > 0.0,
                f"{whose} has NIS {fate.nis} with innovation {innovation} and variance {variance}",
            )
            expected = (innovation or 0.0) ** 2 / (variance or math.inf)
            _require(
                math.isclose(fate.nis, expected, rel_tol=1e-6, abs_tol=1e-12),
                f"{whose} has NIS {fate.nis:.6g}, but innovation² / variance is {expected:.6g}",
            )


@_promise("honest-form", "An estimate is of the time asked for, finite, and numbered as it should be.")
def _honest_form(made: Kind) -> None:
    resets = 0
    for update in _updates(made, NOISY):
        estimate = update.estimate
        _require(estimate.time_ns == update.measurement.time_ns, f"{_at(update)} the estimate has another time")
        _require(all(map(math.isfinite, estimate.pose)) or not estimate.valid, f"{_at(update)} {_brief(estimate)}")
        lost = estimate.p_lost
        _require(lost is None or 0.0 <= lost <= 1.0, f"{_at(update)} p_lost is {lost}")
        _require(estimate.reset_count >= resets, f"{_at(update)} reset_count fell to {estimate.reset_count}")
        resets = estimate.reset_count


@_promise("covariance", "A covariance is finite and positive semi-definite, or None where none is claimed.")
def _covariance(made: Kind) -> None:
    claims_none = Tag.NO_COVARIANCE in made.tags
    for update in _updates(made, NOISY):
        estimate = update.estimate
        if not estimate.valid:
            continue
        given, tagged = "a covariance" if estimate.covariance else "None", "there" if claims_none else "not"
        _require(
            (estimate.covariance is None) == claims_none,
            f"{_at(update)} the covariance is {given}, and the tag no_covariance is {tagged}",
        )
        if estimate.covariance is not None:
            matrix = np.array(estimate.covariance.matrix)
            _require(np.isfinite(matrix).all(), f"{_at(update)} the covariance is {estimate.covariance}")
            lowest = float(np.linalg.eigvalsh(matrix)[0])
            _require(lowest >= -1e-9 * np.trace(matrix), f"{_at(update)} the covariance has eigenvalue {lowest:.6g}")


@_promise("heading-range", "A heading lies in (-pi, pi].")
def _heading_range(made: Kind) -> None:
    for update in _updates(made, Drive(duration_s=60.0)):
        heading = update.estimate.pose.heading
        _require(-math.pi < heading <= math.pi, f"{_at(update)} the heading is {heading:.6g}")


@_promise("any-sensor-out", "Any one sensor may drop out.")
def _any_sensor_out(made: Kind) -> None:
    for sensor in ("wheels", "uwb", "wifi", "gyro"):
        for update in _updates(made, NOISELESS, without(NOISELESS.measurements(), sensor)):
            _require(
                not update.estimate.valid or all(map(math.isfinite, update.estimate.pose)),
                f"without {sensor!r}, {_at(update)} the pose is {_brief(update.estimate)}",
            )


@_promise("no-jump-at-pi", "The heading follows the robot across ±pi.", unless=[Tag.NO_HEADING])
def _no_jump_at_pi(made: Kind) -> None:
    for drive in (Drive(duration_s=30.0), Drive(duration_s=30.0, start=Pose(5.0, 6.0, 0.0), turn_rate_rad_s=-0.25)):
        for update in _updates(made, drive):
            truth = drive.pose(update.estimate.time_ns).heading
            off = abs(wrap_angle(update.estimate.pose.heading - truth))
            _require(off < NEAR_RAD, f"{_at(update)} the heading is {_brief(update.estimate)}, in truth {truth:.3f}")


@_promise("order-of-arrival", "Late inside the horizon equals in order.")
def _order_of_arrival(made: Kind) -> None:
    measurements = NOISY.measurements()
    delays_s = np.random.Generator(np.random.PCG64(3)).uniform(0.0, 1.0, len(measurements))
    arrival = [one.time_ns + nanoseconds(float(wait)) for one, wait in zip(measurements, delays_s, strict=True)]
    shuffled = [measurements[i] for i in np.argsort(arrival, kind="stable")]
    late = final(_updates(made, NOISY, shuffled))
    _same(final(_updates(made, NOISY, measurements)), late, "measurements that arrive late change the answer")


@_promise("small-error", "Without noise the error is small.")
def _small_error(made: Kind) -> None:
    for update in _updates(made, NOISELESS):
        off = _apart(update.estimate.pose, NOISELESS.pose(update.estimate.time_ns), heading=False)
        _require(
            update.estimate.time_ns < SETTLED_NS or (update.estimate.valid and off < NEAR_M),
            f"{_at(update)} the error is {off:.3f} m" + ("" if update.estimate.valid else ", and it is not valid"),
        )


@_promise("world-turns", "Turn and move the world, and the answer turns and moves with it.")
def _world_turns(made: Kind) -> None:
    moved = replace(NOISY, map_from_room=Pose(3.0, -7.0, 0.5 * math.pi))
    with_heading = Tag.NO_HEADING not in made.tags
    chance = Tag.STOCHASTIC in made.tags
    for one, other in zip(_updates(made, NOISY), _updates(made, moved), strict=True):
        expected = moved.map_from_room.compose(one.estimate.pose)
        off = _apart(other.estimate.pose, expected, heading=with_heading)
        _require(
            off < (NEAR_RAD if chance else EXACT_M) or not one.estimate.valid,
            f"{_at(one)} the pose should turn to {_brief(one.estimate._replace(pose=expected))}, "
            f"it is {_brief(other.estimate)}, off by {off:.3g}",
        )


@_promise("names-mean-nothing", "Anchors may have any names.", unless=[Tag.STOCHASTIC])
def _names_mean_nothing(made: Kind) -> None:
    renamed = replace(NOISY, anchor_names=("z", "m", "k", "b"))
    for one, other in zip(_updates(made, NOISY), _updates(made, renamed), strict=True):
        off = _apart(one.estimate.pose, other.estimate.pose)
        _require(off < EXACT_M, f"{_at(one)} renamed anchors move the pose by {off:.3g}")


@_promise("outlier-is-bounded", "One absurd reading moves the answer boundedly.", unless=[Tag.NOT_ROBUST, Tag.NO_RADIO])
def _outlier_is_bounded(made: Kind) -> None:
    honest, measurements = _updates(made, NOISELESS), NOISELESS.measurements()
    for range_m in (50.0, 1e6):
        for one, other in zip(honest, _updates(made, NOISELESS, with_outlier(measurements, 20, range_m)), strict=True):
            off = _apart(one.estimate.pose, other.estimate.pose, heading=False)
            _require(off < 2.0 * NEAR_M, f"one range of {range_m:g} m moves the pose by {off:.3g} m {_at(one)}")


@_promise("forward-is-forward", "Driving forward goes forward, by the distance driven.", unless=[Tag.NO_HEADING])
def _forward_is_forward(made: Kind) -> None:
    straight = Drive(8.0, turn_rate_rad_s=0.0, start=Pose(2.0, 2.0, 0.6), radio_until_s=0.0)
    last = _updates(made, straight)[-1].estimate
    back = straight.pose(0).inverse().compose(last.pose)
    _require(math.hypot(back.x - 4.0, back.y) < 0.2, f"after 4 m straight on, it says ({back.x:.3f}, {back.y:.3f}) m")


@_promise("silence-is-told", "Minutes without radio stay finite, and uncertainty grows.", unless=[Tag.NO_COVARIANCE])
def _silence_is_told(made: Kind) -> None:
    quiet = Drive(130.0, odometry_hz=2, radio_until_s=10.0)
    updates = _updates(made, quiet)
    before = next(update.estimate for update in updates if update.estimate.time_ns >= nanoseconds(10.0))
    last = updates[-1].estimate
    if last.valid and before.covariance and last.covariance:
        spreads = [one.xx + one.yy for one in (before.covariance, last.covariance)]
        _require(
            math.isfinite(spreads[1]) and spreads[1] > spreads[0],
            f"position variance was {spreads[0]:.6g} m² at 10 s, and is {spreads[1]:.6g} after 120 s of silence",
        )
    _require(not last.valid or all(map(math.isfinite, last.pose)), f"after 120 s of silence the pose is {last.pose}")


@_promise("rate-means-nothing", "One motion told at 10 or 50 Hz gives one answer.")
def _rate_means_nothing(made: Kind) -> None:
    slow, fast = (_updates(made, replace(NOISY, odometry_hz=rate))[-1].estimate for rate in (10, 50))
    off = _apart(slow.pose, fast.pose)
    _require(off < 0.01, f"odometry at 50 Hz instead of 10 moves the pose by {off:.3g}")
    # The variance of n samples strays by sqrt(2 / n) of itself, so chance is given more room.
    tolerance = 0.25 if Tag.STOCHASTIC in made.tags else 0.05
    if slow.covariance is not None and fast.covariance is not None:
        for name in ("xx", "yy", "hh"):
            one, other = getattr(slow.covariance, name), getattr(fast.covariance, name)
            _require(
                math.isclose(one, other, rel_tol=tolerance),
                f"variance {name} is {one:.6g} with odometry at 10 Hz, {other:.6g} at 50 Hz",
            )


@_promise("closing-changes-little", "A stretch of motion may be closed early: what follows is the same.")
def _closing_changes_little(made: Kind) -> None:
    ends = []
    for longest in (LONGEST, SHORT):
        for estimator, state, epoch in _states(made, NOISY, longest):
            if epoch.scan is None:
                _, fates = estimator.step(state, epoch.motion, None)
                _require(not fates, f"a stretch without radio was closed, and its step reports {len(fates)} fates")
        ends.append(estimator.estimate(state, epoch.motion, epoch.time_ns))
    off = _apart(ends[0].pose, ends[1].pose)
    chance = Tag.STOCHASTIC in made.tags
    _require(off < (NEAR_RAD if chance else NEAR_CLOSED), f"stretches closed early move the pose by {off:.3g}")
    for name in ("xx", "yy", "hh"):
        one, other = (getattr(end.covariance, name, 1.0) for end in ends)
        _require(
            math.isclose(one, other, rel_tol=0.25 if chance else 0.05),
            f"variance {name} is {one:.6g}, and {other:.6g} where stretches are closed early",
        )


@_promise("unknown-heading", "An unknown heading is not called known before it is.", unless=[Tag.NO_HEADING])
def _unknown_heading(made: Kind) -> None:
    # The pose of such a prior says nothing; a wrong heading shows who believes it.
    drive = replace(NOISELESS, start=Pose(5.0, 2.0, 0.8))
    start = drive.prior()
    lying = replace(start, heading_known=False, pose=start.pose._replace(heading=-2.0))
    updates = _updates(made, drive, prior=lying)
    _require(not updates[0].estimate.heading_known, "the start heading is unknown, yet reported known at once")
    for update in updates:
        estimate = update.estimate
        off = abs(wrap_angle(estimate.pose.heading - drive.pose(estimate.time_ns).heading))
        _require(
            not estimate.heading_known or off < 1.0, f"{_at(update)} the heading is called known, off by {off:.3f} rad"
        )
    resolves = Tag.HEADING_START in made.tags
    _require(
        updates[-1].estimate.heading_known or not resolves,
        "it is tagged heading_start, yet the heading is not known after 20 s of clean data",
    )


@_promise("global-start", "Who claims to start anywhere finds the robot.", needs=[Tag.GLOBAL_START])
def _global_start(made: Kind) -> None:
    unknown = replace(NOISELESS.prior(), position_known=False)
    last = _updates(made, NOISELESS, prior=replace(unknown, pose=Pose(-1.0, 9.0, 0.0)))[-1].estimate
    off = _apart(last.pose, NOISELESS.pose(last.time_ns), heading=False)
    _require(last.valid and off < NEAR_M, f"from an unknown position, the error after 20 s is {off:.3f} m")


@_promise("particles", "Particles are the belief itself, and showing them changes nothing.", offers=ParticleEstimator)
def _particles(made: Kind) -> None:
    world = NOISY.world()
    estimator = made(world)
    tracker, asked = Tracker(estimator, world, NOISY.prior(), seed=SEED), list[Update]()
    for measurement in NOISY.measurements():
        asked += tracker.push(measurement)
        shown = tracker.particles()
        if shown is not None and asked[-1].epochs:
            _be_the_belief(shown, asked[-1])
    _same(_updates(made, NOISY), asked, "showing the particles changed the answer")


def _be_the_belief(shown: Particles, update: Update) -> None:
    """Points with weights that sum to one, about the estimate."""
    positions, weights = shown
    _require(
        weights.ndim == 1 and len(weights) > 0 and positions.shape == (len(weights), 2),
        f"{_at(update)} positions have shape {positions.shape}, weights {weights.shape}; (n, 2) and (n,) are asked for",
    )
    _require(np.isfinite(positions).all(), f"{_at(update)} a particle's position is not finite")
    _require(
        (weights >= 0.0).all() and math.isclose(weights.sum(), 1.0, rel_tol=1e-6),
        f"{_at(update)} the weights are {weights.min():.6g} to {weights.max():.6g}, and sum to {weights.sum():.9g}",
    )
    mean, here = weights @ positions, update.estimate.pose[:2]
    spread = math.sqrt(float(weights @ np.square(positions - mean).sum(axis=1)))
    off = math.dist(mean, here)
    _require(
        off < NEAR_SHARE * spread + EXACT_M or not update.estimate.valid,
        f"{_at(update)} the particles' mean is {off:.3g} m from the estimate, and they spread over {spread:.3g} m",
    )
