"""A plan of a site as tables for people and as a record for programs, both in metres."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from benchmarks.limits.anchor_placement import Proposal, Spread
from benchmarks.limits.floor_plan import Plan, title
from fusion.output.files import write_json
from fusion.output.tables import Table

MOST_LOSSES = 12
"""Anchors in the table of what the loss of one costs; the record has them all."""


def tables(plan: Plan) -> list[Table]:
    """Errors over the floor, the cost of the loss of each anchor, and the best changes."""
    # Of many anchors those that would be missed most: a hundred lines of 1.00 help nobody.
    vital = sorted(plan.losses, key=lambda name: -plan.losses[name].p95_m)[:MOST_LOSSES]
    losses = tuple(
        (name, *_errors(spread), _number(_ratio(spread.p95_m, plan.spread.p95_m)))
        for name, spread in plan.losses.items()
        if name in vital
    )
    worst = f" (the worst {len(vital)} of {len(plan.losses)})" if len(vital) < len(plan.losses) else ""
    shown = [
        Table(title(plan), ("over the floor", ""), tuple(_floor_rows(plan))),
        Table(f"When one anchor falls silent{worst}", ("silent", "median m", "p95 m", "worst m", "p95 times"), losses),
    ]
    if plan.proposals:
        rows = tuple(
            (describe(plan, each), *_errors(each.spread), _number(gain_m(plan, each))) for each in plan.proposals
        )
        shown.append(Table("The best change", ("change", "median m", "p95 m", "worst m", "p95 gain m"), rows))
    return shown


def _floor_rows(plan: Plan) -> Iterator[tuple[str, str]]:
    spread, (x, y) = plan.spread, plan.worst_place
    yield "readings of each anchor", str(plan.readings.scans)
    yield "median error, m", _number(spread.median_m)
    yield "95 % of the floor below, m", _number(spread.p95_m)
    yield f"worst error, m, at ({x:.2f}, {y:.2f})", _number(spread.worst_m)
    yield f"floor below {plan.limit_m:g} m, %", f"{100.0 * plan.below_limit:.1f}"
    yield "floor where the bound is undefined, %", f"{100.0 * spread.undefined:.1f}"
    if plan.hdop is not None:
        yield "median HDOP", _number(Spread.of(plan.hdop).median_m)


def _errors(spread: Spread) -> tuple[str, str, str]:
    return _number(spread.median_m), _number(spread.p95_m), _number(spread.worst_m)


def _number(value: float) -> str:
    """Centimetres are enough; infinite where the bound is undefined."""
    return f"{value:.2f}" if math.isfinite(value) else "∞" if value > 0.0 else "–"


def _ratio(value: float, beside: float) -> float:
    """NaN where both are infinite."""
    return value / beside if math.isfinite(value) or math.isfinite(beside) else math.nan


def gain_m(plan: Plan, proposal: Proposal) -> float:
    """Decrease of the error that 95 % of the floor stays below [m]; infinite where it had no limit."""
    return plan.spread.p95_m - proposal.spread.p95_m


def describe(plan: Plan, proposal: Proposal) -> str:
    """A proposal in words, with its place [m]."""
    anchor = proposal.anchor
    place = f"({anchor.x:.2f}, {anchor.y:.2f}, {anchor.z:.2f})"
    before = plan.world.anchor(anchor.id)
    if before is None:
        return f"one more anchor at {place}"
    return f"{anchor.id} from ({before.x:.2f}, {before.y:.2f}, {before.z:.2f}) to {place}"


def record(plan: Plan) -> dict[str, object]:
    """Everything as one table for strict JSON, in metres: what is infinite or undefined is None."""
    shared = plan.readings.shared
    return {
        "world": plan.world.name,
        "world_hash": plan.world.hash,
        "radio": plan.readings.radio,
        "scans": plan.readings.scans,
        "offset_std": _finite(shared.offset_std),
        "offset_known": math.isfinite(shared.offset_std),
        "limit_m": plan.limit_m,
        "anchors": {anchor.id: (anchor.x, anchor.y, anchor.z) for anchor in plan.world.anchors},
        **_spread(plan.spread),
        "worst_place_m": plan.worst_place,
        "below_limit": plan.below_limit,
        "hdop_median": None if plan.hdop is None else _finite(Spread.of(plan.hdop).median_m),
        "losses": {name: _spread(spread) for name, spread in plan.losses.items()},
        "proposals": [_proposal(plan, each) for each in plan.proposals],
        "remarks": list(plan.remarks),
        "x_m": plan.grid.x.tolist(),
        "y_m": plan.grid.y.tolist(),
        "error_m": [[_finite(error) for error in row] for row in plan.error_m.tolist()],
    }


def _spread(spread: Spread) -> dict[str, float | None]:
    return {key: _finite(value) for key, value in spread._asdict().items()}


def _proposal(plan: Plan, proposal: Proposal) -> dict[str, object]:
    anchor = proposal.anchor
    kind = "add" if plan.world.anchor(anchor.id) is None else "move"
    head = {"kind": kind, "anchor": anchor.id, "place_m": (anchor.x, anchor.y, anchor.z)}
    return {**head, **_spread(proposal.spread), "p95_gain_m": _finite(gain_m(plan, proposal))}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def write_record(plan: Plan, output: Path) -> None:
    """The record as JSON; ``-`` is stdout."""
    write_json(output, record(plan))
