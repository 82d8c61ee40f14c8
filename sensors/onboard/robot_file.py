"""The robot file: the sensors of a robot by name, and the policy of its recordings. `docs/record.md` has every key."""

from __future__ import annotations

import inspect
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fusion import BeliefError, Covariance, Driver, DriverError, Pose, Prior, SettingError, World, WorldError, load
from fusion.driver import Clock
from fusion.errors import did_you_mean
from fusion.plugins import SENSORS
from fusion.schema import check_keys, read_record
from sensors.simulation.scenario import builtin_names, load_scenario


@dataclass(frozen=True)
class Start:
    """Pose of the robot when the recording starts; what is not given is not known."""

    position_m: tuple[float, float] | None = None
    heading_deg: float | None = None
    position_std_m: float = 0.1
    heading_std_deg: float = 5.0

    def prior(self, time_ns: int, world: World) -> Prior:
        """The same as a prior; an unknown position is anywhere in the world."""
        bounds = world.bounds
        middle = 0.5 * (bounds.x_min + bounds.x_max), 0.5 * (bounds.y_min + bounds.y_max)
        x, y = middle if self.position_m is None else self.position_m
        heading = math.radians(self.heading_deg or 0.0)
        covariance = Covariance.from_std(self.position_std_m, self.position_std_m, math.radians(self.heading_std_deg))
        known = self.position_m is not None, self.heading_deg is not None
        return Prior(time_ns, Pose(x, y, heading), covariance, *known)


@dataclass(frozen=True)
class Sensor:
    """One sensor: ``use`` names its driver, ``settings`` are the driver's own."""

    name: str
    use: str
    required: bool = True
    settings: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Policy:
    """Policy of a recording: a new file every so many seconds or megabytes, and how much disk stays free."""

    split_s: float = 600.0
    split_mb: float = 256.0
    min_free_mb: float = 500.0
    ring: bool = False
    """When the disk is full, give up the oldest files of this robot instead of stopping."""


@dataclass(frozen=True)
class RobotFile:
    """A robot file, read. ``text`` is the file itself, which every log keeps."""

    name: str
    world: World
    start: Start
    policy: Policy
    sensors: tuple[Sensor, ...]
    text: str

    @classmethod
    def load(cls, path: Path) -> RobotFile:
        """Read a robot file; raises `SettingError` that names the place."""
        try:
            text = path.read_text(encoding="utf-8")
            return cls._from_table(tomllib.loads(text), path, text)
        except (OSError, UnicodeDecodeError) as error:
            raise SettingError(f"{path}: cannot be read ({error})", "give a robot file (*.toml)") from error
        except tomllib.TOMLDecodeError as error:
            raise SettingError(f"{path}: not TOML: {error}", "correct that line") from error
        except WorldError as error:
            raise SettingError(f"{path}: {error}", "docs/record.md shows the file key by key") from error

    @classmethod
    def _from_table(cls, table: Mapping[str, Any], path: Path, text: str) -> RobotFile:
        check_keys(table, dict.fromkeys(("name", "world", "start", "record", "sensors")), "robot file")
        sensors = _sensors(table.get("sensors"))
        world = _world(table.get("world"), path.parent)
        return cls(
            name=str(table.get("name", path.stem)),
            world=world,
            start=_start(table.get("start", {}), world),
            policy=_policy(read_record(Policy, table.get("record", {}), "record")),
            sensors=sensors,
            text=text,
        )


def build_driver(sensor: Sensor, clock: Clock) -> Driver:
    """The driver of ``sensor``; raises `DriverError` for settings that it refuses, `PluginError` for no such driver."""
    made = load(sensor.use, SENSORS)
    known = list(inspect.signature(made).parameters)[2:]
    for key in sensor.settings:
        if key not in known:
            raise SettingError(f"{sensor.name}: {sensor.use} has no setting {key!r}", did_you_mean(key, known))
    try:
        driver = made(sensor.name, clock, **sensor.settings)
    except DriverError:
        raise
    except Exception as error:
        raise SettingError(f"{sensor.name}: {sensor.use} refuses its settings: {error}", "correct them") from error
    if not isinstance(driver, Driver):
        raise SettingError(f"{sensor.name}: {sensor.use} is no driver", f"try `fusion check --driver {sensor.use}`")
    return driver


def _world(given: object, folder: Path) -> World:
    """A world file beside the robot file, the world of a simulated scenario by name, or the world itself as a table."""
    if isinstance(given, str):
        return load_scenario(given).world if given in builtin_names() else World.load(folder / given)
    if isinstance(given, Mapping):
        return World.from_table(given)
    raise WorldError('world: name a world file, as in world = "hall.toml", or write the world as a table [world]')


def _start(given: object, world: World) -> Start:
    """A start that makes a prior."""
    start = read_record(Start, given, "start")
    for key in ("position_std_m", "heading_std_deg"):
        if getattr(start, key) < 0.0:
            raise WorldError(f"start.{key}: {getattr(start, key)} must not be negative; it is a standard deviation")
    try:
        start.prior(0, world)
    except BeliefError as error:
        raise WorldError(f"start: {error}") from error
    return start


def _sensors(rows: object) -> tuple[Sensor, ...]:
    if not isinstance(rows, list) or not rows:
        raise WorldError("sensors: there is none; add a table [[sensors]] for each")
    sensors = tuple(read_record(Sensor, row, f"sensors[{i}]") for i, row in enumerate(rows))
    names = [sensor.name for sensor in sensors]
    for name in names:
        if names.count(name) > 1:
            raise WorldError(f"sensors: two are called {name!r}; a log cannot hold both, rename one")
    return sensors


def _policy(policy: Policy) -> Policy:
    for key in ("split_s", "split_mb"):
        if getattr(policy, key) <= 0.0:
            raise WorldError(f"record.{key}: {getattr(policy, key)} must be greater than zero")
    if policy.min_free_mb < 0.0:
        raise WorldError(f"record.min_free_mb: {policy.min_free_mb} must not be negative; 0 fills the disk")
    return policy
