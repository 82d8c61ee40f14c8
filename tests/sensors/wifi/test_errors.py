"""Every errno of a Wi-Fi kernel has its error and a hint that can be typed."""

import errno
import os

import pytest

from fusion.errors import DeviceLostError, NotFoundError
from sensors.wifi.errors import FIRMWARE, PASSING, REFUSALS, lost, refused, stuck


def refusal(code, words=None):
    return refused(
        OSError(code, os.strerror(code) if words is None else words), "wlan7", "a scan of (2412,) MHz", "drv"
    )


@pytest.mark.parametrize("code", [*REFUSALS, errno.EPROTO, 9999], ids=lambda code: errno.errorcode.get(code, str(code)))
def test_every_refusal_is_told_whole(code):
    error = refusal(code)
    assert error.hint
    assert "{" not in str(error), "a place that was not filled"
    assert "(the kernel:" not in error.what, "nothing new"


def test_what_passes_and_what_needs_a_person():
    """By the table of measured answers: a robot waits for the first four, and stops for the others."""
    passes = {code for code in REFUSALS if refusal(code).passes}
    assert passes == {errno.ENODEV, errno.ENETDOWN, errno.EBUSY, errno.EAGAIN, errno.EIO, errno.ETIMEDOUT}
    assert not stuck("wlan7", "brcmfmac", 3, "x").passes
    assert not PASSING & FIRMWARE


def test_the_kernel_s_own_words_are_passed_on():
    error = refusal(errno.EINVAL, "FTMs per burst must be set lower than the device limit but non-zero")
    assert "(the kernel: FTMs per burst" in error.what


def test_the_names_in_the_hints_are_those_of_the_device():
    assert "nmcli dev set wlan7 managed no" in refusal(errno.EBUSY).hint
    assert "ip link set wlan7 up" in refusal(errno.ENETDOWN).hint
    assert "modprobe -r brcmfmac && modprobe brcmfmac" in stuck("wlan7", "brcmfmac", 3, "x").hint


def test_what_was_there_is_lost_and_not_absent():
    gone = refusal(errno.ENODEV)
    assert isinstance(gone, NotFoundError)
    assert isinstance(lost(gone), DeviceLostError)
    busy = refusal(errno.EBUSY)
    assert lost(busy) is busy
