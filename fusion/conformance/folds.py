"""An estimator folded over synthetic runs, through the same host as real runs, and comparisons of its answers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from fusion.certificate import digest
from fusion.conformance.promise import require
from fusion.conformance.synthetic_run import SyntheticRun
from fusion.epochs import LONGEST, Epoch, Longest
from fusion.estimator import Estimator
from fusion.fold import Update
from fusion.geometry import Pose, wrap_angle
from fusion.motion import Increment
from fusion.timeline import Timeline
from fusion.tracker import track
from fusion.values import Estimate, Gyro, Measurement, Prior, seconds

SEED = 1
EXACT_M = 1e-6
"""Poses that differ by rounding alone are closer than this [m, rad]."""
NEAR_M = 0.5
"""Error [m] that no estimator of noiseless data may pass once it has settled."""
NEAR_RAD = 0.3
"""The same for a heading [rad]."""
NOISY = SyntheticRun(noisy=True, duration_s=12.0)
NOISELESS = SyntheticRun()


def updates_of(
    made: type[Any],
    run: SyntheticRun,
    measurements: Sequence[Measurement] | None = None,
    prior: Prior | None = None,
    seed: int = SEED,
) -> list[Update]:
    """The whole fold over a run; its own measurements and prior unless others are given."""
    world = run.world()
    given = run.measurements() if measurements is None else measurements
    return list(track(made(world), world, given, prior or run.prior(), seed=seed))


def states_of(
    made: type[Any], run: SyntheticRun, longest: Longest = LONGEST
) -> Iterator[tuple[Estimator[Any], Any, Epoch]]:
    """The bare fold, every state with the epoch that comes next."""
    estimator = made(run.world())
    state = estimator.start(run.prior(), SEED)
    for epoch in _epochs(run, longest):
        yield estimator, state, epoch
        state, _ = estimator.step(state, epoch.motion, epoch.scan)


def _epochs(run: SyntheticRun, longest: Longest) -> Iterator[Epoch]:
    """The epochs of a run, whose measurements are in order."""
    timeline = Timeline(run.world(), run.prior().time_ns, longest=longest)
    for measurement in run.measurements():
        for moment in timeline.push(measurement):
            yield from moment.epochs


def stepped(estimator: Estimator[Any], state: Any, epoch: Epoch) -> Update:  # noqa: ANN401 - a state is opaque
    """One step of the bare fold, and the belief right after it."""
    after, fates = estimator.step(state, epoch.motion, epoch.scan)
    still = Increment(time_ns=epoch.time_ns)
    gyro = Gyro(epoch.time_ns, "", 0, 0.0)
    return Update(epoch.scan or gyro, estimator.estimate(after, still, epoch.time_ns), fates, epochs=(epoch,))


def require_same(one: Sequence[Update], other: Sequence[Update], meaning: str) -> None:
    """Raises `ConformanceError` at the first update whose bytes differ; ``meaning`` begins its sentence."""
    for first, second in zip(one, other, strict=True):
        measurement = first.measurement
        require(
            digest([first]) == digest([second]),
            f"{meaning}: at {type(measurement).__name__} {measurement.sensor!r} {measurement.seq}, "
            f"{seconds(measurement.time_ns)} s, first {brief(first.estimate)}, then {brief(second.estimate)}, "
            "or their fates differ",
        )


def brief(estimate: Estimate) -> str:
    """The pose of an estimate in a counter-example."""
    return f"({', '.join(f'{number:.9g}' for number in estimate.pose)})"


def at(update: Update) -> str:
    """The time of an update in a counter-example."""
    return f"at {seconds(update.estimate.time_ns)} s"


def distance(one: Pose, other: Pose, *, heading: bool = True) -> float:
    """The larger of the distance [m] and, unless left out, the difference of the headings [rad] of two poses."""
    turned = abs(wrap_angle(one.heading - other.heading)) if heading else 0.0
    return max(math.hypot(one.x - other.x, one.y - other.y), turned)
