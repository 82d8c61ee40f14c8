"""Assumptions where the paper gives none: the way the experiments are run, and other ways that would do as well.

Two numbers of every filling are calibrated (`benchmarks.paper.fit_environments`): how strongly wheels err, as a factor
on a fixed mixture of errors, and how strongly Wi-Fi does, in dB. The rest is chosen by hand and named here. A verdict
that changes from one filling to another is a verdict about the filling.
"""

from __future__ import annotations

import copy
import math
from typing import Any, NamedTuple

import numpy as np

DISTANCE_BIAS, TRACK_BIAS, SLIP_STD = 0.01, 0.04, 0.004
"""Odometry errors at a factor of 1. On even floors systematic errors rule, above all that of the track (Borenstein &
Feng 1996); one robot keeps them from run to run."""
RANDOM_SLIP_STD = 0.02
"""The same where wheels only slip."""
OBSTRUCTED_SHARE = 0.15
"""Share of links that are obstructed where obstructions rule."""
MANY_SCANS = 200
"""A stop, where the fading that 20 scans leave (0.23 dB) is too much: for fixes to be accurate between outliers, or for
the Wi-Fi errors of the paper on a floor twice as large."""

Table = dict[str, Any]


class Filling(NamedTuple):
    """One way to fill in what the paper leaves open."""

    key: str
    title: str
    floor_factor: float = 1.0
    """Every length of floor, anchors and route is multiplied by it."""
    systematic: bool = True
    """Wheels err the same way in every run, or at random."""
    obstructed: bool = False
    """Wi-Fi errs where something stands in the way, or everywhere, by shadowing."""
    shadowing_length_m: float | None = None
    """None: as in the scenario."""
    scans_at_stop: int | None = None

    @property
    def drives_like_main(self) -> bool:
        """True where odometry is that of the main filling, so that its calibration holds."""
        return self.floor_factor == 1.0 and self.systematic

    @property
    def receives_like_main(self) -> bool:
        """The same for Wi-Fi."""
        return self._replace(key=MAIN.key, title=MAIN.title, systematic=True) == MAIN


MAIN = Filling("main", "as calibrated")
PREMISE = Filling("obstructions", "obstructions", obstructed=True, scans_at_stop=MANY_SCANS)
"""The premise of section III-A: fixes that are accurate but for outliers."""
ALTERNATIVES = (
    Filling("small_floor", "half the floor", floor_factor=0.5),
    Filling("large_floor", "twice the floor", floor_factor=2.0, scans_at_stop=MANY_SCANS),
    Filling("random_wheels", "random wheels", systematic=False),
    Filling("smooth_shadowing", "smooth shadowing", shadowing_length_m=5.0),
    PREMISE,
)


def filled(table: Table, filling: Filling, odometry_factor: float, wifi_db: float) -> Table:
    """The scenario with these errors in its reality, and with a world that states how large they are.

    ``wifi_db`` is the standard deviation of shadowing, or the mean loss behind an obstruction.
    """
    changed = _scaled(table, filling.floor_factor)
    reality, world = changed["reality"], changed["world"]
    reality["distance_scale_bias"] = short(DISTANCE_BIAS * odometry_factor) if filling.systematic else 0.0
    reality["track_scale_bias"] = short(TRACK_BIAS * odometry_factor) if filling.systematic else 0.0
    reality["slip_std"] = short((SLIP_STD if filling.systematic else RANDOM_SLIP_STD) * odometry_factor)
    for key in ("shadowing_length_m", "scans_at_stop"):
        if (value := getattr(filling, key)) is not None:
            reality[key] = value
    reality["shadowing_std_db"] = 0.0 if filling.obstructed else wifi_db
    if filling.obstructed:
        reality |= {"obstruction_share": OBSTRUCTED_SHARE, "obstruction_mean_db": wifi_db}
    world["radio"]["shadowing_std_db"] = short(_rssi_std_db(reality))
    world["robot"]["noise"] = {key: short(value) for key, value in _odometry_noise(changed).items()}
    return changed


def short(value: float) -> float:
    """Four digits are more than calibration can resolve."""
    return float(f"{value:.4g}")


def _scaled(table: Table, factor: float) -> Table:
    changed = copy.deepcopy(table)
    world, route = changed["world"], changed["route"]
    for anchor in world["anchors"]:
        anchor["position_m"] = [factor * value for value in anchor["position_m"]]
    world["bounds"] = {key: factor * value for key, value in world["bounds"].items()}
    world["walls"] = [[[factor * value for value in corner] for corner in wall] for wall in world["walls"]]
    route["waypoints_m"] = [[factor * value for value in place] for place in route["waypoints_m"]]
    return changed


def _rssi_std_db(reality: Table) -> float:
    """Of one stop's reading: shadowing, obstructions, fading and whole dBm averaged over the scans of the stop."""
    averaged = (reality["fading_std_db"] ** 2 + 1.0 / 12.0) / reality["scans_at_stop"]
    share, mean_db = reality.get("obstruction_share", 0.0), reality.get("obstruction_mean_db", 0.0)
    # An exponential loss that comes with a probability p: E[x^2] = 2 p m^2, E[x] = p m.
    obstructed = (2.0 * share - share**2) * mean_db**2
    return math.sqrt(reality["shadowing_std_db"] ** 2 + obstructed + averaged)


def _odometry_noise(table: Table) -> dict[str, float]:
    """The `OdometryNoise` of slipping wheels whose rounding to whole ticks comes anew on every leg."""
    reality, route, robot = table["reality"], table["route"], table["world"]["robot"]
    places = np.array(route["waypoints_m"])
    leg_m = float(np.hypot(*np.diff(places, axis=0).T).mean())
    slip, held_m = reality["slip_std"], 0.5 * route["speed_m_s"]
    tick_m = robot["wheel_circumference_m"] / robot["ticks_per_revolution"]
    return {
        "distance_std_per_sqrt_m": math.sqrt(slip**2 * held_m / 2.0 + tick_m**2 / (12.0 * leg_m)),
        "distance_std_per_sqrt_s": 0.0005,
        "turn_std_per_sqrt_rad": slip * math.sqrt(0.25 * route["turn_rate_rad_s"]),
        "turn_std_per_sqrt_m": math.sqrt(2.0 * slip**2 * held_m + tick_m**2 / (6.0 * leg_m)) / robot["track_width_m"],
        "turn_std_per_sqrt_s": 0.001,
        "distance_scale_std": reality["distance_scale_bias"],
        "turn_scale_std": reality["track_scale_bias"],
        "turn_bias_std_rad_s": 0.0,
    }
