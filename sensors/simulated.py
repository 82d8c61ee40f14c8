"""A simulated robot on a virtual clock: the same messages a real one would send, and where it really was.

Every source of chance has its own random stream, spawned from the seed by name, so that a change to one sensor leaves
the noise of all others as it was.
"""

from __future__ import annotations

import itertools
import math
import zlib
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fusion import (
    Anchor,
    Covariance,
    Gyro,
    Measurement,
    MotorCommand,
    Pose,
    Prior,
    RangeReading,
    Ranges,
    RssiReading,
    Truth,
    WheelTicks,
    WifiScan,
    wrap_angle,
)
from fusion.values import nanoseconds
from fusion.world import DRIVES
from sensors.scenario import STEP_S, Scenario

SLIP_STEPS = 50
ARRIVED_M = 0.02
WAVES = 48
"""Cosine waves that make up one anchor's shadowing field (spectral representation of a Gaussian field)."""


class Moment(NamedTuple):
    """The robot's true motion in one step: pose at its end, speed [m/s] and turn rate [rad/s] during it."""

    time_ns: int
    pose: Pose
    speed: float
    turn_rate: float


def drive(scenario: Scenario) -> Iterator[Moment]:
    """True motion along the route: turn on the spot towards the next way-point, drive there, pause."""
    route = scenario.route
    places = list(route.waypoints_m) * route.laps
    (x, y), (next_x, next_y) = places[0], places[1]
    pose, step = Pose(x, y, math.atan2(next_y - y, next_x - x)), 0
    for target in places[1:]:
        for speed, rate in _leg(pose, target, scenario):
            middle = pose.heading + 0.5 * rate * STEP_S
            ahead = speed * STEP_S
            pose = Pose(
                pose.x + ahead * math.cos(middle),
                pose.y + ahead * math.sin(middle),
                wrap_angle(pose.heading + rate * STEP_S),
            )
            step += 1
            yield Moment(nanoseconds(step * STEP_S), pose, speed, rate)


def _leg(pose: Pose, target: tuple[float, float], scenario: Scenario) -> Iterator[tuple[float, float]]:
    """Speed and turn rate, step by step, from ``pose`` to ``target``; both legs take a whole number of steps."""
    route = scenario.route
    away = math.hypot(target[0] - pose.x, target[1] - pose.y)
    if away > ARRIVED_M:
        turn = wrap_angle(math.atan2(target[1] - pose.y, target[0] - pose.x) - pose.heading)
        turning = math.ceil(abs(turn) / (route.turn_rate_rad_s * STEP_S))
        yield from ((0.0, turn / (turning * STEP_S)) for _ in range(turning))
        rolling = math.ceil(away / (route.speed_m_s * STEP_S))
        yield from ((away / (rolling * STEP_S), 0.0) for _ in range(rolling))
    yield from ((0.0, 0.0) for _ in range(round(route.pause_s / STEP_S)))


