"""UWB modules are read by tokens, whatever their lines look like; the port beneath fails with a remedy."""

import os
from contextlib import ExitStack

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusion import (
    BootClock,
    BusyError,
    DeviceLostError,
    Diagnostic,
    Level,
    NotFoundError,
    NotPermittedError,
    ProtocolError,
    RangeReading,
    Ranges,
    SettingError,
    VirtualClock,
)
from sensors.uwb import dwm1001 as uwb_dwm1001
from sensors.uwb import lines as uwb_lines
from sensors.uwb import qm33 as uwb_qm33
from sensors.uwb.dwm1001 import FakeShell, UwbDwm1001
from sensors.uwb.fake_serial import fake_serial
from sensors.uwb.lines import UwbLines
from sensors.uwb.qm33 import Frames, UwbQm33
from sensors.uwb.serial_port import LONGEST_LINE, Line, LineReader, opening_error


def heard(driver, wanted, tries=100):
    said = []
    for _ in range(tries):
        said += driver.poll(0.05)
        if any(isinstance(one, wanted) for one in said):
            return said
    return said


# The documented forms of the three modules.


@pytest.mark.parametrize(
    ("line", "ranges", "refused"),
    [
        ("DIST,1,AN0,0A1B,0.00,0.00,0.00,1.25", (("0A1B", 1.25, None),), 0),
        ("DIST,2,AN0,0a1b,0.00,0.00,0.00,1.25,AN1,15BA,4.00,0.00,1.10,2.50,POS,1.00,2.00,0.10,77",
         (("0A1B", 1.25, None), ("15BA", 2.5, None)), 0),
        ("DIST,2,AN0,0A1B,0.00,0.00,0.00,1.25,AN3,15BA,0.00,0,AN3,15BA,0.00,0.00,0.00,3.00",
         (("0A1B", 1.25, None), ("15BA", 3.0, None)), 1),
        ("DIST,4,AN0,0A1B,0.00,0.00,0.00,1.25", (("0A1B", 1.25, None),), 0),
        ("DIST,1,AN0,0A1B,0.00,0.00,0.00", (), 1),
        ("POS,1.00,2.00,0.10,77", (), 0),
        ("0A1B[0.00,0.00,0.00]=1.25 15BA[4.00,0.00,1.10]=2.50 le_us=2345 est[1.00,2.00,0.10,77]",
         (("0A1B", 1.25, None), ("15BA", 2.5, None)), 0),
        ("0A1B[0.00,0.00,0.00]=1.25 15BA[4.00,0.0", (("0A1B", 1.25, None),), 0),
        ("dwm> lec", (), 0),
        ("@@@", (), 1),
    ],
)  # fmt: skip
def test_a_dwm1001_line_is_read_by_tokens(line, ranges, refused):
    said = uwb_dwm1001.parse(line)
    assert (said.ranges, said.refused) == (ranges, refused)


def test_a_dwm1001_tells_its_own_position_apart():
    values = dict(uwb_dwm1001.parse("DIST,1,AN0,0A1B,4.00,5.00,1.10,1.25,POS,1.00,2.00,0.10,77").values)
    assert values == {"place 0A1B": "4.00,5.00,1.10", "position": "1.00,2.00,0.10,77"}


FRAME = """SESSION_INFO_NTF: {session_handle=1, sequence_number=7, block_index=7, n_measurements=3
 [mac_address=0x0001, status="SUCCESS", distance[cm]=29, loc_az_pdoa=1.5, RSSI[dBm]=-70.5];
 [mac_address=0x0002, status="RX_TIMEOUT"]
 [mac_address=0x00A3, status="SUCCESS", distance[cm]=1234]}"""


@pytest.mark.parametrize("text", [FRAME, FRAME.replace("\n", " ")])
def test_a_qm33_notification_spans_lines_or_stands_in_one(text):
    frames = Frames()
    found = [frame for i, line in enumerate(text.splitlines()) for frame in frames.feed(Line(i, line))]
    assert [(time_ns, is_whole) for time_ns, _, is_whole in found] == [(0, True)]
    said = uwb_qm33.parse(found[0][1])
    assert said.ranges == (("0001", 0.29, None), ("00A3", 12.34, None))
    assert said.values == (("0002", "RX_TIMEOUT"),)
    assert said.refused == 0


