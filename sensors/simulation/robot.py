"""A simulated robot on a virtual clock: the same messages a real one would send, and its true poses.

Every source of chance has its own random stream, spawned from the seed by name, so that a change to one sensor leaves
the noise of all others as it was.
"""

from __future__ import annotations

import itertools
import math
import zlib
from collections.abc import Collection, Iterator

import numpy as np
from numpy.typing import NDArray

from fusion import (
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
from fusion.robot import WHEELS
from fusion.values import nanoseconds
from sensors.simulation.channel import Channel
from sensors.simulation.route import Moment, drive
from sensors.simulation.scenario import STEP_S, Scenario

SLIP_STEPS = 50

Steps = NDArray[np.float64]
"""One row per step of the virtual clock."""


class SimulatedRobot:
    """All sensors of one robot in one scenario; a fresh object for every run, since its random streams go on."""

    def __init__(self, scenario: Scenario, seed: int = 0) -> None:
        self.scenario = scenario
        self._seed = seed
        reality = scenario.reality
        calibration = self._stream("calibration")
        self._roll_scale = 1.0 + reality.distance_scale_bias + calibration.normal(0.0, reality.distance_scale_std)
        self._track_scale = 1.0 + reality.track_scale_bias + calibration.normal(0.0, reality.track_scale_std)
        nominal = scenario.world.robot.gyro_bias_rad_s
        self._gyro_bias = nominal + calibration.normal(0.0, reality.gyro_bias_std_rad_s)
        self._channels = {
            anchor.id: Channel(anchor, self._stream(f"radio {anchor.id}"), scenario)
            for anchor in scenario.world.anchors
        }
        self._ranged = itertools.cycle(sorted(self._channels))
        self._streams = {name: self._stream(name) for name in ("slip", "gyro", "wifi", "ranges", "obstruction")}

    def _stream(self, name: str) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence(self._seed, spawn_key=(zlib.crc32(name.encode()),)))

    def prior(self) -> Prior:
        """The start as a person would measure it: off by an error drawn from its covariance."""
        reality, first = self.scenario.reality, drive(self.scenario.route)[0]
        place, heading = reality.start_std_m, reality.start_heading_std_rad
        off = self._stream("start").normal(0.0, 1.0, 3) * (place, place, heading)
        x, y = self.scenario.route.waypoints_m[0]
        pose = Pose(x + float(off[0]), y + float(off[1]), wrap_angle(first.pose.heading + float(off[2])))
        return Prior(0, pose, Covariance.from_std(place, place, heading))

    def run(self) -> Iterator[Measurement | Truth]:
        """Every message of the run and the truth, in time order."""
        moments = drive(self.scenario.route)
        rolled, turn_rates = self._roll(moments), self._turn_rates(moments)
        commanded = self._commanded(moments)
        due = self._due(moments)
        for step in sorted(commanded | due.keys()):
            if step in commanded:
                yield self._command(step, moments[step])
            yield from self._messages(due.get(step, ()), step, moments[step], rolled[step], turn_rates[step])

    def _due(self, moments: tuple[Moment, ...]) -> dict[int, list[str]]:
        """The sensors that speak at the end of a step."""
        due: dict[int, list[str]] = {}
        for name, period in self._periods().items():
            for step in range(period - 1, len(moments), period):
                due.setdefault(step, []).append(name)
        if self.scenario.reality.scans_at_stop:
            for step, moment in enumerate(moments):
                if moment.leaving:
                    due.setdefault(step, []).append("survey")
        return due

    def _periods(self) -> dict[str, int]:
        """Steps from one message of a sensor to its next, for all that are on."""
        reality = self.scenario.reality
        rates = {
            "ticks": reality.ticks_hz if WHEELS[self.scenario.world.robot.drive] else 0.0,
            "gyro": reality.gyro_hz,
            "wifi": reality.wifi_hz,
            "ranges": reality.range_hz if self._channels else 0.0,
            "truth": reality.truth_hz,
        }
        return {name: round(1.0 / (hz * STEP_S)) for name, hz in rates.items() if hz > 0.0}

    @property
    def _single_channel(self) -> bool:
        """One channel counts edges and cannot see their direction: only the command to the motors determines it."""
        return self.scenario.world.robot.encoder == "single_channel"

    def _commanded(self, moments: tuple[Moment, ...]) -> set[int]:
        """Steps that begin with a new command to the motors."""
        if not self._single_channel:
            return set()
        asked = [(0.0, 0.0), *((moment.speed, moment.turn_rate) for moment in moments)]
        return {step for step, (before, now) in enumerate(itertools.pairwise(asked)) if before != now}

    def _command(self, step: int, moment: Moment) -> MotorCommand:
        """Command of the controller to the motors as the step begins, by the nominal track."""
        robot = self.scenario.world.robot
        sideways = 0.5 * robot.track_width_m * moment.turn_rate
        sides = (moment.speed - sideways, moment.speed + sideways)
        axles = len(WHEELS[robot.drive]) // 2
        return MotorCommand(moment.time_ns - nanoseconds(STEP_S), "motors", step, sides * axles)

    def _roll(self, moments: tuple[Moment, ...]) -> Steps:
        """Counts of the left and right encoders by the end of each step [m], (n, 2).

        A slipping wheel rolls further than the robot goes.
        """
        robot = self.scenario.world.robot
        speed = np.array([moment.speed for moment in moments])
        turn_rate = np.array([moment.turn_rate for moment in moments])
        # The distance scale of the world corrects the path alone; its track width is the effective one already.
        ahead = speed / robot.distance_scale
        sideways = 0.5 * robot.track_width_m * self._track_scale * turn_rate
        blocks = -(-len(moments) // SLIP_STEPS)
        slip = self._streams["slip"].normal(0.0, self.scenario.reality.slip_std, (blocks, 2))
        slip = np.repeat(slip, SLIP_STEPS, axis=0)[: len(moments)]
        sides = np.stack([ahead - sideways, ahead + sideways], axis=1) / np.array(robot.side_scales)
        turned = sides * STEP_S * self._roll_scale * (1.0 + slip)
        return np.asarray(np.cumsum(np.abs(turned) if self._single_channel else turned, axis=0))

    def _turn_rates(self, moments: tuple[Moment, ...]) -> Steps:
        """The mean turn rate [rad/s] of the gyro period that ends with each step, (n,).

        A gyro samples far faster than it reports, and its low-pass filter keeps the turn in between.
        """
        period = self._periods().get("gyro", 1)
        turned = np.cumsum([moment.turn_rate for moment in moments])
        before = np.concatenate([np.zeros(period), turned])[: len(moments)]
        return np.asarray((turned - before) / period)

    def _messages(
        self, due: Collection[str], step: int, moment: Moment, rolled: Steps, turn_rate: float
    ) -> Iterator[Measurement | Truth]:
        robot, time_ns, pose = self.scenario.world.robot, moment.time_ns, moment.pose
        if "ticks" in due:
            left, right = (math.floor(side / robot.distance_per_tick_m) for side in rolled)
            yield WheelTicks(time_ns, "encoders", step, (left, right) * (len(WHEELS[robot.drive]) // 2))
        if "gyro" in due:
            noise = self._streams["gyro"].normal(0.0, self.scenario.reality.gyro_noise_std_rad_s)
            yield Gyro(time_ns, "gyro", step, float(turn_rate / robot.gyro_scale + self._gyro_bias + noise))
        if "wifi" in due:
            yield self._scan(step, moment, 1)
        if "ranges" in due:
            name = next(self._ranged)
            away = self._channels[name].range_m(pose, self._streams["ranges"])
            yield Ranges(time_ns, "uwb", step, (RangeReading(name, away),))
        if "survey" in due:
            yield self._scan(step, moment, self.scenario.reality.scans_at_stop)
        if "truth" in due or "survey" in due:
            yield Truth(time_ns, pose.x, pose.y, pose.heading)

    def _scan(self, step: int, moment: Moment, count: int) -> WifiScan:
        """The mean of ``count`` scans in a row, without the anchors that are too weak on average."""
        stream, deaf = self._streams["wifi"], self.scenario.reality.deaf_below_dbm
        strengths = {
            name: channel.rssi_dbm(moment.pose, stream, count) - self._obstruction_db()
            for name, channel in self._channels.items()
        }
        readings = tuple(RssiReading(name, rssi) for name, rssi in strengths.items() if rssi >= deaf)
        return WifiScan(moment.time_ns, "wifi", step, readings)

    def _obstruction_db(self) -> float:
        """Loss by people and things in the way of one link, for one scan or one stop [dB]."""
        reality, stream = self.scenario.reality, self._streams["obstruction"]
        obstructed, loss_db = (
            stream.random() < reality.obstruction_share,
            stream.exponential(reality.obstruction_mean_db),
        )
        return float(loss_db) if obstructed else 0.0
