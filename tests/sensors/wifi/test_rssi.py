"""The driver `wifi` on a stand-in kernel and a virtual clock: what it measures, and how it stands what goes wrong."""

import errno
import math
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.driver import Diagnostic, Level
from fusion.errors import (
    BusyError,
    DependencyError,
    DeviceLostError,
    DriverError,
    NotFoundError,
    NotPermittedError,
    SettingError,
    UnsupportedError,
)
from fusion.values import WifiScan, nanoseconds, seconds
from sensors.onboard.driver_lifecycle import DriverLifecycle, State
from sensors.wifi.discovery import discover, discover_ranging, may_scan
from sensors.wifi.loop import FAILURES_TO_STUCK
from sensors.wifi.nl80211_fake import INDEX, WIPHY, FakeKernel, three_access_points
from sensors.wifi.nl80211_message import Command, Message, encode
from sensors.wifi.reading import MARGIN_NS
from sensors.wifi.report import Report, Stamp
from sensors.wifi.rssi import Wifi

ONE, TWO, THREE = (f"02:00:00:00:0{k}:00" for k in (1, 2, 3))
POLL_S = 0.1


def wifi(kernel, **given):
    return Wifi("wifi", kernel.clock, device=kernel, **given)


def opened(kernel, **given):
    driver = wifi(kernel, **given)
    driver.open()
    return driver


def listen(driver, span_s, said=None):
    """All that is said in that time, added to ``said``; no poll may take longer than it was given."""
    clock, said = driver._clock, [] if said is None else said
    until_ns = clock.now_ns() + nanoseconds(span_s)
    while clock.now_ns() < until_ns:
        before_ns = clock.now_ns()
        said += driver.poll(POLL_S)
        assert clock.now_ns() - before_ns <= nanoseconds(POLL_S)
    return said


def scans(said):
    return [one for one in said if isinstance(one, WifiScan)]


def diagnostics(said, level=None):
    return [one for one in said if isinstance(one, Diagnostic) and level in (None, one.level)]


def asked(kernel, command):
    return [one.attributes for one in kernel.asked if one.command == command]


# -- measuring


def test_a_scan_has_every_access_point_with_its_age_and_the_diagnostic_states_how_it_came_about():
    kernel = FakeKernel()
    said = listen(opened(kernel, names={TWO: "shelf"}), 0.4)
    scan, diagnostic = said
    assert [(one.anchor, one.rssi_dbm, seconds(one.age_ns)) for one in scan.readings] == [
        (ONE, -23.0, 0.2),
        ("shelf", -36.0, 0.1),
        (THREE, -34.0, 0.0),
    ]
    assert (scan.time_ns, scan.sensor, scan.seq) == (nanoseconds(0.25), "wifi", 0)
    assert (diagnostic.level, diagnostic.time_ns) == (Level.OK, nanoseconds(0.3))
    assert dict(diagnostic.values) == {
        "scan": "0",
        "mode": "passive",
        "parts": "1",
        "frequencies_mhz": "2412 2437 2462",
        "trigger_ns": "0",
        "done_ns": "300000000",
        "stamp": "frame",
        "stamp_std_s": "0.0010",
        "stale": "0",
        "heard": f"{ONE}=ap1@2412 shelf=ap2@2437 {THREE}=ap3@2462",
    }


def test_a_scan_is_always_flushed_and_names_its_channels_alone():
    kernel = FakeKernel()
    listen(opened(kernel, frequencies_mhz=[2412, 2462]), 3.5)
    triggers = asked(kernel, Command.TRIGGER_SCAN)
    assert len(triggers) == 4, "one a second"
    assert all(one == {"IFINDEX": INDEX, "SCAN_FREQUENCIES": [2412, 2462], "SCAN_FLAGS": 2} for one in triggers)


def test_an_active_scan_asks_every_network_to_answer():
    kernel = FakeKernel()
    listen(opened(kernel, mode="active"), 0.4)
    assert asked(kernel, Command.TRIGGER_SCAN)[0]["SCAN_SSIDS"] == [b""]


