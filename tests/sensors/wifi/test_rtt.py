"""The driver `wifi_rtt`: ranges with their doubt, every attempt's status, and radios that cannot or do not."""

import errno
import itertools

import pytest

from fusion.driver import Diagnostic, Level
from fusion.errors import DeviceLostError, NotPermittedError, SettingError, UnsupportedError
from fusion.values import Ranges, nanoseconds, seconds
from sensors.wifi.ftm import LIGHT_M_PER_PS, Status, read_attempts, request
from sensors.wifi.nl80211_fake import INDEX, FakeKernel, three_access_points
from sensors.wifi.nl80211_message import Command, Message, encode
from sensors.wifi.rtt import WifiRtt
from sensors.wifi.settings import Peer
from tests.sensors.wifi.polling import poll_for

ONE, TWO, THREE = three_access_points()
PEERS = [{"bssid": bssid, "frequency_mhz": ap.frequency_mhz} for bssid, ap in three_access_points().items()]


def opened(kernel, peers=PEERS, **given):
    driver = WifiRtt("rtt", kernel.clock, device=kernel, peers=peers, **given)
    driver.open()
    return driver


def answer(status=0, host_time=5, **measured):
    data = {"DATA": {"FTM": measured}} if measured else {}
    return {
        "PEER_MEASUREMENTS": {"PEERS": [{"ADDR": bytes(6), "RESP": {"STATUS": status, "HOST_TIME": host_time, **data}}]}
    }


# -- what is asked and answered


def test_a_request_says_who_where_and_how():
    wide = Peer(TWO, 5180, bandwidth_mhz=80, center_mhz=5210, frames_per_burst=8, bursts_exponent=1)
    asked = request(3, [Peer(ONE, 2412), wide])
    first, second = asked["PEER_MEASUREMENTS"]["PEERS"]
    assert asked["IFINDEX"] == 3
    assert first == {
        "ADDR": bytes.fromhex("020000000100"),
        "CHAN": {"WIPHY_FREQ": 2412, "CHANNEL_WIDTH": 1},
        "REQ": {"DATA": {"FTM": {"ASAP": True, "PREAMBLE": 1, "NUM_BURSTS_EXP": 0, "FTMS_PER_BURST": 4}}},
    }
    assert second["CHAN"] == {"WIPHY_FREQ": 5180, "CHANNEL_WIDTH": 3, "CENTER_FREQ1": 5210}
    assert second["REQ"]["DATA"]["FTM"]["PREAMBLE"] == 2, "VHT, for 80 MHz"


def test_a_range_is_the_device_s_or_half_the_light_s_way():
    """9434 ps there and back are 1.414 m: the values a real kernel gave for a peer at sqrt(2) m."""
    (told,) = read_attempts(answer(RTT_AVG=9434, DIST_AVG=1414))
    assert told.range_m == 1.414
    (computed,) = read_attempts(answer(RTT_AVG=9434))
    assert computed.range_m == pytest.approx(1.414, abs=5e-4)


def test_its_doubt_is_that_of_the_round_trip_or_none():
    (told,) = read_attempts(answer(RTT_AVG=9434, RTT_VARIANCE=667**2))
    assert told.std_m == pytest.approx(667 * LIGHT_M_PER_PS / 2.0)
    assert told.std_m == pytest.approx(0.1, abs=1e-3)
    (by_distance,) = read_attempts(answer(DIST_AVG=1414, DIST_VARIANCE=250_000))
    assert by_distance.std_m == 0.5
    (zero,) = read_attempts(answer(RTT_AVG=9434, RTT_VARIANCE=0))
    assert zero.std_m is None, "a variance of nothing claims nothing"


def test_signs_are_kept():
    """Tools print these unsigned: 4294962296 is -5000 mBm."""
    (near,) = read_attempts(answer(RTT_AVG=-200, DIST_AVG=-30, RSSI_AVG=-5000))
    assert (near.range_m, near.rssi_dbm) == (-0.03, -50.0)


@pytest.mark.parametrize(
    ("number", "status"), [(1, Status.REFUSED), (2, Status.TIMEOUT), (3, Status.FAILURE), (9, Status.FAILURE)]
)
def test_a_failed_attempt_keeps_its_status(number, status):
    (told,) = read_attempts(answer(status=number, host_time=0, FAIL_REASON=7))
    assert (told.status, told.range_m, told.time_ns, told.fail_reason) == (status, None, None, 7)