class SimulatedRobot:
    """All sensors of one robot in one scenario; a fresh object for every run, since its random streams go on."""

    def __init__(self, scenario: Scenario, seed: int = 0) -> None:
        self.scenario = scenario
        self._seed = seed
        reality = scenario.reality
        calibration = self._stream("calibration")
        self._roll_scale = 1.0 + calibration.normal(0.0, reality.distance_scale_std)
        self._track_scale = 1.0 + calibration.normal(0.0, reality.track_scale_std)
        told = scenario.world.robot.gyro_bias_rad_s
        self._gyro_bias = told + calibration.normal(0.0, reality.gyro_bias_std_rad_s)
        self._radios = {
            anchor.id: _Radio(anchor, self._stream(f"radio {anchor.id}"), scenario) for anchor in scenario.world.anchors
        }
        self._ranged = itertools.cycle(sorted(self._radios))
        self._streams = {name: self._stream(name) for name in ("slip", "gyro", "wifi", "ranges")}

    def _stream(self, name: str) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence(self._seed, spawn_key=(zlib.crc32(name.encode()),)))

    def prior(self) -> Prior:
        """The start as a person would measure it: off by what its covariance says."""
        reality, first = self.scenario.reality, next(drive(self.scenario))
        place, heading = reality.start_std_m, reality.start_heading_std_rad
        off = self._stream("start").normal(0.0, 1.0, 3) * (place, place, heading)
        x, y = self.scenario.route.waypoints_m[0]
        pose = Pose(x + float(off[0]), y + float(off[1]), wrap_angle(first.pose.heading + float(off[2])))
        return Prior(0, pose, Covariance.from_std(place, place, heading))

    def run(self) -> Iterator[Measurement | Truth]:
        """Every message of the run and the truth, in time order."""
        reality, periods = self.scenario.reality, self._periods()
        single_channel = self.scenario.world.robot.encoder == "single_channel"
        rolled, slip, command = np.zeros(2), np.zeros(2), (0.0, 0.0)
        for step, moment in enumerate(drive(self.scenario)):
            if step % SLIP_STEPS == 0:
                slip = self._streams["slip"].normal(0.0, reality.slip_std, 2)
            turned = self._roll(moment, slip)
            # One channel counts edges and cannot see their direction: only the command to the motors tells it.
            rolled += np.abs(turned) if single_channel else turned
            if single_channel and command != (moment.speed, moment.turn_rate):
                command = (moment.speed, moment.turn_rate)
                yield self._command(step, moment)
            due = {name for name, period in periods.items() if (step + 1) % period == 0}
            yield from self._messages(due, step, moment, rolled)

    def _periods(self) -> dict[str, int]:
        """Steps from one message of a sensor to its next, for all that are on."""
        reality = self.scenario.reality
        rates = {
            "ticks": reality.ticks_hz if DRIVES[self.scenario.world.robot.drive] else 0.0,
            "gyro": reality.gyro_hz,
            "wifi": reality.wifi_hz,
            "ranges": reality.range_hz if self._radios else 0.0,
            "truth": reality.truth_hz,
        }
        return {name: round(1.0 / (hz * STEP_S)) for name, hz in rates.items() if hz > 0.0}

    def _command(self, step: int, moment: Moment) -> MotorCommand:
        """What the controller asks of the motors as the step begins: it knows the nominal track only."""
        robot = self.scenario.world.robot
        sideways = 0.5 * robot.track_width_m * moment.turn_rate
        sides = (moment.speed - sideways, moment.speed + sideways)
        return MotorCommand(moment.time_ns - nanoseconds(STEP_S), "motors", step, sides * (DRIVES[robot.drive] // 2))

    def _roll(self, moment: Moment, slip: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far the left and right wheels roll in one step [m], (2,); slipping, further than the robot goes."""
        robot = self.scenario.world.robot
        # The distance scale that the world tells corrects the path alone; its track width is the effective one already.
        ahead = moment.speed / robot.distance_scale
        sideways = 0.5 * robot.track_width_m * self._track_scale * moment.turn_rate
        sides = np.array([ahead - sideways, ahead + sideways])
        return sides * STEP_S * self._roll_scale * (1.0 + slip)

    def _messages(
        self, due: set[str], step: int, moment: Moment, rolled: NDArray[np.float64]
    ) -> Iterator[Measurement | Truth]:
        robot, time_ns, pose = self.scenario.world.robot, moment.time_ns, moment.pose
        if "gyro" in due:
            noise = self._streams["gyro"].normal(0.0, self.scenario.reality.gyro_noise_std_rad_s)
            yield Gyro(time_ns, "gyro", step, moment.turn_rate + self._gyro_bias + float(noise))
        if "ticks" in due:
            left, right = (math.floor(side / robot.distance_per_tick_m) for side in rolled)
            yield WheelTicks(time_ns, "encoders", step, (left, right) * (DRIVES[robot.drive] // 2))
        if "wifi" in due:
            heard = {name: radio.rssi_dbm(pose, self._streams["wifi"]) for name, radio in self._radios.items()}
            deaf = self.scenario.reality.deaf_below_dbm
            yield WifiScan(time_ns, "wifi", step, tuple(RssiReading(n, r) for n, r in heard.items() if r >= deaf))
        if "ranges" in due:
            name = next(self._ranged)
            away = self._radios[name].range_m(pose, self._streams["ranges"])
            yield Ranges(time_ns, "uwb", step, (RangeReading(name, away),))
        if "truth" in due:
            yield Truth(time_ns, pose.x, pose.y, pose.heading)


class _Radio:
    """One anchor as it really is: its own power, its own shadowing field, walls in the way."""

    def __init__(self, anchor: Anchor, stream: np.random.Generator, scenario: Scenario) -> None:
        self._anchor, self._scenario = anchor, scenario
        reality = scenario.reality
        self._offset_db = stream.normal(0.0, reality.anchor_offset_std_db)
        self._waves = stream.normal(0.0, 1.0 / reality.shadowing_length_m, (WAVES, 2))
        self._phases = stream.uniform(0.0, math.tau, WAVES)

    def rssi_dbm(self, pose: Pose, stream: np.random.Generator) -> float:
        """One reading, in whole dBm as receivers give it."""
        reality, (x, y, distance) = self._scenario.reality, self._antenna(pose)
        field = math.sqrt(2.0 / WAVES) * np.cos(self._waves @ (x, y) + self._phases).sum()
        shadowing_db = reality.shadowing_std_db * field + stream.normal(0.0, reality.fading_std_db)
        loss_db = reality.wall_loss_db * self._walls(x, y)
        return float(round(float(self._anchor.radio.expected(distance)) + self._offset_db + shadowing_db - loss_db))

    def range_m(self, pose: Pose, stream: np.random.Generator) -> float:
        """One range; through walls it reads too long."""
        reality, (x, y, distance) = self._scenario.reality, self._antenna(pose)
        noise, excess = stream.normal(0.0, reality.range_std_m), stream.exponential(reality.wall_excess_m)
        return float(self._anchor.ranging.expected(distance)) + noise + excess * min(self._walls(x, y), 3)

    def _antenna(self, pose: Pose) -> tuple[float, float, float]:
        """The robot's antenna on the floor plan [m], and its distance to the anchor [m]."""
        forward, left, up = self._scenario.world.robot.antenna_m
        x, y = pose.transform(forward, left)
        return x, y, math.dist((x, y, up), (self._anchor.x, self._anchor.y, self._anchor.z))

    def _walls(self, x: float, y: float) -> int:
        """Walls between the anchor and a place."""
        here, there = (x, y), (self._anchor.x, self._anchor.y)
        walls = self._scenario.world.walls
        return sum(_cross(here, there, a, b) for wall in walls for a, b in itertools.pairwise(wall))


Point = tuple[float, float]


def _cross(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Whether the segments a-b and c-d cross."""

    def side(p: Point, q: Point, r: Point) -> float:
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    return side(a, b, c) * side(a, b, d) < 0.0 and side(c, d, a) * side(c, d, b) < 0.0
