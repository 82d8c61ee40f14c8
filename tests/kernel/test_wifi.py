"""Simulated radios behind the real nl80211: the RSSI of a moving robot, ranges, and each answer a driver must stand."""

import errno
import itertools

import pytest

from kernel.guest.nl80211 import NEW_SCAN_RESULTS, SCAN_ABORTED

pytestmark = pytest.mark.kernel

PATH = [(1.0, 1.0), (5.0, 1.0), (3.0, 4.0)]
RSSI_DBM = [(-23, -36, -34), (-36, -23, -34), (-35, -35, -20)]
BSSIDS = ["02:00:00:00:01:00", "02:00:00:00:02:00", "02:00:00:00:03:00"]


def test_scans_of_a_moving_robot_have_the_rssi_of_the_world_model(run_job):
    """The last scan, after the medium has stopped, shows what the first nine would be without it."""
    seen = run_job("scan_moving_robot", path=PATH * 3).answer
    names = list(zip(BSSIDS, ("ap1", "ap2", "ap3"), (2412, 2437, 2462), strict=True))
    for place, (scan, rssi_dbm) in enumerate(zip(seen["scans"], RSSI_DBM * 3, strict=True)):
        assert [tuple(reading[:3]) for reading in scan] == names, place
        assert tuple(reading[3] / 100 for reading in scan) == rssi_dbm, place
    heard_ns = [[reading[4] for reading in scan] for scan in seen["scans"]]
    assert all(max(before) < min(now) for before, now in itertools.pairwise(heard_ns)), "a reading of an older scan"
    assert [reading[3] for reading in seen["without_medium"]] == [-3000] * 3


def test_every_refused_scan_has_its_own_errno_and_every_cut_one_its_event(run_job):
    seen = run_job("scan_answers").answer
    assert seen["errno"] == {
        "interface down": errno.ENETDOWN,
        "unknown interface": errno.ENODEV,
        "frequency the card lacks": errno.EINVAL,
        "abort without a scan": errno.ENOENT,
        "no capability": errno.EPERM,
        "second trigger": errno.EBUSY,
    }
    assert seen["event"] == {"whole": NEW_SCAN_RESULTS, "aborted": SCAN_ABORTED, "link down": SCAN_ABORTED}
    assert seen["listener"] == {"event": NEW_SCAN_RESULTS, "bssids": BSSIDS}, "a user without rights may listen"
    assert seen["silent access point"] == {"without flush": ["ap1", "ap2", "ap3"], "with flush": ["ap1", "ap3"]}


def test_ranges_are_the_true_distances_and_a_silent_peer_times_out(run_job):
    """From (1, 1): sqrt(2), sqrt(26) and sqrt(20) metres, and light's time there and back."""
    seen = run_job("ranges", robot=(1.0, 1.0)).answer
    three = [
        [BSSIDS[0], 0, 1414, 9435, -2300],
        [BSSIDS[1], 0, 5099, 34017, -3600],
        [BSSIDS[2], 0, 4472, 29835, -3400],
    ]
    assert seen == {"all there": three, "ap3 silent": [*three[:2], [BSSIDS[2], 2, None, None, None]]}
