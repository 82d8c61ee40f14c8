"""`fusion record` in the guest, real drivers on all its devices, while a simulated robot is driven in real time."""

from __future__ import annotations

import os
import signal
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from fusion import BootClock, Measurement, Truth
from fusion.values import seconds
from kernel.guest.radios import access_points, air_with_radios
from kernel.guest.recorder import Recorder
from kernel.guest.robot import Robot, SimulatedAir
from kernel.guest.runner import SHARE
from kernel.guest.system import set_link, wait_until
from sensors.simulation.robot import SimulatedRobot
from sensors.simulation.scenario import Scenario, load_scenario

ROBOT_FILE = Path(__file__).parents[1] / "robot.toml"
WAYPOINTS_M = ((1.0, 1.0), (4.0, 1.0), (4.0, 3.0), (1.0, 3.0), (1.0, 1.0))
SPEED_M_S, TURN_RAD_S = 0.2, 0.5
"""Slow enough for an emulated processor, which has to run the robot, its recorder and three access points."""
CLOCK = BootClock()
Place = tuple[int, float, float, float | None]
"""When [ns], x, y [m] and heading [rad]."""


def run(seed: int, killed_after_bytes: int) -> dict[str, Any]:
    """Where the robot really was, by the guest's clock, the ticks of its wheels, and how late its devices spoke [s].

    The share has two recordings: the whole drive, and one of the robot at rest whose recorder was killed.
    """
    whole, killed = (Recorder(ROBOT_FILE, SHARE / folder) for folder in ("whole", "killed"))
    os.setpriority(os.PRIO_PROCESS, 0, -20)  # the world does not wait until the robot's computer has time
    scenario = slow_drive(load_scenario("room"))
    script = list(SimulatedRobot(scenario, seed).run())
    air = SimulatedAir(scenario, seed)
    robot = Robot(air)
    with air_with_radios(air), access_points(air), robot.uwb():
        set_link("wlan0", "up")
        whole.begin()
        truth, late_s = drive(robot, script)
        ended = whole.end(signal.SIGTERM)
        killed.begin()
        wait_until(lambda: killed.size > killed_after_bytes, "a recording to kill")
        ends = [ended, killed.end(signal.SIGKILL)]
    return {"truth": truth, "late": late_s, "ticks": robot.counts, "ended": ends}


def slow_drive(scenario: Scenario) -> Scenario:
    """The same room, driven around at a walk, with fewer messages; Wi-Fi is the air's."""
    route = replace(scenario.route, waypoints_m=WAYPOINTS_M, speed_m_s=SPEED_M_S, turn_rate_rad_s=TURN_RAD_S)
    reality = replace(scenario.reality, ticks_hz=20.0, gyro_hz=10.0, range_hz=5.0, wifi_hz=0.0, truth_hz=10.0)
    return replace(scenario, route=route, reality=reality)


def drive(robot: Robot, script: Sequence[Measurement | Truth]) -> tuple[list[Place], dict[str, float]]:
    """Show everything when it falls due: where the robot was when, and by how much it was late."""
    truth: list[Place] = []
    late_s: list[float] = []
    start_ns = CLOCK.now_ns()
    for said in script:
        due_ns = start_ns + said.time_ns
        CLOCK.sleep(seconds(due_ns - CLOCK.now_ns()))
        robot.show(said)
        late_s.append(seconds(CLOCK.now_ns() - due_ns))
        if isinstance(said, Truth):
            truth.append((CLOCK.now_ns(), said.x, said.y, said.heading))
    return truth, {"mean": sum(late_s) / len(late_s), "most": max(late_s)}
