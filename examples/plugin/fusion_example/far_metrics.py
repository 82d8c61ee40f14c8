"""A family of metrics: how long the robot was taken to be far from where it was."""

from __future__ import annotations

from benchmarks.metrics.errors import Errors
from benchmarks.metrics.metric import Better, rows

FAR_M = 5.0

METRICS = rows("far_share", "share", Better.LESS, "share of instants with a position error above 5 m, or no estimate")


def metrics(measured: Errors) -> dict[str, float]:
    """The share; NaN of a run without instants. The error of an instant without an estimate is infinite."""
    return {"far_share": float((measured.position > FAR_M).mean()) if len(measured.position) else float("nan")}
