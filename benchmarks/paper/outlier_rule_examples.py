"""Two weaknesses of the published outlier rule, each by the smallest experiment that shows it. Nothing here is random.

Ranges are exact, so every fix is where the robot stands, or where it is supposed to stand.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import fusion
from benchmarks.paper.published import PROPOSED
from fusion import Covariance, Decision, Odometry, Pose, Prior, RangeReading, Ranges, Tracker, World
from fusion.values import NANOSECONDS

REPAIRED = "dynamic_weight_repaired"
ANCHORS_M = {"a": (0.0, 0.0), "b": (8.0, 0.0), "c": (1.0, 7.0)}
OFFSETS_M = (0.0, 1.0, 2.0, 5.0, 10.0)
STANDS_M, FIX_M = (2.0, 3.0), (2.5, 3.0)
SQUARE_M, LAPS, SLIPPING_LEG, SLIP_M = 3.0, 6, 3, 1.0
START = Pose(2.0, 2.0, 0.0)


class Moved(NamedTuple):
    """One and the same fix in one and the same room, its origin ``offset_m`` away along both axes."""

    offset_m: float
    odometry_x_m: float
    differs_percent: float
    is_outlier: bool
    answer_x_m: float
    """The answer, in the room's own coordinates."""


class Leg(NamedTuple):
    """Errors [m] at one corner, after its fix, and how many exact fixes in a row the published rule has refused."""

    trial: int
    proposed_m: float
    repaired_m: float
    refused_in_a_row: int


def origin_example() -> list[Moved]:
    """Odometry gives x = 2 m, the fix 2.5 m: an outlier, until the map's origin is moved."""
    moved = []
    for offset_m in OFFSETS_M:
        one = _Driven(PROPOSED, Pose(STANDS_M[0] + offset_m, STANDS_M[1] + offset_m, 0.0), offset_m)
        decision = one.fix(FIX_M[0] + offset_m, FIX_M[1] + offset_m)
        x = STANDS_M[0] + offset_m
        percent = 100.0 * (FIX_M[0] - STANDS_M[0]) / x
        moved.append(Moved(offset_m, x, percent, decision is Decision.REJECTED, one.pose.x - offset_m))
    return moved


def lock_out_example() -> list[Leg]:
    """A robot drives a square of 3 m, a fix at every corner. On one leg its wheels slip: they count 1 m too much.

    Before and after, odometry and fixes are exact.
    """
    driven, truth, refused, legs = (_Driven(PROPOSED, START), _Driven(REPAIRED, START)), START, 0, list[Leg]()
    for trial in range(1, 4 * LAPS + 1):
        truth = truth.compose(Pose(SQUARE_M, 0.0, 0.0))
        counted_m = SQUARE_M + (SLIP_M if trial == SLIPPING_LEG else 0.0)
        decision, _ = [one.corner(counted_m, truth) for one in driven]
        refused = refused + 1 if decision is Decision.REJECTED else 0
        errors = [math.dist(one.pose[:2], truth[:2]) for one in driven]
        legs.append(Leg(trial, errors[0], errors[1], refused))
        truth = truth.compose(Pose(0.0, 0.0, math.pi / 2.0))
        for one in driven:
            one.drive(0.0, math.pi / 2.0)
    return legs


class _Driven:
    """One estimator, fed one measurement a second."""

    def __init__(self, name: str, start: Pose, offset_m: float = 0.0) -> None:
        self._anchors = {key: (x + offset_m, y + offset_m) for key, (x, y) in ANCHORS_M.items()}
        rows = [{"id": key, "position_m": list(place)} for key, place in self._anchors.items()]
        world = World.from_table({"anchors": rows})
        prior = Prior(0, start, Covariance.from_std(0.01, 0.01, 0.01))
        self._tracker = Tracker(fusion.build(name, world), world, prior)
        self._seconds = 0

    @property
    def pose(self) -> Pose:
        return self._tracker.estimate(self._seconds * NANOSECONDS).pose

    def drive(self, distance_m: float, turn_rad: float) -> None:
        self._seconds += 1
        now_ns = self._seconds * NANOSECONDS
        self._tracker.push(Odometry(now_ns, "wheels", self._seconds, now_ns - NANOSECONDS, distance_m, turn_rad))

    def stand(self) -> None:
        self.drive(0.0, 0.0)

    def corner(self, counted_m: float, truth: Pose) -> Decision:
        self.drive(counted_m, 0.0)
        return self.fix(truth.x, truth.y)

    def fix(self, x: float, y: float) -> Decision:
        """Exact ranges from (x, y), after a second at rest."""
        self.stand()
        readings = tuple(RangeReading(key, math.dist((x, y), place)) for key, place in self._anchors.items())
        (update,) = self._tracker.push(Ranges(self._seconds * NANOSECONDS, "radio", self._seconds, readings))
        return update.fates[0].decision
