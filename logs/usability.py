"""Usability of a run for each available estimator, by its tags and by the Fates of a short replay.

Nothing is scored here. An estimator is usable where the log has the start it needs and at least one reading (for those
that use motion alone: odometry) that enters its state.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import fusion
from fusion import (
    Decision,
    Estimator,
    Fate,
    FusionError,
    Measurement,
    Odometry,
    Prior,
    Radio,
    Tag,
    Update,
    WheelTicks,
    track,
)
from logs.prior import starting_prior
from logs.run import Run

SCANS = 50
"""Radio messages in the short replay."""
MESSAGES = 2000
"""Most messages of any kind in it."""
ENTERED = (Decision.USED, Decision.DOWNWEIGHTED)


class Usability(NamedTuple):
    """Whether ``estimator`` can use a run: what it ``lacks`` to do so, and what became of the readings replayed."""

    estimator: str
    lacks: tuple[str, ...]
    readings: int = 0
    used: int = 0
    refused: tuple[tuple[str, int], ...] = ()
    """Number of readings that did not enter, by reason."""

    def record(self) -> dict[str, Any]:
        """The same as plain values."""
        return {**self._asdict(), "usable": not self.lacks, "lacks": [*self.lacks], "refused": dict(self.refused)}


def usability(run: Run) -> list[Usability]:
    """One per available estimator, by name."""
    start = starting_prior(run)
    excerpt = _excerpt(run.measurements)
    return [_judge(name, run, start, excerpt) for name in fusion.available()]


def _judge(name: str, run: Run, start: Prior, excerpt: Sequence[Measurement]) -> Usability:
    try:
        estimator = fusion.build(name, run.world)
        updates = list(track(estimator, run.world, excerpt, start))
    except FusionError as error:
        return Usability(name, (str(error),))
    except Exception as error:  # noqa: BLE001 - a stranger's class may break anything
        return Usability(name, (f"it fails: {error!r}",))
    fates = [] if Tag.NO_RADIO in estimator.tags else _radio_fates(updates)
    used = sum(fate.decision in ENTERED for fate in fates)
    refused = Counter(fate.reason.value for fate in fates if fate.decision not in ENTERED)
    lacks = (*_missing_start(estimator, start), *_missing_data(estimator, run.measurements, used))
    return Usability(name, lacks, len(fates), used, tuple(refused.most_common()))


def _missing_start(estimator: Estimator[Any], start: Prior) -> Iterator[str]:
    if not start.position_known and Tag.GLOBAL_START not in estimator.tags:
        yield "the start position is unknown"
    if not start.heading_known and not {Tag.HEADING_START, Tag.NO_HEADING} & estimator.tags:
        yield "the start heading is unknown"


def _missing_data(estimator: Estimator[Any], measurements: Sequence[Measurement], used: int) -> Iterator[str]:
    if Tag.NO_RADIO in estimator.tags:
        if not any(isinstance(measurement, Odometry | WheelTicks) for measurement in measurements):
            yield "no odometry"
    elif not any(isinstance(measurement, Radio) for measurement in measurements):
        yield "no radio readings"
    elif not used:
        yield "no reading of the replay enters it"


def _radio_fates(updates: Sequence[Update]) -> list[Fate]:
    """Fates of the readings, each once: an update that was revised counts for the first one."""
    own = (update for update in updates if not update.revised and isinstance(update.measurement, Radio))
    return [fate for update in own for fate in update.fates]


def _excerpt(measurements: Sequence[Measurement]) -> Sequence[Measurement]:
    """The beginning of a run: up to enough radio messages, and to the first one however late it comes."""
    scans = [i + 1 for i, measurement in enumerate(measurements) if isinstance(measurement, Radio)][:SCANS]
    return measurements[: max(scans[0], min(scans[-1], MESSAGES)) if scans else MESSAGES]
