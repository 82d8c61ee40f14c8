"""Losses of a damaged file, in numbers and in one sentence: bytes, and seconds of the run.

Bytes can be counted. Seconds can only be bounded: a hole lies between the last stamp before it and the first one after
it. What followed the end of a file that was cut off stands nowhere, but a writer that is known to flush each second
loses no more than that when it is killed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from fusion.values import seconds

NAMED = 3
"""Holes named one by one in a sentence; of more only the number is stated."""


class Hole(NamedTuple):
    """Bytes from ``start`` up to ``end`` of a file that cannot be used, why, and what is known of their time: the last
    stamp kept before, the first one kept after (both log time [ns]). For a hole that the file ends with, ``until_ns``
    is None, and ``stated_ns`` the time of the last message by the head of a half written chunk.
    """

    start: int
    end: int
    why: str
    from_ns: int | None
    until_ns: int | None = None
    stated_ns: int | None = None

    @property
    def seconds(self) -> float | None:
        """The most that this hole can have taken; None where a side of it is open."""
        if self.from_ns is None or self.until_ns is None:
            return None
        return seconds(max(self.until_ns - self.from_ns, 0))


class Damage(NamedTuple):
    """Everything that is wrong with a file of ``size`` bytes."""

    size: int
    holes: Sequence[Hole]
    finished: bool
    """The end of the messages was reached: nothing can be missing behind the last hole."""
    indexed: bool
    """The index at the end of the file is whole."""
    missing: int | None
    """Messages that the file's own statistics count and that are not there; None where there are none."""
    first_ns: int | None
    """First stamp kept (log time); seconds in sentences count from here."""
    writer: str
    flush_ns: int | None
    """Period at which the writer hands over what it has to the system; None for one that is not known to."""

    @property
    def is_lossy(self) -> bool:
        """Whether a message may be lost; an index alone can be built anew."""
        return bool(self.holes) or not self.finished or bool(self.missing)

    @property
    def bytes_dropped(self) -> int:
        """Bytes of records and half records that cannot be used."""
        return sum(hole.end - hole.start for hole in self.holes)

    @property
    def seconds_lost(self) -> float | None:
        """The most that is lost [s], for a cut-off log if its recorder stopped there; None: not known."""
        bounds = [self._bound(hole) for hole in self.holes]
        return None if None in bounds else sum((bound for bound in bounds if bound is not None), 0.0)

    def _bound(self, hole: Hole) -> float | None:
        if hole is self._tail and self.flush_ns is not None and hole.from_ns is not None:
            return seconds(max(self.flush_ns, (hole.stated_ns or 0) - hole.from_ns))
        return hole.seconds

    @property
    def _tail(self) -> Hole | None:
        return None if self.finished or not self.holes else self.holes[-1]

    def __str__(self) -> str:
        """One sentence; empty for a file that is whole."""
        if not self.is_lossy:
            return "" if self.indexed else "its index is cut off or damaged, but no message is lost"
        what = []
        if self.bytes_dropped:
            why = ", ".join(dict.fromkeys(hole.why for hole in self.holes if hole.end > hole.start))
            what.append(f"{self.bytes_dropped} of its {self.size} bytes cannot be read ({why})")
        if self.missing:
            what.append(f"{self.missing} messages that its index counts are lost")
        inner = [hole for hole in self.holes if hole is not self._tail]
        what += [self._between(hole) for hole in inner] if len(inner) <= NAMED else [self._many(inner)]
        what += [self._after(self._tail)] if self._tail else []
        return ("cut off: " if self._tail else "damaged: ") + "; ".join(what)

    def record(self) -> dict[str, Any]:
        """The same as plain values: times in seconds since the first stamp kept, None where not known."""
        return {
            "damage": str(self),
            "bytes": self.size,
            "bytes_dropped": self.bytes_dropped,
            "seconds_lost_at_most": self.seconds_lost,
            "messages_missing": self.missing,
            "finished": self.finished,
            "index_whole": self.indexed,
            "holes": [
                {
                    "start_byte": hole.start,
                    "end_byte": hole.end,
                    "why": hole.why,
                    "from_s": self._since(hole.from_ns),
                    "until_s": self._since(hole.until_ns),
                    "stated_s": self._since(hole.stated_ns),
                }
                for hole in self.holes
            ],
        }

    def _since(self, time_ns: int | None) -> float | None:
        return None if time_ns is None or self.first_ns is None else seconds(time_ns - self.first_ns)

    def _at(self, time_ns: int | None) -> str:
        since_s = self._since(time_ns)
        return "?" if since_s is None else f"{since_s:.1f} s"

    def _between(self, hole: Hole) -> str:
        most = "an unknown time" if hole.seconds is None else f"at most {hole.seconds:.1f} s"
        return f"{most} lost between {self._at(hole.from_ns)} and {self._at(hole.until_ns)}"

    def _many(self, holes: Sequence[Hole]) -> str:
        bounds = [hole.seconds for hole in holes]
        most = "unknown times" if None in bounds else f"at most {sum(bound or 0.0 for bound in bounds):.1f} s"
        return f"{most} lost in {len(holes)} places"

    def _after(self, hole: Hole) -> str:
        where = f"after {self._at(hole.from_ns)}" if hole.from_ns is not None else "from the start"
        bound = self._bound(hole)
        if bound is not None:
            return f"at most {bound:.1f} s lost {where}, if the recorder stopped there (it flushes each second)"
        is_stated = hole.stated_ns is not None and hole.from_ns is not None
        least = f", at least {seconds((hole.stated_ns or 0) - (hole.from_ns or 0)):.1f} s" if is_stated else ""
        return f"an unknown time lost {where}{least}: its writer {self.writer!r} is not known to flush"
