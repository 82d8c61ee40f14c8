"""A recording brought in from elsewhere, before it becomes a log."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from pathlib import Path

from fusion import Measurement, Prior, RecordingError, Truth, World
from fusion.errors import did_you_mean
from fusion.timeline import order
from fusion.values import NANOSECONDS
from logs.run import left_out
from logs.writer import RunWriter


@dataclass(frozen=True)
class Recording:
    """One run of a foreign recording, in our values."""

    name: str
    world: World
    prior: Prior | None
    measurements: Sequence[Measurement]
    truths: Sequence[Truth]
    metadata: Mapping[str, str] = field(default_factory=dict)
    arrivals_ns: Sequence[int] | None = None
    """Times of arrival of each measurement, and then of each truth; None: those of their stamps."""
    warnings: Sequence[str] = ()
    """Losses and doubts, a sentence each."""

    @property
    def doubts(self) -> list[str]:
        """The warnings, and how many true poses have no position."""
        uncounted = left_out([truth.position_known for truth in self.truths])
        return [*self.warnings, *(f"{self.name}: {sentence}" for sentence in uncounted)]

    def write(self, path: Path) -> Path:
        """Write it as a log, in the order of arrival."""
        values: list[Measurement | Truth] = [*self.measurements, *self.truths]
        keys: list[tuple[int, int, str, int]] = [order(m) for m in self.measurements]
        keys += [(truth.time_ns, 2, "", i) for i, truth in enumerate(self.truths)]
        arrivals = [value.time_ns for value in values] if self.arrivals_ns is None else self.arrivals_ns
        rows = sorted(zip(arrivals, keys, values, strict=True), key=lambda row: row[:2])
        with RunWriter(path, self.world, name=self.name, prior=self.prior, metadata=self.metadata) as log:
            for arrived_ns, _, value in rows:
                if isinstance(value, Truth):
                    log.write_truth(value, log_time_ns=arrived_ns)
                else:
                    log.write(value, log_time_ns=arrived_ns)
        return path


def exact_ns(text: str, place: str = "recording") -> int:
    """Seconds written as decimal text, in nanoseconds, without passing through a float; raises `RecordingError`.

    >>> exact_ns("1652380260.171842098")
    1652380260171842098
    """
    try:
        return int((Decimal(text) * NANOSECONDS).to_integral_value())
    except (InvalidOperation, ValueError, OverflowError) as error:
        raise RecordingError(f"{place}: {text!r} is not a time in seconds; correct it") from error


@dataclass(frozen=True)
class Row:
    """One row of a table, with the place it stands at."""

    place: str
    cells: Mapping[str, str]

    def text(self, column: str) -> str:
        """A cell's text."""
        return (self.cells.get(column) or "").strip()

    def number(self, column: str) -> float:
        """A cell as a number (``nan`` and ``inf`` are numbers here); raises `RecordingError` naming the place."""
        try:
            return float(self.text(column))
        except ValueError as error:
            raise RecordingError(
                f"{self.place}: {column} is {self.text(column)!r}, not a number; correct it"
            ) from error

    def optional(self, column: str) -> float | None:
        """A cell as a finite number, None where it is empty or ``nan`` and so not known; raises `RecordingError`."""
        number = self.number(column) if self.text(column) else math.nan
        if math.isinf(number):
            raise RecordingError(
                f"{self.place}: {column} is {self.text(column)!r}, not a finite number; leave it empty if not known"
            )
        return None if math.isnan(number) else number

    def time_ns(self, column: str) -> int:
        """A cell holding seconds, in nanoseconds."""
        return exact_ns(self.text(column), f"{self.place}: {column}")

    def whole(self, column: str) -> int:
        """A cell as a whole number; raises `RecordingError` naming the place."""
        number = self.number(column)
        if not number.is_integer():
            raise RecordingError(f"{self.place}: {column} is {self.text(column)!r}, not a whole number; correct it")
        return int(number)


def read_table(path: Path, required: Sequence[str]) -> Iterator[Row]:
    """Rows of a CSV file with a header line; raises `RecordingError` for a missing file or column."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.DictReader(stream, skipinitialspace=True)
            header = [name.strip() for name in reader.fieldnames or []]
            reader.fieldnames = header
            for name in required:
                if name not in header:
                    raise RecordingError(f"{path}: no column {name!r} in its first line; {did_you_mean(name, header)}")
            for cells in reader:
                yield Row(f"{path}:{reader.line_num}", cells)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(f"{path}: cannot be read as CSV ({error})") from error
