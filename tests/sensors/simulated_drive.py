"""Simulated drives whose true calibration is known: lines, spins and squares in both senses."""

from sensors.simulation.scenario import Scenario
from sensors.simulation.simulate import simulated_run

ANCHORS = [
    {"id": "a", "position_m": [0.0, 0.0, 2.0]},
    {"id": "b", "position_m": [12.0, 0.0, 2.0]},
    {"id": "c", "position_m": [6.0, 9.0, 2.0]},
]
LINES = [[0.0, 0.0], [3.0, 0.0], [0.0, 0.0], [0.0, 2.0], [0.0, 0.0], [2.5, 0.0], [0.0, 2.5], [0.0, 0.0]]
SQUARES = [[3.0, 0.0], [3.0, 3.0], [0.0, 3.0], [0.0, 0.0], [0.0, 3.0], [3.0, 3.0], [3.0, 0.0], [0.0, 0.0]]
QUIET = {
    "distance_scale_std": 0.0,
    "track_scale_std": 0.0,
    "anchor_offset_std_db": 0.0,
    "gyro_hz": 0.0,
    "wifi_hz": 0.0,
}


def simulated_drive(seed=0, *, waypoints=LINES + SQUARES, robot=None, laps=1, pause_s=1.0, **reality):
    """The run of a robot with wheels of known scale, without noise but for the numbers given in ``reality``."""
    table = {
        "world": {
            "anchors": ANCHORS,
            "robot": {"drive": "differential", "track_width_m": 0.3, "ticks_per_revolution": 200, **(robot or {})},
        },
        "route": {"waypoints_m": waypoints, "laps": laps, "pause_s": pause_s},
        "reality": {**QUIET, **reality},
    }
    return simulated_run(Scenario.from_table("drive", table), seed)