def test_scanning_by_channel_gives_one_measurement_of_one_scan_for_each():
    kernel = FakeKernel()
    said = listen(opened(kernel, per_channel=True), 0.9)
    assert [one["SCAN_FREQUENCIES"] for one in asked(kernel, Command.TRIGGER_SCAN)] == [[2412], [2437], [2462]]
    (scan,), (diagnostic,) = scans(said), diagnostics(said)
    assert [one.anchor for one in scan.readings] == [ONE, TWO, THREE]
    assert dict(diagnostic.values)["parts"] == "3"


def test_only_anchors_with_a_name_are_kept_where_that_is_wished():
    (scan,) = scans(listen(opened(FakeKernel(), names={TWO: "shelf"}, only_named=True), 0.4))
    assert [one.anchor for one in scan.readings] == ["shelf"]


def test_a_scan_that_heard_nobody_is_told_and_no_measurement():
    kernel = FakeKernel(access_points={})
    said = listen(opened(kernel), 0.4)
    assert not scans(said)
    assert [one.text for one in diagnostics(said)] == ["heard 0 access points"]


def test_a_device_that_stamps_at_the_end_is_found_out_and_its_doubt_is_told():
    kernel = FakeKernel(stamps_at_end=True)
    said = listen(opened(kernel), 0.4)
    (scan,), (diagnostic,) = scans(said), diagnostics(said)
    assert {one.age_ns for one in scan.readings} == {0}
    assert scan.time_ns == nanoseconds(0.15), "the middle of the window"
    assert dict(diagnostic.values)["stamp"] == "scan_end"
    assert float(dict(diagnostic.values)["stamp_std_s"]) == pytest.approx(0.3 / math.sqrt(12.0), abs=1e-4)


def test_without_boot_times_the_doubt_is_the_window_s():
    kernel = FakeKernel(counts_age=True)
    (diagnostic,) = diagnostics(listen(opened(kernel), 0.4))
    assert dict(diagnostic.values)["stamp"] == "scan_end"


def test_scanning_by_channel_narrows_the_doubt_of_a_device_that_stamps_at_the_end():
    kernel = FakeKernel(stamps_at_end=True)
    (diagnostic,) = diagnostics(listen(opened(kernel, per_channel=True, stamp="scan_end"), 0.9))
    assert float(dict(diagnostic.values)["stamp_std_s"]) == pytest.approx(0.1 / math.sqrt(12.0), abs=1e-4)


@pytest.mark.parametrize(
    ("driver", "stamp", "expected"),
    [
        ("brcmfmac", "auto", Stamp.SCAN_END),
        ("brcmfmac", "frame", Stamp.FRAME),
        ("mac80211_hwsim", "auto", Stamp.FRAME),
        ("mac80211_hwsim", "scan_end", Stamp.SCAN_END),
    ],
)
def test_how_a_known_driver_stamps_is_known(driver, stamp, expected):
    report = Report("wifi", wifi(FakeKernel(), stamp=stamp)._settings)
    report.begin(driver)
    assert report.stamp is expected


def test_opening_says_which_radio_and_what_is_in_force():
    info = wifi(FakeKernel(), frequencies_mhz=[2412]).open()
    assert info.serial == "02:00:00:00:00:00"
    assert info.model == "Wi-Fi radio on phy0"
    assert info.settings["power_save"] == "on", "read from the device"
    assert (info.settings["mode"], info.settings["frequencies_mhz"]) == ("passive", (2412,))


# -- stale and foreign scans


def test_an_access_point_that_was_switched_off_is_gone_from_the_next_scan():
    kernel = FakeKernel()
    driver = opened(kernel)
    listen(driver, 0.4)
    del kernel.access_points[TWO]
    (scan,) = scans(listen(driver, 1.0))
    assert [one.anchor for one in scan.readings] == [ONE, THREE]


