"""The world a run happens in: anchors and their radio, the robot, the floor. A TOML file on disk.

The whole world is stored inside every log, with its hash, so that a log shows by itself what it was recorded with.
Unknown keys are refused with the nearest match; anchors that make positioning impossible are refused at load.
`docs/world.md` shows the file key by key.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fusion.errors import WorldError
from fusion.radio import DistanceModel, PathLoss, RadioKind, Ranging
from fusion.robot import Robot, read_robot
from fusion.schema import check_keys, read_record, read_value, require_positive
from fusion.trilateration import are_collinear

FLOOR_MARGIN_M = 2.0
"""Floor assumed beyond the outermost anchors when the world states no bounds."""


@dataclass(frozen=True, slots=True)
class Anchor:
    """An access point, beacon or UWB module: its place [m] and how its readings depend on distance."""

    id: str
    x: float
    y: float
    z: float
    radio: PathLoss
    ranging: Ranging

    def model(self, kind: RadioKind) -> DistanceModel:
        """The dependence of readings of that kind on distance."""
        return self.radio if kind == "rssi" else self.ranging


POSITIVE_RADIO = "frequency_hz", "path_loss_exponent", "reference_distance_m", "shadowing_std_db", "shadowing_length_m"


@dataclass(frozen=True, slots=True)
class Calibration:
    """Provenance of calibrated numbers of a world, for people and reports; no estimator reads it.

    ``recorded``: date of the newest log, by its own stamps. ``residual_std`` of the ``samples``, in their own unit.
    """

    method: str
    logs: tuple[str, ...]
    sha256: tuple[str, ...]
    recorded: str
    samples: int
    residual_std: float
    fusion: str


@dataclass(frozen=True, slots=True)
class Bounds:
    """The floor's extent [m], map frame."""

    x_min: float
    x_max: float
    y_min: float
    y_max: float


Wall = tuple[tuple[float, float], ...]
"""Corners of one wall [m], in order."""


@dataclass(frozen=True, slots=True)
class World:
    """Everything an estimator may know beforehand. Build one with `load`, `from_toml` or `from_table`."""

    name: str
    anchors: tuple[Anchor, ...]
    robot: Robot
    bounds: Bounds
    walls: tuple[Wall, ...]
    provenance: str
    calibration: Mapping[str, Calibration]
    """By what was calibrated: ``radio``, ``odometry``, ``gyro`` ..."""
    hash: str
    """SHA-256 of the world's content, whatever the order or spelling of its keys."""
    table: str = field(repr=False)
    """The content as canonical JSON: what `hash` is the hash of."""
    _by_id: Mapping[str, Anchor] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_by_id", {anchor.id: anchor for anchor in self.anchors})

    @classmethod
    def load(cls, path: Path) -> World:
        """Read a world file; raises `WorldError` that names the file."""
        try:
            return cls.from_toml(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError) as error:
            raise WorldError(f"{path}: cannot be read ({error}); give a world file in TOML") from error
        except WorldError as error:
            raise WorldError(f"{path}: {error}") from error

    @classmethod
    def from_toml(cls, text: str) -> World:
        """A world from the text of a world file."""
        import tomllib

        try:
            return cls.from_table(tomllib.loads(text))
        except tomllib.TOMLDecodeError as error:
            raise WorldError(f"not TOML: {error}; correct that line") from error

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> World:
        """A world from nested tables, as TOML or JSON gives them."""
        import hashlib
        import json

        known = {"name", "provenance", "anchors", "radio", "ranging", "robot", "bounds", "walls", "calibration"}
        check_keys(table, dict.fromkeys(known), "world")
        robot = read_robot(table.get("robot", {}))
        read_record(PathLoss, table.get("radio", {}), "radio")
        read_record(Ranging, table.get("ranging", {}), "ranging")
        anchors = _read_anchors(table, robot.antenna_m[2])
        bounds = _read_bounds(table, anchors)
        name = read_value(str, table.get("name", "unnamed"), "name")
        walls = read_value(tuple[Wall, ...], table.get("walls", ()), "walls")
        provenance = read_value(str, table.get("provenance", ""), "provenance")
        calibration = read_value(Mapping[str, Calibration], table.get("calibration", {}), "calibration")
        # Only now: every value is known to be one that JSON can hold (TOML also has dates).
        text = json.dumps(table, sort_keys=True, separators=(",", ":"))
        return cls(
            name=name,
            anchors=anchors,
            robot=robot,
            bounds=bounds,
            walls=walls,
            provenance=provenance,
            calibration=calibration,
            hash=hashlib.sha256(text.encode()).hexdigest(),
            table=text,
        )

    def anchor(self, anchor_id: str) -> Anchor | None:
        """The anchor of that id, None if the world has none."""
        return self._by_id.get(anchor_id)


