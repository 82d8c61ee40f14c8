"""Scenario of a simulated run: a TOML file with three parts that are kept strictly apart.

``[world]`` is given to the estimators (a world file, `docs/world.md`), ``[route]`` is where the robot is driven, and
``[reality]`` is hidden from them: shadowing, walls that absorb signal, slipping wheels, a gyro bias. ``[calibration]``
may describe the method behind the numbers; it is for people and reports. The built-in scenarios carry the paper's
path-loss exponents; their floor plans and anchor places are our own, since the paper's drawings are not published as
data.
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from fusion import World, WorldError
from fusion.errors import did_you_mean
from fusion.schema import check_keys, read_record

STEP_S = 0.01
"""Step of the virtual clock [s]: the periods of all sensors are whole numbers of it."""


@dataclass(frozen=True, slots=True)
class Route:
    """Way-points [m], driven one after another; the robot turns on the spot and pauses at each."""

    waypoints_m: tuple[tuple[float, float], ...]
    speed_m_s: float = 0.4
    turn_rate_rad_s: float = 0.9
    pause_s: float = 1.0
    laps: int = 1


@dataclass(frozen=True, slots=True)
class Reality:
    """Hidden from the estimators. Deviations are drawn once a run from the standard deviations given."""

    anchor_offset_std_db: float = 1.0
    shadowing_std_db: float = 2.0
    """Shadowing that belongs to the place [dB], correlated over ``shadowing_length_m``."""
    shadowing_length_m: float = 2.0
    fading_std_db: float = 1.5
    """Scan to scan [dB]."""
    wall_loss_db: float = 4.0
    obstruction_share: float = 0.0
    """Probability that something stands in the way of a link, drawn anew for every scan or stop, with an exponentially
    distributed loss of mean ``obstruction_mean_db``."""
    obstruction_mean_db: float = 6.0
    deaf_below_dbm: float = -92.0
    range_std_m: float = 0.1
    wall_excess_m: float = 0.3
    """Mean excess of a range through walls [m]."""
    distance_scale_bias: float = 0.0
    """Wheels that roll further than by the world, as a share, the same in every run."""
    track_scale_bias: float = 0.0
    """An effective track that is wider than in the world, as a share, the same in every run."""
    distance_scale_std: float = 0.02
    track_scale_std: float = 0.05
    slip_std: float = 0.006
    """Wheel roll that does not become motion, as a share, drawn anew each half second."""
    gyro_bias_std_rad_s: float = 0.002
    gyro_noise_std_rad_s: float = 0.01
    start_std_m: float = 0.05
    start_heading_std_rad: float = 0.03
    ticks_hz: float = 20.0
    """Rates: 0 turns the sensor off; a period is rounded to whole steps of the clock."""
    gyro_hz: float = 50.0
    wifi_hz: float = 2.0
    range_hz: float = 0.0
    truth_hz: float = 20.0
    scans_at_stop: int = 0
    """Scans averaged into one as the robot leaves a way-point, where its true pose is then surveyed; 0: neither."""


@dataclass(frozen=True, slots=True)
class Scenario:
    """One simulated experiment."""

    name: str
    world: World
    route: Route
    reality: Reality
    calibration: Mapping[str, object] = field(default_factory=dict, compare=False)

    @classmethod
    def from_table(cls, name: str, table: Mapping[str, Any]) -> Scenario:
        """A scenario from nested tables, as TOML gives them; raises `WorldError`."""
        check_keys(table, dict.fromkeys(("world", "route", "reality", "calibration")), f"scenario {name}")
        for part in ("world", "route"):
            if not isinstance(table.get(part), dict):
                raise WorldError(f"scenario {name}: it needs a table [{part}]; add it")
        calibration = table.get("calibration", {})
        if not isinstance(calibration, dict):
            raise WorldError(f"scenario {name}: calibration: expected a table, got {calibration!r}")
        route = read_record(Route, table["route"], f"scenario {name}: route")
        reality = read_record(Reality, table.get("reality", {}), f"scenario {name}: reality")
        _check_route(route, f"scenario {name}: route")
        _check_reality(reality, f"scenario {name}: reality")
        world = World.from_table({"name": name, **table["world"]})
        return cls(name, world, route, reality, calibration)


def builtin_names() -> tuple[str, ...]:
    """Scenarios that come with the package."""
    files = (entry.name for entry in resources.files("sensors").joinpath("simulation", "scenarios").iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in files if name.endswith(".toml")))


def load_scenario(scenario: str | Path) -> Scenario:
    """A built-in scenario by name, or one from a file; raises `WorldError`."""
    name = Path(scenario).stem if Path(scenario).suffix == ".toml" else str(scenario)
    try:
        return Scenario.from_table(name, tomllib.loads(scenario_text(scenario)))
    except tomllib.TOMLDecodeError as error:
        raise WorldError(f"scenario {name}: not TOML: {error}; correct that line") from error


def scenario_text(scenario: str | Path) -> str:
    """The text of a scenario's file; raises `WorldError` when there is none."""
    path = Path(scenario)
    if path.suffix == ".toml":
        try:
            return path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise WorldError(f"{path}: cannot be read ({error}); give a scenario file") from error
    if str(scenario) not in builtin_names():
        raise WorldError(f"no scenario {str(scenario)!r}; {did_you_mean(str(scenario), builtin_names())}")
    return resources.files("sensors").joinpath("simulation", "scenarios", f"{scenario}.toml").read_text("utf-8")


def _check_route(route: Route, where: str) -> None:
    if len(set(route.waypoints_m)) < 2:
        raise WorldError(f"{where}.waypoints_m: give at least two different places to drive between")
    for key in ("speed_m_s", "turn_rate_rad_s", "laps"):
        if getattr(route, key) <= 0:
            raise WorldError(f"{where}.{key}: {getattr(route, key)} must be greater than zero")
    if route.pause_s < 0.0:
        raise WorldError(f"{where}.pause_s: {route.pause_s} must not be negative; 0 drives on at once")


def _check_reality(reality: Reality, where: str) -> None:
    for key in (entry.name for entry in dataclasses.fields(reality)):
        value = getattr(reality, key)
        if value < 0.0 and key != "deaf_below_dbm" and not key.endswith("_bias"):
            raise WorldError(f"{where}.{key}: {value} must not be negative; 0 turns it off")
        if key.endswith("_share") and value > 1.0:
            raise WorldError(f"{where}.{key}: {value} is more than always; give a share from 0 to 1")
        if key.endswith("_hz") and value * STEP_S > 1.0:
            raise WorldError(f"{where}.{key}: {value} is faster than the virtual clock; at most {1.0 / STEP_S:g}")
    if reality.shadowing_length_m == 0.0:
        raise WorldError(f"{where}.shadowing_length_m: 0 must be greater than zero; for none, shadowing_std_db = 0")
