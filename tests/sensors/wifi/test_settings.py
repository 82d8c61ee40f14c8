"""A wrong setting is refused before any device is touched, with what would be right."""

import pytest

from fusion.driver import VirtualClock
from fusion.errors import SettingError
from sensors.onboard.robot_file import Sensor, build_driver
from sensors.wifi.rssi import Wifi
from sensors.wifi.rtt import WifiRtt

BSSID = "02:00:00:00:01:00"
PEER = {"bssid": BSSID, "frequency_mhz": 2412}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"mode": "pasive"}, "did you mean 'passive'"),
        ({"stamp": "end"}, "scan_end"),
        ({"frequencies_mhz": []}, "is empty"),
        ({"frequencies_mhz": [1]}, "channel 1 is 2412"),
        ({"frequencies_mhz": [2412, 2412]}, "twice"),
        ({"frequencies_mhz": "2412"}, "expected a list"),
        ({"names": {"02:00:00:00:0a:0G": "a"}}, "six pairs of hex digits"),
        ({"names": {"02:00:00:00:0A:00": "a"}}, "did you mean '02:00:00:00:0a:00'"),
        ({"only_named": True}, "give names"),
        ({"interface": ""}, "is no interface"),
        ({"interface": "a name of sixteen"}, "is no interface"),
        ({"period_s": -1.0}, "give 0 to 60"),
        ({"period_s": float("nan")}, "finite"),
    ],
)
def test_wifi_refuses(given, message):
    with pytest.raises(SettingError, match=message):
        Wifi("wifi", VirtualClock(), **given)


def test_whoever_listens_needs_no_channels():
    assert Wifi("wifi", VirtualClock(), mode="listen", frequencies_mhz=[]).spec.least_hz == 0.0


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"peers": []}, "is empty"),
        ({"peers": [PEER, PEER]}, "twice"),
        ({"peers": [{"bssid": BSSID}]}, "frequency_mhz is missing"),
        ({"peers": [PEER | {"bssid": "ap1"}]}, "six pairs"),
        ({"peers": [PEER | {"bandwidth_mhz": 10}]}, r"\(20, 40, 80\)"),
        ({"peers": [PEER | {"bandwidth_mhz": 80}]}, "center_mhz"),
        ({"peers": [PEER | {"frames_per_burst": 0}]}, "1 to 31"),
        ({"peers": [PEER | {"bursts_exponent": 15}]}, "0 to 14"),
        ({"peers": [PEER | {"burst": 1}]}, "did you mean 'bursts_exponent'|unknown key"),
        ({"peers": [PEER], "period_s": 61.0}, "give 0 to 60"),
    ],
)
def test_wifi_rtt_refuses(given, message):
    with pytest.raises(SettingError, match=message):
        WifiRtt("rtt", VirtualClock(), **given)


@pytest.mark.parametrize(
    ("use", "given", "near"),
    [("wifi", "freqencies_mhz", "frequencies_mhz"), ("wifi_rtt", "peer", "peers"), ("wifi", "interfaces", "interface")],
)
def test_a_misspelt_setting_of_a_robot_file_is_answered_with_the_nearest(use, given, near):
    with pytest.raises(SettingError, match=f"did you mean '{near}'"):
        build_driver(Sensor("radio", use, settings={given: 1}), VirtualClock())
