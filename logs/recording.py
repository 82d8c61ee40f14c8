"""A recording brought in from elsewhere, before it becomes a log."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from pathlib import Path

from fusion import (
    Covariance,
    Increment,
    Measurement,
    Odometry,
    OdometryNoise,
    Pose,
    Prior,
    RecordingError,
    Truth,
    World,
)
from fusion.errors import did_you_mean
from fusion.timeline import order
from fusion.values import NANOSECONDS
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
    """When each measurement, and then each truth, arrived; None: when it was true."""
    warnings: Sequence[str] = ()
    """What is lost or doubtful, in sentences."""

    def write(self, path: Path) -> Path:
        """Write it as a log, in the order of arrival."""
        values: list[Measurement | Truth] = [*self.measurements, *self.truths]
        keys = [order(m) for m in self.measurements]
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


def heading_from_motion(odometry: Sequence[Odometry], truths: Sequence[Truth], path_m: float) -> float | None:
    """The start heading [rad] with which the first ``path_m`` of odometry follow the truth, or None without motion.

    Closed form: the rotation about the start that minimises the squared distances (2-D Procrustes; Arun et al. 1987).
    """
    sine = cosine = 0.0
    motion, noise, place = Increment(), OdometryNoise(), 0
    first = truths[0]
    for step in odometry:
        motion = motion.extend(step, noise)
        while place + 1 < len(truths) and truths[place + 1].time_ns <= step.time_ns:
            place += 1
        ahead = truths[place]
        if ahead.time_ns != step.time_ns and step.time_ns - ahead.time_ns > NANOSECONDS:
            continue
        dx, dy = ahead.x - first.x, ahead.y - first.y
        cosine += motion.x * dx + motion.y * dy
        sine += motion.x * dy - motion.y * dx
        if motion.path_m >= path_m:
            break
    return math.atan2(sine, cosine) if math.hypot(sine, cosine) > 1e-6 else None


def prior_from_truth(
    odometry: Sequence[Odometry], truths: Sequence[Truth], *, path_m: float = 1.0, heading_std: float = 0.2
) -> tuple[Prior | None, str]:
    """A starting prior at the first true pose, and a sentence that says how it was made.

    Without a heading in the truth, it is found from the first ``path_m`` of motion, with ``heading_std`` [rad].
    """
    if not truths:
        return None, "no truth: start unknown"
    first = truths[0]
    if first.heading is not None:
        return (
            Prior(first.time_ns, Pose(first.x, first.y, first.heading), Covariance.from_std(0.05, 0.05, 0.05)),
            "first true pose, 0.05 m, 0.05 rad",
        )
    after = [step for step in odometry if step.time_ns > first.time_ns]
    heading = heading_from_motion(after, truths, path_m)
    pose = Pose(first.x, first.y, heading or 0.0)
    prior = Prior(first.time_ns, pose, Covariance.from_std(0.05, 0.05, heading_std), heading_known=heading is not None)
    if heading is None:
        return prior, "first true position, heading unknown"
    return prior, f"first true position, heading from the first {path_m:g} m of motion against the truth"
