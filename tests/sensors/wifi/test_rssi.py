"""The driver `wifi` on a stand-in kernel and a virtual clock: its own scans and those of other programs."""

import errno
import math

import pytest

from fusion.driver import Level
from fusion.errors import (
    NotPermittedError,
)
from fusion.values import nanoseconds, seconds
from sensors.wifi.nl80211_fake import INDEX, WIPHY, FakeKernel, three_access_points
from sensors.wifi.nl80211_message import Command, Message, encode
from sensors.wifi.report import Report, Stamp
from tests.sensors.wifi.polling import asked, diagnostics, opened, poll_for, scans, wifi

ONE, TWO, THREE = three_access_points()


def test_a_scan_has_every_access_point_with_its_age_and_the_diagnostic_states_how_it_came_about():
    kernel = FakeKernel()
    said = poll_for(opened(kernel, names={TWO: "shelf"}), 0.4)
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
    poll_for(opened(kernel, frequencies_mhz=[2412, 2462]), 3.5)
    triggers = asked(kernel, Command.TRIGGER_SCAN)
    assert len(triggers) == 4, "one a second"
    assert all(one == {"IFINDEX": INDEX, "SCAN_FREQUENCIES": [2412, 2462], "SCAN_FLAGS": 2} for one in triggers)


def test_an_active_scan_asks_every_network_to_answer():
    kernel = FakeKernel()
    poll_for(opened(kernel, mode="active"), 0.4)
    assert asked(kernel, Command.TRIGGER_SCAN)[0]["SCAN_SSIDS"] == [b""]


def test_scanning_by_channel_gives_one_measurement_of_one_scan_for_each():
    kernel = FakeKernel()
    said = poll_for(opened(kernel, per_channel=True), 0.9)
    assert [one["SCAN_FREQUENCIES"] for one in asked(kernel, Command.TRIGGER_SCAN)] == [[2412], [2437], [2462]]
    (scan,), (diagnostic,) = scans(said), diagnostics(said)
    assert [one.anchor for one in scan.readings] == [ONE, TWO, THREE]
    assert dict(diagnostic.values)["parts"] == "3"


def test_only_anchors_with_a_name_are_kept_where_that_is_wished():
    (scan,) = scans(poll_for(opened(FakeKernel(), names={TWO: "shelf"}, only_named=True), 0.4))
    assert [one.anchor for one in scan.readings] == ["shelf"]


def test_a_scan_that_heard_nobody_is_told_and_no_measurement():
    kernel = FakeKernel(access_points={})
    said = poll_for(opened(kernel), 0.4)
    assert not scans(said)
    assert [one.text for one in diagnostics(said)] == ["heard 0 access points"]


def test_a_device_that_stamps_at_the_end_is_found_out_and_its_doubt_is_told():
    kernel = FakeKernel(stamps_at_end=True)
    said = poll_for(opened(kernel), 0.4)
    (scan,), (diagnostic,) = scans(said), diagnostics(said)
    assert {one.age_ns for one in scan.readings} == {0}
    assert scan.time_ns == nanoseconds(0.15), "the middle of the window"
    assert dict(diagnostic.values)["stamp"] == "scan_end"
    assert float(dict(diagnostic.values)["stamp_std_s"]) == pytest.approx(0.3 / math.sqrt(12.0), abs=1e-4)


def test_without_boot_times_the_doubt_is_the_window_s():
    kernel = FakeKernel(counts_age=True)
    (diagnostic,) = diagnostics(poll_for(opened(kernel), 0.4))
    assert dict(diagnostic.values)["stamp"] == "scan_end"


def test_scanning_by_channel_narrows_the_doubt_of_a_device_that_stamps_at_the_end():
    kernel = FakeKernel(stamps_at_end=True)
    (diagnostic,) = diagnostics(poll_for(opened(kernel, per_channel=True, stamp="scan_end"), 0.9))
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
    poll_for(driver, 0.4)
    del kernel.access_points[TWO]
    (scan,) = scans(poll_for(driver, 1.0))
    assert [one.anchor for one in scan.readings] == [ONE, THREE]


