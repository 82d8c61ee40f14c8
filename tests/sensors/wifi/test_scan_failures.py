"""The driver `wifi` in trouble: aborted and endless scans, refusals, lost events, a radio that is unplugged."""

import errno
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.driver import Level
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
from fusion.values import nanoseconds, seconds
from sensors.onboard.driver_lifecycle import DriverLifecycle, State
from sensors.wifi.loop import FAILURES_TO_STUCK
from sensors.wifi.nl80211_fake import FakeKernel, three_access_points
from sensors.wifi.nl80211_message import Command
from sensors.wifi.reading import MARGIN_NS
from tests.sensors.wifi.polling import POLL_S, asked, diagnostics, opened, poll_for, scans, wifi


def test_an_aborted_scan_is_told_and_its_list_is_not_even_asked_for():
    kernel = FakeKernel(end=Command.SCAN_ABORTED)
    driver = opened(kernel)
    (told,) = poll_for(driver, 0.4)
    assert told.level is Level.WARN
    assert "aborted after 0.3 s" in told.text
    assert not asked(kernel, Command.GET_SCAN)
    kernel.end = Command.NEW_SCAN_RESULTS
    assert len(scans(poll_for(driver, 1.5))) == 1


def test_an_aborted_channel_costs_its_whole_round():
    kernel = FakeKernel()
    driver = opened(kernel, per_channel=True)
    poll_for(driver, 0.15)
    kernel.end = Command.SCAN_ABORTED
    assert not scans(poll_for(driver, 0.5))
    kernel.end = Command.NEW_SCAN_RESULTS
    (scan,) = scans(poll_for(driver, 1.6))
    assert len(scan.readings) == 3
    assert scan.readings[0].age_ns < nanoseconds(0.3)


def test_aborts_however_many_do_not_end_it():
    kernel = FakeKernel(end=Command.SCAN_ABORTED)
    driver = opened(kernel)
    assert len(diagnostics(poll_for(driver, 60.0), Level.WARN)) > 20


@pytest.mark.parametrize("code", [errno.EIO, errno.ETIMEDOUT])
def test_a_radio_that_does_not_answer_ends_in_a_call_for_a_person(code):
    kernel = FakeKernel(refusals={Command.TRIGGER_SCAN: code})
    driver = opened(kernel)
    with pytest.raises(UnsupportedError, match="3 times in a row") as caught:
        poll_for(driver, 60.0)
    assert "modprobe -r" in caught.value.hint
    assert not caught.value.passes, "the lifecycle must not try for ever"
    assert len(asked(kernel, Command.TRIGGER_SCAN)) == FAILURES_TO_STUCK


def test_scans_that_never_end_are_told_and_end_in_a_call_for_a_person():
    kernel = FakeKernel(end=None)
    driver = opened(kernel)
    said = []
    with pytest.raises(UnsupportedError, match="in a row"):
        poll_for(driver, 60.0, said)
    assert [one.text for one in said] == ["a scan did not end within 12 s"] * (FAILURES_TO_STUCK - 1)
    assert seconds(kernel.clock.now_ns()) == pytest.approx(38.0, abs=0.5)
    assert len(asked(kernel, Command.TRIGGER_SCAN)) <= FAILURES_TO_STUCK


def test_scans_that_the_firmware_itself_gives_up_end_so_too():
    kernel = FakeKernel(end=Command.SCAN_ABORTED, dwell_s=3.34)
    driver = opened(kernel)
    with pytest.raises(UnsupportedError, match=r"aborted after 10\.0 s"):
        poll_for(driver, 60.0)


def test_one_good_scan_forgives_the_failures_before_it():
    kernel = FakeKernel()
    driver = opened(kernel)
    for _ in range(4):
        kernel.refusals[Command.TRIGGER_SCAN] = errno.EIO
        poll_for(driver, 2.0)
        kernel.refusals[Command.TRIGGER_SCAN] = 0
        assert scans(poll_for(driver, 2.5))


def test_a_radio_that_another_keeps_busy_without_end_is_busy_and_the_hint_names_the_usual_one():
    kernel = FakeKernel(refusals={Command.TRIGGER_SCAN: errno.EBUSY})
    driver = opened(kernel)
    with pytest.raises(BusyError) as caught:
        poll_for(driver, 60.0)
    assert "nmcli dev set wlan0 managed no" in caught.value.hint
    assert seconds(kernel.clock.now_ns()) == pytest.approx(12.0, abs=0.2)
    assert len(asked(kernel, Command.TRIGGER_SCAN)) == 1


@pytest.mark.parametrize("code", [errno.EAGAIN, errno.ENOMEM, errno.ENOBUFS])
def test_what_may_pass_is_tried_again_a_second_later(code):
    kernel = FakeKernel(refusals={Command.TRIGGER_SCAN: code})
    driver = opened(kernel)
    assert len(diagnostics(poll_for(driver, 10.5), Level.WARN)) == 11
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
        poll_for(driver, 5.0)
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
    said = poll_for(driver, 0.5)
    assert "lost" in diagnostics(said, Level.WARN)[0].text
    assert len(scans(said)) == 1


def test_without_pyroute2_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyroute2", None)
    with pytest.raises(DependencyError, match="pip install") as caught:
        wifi(FakeKernel()).open()
    assert not caught.value.passes


def test_unplugged_in_the_middle_of_a_scan_it_is_lost_and_its_lifecycle_reopens_it_with_one_diagnostic_each_way():
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
