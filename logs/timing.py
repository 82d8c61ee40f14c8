"""Times of the messages of one sensor, and their faults: gaps, disorder, duplicates, lateness, clock jumps.

Two clocks are compared: the stamp is when a measurement was true, the log time when it arrived. A message that is
late comes back to the usual delay with the next one; after a jump of a clock the delay stays another.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fusion.arrays import Stamps, Whole
from fusion.values import nanoseconds, seconds

GAP_PERIODS = 3
"""A pause longer than this many usual periods is a gap."""
JUMP_NS = nanoseconds(0.1)
"""Least change of the delay that counts as a jump of a clock."""
JUMP_MESSAGES = 10
"""So many messages before a jump and after it must all agree; of delays without any order two in 185 000 places do."""


class Stream(NamedTuple):
    """The messages of one sensor in the order they stand in the file: stamps and log times [ns], numbers, each (n,)."""

    stamps: Stamps
    arrivals: Stamps
    numbers: Whole

    def timing(self, start_ns: int) -> dict[str, Any]:
        """The same as plain values: [s] and [Hz], places in seconds after ``start_ns``."""
        ordered = np.sort(self.stamps)
        gaps = np.diff(ordered)
        arrived = self.stamps[np.argsort(self.arrivals, kind="stable")]
        period_ns = float(np.median(gaps)) if len(gaps) else 0.0
        span_s = seconds(int(ordered[-1] - ordered[0]))
        longest = int(np.argmax(gaps)) if len(gaps) else 0
        return {
            "count": len(ordered),
            "rate_hz": (len(ordered) - 1) / span_s if span_s > 0.0 else None,
            "period_s": seconds(round(period_ns)),
            "longest_gap_s": seconds(int(gaps[longest])) if len(gaps) else 0.0,
            "longest_gap_at_s": seconds(int(ordered[longest]) - start_ns),
            "gaps": int(np.sum(gaps > GAP_PERIODS * period_ns)) if period_ns > 0.0 else 0,
            "out_of_order": int(np.sum(np.diff(arrived) < 0)),
            "duplicates": len(ordered) - len(np.unique(np.stack([self.stamps, self.numbers]), axis=1).T),
            "late_s": seconds(round(float(np.median(self._late)))),
            "latest_s": seconds(int(self._late.max())),
            "clock_jumps": [
                {"at_s": seconds(int(self.stamps[i]) - start_ns), "by_s": seconds(by_ns)} for i, by_ns in self.jumps()
            ],
            "log_time_backwards": int(np.sum(np.diff(self.arrivals) < 0)),
        }

    @property
    def _late(self) -> Whole:
        """Delay of each message [ns]."""
        return self.arrivals - self.stamps

    def jumps(self) -> list[tuple[int, int]]:
        """Changes of the delay that last: the first message after it, and by how much [ns]."""
        if len(self.stamps) < 2 * JUMP_MESSAGES:
            return []
        windows = np.lib.stride_tricks.sliding_window_view(self._late, JUMP_MESSAGES)
        before, after = windows[:-JUMP_MESSAGES], windows[JUMP_MESSAGES:]
        up, down = after.min(axis=1) - before.max(axis=1), before.min(axis=1) - after.max(axis=1)
        places = np.flatnonzero(np.maximum(up, down) >= JUMP_NS)
        return [(int(i) + JUMP_MESSAGES, round(float(np.median(after[i]) - np.median(before[i])))) for i in places]
