"""The Wi-Fi drivers on a real nl80211: exact strengths and ranges of a moving robot, and every answer to be stood."""

import pytest

from kernel import boot

pytestmark = pytest.mark.kernel

PATH = [(1.0, 1.0), (5.0, 1.0), (3.0, 4.0)]
RSSI_DBM = [(-23, -36, -34), (-36, -23, -34), (-35, -35, -20)]
LAST_DBM = RSSI_DBM[-1]
BSSIDS = ["02:00:00:00:01:00", "02:00:00:00:02:00", "02:00:00:00:03:00"]


@pytest.fixture(scope="module")
def seen(machine, first_files, tmp_path_factory):
    """All observations of one guest: it takes half a minute to come up and listen."""
    return boot.run(machine, first_files, tmp_path_factory.mktemp("wifi"), "wifi_driver", path=PATH).answer


def rssi_of(*numbers, dbm=LAST_DBM):
    """What is heard of the access points of these numbers."""
    return {BSSIDS[number - 1]: dbm[number - 1] for number in numbers}


def test_strengths_are_those_of_the_world_model_at_every_place(seen):
    for place, (scan, dbm) in enumerate(zip(seen["scans"], RSSI_DBM, strict=True)):
        assert scan["rssi"] == rssi_of(1, 2, 3, dbm=dbm), place
        assert (scan["mode"], scan["stamp"], scan["stale"], scan["in_window"]) == ("passive", "frame", "0", True)
        assert scan["ages_s"][0] > scan["ages_s"][1] > scan["ages_s"][2] == 0.0, "channel after channel"
        assert scan["heard"] == " ".join(f"{BSSIDS[k]}=ap{k + 1}@{2412 + 25 * k}" for k in range(3))


def test_every_way_of_scanning_hears_the_same(seen):
    assert seen["modes"]["active"]["rssi"] == rssi_of(1, 2, 3)
    assert seen["modes"]["per channel"]["rssi"] == rssi_of(1, 2, 3)
    assert seen["modes"]["per channel"]["parts"] == "3"
    assert seen["modes"]["named"]["rssi"] == {"two": LAST_DBM[1]}


def test_what_a_real_kernel_refuses_has_its_error_and_its_cure(seen):
    kind, what, hint = seen["down"]
    assert (kind, what) == ("NotFoundError", "wlan0 is down")
    assert "ip link set wlan0 up" in hint
    kind, _, hint = seen["refusals"]["unknown interface"]
    assert kind == "NotFoundError"
    assert "did you mean 'wlan" in hint
    kind, what, hint = seen["refusals"]["frequency the card lacks"]
    assert (kind, what) == ("SettingError", "wlan0 has no channel at 2499 MHz")
    assert hint == "the nearest is 2484 MHz"


def test_the_radio_says_what_it_is(seen):
    assert seen["info"]["serial"] == "02:00:00:00:00:00"
    assert seen["info"]["model"].startswith("mac80211_hwsim on phy")
    assert seen["info"]["power_save"] in ("on", "off")
    assert seen["found"] == [["wifi:02:00:00:00:00:00", {"interface": "wlan0"}]]


def test_a_scan_that_is_cut_is_told_and_the_next_one_is_whole(seen):
    cut, whole = seen["aborted"]
    assert cut["level"] == "WARN"
    assert "aborted" in cut["text"]
    assert cut["rssi"] == {}
    assert whole["rssi"] == rssi_of(1, 2, 3)


def test_another_s_scan_is_waited_for_and_used_but_for_what_was_heard_before(seen):
    """Its beginning was not seen, so what its first channels heard may be refused; of the last one nothing may be."""
    borrowed, own = seen["borrowed"]
    assert borrowed["mode"] == "borrowed"
    assert borrowed["rssi"].items() <= rssi_of(1, 2, 3).items()
    assert BSSIDS[2] in borrowed["rssi"]
    assert borrowed["in_window"]
    assert (own["mode"], own["rssi"]) == ("passive", rssi_of(1, 2, 3))


def test_a_user_without_rights_is_refused_or_listens(seen):
    nobody = seen["nobody"]
    kind, what, hint = nobody["scanning"]
    assert kind == "NotPermittedError"
    assert "CAP_NET_ADMIN" in what
    assert "AmbientCapabilities=CAP_NET_ADMIN" in hint
    assert nobody["found"] == [{"interface": "wlan0", "mode": "listen"}]
    for way in ("listening", "falling back"):
        assert (nobody[way]["mode"], nobody[way]["rssi"]) == ("listen", rssi_of(1, 2, 3))


def test_an_access_point_that_fell_silent_is_gone_at_once(seen):
    assert seen["silent"]["rssi"] == rssi_of(1, 3)


def test_a_link_that_goes_down_is_lost_and_comes_back(seen):
    assert seen["link"]["polling"][:2] == ["DeviceLostError", "wlan0 is down"]
    assert seen["link"]["opening"][:2] == ["NotFoundError", "wlan0 is down"]
    assert seen["link"]["again"]["rssi"] == rssi_of(1, 3)


def test_an_interface_that_is_removed_is_lost_and_then_absent(seen):
    assert seen["gone"]["polling"][:2] == ["DeviceLostError", "there is no interface wlan0"]
    assert seen["gone"]["opening"][0] == seen["gone"]["listening"][0] == "NotFoundError"


def test_ranges_are_the_true_distances_and_a_silent_peer_is_told(run_job):
    """From the three places: sqrt(2), sqrt(26), sqrt(20); the first two exchanged; 5, 5 and 1 m."""
    ranges = run_job("wifi_rtt_driver", path=PATH).answer
    true_m = [(1.414, 5.099, 4.472), (5.099, 1.414, 4.472), (5.0, 5.0, 1.0)]
    for one, metres in zip(ranges["rounds"], true_m, strict=True):
        assert one["ranges"] == [[f"ap{k}", m, None] for k, m in enumerate(metres, 1)]
        assert [diagnostic[:2] for diagnostic in one["diagnostics"]] == [["OK", "3 of 3 ranges"]]
    silent = ranges["ap3 silent"]
    assert silent["ranges"] == [["ap1", 5.0, None], ["ap2", 5.0, None]]
    assert silent["diagnostics"][0][0] == "WARN"
    assert ["ap3", "timeout"] in silent["diagnostics"][0]
    assert "wifi_rtt:02:00:00:00:00:00" in ranges["found"]
    assert ranges["down"][:2] == ["NotFoundError", "wlan0 is down"]
    assert ranges["plain radio"][0] == "UnsupportedError"
