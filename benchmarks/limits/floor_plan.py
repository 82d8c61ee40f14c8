"""The plan of a site: the least error of a fix all over its floor, what would change it, and what to be wary of."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.limits.anchor_placement import (
    Grid,
    Proposal,
    Readings,
    Spread,
    best_addition,
    best_move,
    default_step,
    error_map,
    losses,
)
from benchmarks.limits.fix_bound import Shared, dilution
from benchmarks.limits.floor_source import choose_radio, load_site
from fusion import Anchor, ParameterError, World, WorldError
from fusion.arrays import Floats
from fusion.output.progress import Progress
from fusion.radio import RadioKind
from fusion.trilateration import are_collinear

LIMIT_M = 1.0
"""Error whose share of the floor is reported [m]."""
MOST_CELLS = 100_000
"""A finer floor than this is a slip of the finger, and would fill the memory."""


@dataclass(frozen=True)
class Plan:
    """The least error of a fix all over a floor, and what would change it.

    ``error_m`` (ny, nx) [m], NaN where undefined, belongs to ``grid``. ``hdop`` likewise, for ranges, else None.
    ``proposals``: the changes asked for, one more anchor before the move. ``remarks``: cautions beside the numbers.
    """

    world: World
    readings: Readings
    grid: Grid
    limit_m: float
    error_m: Floats
    hdop: Floats | None
    losses: Mapping[str, Spread]
    proposals: tuple[Proposal, ...]
    remarks: tuple[str, ...]

    @property
    def spread(self) -> Spread:
        """Errors over the floor."""
        return Spread.of(self.error_m)

    @property
    def below_limit(self) -> float:
        """Share of the floor where the error is ``limit_m`` at most."""
        return float(np.mean(self.error_m <= self.limit_m))

    @property
    def worst_place(self) -> tuple[float, float]:
        """Middle of the first cell [m] of the largest error, undefined the largest of all."""
        row, column = np.unravel_index(np.argmax(self.error_m), self.error_m.shape)
        return float(self.grid.x[column]), float(self.grid.y[row])


def title(plan: Plan) -> str:
    """Title of the plan, in one line."""
    return f"{plan.world.name}, {plan.readings.radio}: least error of a fix"


def plan_site(
    source: str | Path,
    *,
    radio: RadioKind | None = None,
    scans: int = 1,
    step_m: float | None = None,
    limit_m: float = LIMIT_M,
    offset_std: float = 0.0,
    add: bool = False,
    move: bool = False,
    progress: Progress | None = None,
) -> Plan:
    """The plan of a site: a world file, a scenario (file or built-in name) or a log.

    ``radio`` None: the one in use there, signal strength where that does not decide. ``offset_std`` [dB or m]: how far
    the readings of all anchors may be off together, infinite where that is not known. Raises `WorldError`, `LogError`
    or `ParameterError`.
    """
    _check(scans, step_m, limit_m, offset_std)
    site = load_site(source)
    world, remarks = site.world, []
    if radio is None:
        radio, why = choose_radio(site.radios)
        remarks.append(why)
    _check_anchors(world)
    readings, grid = Readings(radio, scans, Shared(offset_std)), _grid(world, step_m)
    places = grid.places(world.robot.antenna_m[2])
    searches = [search for search, wanted in ((best_addition, add), (best_move, move)) if wanted]
    proposals = [search(world, readings, places, progress) for search in searches]
    error_m = error_map(world.anchors, readings, places)
    return Plan(
        world,
        readings,
        grid,
        limit_m,
        error_m,
        dilution(world.anchors, places).hdop if radio == "range" else None,
        losses(world.anchors, readings, places),
        tuple(proposal for proposal in proposals if proposal is not None),
        (*remarks, *_cautions(world, error_m, proposals)),
    )


def _check(scans: int, step_m: float | None, limit_m: float, offset_std: float) -> None:
    if scans < 1:
        raise ParameterError(f"{scans} scans: a fix needs 1 or more")
    for name, value in (("step", step_m), ("limit", limit_m)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise ParameterError(f"{name} {value} m: give a length greater than zero")
    if not offset_std >= 0.0:
        raise ParameterError(f"offset std {offset_std}: must not be negative; 0 known, inf not known at all")


def _grid(world: World, step_m: float | None) -> Grid:
    bounds = world.bounds
    step_m = default_step(bounds) if step_m is None else step_m
    cells = max(1.0, (bounds.x_max - bounds.x_min) / step_m) * max(1.0, (bounds.y_max - bounds.y_min) / step_m)
    if cells > MOST_CELLS:
        raise ParameterError(f"step {step_m} m cuts the floor into {cells:.0f} cells; give a longer one, or none")
    return Grid.over(bounds, step_m)


def _check_anchors(world: World) -> None:
    count = len(world.anchors)
    if count < 2:
        raise WorldError(
            f"{world.name}: {count or 'no'} anchor{'s' * (count != 1)}; a fix needs the distance to two at least, and "
            "to three that do not stand on one line to be the only one; add [[anchors]]"
        )


def _cautions(world: World, error_m: Floats, proposals: Sequence[Proposal | None]) -> list[str]:
    cautions = []
    if len(world.anchors) == 2:
        cautions.append("two anchors leave two mirror images of every fix; the bound is the error around the right one")
    vital = [anchor.id for anchor in world.anchors if _leaves_a_line(world, anchor)]
    if vital:
        cautions.append(f"without {' or '.join(vital)} every fix has a mirror image, which the bound does not see")
    undefined = np.isnan(error_m)
    if undefined.any():
        cautions.append(
            f"the bound is undefined on {undefined.mean():.1%} of the floor: there a direction is not measured"
        )
    if None in proposals:
        cautions.append("no place on the floor would lower the error for 95 % of it")
    return cautions


def _leaves_a_line(world: World, silent: Anchor) -> bool:
    """True where the other anchors, two or more, stand on one line."""
    rest = np.array([(anchor.x, anchor.y) for anchor in world.anchors if anchor is not silent])
    return len(rest) >= 2 and are_collinear(rest)
