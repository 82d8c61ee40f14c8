"""True motion of the simulated robot along its route, on a virtual clock."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

from fusion import Pose, wrap_angle
from fusion.values import nanoseconds
from sensors.simulation.scenario import STEP_S, Route

ARRIVED_M = 0.02


class Moment(NamedTuple):
    """The robot's true motion in one step: pose at its end, speed [m/s] and turn rate [rad/s] during it.

    ``leaving``: its pause at a way-point, if any, ends with this step.
    """

    time_ns: int
    pose: Pose
    speed: float
    turn_rate: float
    leaving: bool


@lru_cache(maxsize=8)
def drive(route: Route) -> tuple[Moment, ...]:
    """True motion along the route: turn on the spot towards the next way-point, drive there, pause."""
    return tuple(_moments(route))


def _moments(route: Route) -> Iterator[Moment]:
    places = list(route.waypoints_m) * route.laps
    (x, y), (next_x, next_y) = places[0], places[1]
    pose, step = Pose(x, y, math.atan2(next_y - y, next_x - x)), 0
    for target in places[1:]:
        leg = list(_leg(pose, target, route))
        for left, (speed, rate) in zip(range(len(leg) - 1, -1, -1), leg, strict=True):
            middle = pose.heading + 0.5 * rate * STEP_S
            ahead = speed * STEP_S
            pose = Pose(
                pose.x + ahead * math.cos(middle),
                pose.y + ahead * math.sin(middle),
                wrap_angle(pose.heading + rate * STEP_S),
            )
            step += 1
            yield Moment(nanoseconds(step * STEP_S), pose, speed, rate, leaving=left == 0)


def _leg(pose: Pose, target: tuple[float, float], route: Route) -> Iterator[tuple[float, float]]:
    """Speed and turn rate, step by step, from ``pose`` to ``target``; both legs take a whole number of steps."""
    away = math.hypot(target[0] - pose.x, target[1] - pose.y)
    if away > ARRIVED_M:
        turn = wrap_angle(math.atan2(target[1] - pose.y, target[0] - pose.x) - pose.heading)
        turning = math.ceil(abs(turn) / (route.turn_rate_rad_s * STEP_S))
        yield from ((0.0, turn / (turning * STEP_S)) for _ in range(turning))
        rolling = math.ceil(away / (route.speed_m_s * STEP_S))
        yield from ((away / (rolling * STEP_S), 0.0) for _ in range(rolling))
    yield from ((0.0, 0.0) for _ in range(round(route.pause_s / STEP_S)))
