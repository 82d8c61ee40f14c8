"""The medium's arithmetic, without a guest."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kernel.guest import netlink
from kernel.guest.world import Air


@pytest.mark.parametrize(
    ("robot", "rssi_dbm"),
    [((1.0, 1.0), (-23, -36, -34)), ((5.0, 1.0), (-36, -23, -34)), ((3.0, 4.0), (-35, -35, -20))],
)
def test_rssi_follows_the_log_distance_law(robot, rssi_dbm):
    """20 - 40 - 22 log10(d), worked out by hand: d = sqrt(2) gives -23.3 and so on."""
    air = Air(robot=robot)
    assert tuple(air.rssi_dbm(k, 0) for k in (1, 2, 3)) == rssi_dbm


def test_a_silent_or_far_access_point_is_not_heard():
    assert Air(silent=frozenset({2})).rssi_dbm(2, 0) is None
    assert Air(robot=(10_000.0, 0.0)).rssi_dbm(1, 0) is None
    assert Air().rssi_dbm(1, 2) == -30


def test_light_goes_there_and_back():
    assert Air(robot=(1.0, 1.0)).round_trip_ps(1) == 9435


@given(st.lists(st.tuples(st.integers(1, 0x3FFF), st.binary(max_size=40))))
def test_attributes_written_are_attributes_read(pairs):
    data = b"".join(netlink.attribute(kind, payload) for kind, payload in pairs)
    assert list(netlink.each(data)) == pairs
    assert list(netlink.each(netlink.attributes(netlink.nest(7, data))[7])) == pairs


@given(st.integers(-(2**31), 2**31 - 1))
def test_signed_numbers_survive(value):
    assert netlink.integer(netlink.attributes(netlink.u32(6, value))[6], signed=True) == value
