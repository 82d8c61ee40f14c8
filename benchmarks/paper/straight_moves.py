"""Straight moves of set lengths, as in the paper's Fig. 3: what the encoders count over what the robot drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fusion import Truth, WheelTicks
from fusion.arrays import Floats
from sensors.simulation.robot import SimulatedRobot
from sensors.simulation.scenario import Scenario

MOVES_M = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0)


def measured_moves(scenario: Scenario, seed: int) -> Floats:
    """The moves `MOVES_M`, driven one after another, as measured by the wheels of this robot, (moves,) [m]."""
    places = tuple((float(x), 0.0) for x in np.cumsum([0.0, *MOVES_M]))
    reality = replace(scenario.reality, gyro_hz=0.0)
    straight = replace(scenario, route=replace(scenario.route, waypoints_m=places), reality=reality)
    rolled_m, stops_m, per_tick_m = 0.0, [0.0], scenario.world.robot.distance_per_tick_m
    for message in SimulatedRobot(straight, seed).run():
        if isinstance(message, WheelTicks):
            rolled_m = float(np.mean(message.counts)) * per_tick_m
        elif isinstance(message, Truth):
            stops_m.append(rolled_m)
    return np.diff(stops_m)


def r_squared(measured_m: Floats) -> float:
    """Of the straight line through `MOVES_M` over ``measured_m``."""
    return float(np.corrcoef(MOVES_M, measured_m)[0, 1] ** 2)
