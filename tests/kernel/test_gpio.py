"""Simulated GPIO lines behind the kernel's real character device: what an encoder's ticks become."""

import errno
import select

import pytest

pytestmark = pytest.mark.kernel

PULSES = [3, 1, 4, 2]
UNREAD, BUFFER = 1550, 1024
REFUSALS = {
    "second owner": "BusyError",
    "line that is not there": "SettingError",
    "chip that is not there": "NotFoundError",
    "unplugged": "DeviceLostError",
    "while unplugged": "NotFoundError",
}


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


@pytest.mark.usefixtures("gpio")
def test_the_encoders_driver_keeps_distance_through_everything_and_says_what_happened(run_job):
    """526 of 1550 edges fell out of the kernel's buffer; the chip was away between the last two counts."""
    seen = run_job("encoders_driver", pulses=PULSES, unread=UNREAD).answer
    (chip,) = seen["found"]
    assert seen["opened"] == {"chip": chip, "lines": [0, 1, 2, 3], "hz": 20.0, "debounce_s": 0.0}
    assert seen["at rest"] == {"counts": [0, 0, 0, 0], "diagnostics": []}
    assert seen["turned"] == {"counts": PULSES, "diagnostics": []}
    assert seen["held up"]["counts"] == [PULSES[0] + UNREAD, *PULSES[1:]]
    assert [diagnostic["edges"] for diagnostic in seen["held up"]["diagnostics"]] == [str(UNREAD - BUFFER)]
    assert seen["plugged again"] == {
        "counts": [2 * PULSES[0] + UNREAD, *(2 * n for n in PULSES[1:])],
        "diagnostics": [],
    }
    for what, kind in REFUSALS.items():
        assert seen[what][0] == kind, what
    assert "gpioinfo" in seen["second owner"][1]
    assert seen["after the first owner"] == []