def test_what_the_kernel_remembers_from_before_a_foreign_scan_is_refused():
    kernel = FakeKernel()
    driver = opened(kernel, period_s=2.0)
    poll_for(driver, 1.0)
    del kernel.access_points[TWO]
    kernel.clock.sleep(0.9)
    kernel.scan_by_another()
    said = poll_for(driver, 2.0)
    borrowed = diagnostics(said)[0]
    assert dict(borrowed.values)["mode"] == "borrowed"
    assert dict(borrowed.values)["stale"] == "1"
    assert [one.anchor for one in scans(said)[0].readings] == [ONE, THREE]


def test_while_another_scans_the_driver_waits_for_that_end_and_asks_once():
    kernel = FakeKernel()
    kernel.scan_by_another(is_seen=False)
    driver = opened(kernel)
    assert len(asked(kernel, Command.TRIGGER_SCAN)) == 1, "refused: busy"
    said = poll_for(driver, 2.0)
    assert len(asked(kernel, Command.TRIGGER_SCAN)) == 2
    assert [dict(one.values)["mode"] for one in diagnostics(said)] == ["borrowed", "passive"]
    assert len(scans(said)[0].readings) == 3


def test_a_scan_on_another_interface_of_the_radio_is_waited_for_but_not_used():
    kernel = FakeKernel()
    kernel.scan_by_another((2412,), index=INDEX + 1)
    said = poll_for(opened(kernel), 0.5)
    assert [dict(one.values)["mode"] for one in diagnostics(said)] == ["passive"]
    assert dict(diagnostics(said)[0].values)["trigger_ns"] == str(nanoseconds(0.1)), "as soon as the radio was free"


def test_the_end_of_an_earlier_scan_is_not_taken_for_ours():
    class Racing(FakeKernel):
        """Somebody's scan is aborted just before ours begins."""

        def _scan(self, frequencies_mhz, index, *, is_seen=True):
            about = {"IFINDEX": INDEX, "WIPHY": WIPHY}
            self.emit(encode(Message(Command.SCAN_ABORTED, about), 28))
            super()._scan(frequencies_mhz, index, is_seen=is_seen)

    said = poll_for(opened(Racing()), 0.4)
    assert not diagnostics(said, Level.WARN)
    assert len(scans(said)) == 1


def test_somebody_s_scan_between_two_of_ours_changes_nothing():
    kernel = FakeKernel()
    driver = opened(kernel, period_s=5.0)
    poll_for(driver, 0.5)
    kernel.scan_by_another()
    assert not poll_for(driver, 2.0)
    assert len(scans(poll_for(driver, 3.0))) == 1


def test_other_interfaces_events_mean_nothing():
    kernel = FakeKernel()
    driver = opened(kernel, frequencies_mhz=[2412])
    kernel.emit(encode(Message(Command.NEW_SCAN_RESULTS, {"IFINDEX": 99, "WIPHY": 9}), 28))
    kernel.emit(encode(Message(Command.SCAN_ABORTED, {}), 28))
    kernel.emit(encode(Message(Command.NEW_INTERFACE, {"IFINDEX": INDEX}), 28))
    assert len(poll_for(driver, 0.3)) == 2


# -- listening


def test_who_listens_triggers_nothing_and_uses_what_others_scan():
    kernel = FakeKernel(refusals={Command.TRIGGER_SCAN: errno.EPERM})
    driver = opened(kernel, mode="listen")
    assert not poll_for(driver, 60.0)
    kernel.scan_by_another((2412, 2437))
    said = poll_for(driver, 1.0)
    assert [one.anchor for one in scans(said)[0].readings] == [ONE, TWO]
    assert dict(diagnostics(said)[0].values)["mode"] == "listen"
    assert not asked(kernel, Command.TRIGGER_SCAN)
    assert driver.spec.least_hz == 0.0, "no silence is too long"
    assert not driver.spec.needs.capabilities


def test_a_scan_whose_beginning_was_not_seen_counts_from_when_listening_began():
    kernel = FakeKernel()
    kernel.scan_by_another((2412, 2437, 2462), is_seen=False)
    kernel.clock.sleep(0.12)
    said = poll_for(opened(kernel, mode="listen"), 1.0)
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
    (told,) = poll_for(driver, 5.0)
    assert told.level is Level.WARN
    assert "listening" in told.text
    assert driver.spec.least_hz == 0.0
    kernel.scan_by_another()
    assert len(scans(poll_for(driver, 2.0))) == 1
