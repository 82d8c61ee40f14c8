"""From the kernel's list to stamped readings."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sensors.wifi.nl80211_message import Command, Message, decode
from sensors.wifi.reading import (
    FRAME_STD_NS,
    Part,
    ScanEntry,
    Stamp,
    Window,
    betrays_end_stamping,
    fresh,
    read_entries,
    read_ssid,
    stamped,
)

MS = 1_000_000
RECORDINGS = Path(__file__).resolve().parents[4] / "shared" / "data" / "wifi"
RECORDED = RECORDINGS / "nl80211_get_scan_hwsim_3ap_pos1_1.hex"


def heard(time_ns, frequency_mhz=2412, bssid="02:00:00:00:01:00", *, is_exact=True):
    return ScanEntry(bssid, "ap", frequency_mhz, -50.0, time_ns, is_exact)


def listed(**bss):
    return Message(Command.NEW_SCAN_RESULTS, {"IFINDEX": 3, "BSS": bss})


@pytest.fixture
def recorded():
    """A reply of a real kernel (Debian's 6.1) to GET_SCAN, three access points on simulated radios."""
    if not RECORDED.is_file():
        pytest.skip(f"no recording {RECORDED.name}")
    lines = RECORDED.read_text().splitlines()
    return [one for line in lines if line.startswith("MSG ") for one in decode(bytes.fromhex(line[4:]))]


def test_a_real_kernels_reply_is_read(recorded):
    found = read_entries(recorded, 15_000_000_000)
    assert found == [
        ScanEntry("02:00:00:00:01:00", "ap1", 2412, -23.0, 11279460612, is_exact=True),
        ScanEntry("02:00:00:00:02:00", "ap2", 2437, -36.0, 11375930280, is_exact=True),
        ScanEntry("02:00:00:00:03:00", "ap3", 2462, -34.0, 11577868164, is_exact=True),
    ]


def test_the_real_reply_is_stale_for_a_scan_that_began_after_it(recorded):
    """It was dumped three seconds after its scan: whoever begins now must not take it for fresh."""
    window = Window(14_000_000_000, 14_500_000_000)
    assert fresh(read_entries(recorded, 15_000_000_000), window, 15_000_000_000) == Part(window, (), 3)


def test_without_a_boot_time_the_age_is_counted_back():
    (one,) = read_entries([listed(BSSID=bytes(6), FREQUENCY=2412, SIGNAL_MBM=-5050, SEEN_MS_AGO=250)], 1000 * MS)
    assert (one.time_ns, one.is_exact, one.rssi_dbm) == (750 * MS, False, -50.5)


def test_an_entry_without_strength_or_address_is_left_out():
    whole = {"BSSID": bytes(6), "FREQUENCY": 2412, "SIGNAL_MBM": -5000, "LAST_SEEN_BOOTTIME": 5}
    for missing in ("BSSID", "FREQUENCY", "SIGNAL_MBM"):
        assert read_entries([listed(**{k: v for k, v in whole.items() if k != missing})], 10) == []
    assert read_entries([Message(Command.NEW_SCAN_RESULTS, {"IFINDEX": 3})], 10) == []


@pytest.mark.parametrize(
    ("elements", "ssid"),
    [
        (b"\x00\x03ap1\x01\x01\x82", "ap1"),
        (b"\x01\x01\x82\x00\x03ap1", "ap1"),
        (b"\x00\x00", ""),
        (b"\x00\x05\0\0\0\0\0", ""),
        (b"\x00\x09ap", "ap"),
        (b"\x00\x02\xff\xfe", "\ufffd\ufffd"),
        (b"", ""),
        (b"\x01", ""),
    ],
)
def test_a_network_s_name_is_found_wherever_it_stands(elements, ssid):
    assert read_ssid(elements) == ssid


@given(st.binary(max_size=100))
def test_any_elements_have_some_name(elements):
    assert isinstance(read_ssid(elements), str)


def test_only_what_was_heard_in_the_window_counts():
    window = Window(1000 * MS, 1400 * MS)
    times = (900 * MS, 985 * MS, 1200 * MS, 1400 * MS, 1500 * MS, 1600 * MS)
    part = fresh([heard(time_ns) for time_ns in times], window, 1500 * MS)
    assert [one.time_ns for one in part.entries] == [985 * MS, 1200 * MS, 1400 * MS, 1500 * MS]
    assert part.refused == 2, "one from before, one from the future"


def test_a_frame_s_stamp_is_kept_and_a_scan_s_end_becomes_the_middle_of_its_window():
    part = Part(Window(0, 1200 * MS), (heard(300 * MS), heard(100 * MS)), 0)
    assert [(one.time_ns, one.std_ns) for one in stamped(part, Stamp.FRAME)] == [
        (100 * MS, FRAME_STD_NS),
        (300 * MS, FRAME_STD_NS),
    ]
    late = Part(Window(0, 1200 * MS), (heard(1200 * MS), heard(1200 * MS, 2437)), 0)
    assert {one.time_ns for one in stamped(late, Stamp.SCAN_END)} == {600 * MS}
    assert {one.std_ns for one in stamped(late, Stamp.SCAN_END)} == {round(1200 * MS / math.sqrt(12.0))}


@given(st.integers(1, 10**11), st.integers(0, 10**15))
def test_the_doubt_of_a_scan_end_reaches_both_ends_of_its_window(length_ns, began_ns):
    """A uniform distribution ends at sqrt(3) of its standard deviations."""
    window = Window(began_ns, began_ns + length_ns)
    (one,) = stamped(Part(window, (heard(window.done_ns),), 0), Stamp.SCAN_END)
    for end_ns in window:
        assert abs(abs(end_ns - one.time_ns) - math.sqrt(3.0) * one.std_ns) <= 2.0


@pytest.mark.parametrize(
    ("found", "betrays"),
    [
        ([heard(0), heard(100 * MS, 2437)], False),
        ([heard(0), heard(MS, 2437)], True),
        ([heard(0), heard(MS, bssid="02:00:00:00:09:00")], False),
        ([heard(0, is_exact=False)], True),
        ([heard(0)], False),
        ([], False),
    ],
)
def test_two_channels_heard_at_once_betray_a_device_that_stamps_at_the_end(found, betrays):
    assert betrays_end_stamping(Part(Window(0, 1), tuple(found), 0)) is betrays
