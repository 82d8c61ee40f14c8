"""An importer: a folder with ``world.toml`` and ``run.txt``, a line for each measurement and each true pose.

odometry 12.50 12.45 0.020 -0.001    time [s], since when [s], distance [m], turn [rad]
range 12.51 a 3.42                   time [s], anchor, distance [m]
truth 12.55 1.00 2.00 0.30           time [s], position [m], heading [rad]
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from fusion import Measurement, Odometry, RangeReading, Ranges, RecordingError, Truth, World
from logs.importers.foreign_recording import Recording, exact_ns
from logs.prior import prior_from_truth


def recordings(folder: Path) -> Iterator[Recording]:
    """The one run of a folder; raises `RecordingError` naming file and line."""
    path = folder / "run.txt"
    if not path.is_file():
        raise RecordingError(f"{folder}: no run.txt; give the folder that holds one")
    values = [
        _value(line.split(), number, f"{path}:{number}")
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        if line.strip()
    ]
    truths = [value for value in values if isinstance(value, Truth)]
    measurements = [value for value in values if not isinstance(value, Truth)]
    prior, where_from = prior_from_truth(measurements, truths)
    world = World.load(folder / "world.toml")
    yield Recording(folder.resolve().name, world, prior, measurements, truths, {"source": "text", "prior": where_from})


def _value(words: list[str], number: int, place: str) -> Measurement | Truth:
    try:
        match words:
            case ["odometry", time, since, distance_m, turn_rad]:
                stretch = exact_ns(time, place), "odometry", number, exact_ns(since, place)
                return Odometry(*stretch, float(distance_m), float(turn_rad))
            case ["range", time, anchor, range_m]:
                return Ranges(exact_ns(time, place), "uwb", number, (RangeReading(anchor, float(range_m)),))
            case ["truth", time, x, y, heading_rad]:
                return Truth(exact_ns(time, place), float(x), float(y), float(heading_rad))
    except ValueError as error:
        raise RecordingError(f"{place}: {error}; correct it") from error
    raise RecordingError(f"{place}: {' '.join(words)!r} is no odometry, range or truth; correct it")
