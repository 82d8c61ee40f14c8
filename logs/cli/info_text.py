"""The text of `fusion info` for one file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, TypeAlias

from logs.timing import GAP_PERIODS

Facts: TypeAlias = Mapping[str, Any]
"""Plain values, as `logs.cli.info.describe` answers them."""


def info_text(about: Facts) -> str:
    """Lines for a reader."""
    lines = _bag(about) if "topics" in about else _log(about)
    return "".join(f"{line}\n" for line in (*lines, *(f"warning: {warning}" for warning in about["warnings"])))


def _rate(rate_hz: float | None) -> str:
    return "once" if rate_hz is None else f"{rate_hz:.2f} Hz"


def _bag(about: Facts) -> Iterator[str]:
    """A foreign bag: a line per topic, and what it could be."""
    yield f"{about['name']}: a bag of {about['duration_s']:.1f} s, not a log of fusion"
    width = max((len(row["topic"]) for row in about["topics"]), default=0)
    for row in about["topics"]:
        could = f"  could be {' or '.join(row['roles'])}" if row["roles"] else ""
        names = f" ({', '.join(row['names'])})" if row["names"] else ""
        bad = f", {row['undecodable']} cannot be decoded" if row["undecodable"] else ""
        rate = _rate(row["rate_hz"]) if row["count"] else "empty"
        yield f"  {row['topic']:<{width}} {row['count']:>7}  {rate:>10}  {row['type']}{bad}{could}{names}"
        if row["missing"]:
            yield f"    {row['missing']}"
    yield "bring it in: fusion import rosbag BAG --world WORLD.toml --topic ROLE=TOPIC ... -o OUT.mcap"


def _log(about: Facts) -> Iterator[str]:
    yield f"{about['name']}: {about['duration_s']:.1f} s in the world {about['world']!r} ({about['world_hash'][:12]})"
    yield f"anchors: {', '.join(about['anchors']) or 'none'}"
    silent = [anchor for anchor, count in about["readings"].items() if not count]
    if silent:
        yield f"never received: {', '.join(silent)}"
    if about["unknown_anchors"]:
        strangers = ", ".join(f"{anchor} ({count})" for anchor, count in about["unknown_anchors"].items())
        yield f"readings of what is no anchor of the world: {strangers}"
    for row in about["channels"]:
        head = f"  {row['kind']:<12} {row['sensor']:<12} {row['count']:>7}  {_rate(row['rate_hz']):>10}"
        yield f"{head}  {', '.join(_oddities(row))}"
    yield from _recording(about)
    yield _truth(about)
    yield f"start: {_start(about)}"
    yield from (f"estimates of {name}: {count}" for name, count in about["estimators"].items())
    yield "estimators that could use it, by their tags and a short replay:"
    yield from map(_usability, about["usability"])
    yield from (f"  {absent}" for absent in about["left_out"])


def _recording(about: Facts) -> Iterator[str]:
    """The clock and the devices by a recorder; nothing for logs that come from elsewhere."""
    if clock := about["wall_clock"]:
        yield f"began {clock['began']}{'' if clock['synced'] else ' by a wall clock that is not synchronised'}"
        yield from (f"the wall clock stepped by {s['by_s']:+.2f} s at {s['at_s']:.1f} s" for s in clock["steps"])
        if clock["suspended_s"] >= 1.0:
            yield f"the computer was suspended for {clock['suspended_s']:.0f} s"
    for sensor, device in about["devices"].items():
        yield f"  {sensor} is a {device.get('model', 'device')} {device.get('firmware', '')}".rstrip()
    yield from (f"  {text} ({count} times)" for text, count in about["complaints"].items())
    yield from (f"  {sensor}: the recorder dropped {count} messages" for sensor, count in about["dropped"].items())


def _oddities(row: Facts) -> Iterator[str]:
    at = f" at {row['longest_gap_at_s']:.1f} s" if row["gaps"] else ""
    yield f"longest gap {row['longest_gap_s']:.2f} s{at}"
    if row["gaps"]:
        yield f"gaps of over {GAP_PERIODS} periods: {row['gaps']}"
    if row["out_of_order"]:
        yield f"{row['out_of_order']} out of order"
    if row["duplicates"]:
        yield f"{row['duplicates']} twice"
    if row["latest_s"] > 0.0:
        yield f"{row['late_s']:.3f} s late, at most {row['latest_s']:.3f} s"
    for jump in row["clock_jumps"][:3]:
        yield f"clock jump at {jump['at_s']:.1f} s: its delay changes by {jump['by_s']:+.2f} s"
    if len(row["clock_jumps"]) > 3:
        yield f"{len(row['clock_jumps'])} clock jumps in all"
    if row["log_time_backwards"]:
        yield f"times that the log time runs backwards: {row['log_time_backwards']}"


def _truth(about: Facts) -> str:
    if not about["truth"]:
        return "truth: none, so errors cannot be scored"
    headings = about["true_headings"]
    known = "" if headings == about["truth"] else f", the heading known at {headings or 'none'} of them"
    return f"truth: {about['truth']} poses{known}"


def _start(about: Facts) -> str:
    if about["prior"] is None:
        return "none in the log"
    x, y, heading = about["prior"]
    turned = f"{math.degrees(heading):.1f}°" if about["heading_known"] else "unknown"
    place = f"x {x:.2f} m, y {y:.2f} m" if about["position_known"] else "position unknown"
    return f"{place}, heading {turned}"


def _usability(row: Facts) -> str:
    refused = [f"{count} {reason}" for reason, count in row["refused"].items()]
    counts = [f"{row['used']} of {row['readings']} readings used", *refused] if row["readings"] else []
    detail = "; ".join([*row["lacks"], *([", ".join(counts)] if counts else [])])
    return f"  {row['estimator']:<23} {'yes' if row['usable'] else 'no':<4} {detail}".rstrip()
