"""Simulated GPIO lines behind the kernel's real character device: what an encoder's ticks become."""

import errno
import select

import pytest

pytestmark = pytest.mark.kernel

PULSES = [3, 1, 4, 2]
UNREAD, BUFFER = 1550, 1024


@pytest.mark.usefixtures("gpio")
def test_each_line_counts_its_own_edges_even_those_nobody_read(run_job):
    """Of 1550 unread edges the kernel keeps the last 1024, but the number of the last one tells of them all."""
    seen = run_job("gpio_edges", pulses=PULSES, unread=UNREAD).answer
    lines = [line for line, times in enumerate(PULSES) for _ in range(times)]
    own = [number for times in PULSES for number in range(1, times + 1)]
    assert seen["read"] == [[line, number, n] for number, (line, n) in enumerate(zip(lines, own, strict=True), 1)]
    last = PULSES[0] + UNREAD
    assert seen["kept"] == [last - BUFFER + 1, last, BUFFER]
    assert seen["times rise"]
    assert seen["errno of a second owner"] == errno.EBUSY
    assert seen["poll after loss"] == select.POLLERR | select.POLLHUP
    assert seen["errno after loss"] == errno.ENODEV