def test_what_the_kernel_remembers_from_before_a_foreign_scan_is_refused():
    kernel = FakeKernel()
    driver = opened(kernel, period_s=2.0)
    listen(driver, 1.0)
    del kernel.access_points[TWO]
    kernel.clock.sleep(0.9)
    kernel.scan_by_another()
    said = listen(driver, 2.0)
    borrowed = diagnostics(said)[0]
    assert dict(borrowed.values)["mode"] == "borrowed"
    assert dict(borrowed.values)["stale"] == "1"
    assert [one.anchor for one in scans(said)[0].readings] == [ONE, THREE]


def test_while_another_scans_the_driver_waits_for_that_end_and_asks_once():
    kernel = FakeKernel()
    kernel.scan_by_another(is_seen=False)
    driver = opened(kernel)
    assert len(asked(kernel, Command.TRIGGER_SCAN)) == 1, "refused: busy"
    said = listen(driver, 2.0)
    assert len(asked(kernel, Command.TRIGGER_SCAN)) == 2
    assert [dict(one.values)["mode"] for one in diagnostics(said)] == ["borrowed", "passive"]
    assert len(scans(said)[0].readings) == 3


def test_a_scan_on_another_interface_of_the_radio_is_waited_for_but_not_used():
    kernel = FakeKernel()
    kernel.scan_by_another((2412,), index=INDEX + 1)
    said = listen(opened(kernel), 0.5)
    assert [dict(one.values)["mode"] for one in diagnostics(said)] == ["passive"]
    assert dict(diagnostics(said)[0].values)["trigger_ns"] == str(nanoseconds(0.1)), "as soon as the radio was free"


def test_the_end_of_an_earlier_scan_is_not_taken_for_ours():
    class Racing(FakeKernel):
        """Somebody's scan is aborted just before ours begins."""

        def _scan(self, frequencies_mhz, index, *, is_seen=True):
            about = {"IFINDEX": INDEX, "WIPHY": WIPHY}
            self.emit(encode(Message(Command.SCAN_ABORTED, about), 28))
            super()._scan(frequencies_mhz, index, is_seen=is_seen)

    said = listen(opened(Racing()), 0.4)
    assert not diagnostics(said, Level.WARN)
    assert len(scans(said)) == 1


def test_somebody_s_scan_between_two_of_ours_changes_nothing():
    kernel = FakeKernel()
    driver = opened(kernel, period_s=5.0)
    listen(driver, 0.5)
    kernel.scan_by_another()
    assert not listen(driver, 2.0)
    assert len(scans(listen(driver, 3.0))) == 1


def test_other_interfaces_events_mean_nothing():
    kernel = FakeKernel()
    driver = opened(kernel, frequencies_mhz=[2412])
    kernel.emit(encode(Message(Command.NEW_SCAN_RESULTS, {"IFINDEX": 99, "WIPHY": 9}), 28))
    kernel.emit(encode(Message(Command.SCAN_ABORTED, {}), 28))
    kernel.emit(encode(Message(Command.NEW_INTERFACE, {"IFINDEX": INDEX}), 28))
    assert len(listen(driver, 0.3)) == 2


# -- listening


def test_who_listens_triggers_nothing_and_uses_what_others_scan():
    kernel = FakeKernel(refusals={Command.TRIGGER_SCAN: errno.EPERM})
    driver = opened(kernel, mode="listen")
    assert not listen(driver, 60.0)
    kernel.scan_by_another((2412, 2437))
    said = listen(driver, 1.0)
    assert [one.anchor for one in scans(said)[0].readings] == [ONE, TWO]
    assert dict(diagnostics(said)[0].values)["mode"] == "listen"
    assert not asked(kernel, Command.TRIGGER_SCAN)
    assert driver.spec.least_hz == 0.0, "no silence is too long"
    assert not driver.spec.needs.capabilities


def test_a_scan_whose_beginning_was_not_seen_counts_from_when_listening_began():
    kernel = FakeKernel()
    kernel.scan_by_another((2412, 2437, 2462), is_seen=False)
    kernel.clock.sleep(0.12)
    said = listen(opened(kernel, mode="listen"), 1.0)
    assert [one.anchor for one in scans(said)[0].readings] == [TWO, THREE], "the first was heard before"
    assert dict(diagnostics(said)[0].values)["stale"] == "1"