def test_a_qm33_notification_that_breaks_off_costs_itself_alone():
    frames = Frames()
    lines = ["ok", FRAME.splitlines()[0], FRAME.splitlines()[1], *FRAME.splitlines()]
    found = [frame for i, line in enumerate(lines) for frame in frames.feed(Line(i, line))]
    assert [(time_ns, is_whole) for time_ns, _, is_whole in found] == [(1, False), (3, True)]
    endless = [
        frame for i in range(5000) for frame in frames.feed(Line(i, "SESSION_INFO_NTF: {" if i == 0 else "x" * 10))
    ]
    assert [is_whole for _, _, is_whole in endless] == [False]


def test_lost_qm33_notifications_are_counted_by_their_numbers():
    with UwbQm33.fake() as device:
        driver = UwbQm33("uwb", device.clock, **device.settings)
        driver.open()
        for number in (7, 8, 12):
            device._send(FRAME.replace("number=7", f"number={number}").replace("\n", "\r\n").encode() + b"\r\n")
        said = []
        while sum(isinstance(one, Ranges) for one in said) < 3:
            said += driver.poll(0.1)
        driver.close()
    lost = [dict(one.values).get("notifications lost") for one in said if isinstance(one, Diagnostic)]
    assert [count for count in lost if count] == ["3"]


@pytest.mark.parametrize(
    ("line", "ranges", "refused"),
    [
        ("R,0x1a,3.417", (("0x1a", 3.417, None),), 0),
        ("R,0x1a,3.417;0x2b,5.02,0.1", (("0x1a", 3.417, None), ("0x2b", 5.02, 0.1)), 0),
        ("R,a,-1;b,nan;c,inf;d,1e9;e,2", (("e", 2.0, None),), 4),
        ("R,a,1,0;b,1,-0.1;,3;b,1,2,3", (), 4),
        ("R", (), 1),
        ("X,1", (), 1),
        ("# booting", (), 0),
    ],
)
def test_plain_lines(line, ranges, refused):
    said = uwb_lines.parse(line)
    assert (said.ranges, said.refused) == (ranges, refused)


@given(st.one_of(st.text(), st.text(alphabet='DISTANPOR,;#[]=.0123456789abf{}\n"')))
def test_no_text_makes_a_parser_fail_or_invent_a_range(text):
    frames = Frames()
    for parse in (uwb_dwm1001.parse, uwb_lines.parse, uwb_qm33.parse):
        for _, range_m, std_m in parse(text).ranges:
            assert 0.0 <= range_m <= 1000.0
            assert std_m is None or std_m > 0.0
    list(frames.feed(Line(0, text)))


# Lines and ports.


@given(st.lists(st.binary(max_size=60), max_size=20))
def test_lines_do_not_depend_on_how_their_bytes_arrive(pieces):
    data = b"".join(pieces)
    apart, together = LineReader(VirtualClock()), LineReader(VirtualClock())
    one_by_one = [line.text for piece in pieces for line in apart.feed(piece)]
    assert one_by_one == [line.text for line in together.feed(data)]


def test_a_line_is_stamped_at_its_first_byte():
    clock = VirtualClock(100)
    reader = LineReader(clock)
    assert list(reader.feed(b"one\ntw")) == [Line(100, "one")]
    clock.sleep(1.0)
    assert list(reader.feed(b"o\nthree\n")) == [Line(100, "two"), Line(1_000_000_100, "three")]


def test_a_line_without_an_end_is_given_up_and_counted():
    reader = LineReader(VirtualClock())
    assert list(reader.feed(b"x" * (LONGEST_LINE + 1))) == []
    assert reader.overlong == 1
    assert [line.text for line in reader.feed(b"R,a,1\n")] == ["R,a,1"]


