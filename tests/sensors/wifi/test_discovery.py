"""Interfaces are found with what this user may do."""

import errno
from pathlib import Path

import pytest

from sensors.wifi.discovery import discover, discover_ranging, may_scan
from sensors.wifi.nl80211_fake import FakeKernel
from sensors.wifi.nl80211_message import Command


def test_interfaces_are_found_with_what_this_user_may_do():
    (found,) = discover("about", FakeKernel())
    assert found.id == "wifi:02:00:00:00:00:00"
    assert found.settings["interface"] == "wlan0"
    assert ("mode" in found.settings) is not may_scan()
    assert "02:00:00:00:00:00" in found.about
    assert [one.id for one in discover_ranging("about", FakeKernel())] == ["wifi_rtt:02:00:00:00:00:00"]
    assert discover_ranging("about", FakeKernel(ranges=False)) == []


def test_where_nothing_can_be_asked_nothing_is_found():
    kernel = FakeKernel(refusals={Command.GET_INTERFACE: errno.EIO})
    assert discover("about", kernel) == []
    assert discover_ranging("about", kernel) == []


@pytest.mark.parametrize(("mask", "may"), [("0000000000001000", True), ("000001ffffffffff", True), ("00000fff", False)])
def test_the_right_to_scan_is_read_from_the_process(tmp_path, mask, may):
    status = tmp_path / "status"
    status.write_text(f"Name:\tpython\nCapEff:\t{mask}\n")
    assert may_scan(status) is may
    assert not may_scan(Path(tmp_path / "none"))