def test_without_the_right_to_scan_the_driver_says_what_gives_it():
    with pytest.raises(NotPermittedError, match="CAP_NET_ADMIN") as caught:
        wifi(FakeKernel(refusals={Command.TRIGGER_SCAN: errno.EPERM})).open()
    assert "AmbientCapabilities" in caught.value.hint
    assert 'mode = "listen"' in caught.value.hint


def test_without_the_right_to_scan_it_listens_where_that_is_allowed_and_tells():
    kernel = FakeKernel(refusals={Command.TRIGGER_SCAN: errno.EPERM})
    driver = wifi(kernel, or_listen=True)
    assert driver.spec.least_hz > 0.0
    assert driver.open().settings["mode"] == "listen"
    (told,) = listen(driver, 5.0)
    assert told.level is Level.WARN
    assert "listening" in told.text
    assert driver.spec.least_hz == 0.0
    kernel.scan_by_another()
    assert len(scans(listen(driver, 2.0))) == 1


# -- trouble


def test_an_aborted_scan_is_told_and_its_list_is_not_even_asked_for():
    kernel = FakeKernel(end=Command.SCAN_ABORTED)
    driver = opened(kernel)
    (told,) = listen(driver, 0.4)
    assert told.level is Level.WARN
    assert "aborted after 0.3 s" in told.text
    assert not asked(kernel, Command.GET_SCAN)
    kernel.end = Command.NEW_SCAN_RESULTS
    assert len(scans(listen(driver, 1.5))) == 1


def test_an_aborted_channel_costs_its_whole_round():
    kernel = FakeKernel()
    driver = opened(kernel, per_channel=True)
    listen(driver, 0.15)
    kernel.end = Command.SCAN_ABORTED
    assert not scans(listen(driver, 0.5))
    kernel.end = Command.NEW_SCAN_RESULTS
    (scan,) = scans(listen(driver, 1.6))
    assert len(scan.readings) == 3
    assert scan.readings[0].age_ns < nanoseconds(0.3)


def test_aborts_however_many_do_not_end_it():
    kernel = FakeKernel(end=Command.SCAN_ABORTED)
    driver = opened(kernel)
    assert len(diagnostics(listen(driver, 60.0), Level.WARN)) > 20


@pytest.mark.parametrize("code", [errno.EIO, errno.ETIMEDOUT])
def test_a_radio_that_does_not_answer_ends_in_a_call_for_a_person(code):
    kernel = FakeKernel(refusals={Command.TRIGGER_SCAN: code})
    driver = opened(kernel)
    with pytest.raises(UnsupportedError, match="3 times in a row") as caught:
        listen(driver, 60.0)
    assert "modprobe -r" in caught.value.hint
    assert not caught.value.passes, "the lifecycle must not try for ever"
    assert len(asked(kernel, Command.TRIGGER_SCAN)) == FAILURES_TO_STUCK


def test_scans_that_never_end_are_told_and_end_in_a_call_for_a_person():
    kernel = FakeKernel(end=None)
    driver = opened(kernel)
    said = []
    with pytest.raises(UnsupportedError, match="in a row"):
        listen(driver, 60.0, said)
    assert [one.text for one in said] == ["a scan did not end within 12 s"] * (FAILURES_TO_STUCK - 1)
    assert seconds(kernel.clock.now_ns()) == pytest.approx(38.0, abs=0.5)
    assert len(asked(kernel, Command.TRIGGER_SCAN)) <= FAILURES_TO_STUCK


def test_scans_that_the_firmware_itself_gives_up_end_so_too():
    kernel = FakeKernel(end=Command.SCAN_ABORTED, dwell_s=3.34)
    driver = opened(kernel)
    with pytest.raises(UnsupportedError, match=r"aborted after 10\.0 s"):
        listen(driver, 60.0)