@pytest.mark.parametrize(
    ("number", "kind", "hint"),
    [
        (2, NotFoundError, "plug it in"),
        (19, NotFoundError, "plug it in"),
        (13, NotPermittedError, "dialout"),
        (16, BusyError, "fuser"),
        (11, BusyError, "fuser"),
        (25, NotFoundError, "no serial port"),
        (5, DeviceLostError, "cable"),
    ],
)
def test_every_refusal_of_a_port_has_its_remedy(number, kind, hint):
    error = opening_error("/dev/ttyX", OSError(number, os.strerror(number)))
    assert type(error) is kind
    assert hint in str(error)
    assert "/dev/ttyX" in str(error)


def test_two_owners_of_one_port_are_told_so():
    with UwbLines.fake() as device, ExitStack() as stack:
        first, second = (UwbLines(name, device.clock, **device.settings) for name in "ab")
        stack.callback(first.close)
        first.open()
        with pytest.raises(BusyError, match="stop the other program"):
            second.open()


def test_unplugged_before_opening_while_reading_and_never_there():
    with UwbLines.fake() as device:
        driver = UwbLines("uwb", device.clock, **device.settings)
        driver.open()
        device.unplug()
        with pytest.raises(DeviceLostError, match="plug it in again"):
            heard(driver, Ranges)
        with pytest.raises(NotFoundError):
            driver.open()
        device.plug()
        driver.open()
        device.speak()
        assert heard(driver, Ranges)
        driver.close()
    with pytest.raises(DeviceLostError, match="not open"):
        driver.poll(0.0)


def test_names_and_deviations_are_those_of_the_settings():
    with UwbLines.fake() as device:
        driver = UwbLines("uwb", device.clock, **device.settings, names={"a": "door"}, std_m=0.2)
        driver.open()
        device.speak()
        ranges = next(one for one in heard(driver, Ranges) if isinstance(one, Ranges))
        driver.close()
    assert ranges.readings == (RangeReading("door", 3.41, 0.2), RangeReading("b", 5.02, 0.1))


def test_the_start_command_is_sent():
    class Waiting:
        reports = False

        def answer(self, data):
            return b"R,a,1.5\n" if data == b"go\r\n" else b"?\n"

    with fake_serial(b"", b"", Waiting()) as device:
        driver = UwbLines("uwb", device.clock, **device.settings, start="go")
        driver.open()
        assert heard(driver, Ranges)
        driver.close()


@pytest.mark.parametrize("settings", [{"hz": 0.5}, {"least_hz": 0.0}, {"std_m": 0.0}, {"std_m": -1.0}])
def test_settings_that_cannot_be_are_refused(settings):
    with pytest.raises(SettingError):
        UwbLines("uwb", BootClock(), port="/dev/x", **settings)


# The shell of the DWM1001.


def test_a_dwm1001_that_reports_already_is_not_switched_off():
    shell = FakeShell()
    with fake_serial(b"DIST,1,AN0,0A1B,0.00,0.00,0.00,1.25\r\n", b"", shell) as device:
        first = UwbDwm1001("uwb", device.clock, **device.settings)
        first.open()
        assert shell.reports
        first.close()
        again = UwbDwm1001("uwb", device.clock, **device.settings)
        again.open()
        assert shell.reports
        assert heard(again, Ranges)
        again.close()


def test_what_is_no_dwm1001_is_told_so_and_leaves_the_port_free(monkeypatch):
    monkeypatch.setattr(uwb_dwm1001, "ANSWER_S", 0.1)
    with fake_serial(b"", b"") as device:
        driver = UwbDwm1001("uwb", device.clock, **device.settings)
        with pytest.raises(ProtocolError, match="no DWM1001 shell answers"):
            driver.open()
        other = UwbLines("uwb", device.clock, **device.settings)
        other.open()
        other.close()


def test_a_diagnostic_shows_the_line_that_nobody_understands():
    with UwbLines.fake() as device:
        driver = UwbLines("uwb", device.clock, **device.settings)
        driver.open()
        device.garble()
        diagnostic = next(one for one in heard(driver, Diagnostic) if isinstance(one, Diagnostic))
        driver.close()
    assert diagnostic.level is Level.WARN
    assert dict(diagnostic.values)["line"].startswith("R,a,")
