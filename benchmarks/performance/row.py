"""One figure of the table: what it cost, beside what, and the floor that it must hold."""

from __future__ import annotations

from enum import Enum, unique
from typing import NamedTuple

from benchmarks.performance.interleaved import Cost


@unique
class Sense(Enum):
    """On which side of its bound a figure must stay."""

    AT_LEAST = "≥"
    AT_MOST = "≤"


class Floor(NamedTuple):
    """The least that is asked of a row: of its ratio, or of its value where ``of_value``."""

    sense: Sense
    bound: float
    of_value: bool = False

    def holds(self, figure: float) -> bool:
        """Whether a ``figure`` is on the right side."""
        return figure >= self.bound if self.sense is Sense.AT_LEAST else figure <= self.bound


class Row(NamedTuple):
    """The ``subject``'s value of a ``quantity``, as ``unit`` states it.

    ``ratio``: how many times as fast as ``against``, or, of a law, how many times as much at its far end; None where
    there is nothing to compare with. ``median`` None: the value is a count, the same every time.
    """

    quantity: str
    subject: str
    unit: str
    value: float
    median: float | None = None
    ratio: float | None = None
    against: str = ""

    @property
    def floor(self) -> Floor | None:
        """The bound that it must hold, None where there is none."""
        return FLOORS.get((self.quantity, self.subject))

    @property
    def holds(self) -> bool | None:
        """Whether it holds its floor; None where there is none, or nothing to compare with."""
        if self.floor is None:
            return None
        figure = self.value if self.floor.of_value else self.ratio
        return None if figure is None else self.floor.holds(figure)


def compared(quantity: str, subject: str, unit: str, cost: Cost, reference: tuple[str, Cost] | None) -> Row:
    """A row of processor time: how many times as fast as the reference, least against least."""
    if reference is None:
        return Row(quantity, subject, unit, *cost)
    return Row(quantity, subject, unit, *cost, reference[1].least / cost.least, reference[0])


PUSH, PUSH_ESTIMATE = "odometry push, estimate on demand", "odometry push, estimate after each"
SCAN, MIXED = "update of 3 ranges, estimate on demand", "odometry push and its share of an update"
WHOLE, AGAIN, DRAW = "whole log", "further estimator on the same log", "further draw on the same log"
GRID = "grid of 20 values, against one run of the log"
DECODE = "MCAP to a run"
CALLS, STATE = "calls of functions", "state of an epoch, by anchors of the world"
INSTRUCTIONS = "instructions of Python by each anchor that is never received"
LENGTH, RECEIVED, UNUSED = "length of the log", "anchors received", "anchors that are never received"
LATE, REFOLDS, PARTICLES = "steps by which scans are late", "steps of the estimator by a late scan", "particles"
WORKERS = "16 cells on 2 workers, against 1"
START_CPU, START_RSS = "import of fusion and ekf built: processor time", "import of fusion and ekf built: memory"


def _at_least(bound: float, *, of_value: bool = False) -> Floor:
    return Floor(Sense.AT_LEAST, bound, of_value)


def _at_most(bound: float, *, of_value: bool = False) -> Floor:
    return Floor(Sense.AT_MOST, bound, of_value)


FLOORS = {
    (PUSH, "ekf, 10 states"): _at_least(3.0),
    (PUSH_ESTIMATE, "ekf, 10 states"): _at_least(1.2),
    (SCAN, "ekf, 10 states"): _at_least(1.5),
    (WHOLE, "ekf, 10 states"): _at_least(5.0),
    (WHOLE, "ekf, 3 states"): _at_least(10.0),
    (WHOLE, "dynamic_weight"): _at_least(8.0),
    (WHOLE, "dead_reckoning"): _at_least(8.0),
    (WHOLE, "particle, 1000"): _at_least(4.0),
    (DRAW, "ekf, 10 states"): _at_least(8.0),
    (GRID, "ekf, 10 states"): _at_most(3.0),
    (DECODE, "messages"): _at_least(0.5, of_value=True),
    (UNUSED, "ekf, 300 for 3"): _at_most(1.2),
    (REFOLDS, "150 steps late"): _at_most(2.0, of_value=True),
    (WORKERS, "processor time"): _at_most(1.05),
    (START_CPU, "fresh process"): _at_most(0.15, of_value=True),
    (START_RSS, "fresh process"): _at_most(35.0, of_value=True),
}
"""By quantity and subject."""