def test_one_good_scan_forgives_the_failures_before_it():
    kernel = FakeKernel()
    driver = opened(kernel)
    for _ in range(4):
        kernel.refusals[Command.TRIGGER_SCAN] = errno.EIO
        listen(driver, 2.0)
        kernel.refusals[Command.TRIGGER_SCAN] = 0
        assert scans(listen(driver, 2.5))


def test_a_radio_that_another_keeps_busy_without_end_is_busy_and_the_hint_names_the_usual_one():
    kernel = FakeKernel(refusals={Command.TRIGGER_SCAN: errno.EBUSY})
    driver = opened(kernel)
    with pytest.raises(BusyError) as caught:
        listen(driver, 60.0)
    assert "nmcli dev set wlan0 managed no" in caught.value.hint
    assert seconds(kernel.clock.now_ns()) == pytest.approx(12.0, abs=0.2)
    assert len(asked(kernel, Command.TRIGGER_SCAN)) == 1


@pytest.mark.parametrize("code", [errno.EAGAIN, errno.ENOMEM, errno.ENOBUFS])
def test_what_may_pass_is_tried_again_a_second_later(code):
    kernel = FakeKernel(refusals={Command.TRIGGER_SCAN: code})
    driver = opened(kernel)
    assert len(diagnostics(listen(driver, 10.5), Level.WARN)) == 11
    assert len(asked(kernel, Command.TRIGGER_SCAN)) == 11


@pytest.mark.parametrize(
    ("code", "opening", "running"),
    [
        (errno.ENETDOWN, NotFoundError, DeviceLostError),
        (errno.ENODEV, NotFoundError, DeviceLostError),
        (errno.EINVAL, SettingError, SettingError),
        (errno.EPERM, NotPermittedError, NotPermittedError),
        (errno.EOPNOTSUPP, UnsupportedError, UnsupportedError),
        (errno.EPROTO, DeviceLostError, DeviceLostError),
    ],
)
def test_every_refusal_is_an_error_with_a_remedy(code, opening, running):
    kernel = FakeKernel(refusals={Command.TRIGGER_SCAN: code})
    with pytest.raises(opening) as caught:
        wifi(kernel).open()
    assert caught.value.hint
    kernel.refusals.clear()
    driver = opened(kernel)
    kernel.refusals[Command.TRIGGER_SCAN] = code
    with pytest.raises(running) as caught:
        listen(driver, 5.0)
    assert caught.value.hint


def test_a_link_that_is_down_is_cured_by_the_command_in_the_hint():
    with pytest.raises(NotFoundError, match="ip link set wlan0 up"):
        wifi(FakeKernel(refusals={Command.TRIGGER_SCAN: errno.ENETDOWN})).open()


def test_a_channel_the_card_lacks_is_named_with_its_nearest():
    with pytest.raises(SettingError, match="no channel at 2484 MHz; the nearest is 2472 MHz"):
        wifi(FakeKernel(), frequencies_mhz=[2412, 2484]).open()


def test_an_unknown_interface_is_answered_with_those_that_are_there():
    with pytest.raises(NotFoundError, match="did you mean 'wlan0'"):
        wifi(FakeKernel(), interface="wlan1").open()


def test_a_kernel_without_wifi_is_told_so():
    class Wired(FakeKernel):
        def open(self, groups):
            raise OSError(errno.ENOENT, "")

    with pytest.raises(UnsupportedError, match="no Wi-Fi"):
        wifi(Wired()).open()


def test_lost_events_are_told_and_survived():
    class Overrun(FakeKernel):
        overruns = 1

        def receive(self, timeout_s):
            if self.overruns and self.clock.now_ns() and timeout_s < 1.0:
                self.overruns -= 1
                raise OSError(errno.ENOBUFS, "")
            return super().receive(timeout_s)

    kernel = Overrun()
    kernel.clock.sleep(1.0)
    kernel.overruns = 0
    driver = opened(kernel)
    kernel.overruns = 1
    said = listen(driver, 0.5)
    assert "lost" in diagnostics(said, Level.WARN)[0].text
    assert len(scans(said)) == 1