def _read_anchors(table: Mapping[str, Any], antenna_height_m: float) -> tuple[Anchor, ...]:
    rows = table.get("anchors", [])
    if not isinstance(rows, list | tuple):
        raise WorldError(f"anchors: expected [[anchors]] tables, got {rows!r}")
    anchors = tuple(_read_anchor(row, table, antenna_height_m, f"anchors[{i}]") for i, row in enumerate(rows))
    _check_anchors(anchors)
    return tuple(sorted(anchors, key=lambda anchor: anchor.id))


def _read_anchor(row: Any, world: Mapping[str, Any], antenna_height_m: float, where: str) -> Anchor:  # noqa: ANN401
    """One [[anchors]] table; its own radio and ranging keys win over the world's. No height given: the antenna's."""
    if not isinstance(row, Mapping):
        raise WorldError(f"{where}: expected a table, got {row!r}")
    check_keys(row, dict.fromkeys(("id", "position_m", "radio", "ranging")), where)
    for key in ("id", "position_m"):
        if key not in row:
            raise WorldError(f"{where}: {key} is missing; add it")
    position = read_value(tuple[float, ...], row["position_m"], f"{where}.position_m")
    if len(position) not in (2, 3):
        raise WorldError(f"{where}.position_m: expected [x, y] or [x, y, z], got {len(position)} numbers")
    anchor = Anchor(
        id=read_value(str, row["id"], f"{where}.id"),
        x=position[0],
        y=position[1],
        z=position[2] if len(position) == 3 else antenna_height_m,
        radio=read_record(PathLoss, {**world.get("radio", {}), **_own(row, "radio", where)}, f"{where}.radio"),
        ranging=read_record(Ranging, {**world.get("ranging", {}), **_own(row, "ranging", where)}, f"{where}.ranging"),
    )
    for name, model, keys in (
        ("radio", anchor.radio, POSITIVE_RADIO),
        ("ranging", anchor.ranging, ("scale", "std_m")),
    ):
        require_positive(model, keys, f"{where}.{name}")
    return anchor


def _own(row: Mapping[str, Any], key: str, where: str) -> Mapping[str, Any]:
    """An anchor's own radio or ranging table; what it lacks comes from the world's."""
    table = row.get(key, {})
    if not isinstance(table, Mapping):
        raise WorldError(f"{where}.{key}: expected a table of names and values, got {table!r}")
    return table


def _check_anchors(anchors: tuple[Anchor, ...]) -> None:
    by_id: dict[str, Anchor] = {}
    by_place: dict[tuple[float, float, float], Anchor] = {}
    for anchor in anchors:
        if anchor.id in by_id:
            raise WorldError(f"anchors: id {anchor.id!r} stands twice; give every anchor its own")
        place = (anchor.x, anchor.y, anchor.z)
        if place in by_place:
            raise WorldError(f"anchors: {by_place[place].id!r} and {anchor.id!r} are both at {place}; remove one")
        by_id[anchor.id] = by_place[place] = anchor
    if len(anchors) >= 3 and are_collinear(np.array([[anchor.x, anchor.y] for anchor in anchors])):
        ids = ", ".join(anchor.id for anchor in anchors)
        raise WorldError(
            f"anchors: {ids} lie on one line, so left and right of it look the same; move one off the line"
        )


def _read_bounds(table: Mapping[str, Any], anchors: tuple[Anchor, ...]) -> Bounds:
    if "bounds" in table:
        bounds = read_record(Bounds, table["bounds"], "bounds")
    elif not anchors:
        raise WorldError("world: neither anchors nor bounds are given; add [[anchors]], or [bounds] for odometry alone")
    else:
        xs, ys = [anchor.x for anchor in anchors], [anchor.y for anchor in anchors]
        bounds = Bounds(
            min(xs) - FLOOR_MARGIN_M, max(xs) + FLOOR_MARGIN_M, min(ys) - FLOOR_MARGIN_M, max(ys) + FLOOR_MARGIN_M
        )
    if bounds.x_min >= bounds.x_max or bounds.y_min >= bounds.y_max:
        raise WorldError(f"bounds: {bounds} enclose nothing; the minimum must be less than the maximum")
    return bounds
