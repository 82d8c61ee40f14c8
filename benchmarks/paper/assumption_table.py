"""Every assumption by name: those of the paper, those chosen by hand, those calibrated."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

from benchmarks.paper.experiment import Outcome
from benchmarks.paper.interpretations import literal
from fusion.output.tables import Table
from sensors.simulation.scenario import Scenario

PAPER, CHOSEN, CALIBRATED, READ = "paper", "chosen", "calibrated", "open, read so"

Row = tuple[str, str, Callable[[Scenario], str]]


def _floor(scenario: Scenario) -> str:
    bounds = scenario.world.bounds
    return f"{bounds.x_max - bounds.x_min:g} × {bounds.y_max - bounds.y_min:g}"


def _path(scenario: Scenario) -> str:
    return f"{sum(math.dist(a, b) for a, b in pairwise(scenario.route.waypoints_m)):.1f}"


def _anchors(scenario: Scenario) -> str:
    return ", ".join(f"({anchor.x:g}, {anchor.y:g})" for anchor in scenario.world.anchors)


def _speeds(scenario: Scenario) -> str:
    return f"{scenario.route.speed_m_s:g}, {scenario.route.turn_rate_rad_s:g}"


def _start(scenario: Scenario) -> str:
    return f"{100.0 * scenario.reality.start_std_m:g}, {scenario.reality.start_heading_std_rad:g}"


ROWS: tuple[Row, ...] = (
    ("path-loss exponent n", PAPER, lambda s: f"{s.world.anchors[0].radio.path_loss_exponent:g}"),
    ("trial points", PAPER, lambda s: f"{len(s.route.waypoints_m) - 1}"),
    ("one tick, cm (20 per revolution)", PAPER, lambda s: f"{100.0 * s.world.robot.distance_per_tick_m:.2f}"),
    ("drive, four wheels in pairs", PAPER, lambda s: s.world.robot.drive.replace("_", " ")),
    ("floor, m", CHOSEN, _floor),
    ("access points, m from the floor's corner, the origin", CHOSEN, _anchors),
    ("length of the path, m", CHOSEN, _path),
    ("speed, m/s, and turn on the spot, rad/s", CHOSEN, _speeds),
    ("effective track, m", CHOSEN, lambda s: f"{s.world.robot.track_width_m:g}"),
    ("direction of the wheels is known", CHOSEN, lambda s: "yes" if s.world.robot.encoder == "quadrature" else "no"),
    ("start: place known to, cm, and heading to, rad", CHOSEN, _start),
    ("distance counted too long, %", CALIBRATED, lambda s: f"{100.0 * s.reality.distance_scale_bias:.2f}"),
    ("track wider than stated, %", CALIBRATED, lambda s: f"{100.0 * s.reality.track_scale_bias:.2f}"),
    ("wheel slip each half second, σ, %", CALIBRATED, lambda s: f"{100.0 * s.reality.slip_std:.2f}"),
    ("shadowing χ, σ, dB", CALIBRATED, lambda s: f"{s.reality.shadowing_std_db:.2f}"),
    ("shadowing is alike over, m", CHOSEN, lambda s: f"{s.reality.shadowing_length_m:g}"),
    ("fading of one scan, σ, dB; readings in whole dBm", CHOSEN, lambda s: f"{s.reality.fading_std_db:g}"),
    ("scans averaged at a stop", CHOSEN, lambda s: f"{s.reality.scans_at_stop}"),
    ("loss through a wall, dB", CHOSEN, lambda s: f"{s.reality.wall_loss_db:g}"),
    ("gyro (where used): bias left, σ, rad/s", CHOSEN, lambda s: f"{s.reality.gyro_bias_std_rad_s:g}"),
    ("gyro (where used): noise at 10 Hz, σ, rad/s", CHOSEN, lambda s: f"{s.reality.gyro_noise_std_rad_s:g}"),
    ("outlier threshold ξ", PAPER, lambda _: "10 %"),
    ("weights at the start", PAPER, lambda _: "0.5, 0.5"),
)


def assumptions(outcomes: Sequence[Outcome]) -> Table:
    """One row per assumption, one column per environment."""
    rows = [(name, source, *(value(outcome.scenario) for outcome in outcomes)) for name, source, value in ROWS]
    rows += [(name, READ, *([str(value)] * len(outcomes))) for name, value in literal().options.items()]
    head = ("assumption", "from", *(outcome.environment.short for outcome in outcomes))
    return Table("Every assumption", head, tuple(rows), prose=True)