def test_without_pyroute2_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyroute2", None)
    with pytest.raises(DependencyError, match="pip install") as caught:
        wifi(FakeKernel()).open()
    assert not caught.value.passes


def test_unplugged_in_the_middle_of_a_scan_it_is_lost_and_the_keeper_brings_it_back_with_one_word_each_way():
    kernel = FakeKernel()
    lifecycle = DriverLifecycle("wifi", wifi(kernel), kernel.clock)
    for _ in range(2):
        lifecycle.step(POLL_S)
    kernel.unplug()
    said = [one.output for _ in range(600) for one in lifecycle.step(POLL_S)]
    assert [one.level for one in said] == [Level.WARN]
    assert lifecycle.state is State.BACKOFF
    kernel.is_there = True
    said = [one.output for _ in range(600) for one in lifecycle.step(POLL_S)]
    assert sum("is back" in one.text for one in diagnostics(said)) == 1
    assert len(scans(said)) > 10


def fade(kernel):
    """Every strength tells when it was set: it falls by one dB a second."""
    for ap in kernel.access_points.values():
        ap.rssi_dbm = -20.0 - seconds(kernel.clock.now_ns())


def make_trouble(kernel, data):
    """One thing that happens to a radio, or nothing."""
    calm, loud = ["nothing"] * 4, ["abort", "never", "garble", "refuse", "heal"]
    action = data.draw(st.sampled_from([*calm, "another", "another", "switch", *loud]))
    if action == "switch":
        whole = three_access_points()
        on = data.draw(st.sets(st.sampled_from(sorted(whole))))
        kernel.access_points = {bssid: whole[bssid] for bssid in on}
    elif action == "another" and kernel.clock.now_ns() >= kernel._busy_until_ns:
        kernel.scan_by_another(is_seen=data.draw(st.booleans()))
    elif action == "abort":
        kernel.end = Command.SCAN_ABORTED
    elif action == "never":
        kernel.end = None
    elif action == "garble":
        kernel.emit(data.draw(st.binary(min_size=1, max_size=40)))
    elif action == "refuse":
        kernel.refusals[Command.TRIGGER_SCAN] = data.draw(st.sampled_from([5, 11, 16, 22, 100, 110]))
    elif action == "heal":
        heal(kernel)


def heal(kernel):
    kernel.end, kernel._busy_until_ns = Command.NEW_SCAN_RESULTS, 0
    kernel.refusals.clear()


@settings(max_examples=100)
@given(st.data())
def test_whatever_happens_nothing_stale_is_shown_as_fresh(data):
    """Trouble comes in any order; every reading lies in its scan's window and has a strength of that time."""
    kernel = FakeKernel(dwell_s=data.draw(st.sampled_from([0.04, 0.5, 2.0])))
    fade(kernel)
    mode, per_channel = data.draw(st.sampled_from(["passive", "active", "listen"])), data.draw(st.booleans())
    driver = opened(kernel, mode=mode, per_channel=per_channel, stamp="frame")
    for _ in range(30):
        make_trouble(kernel, data)
        fade(kernel)
        try:
            said = driver.poll(data.draw(st.sampled_from([0.0, 0.1, 1.0])))
        except DriverError:
            heal(kernel)
            driver.open()
            continue
        for scan in scans(said):
            (diagnostic,) = diagnostics(said)
            told = dict(diagnostic.values)
            began_ns, done_ns = int(told["trigger_ns"]), int(told["done_ns"])
            for one in scan.readings:
                heard_ns, set_ns = scan.time_ns - one.age_ns, nanoseconds(-one.rssi_dbm - 20.0)
                assert began_ns - MARGIN_NS <= heard_ns <= done_ns
                assert set_ns <= heard_ns + nanoseconds(0.01), "a strength that was not yet"
                if told["mode"] == mode != "listen":
                    assert set_ns >= began_ns - nanoseconds(1.02), "a strength from before the scan"


# -- finding


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