def test_a_result_without_status_or_address_says_nothing():
    assert read_attempts({}) == []
    assert read_attempts({"PEER_MEASUREMENTS": {"PEERS": [{"ADDR": bytes(6)}, {"RESP": {"STATUS": 0}}]}}) == []


# -- the driver


def test_a_round_has_every_range_with_its_doubt_at_the_time_of_the_last_answer():
    kernel = FakeKernel()
    ranges, diagnostic = poll_for(opened(kernel, peers=[PEERS[0] | {"name": "door"}, *PEERS[1:]]), 0.2)
    assert [(one.anchor, one.range_m) for one in ranges.readings] == [("door", 1.414), (TWO, 5.099), (THREE, 4.472)]
    assert [one.std_m for one in ranges.readings] == pytest.approx([0.1] * 3, abs=1e-4)
    assert (ranges.time_ns, ranges.seq) == (nanoseconds(0.09), 0)
    assert (diagnostic.level, diagnostic.text) == (Level.OK, "3 of 3 ranges")
    assert dict(diagnostic.values)["door"] == "success, 1.414 m, std 0.100 m, -23 dBm"


def test_a_peer_that_does_not_answer_is_told_and_the_others_are_measured():
    kernel = FakeKernel()
    kernel.access_points[TWO].range_m = None
    ranges, diagnostic = poll_for(opened(kernel), 0.2)
    assert [one.anchor for one in ranges.readings] == [ONE, THREE]
    assert diagnostic.level is Level.WARN
    assert dict(diagnostic.values)[TWO] == "timeout"


def test_if_no_peer_answers_there_is_no_measurement():
    (diagnostic,) = poll_for(opened(FakeKernel(access_points={})), 0.2)
    assert (diagnostic.level, diagnostic.text) == (Level.WARN, "0 of 3 ranges")


def test_rounds_keep_their_period_and_numbers():
    said = [one for one in poll_for(opened(FakeKernel(), period_s=2.0), 9.0) if isinstance(one, Ranges)]
    assert [one.seq for one in said] == [0, 1, 2, 3, 4]
    assert [seconds(b.time_ns - a.time_ns) for a, b in itertools.pairwise(said)] == [2.0] * 4


def test_the_end_of_another_s_round_is_not_ours():
    kernel = FakeKernel()
    driver = opened(kernel)
    for command in (Command.PEER_MEASUREMENT_RESULT, Command.PEER_MEASUREMENT_COMPLETE):
        kernel.emit(encode(Message(command, {"IFINDEX": INDEX, "COOKIE": 999, **answer()}), 28))
    ranges, _ = poll_for(driver, 0.2)
    assert len(ranges.readings) == 3


def test_a_radio_that_cannot_is_told_so_and_needs_a_person():
    with pytest.raises(UnsupportedError, match="no PMSR capability") as caught:
        opened(FakeKernel(ranges=False))
    assert "Intel" in caught.value.hint


def test_more_frames_than_the_radio_has_are_refused_with_its_limit():
    kernel = FakeKernel(most_frames=8)
    with pytest.raises(SettingError, match="frames_per_burst = 8"):
        opened(kernel, peers=[PEERS[0] | {"frames_per_burst": 9}])


def test_rounds_that_never_end_are_told_and_end_in_a_call_for_a_person():
    kernel = FakeKernel(end=None)
    driver = opened(kernel)
    said = []
    with pytest.raises(UnsupportedError, match="3 times in a row"):
        poll_for(driver, 60.0, said)
    assert [one.text for one in said if isinstance(one, Diagnostic)] == [
        "a round of ranging did not end within 12 s"
    ] * 2


@pytest.mark.parametrize("code", [errno.EBUSY, errno.EAGAIN])
def test_a_busy_radio_is_tried_again_later(code):
    kernel = FakeKernel(refusals={Command.PEER_MEASUREMENT_START: code})
    driver = opened(kernel)
    assert len(poll_for(driver, 5.5)) == 6
    kernel.refusals.clear()
    assert any(isinstance(one, Ranges) for one in poll_for(driver, 1.5))


def test_without_the_right_the_hint_says_how_to_get_it():
    with pytest.raises(NotPermittedError, match="AmbientCapabilities"):
        opened(FakeKernel(refusals={Command.PEER_MEASUREMENT_START: errno.EPERM}))


def test_a_closed_driver_says_so():
    driver = opened(FakeKernel())
    driver.close()
    with pytest.raises(DeviceLostError, match="not open"):
        driver.poll(0.1)
