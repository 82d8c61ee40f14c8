"""Times of the messages of one sensor: gaps, twins, delays and jumps of the clock."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from logs.timing import JUMP_MESSAGES, JUMP_NS, Stream

SECOND = 1_000_000_000


def stream(stamps, delays, numbers=None):
    stamps = np.array(stamps, dtype=np.int64)
    arrivals = stamps + np.array(delays, dtype=np.int64)
    return Stream(stamps, arrivals, np.arange(len(stamps)) if numbers is None else np.array(numbers))


@settings(derandomize=True)
@given(st.integers(2 * JUMP_MESSAGES, 60), st.lists(st.integers(0, JUMP_NS // 2), min_size=60, max_size=60))
def test_regular_stream_with_any_small_delay_has_nothing_odd(count, delays):
    timing = stream([i * SECOND for i in range(count)], delays[:count]).timing(0)
    assert (timing["rate_hz"], timing["period_s"], timing["gaps"], timing["longest_gap_s"]) == (1.0, 1.0, 0, 1.0)
    assert (timing["duplicates"], timing["out_of_order"], timing["clock_jumps"]) == (0, 0, [])
    assert timing["latest_s"] == max(delays[:count]) / SECOND


@settings(derandomize=True)
@given(
    st.integers(4 + JUMP_MESSAGES, 50),
    st.sampled_from([-3600.0, -5.0, -0.2, 0.2, 5.0, 1e6]),
    st.lists(st.integers(0, JUMP_NS // 2), min_size=60, max_size=60),
)
def test_clock_jump_is_found_where_it_is_and_a_late_message_is_none(place, jump_s, delays):
    """The log time steps by ``jump_s`` before the message at ``place``; one well before comes half an hour late."""
    jumped = [delay + (round(jump_s * SECOND) if i >= place else 0) for i, delay in enumerate(delays)]
    jumped[3] += 1800 * SECOND
    ((at, by_ns),) = stream([i * SECOND for i in range(60)], jumped).jumps()
    assert at == place
    assert abs(by_ns - jump_s * SECOND) <= JUMP_NS / 2


def test_short_stream_has_no_jump():
    assert stream(range(19), [0] * 10 + [SECOND] * 9).jumps() == []


def test_gaps_are_counted_and_placed_and_twins_are_counted():
    timing = stream([0, 1, 2, 3, 10, 11, 12, 20, 20, 21], [0] * 10, [0, 1, 2, 3, 4, 5, 6, 7, 7, 8]).timing(0)
    assert (timing["gaps"], timing["duplicates"]) == (2, 1)
    assert (timing["longest_gap_s"], timing["longest_gap_at_s"]) == (8e-9, 12e-9)
