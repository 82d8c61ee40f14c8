"""The bytes of nl80211 are read as a real kernel wrote them, and nothing but a ProtocolError comes of any others."""

import subprocess
import sys
from contextlib import suppress

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fusion.errors import ProtocolError
from sensors.wifi.ftm import read_attempts
from sensors.wifi.nl80211_message import (
    ACK,
    HEADER,
    MESSAGE,
    REQUEST,
    Command,
    Message,
    decode,
    encode,
    encode_end,
)
from sensors.wifi.reading import read_entries

SCAN_TRIGGER = Message(
    Command.TRIGGER_SCAN,
    {"IFINDEX": 2, "SCAN_FREQUENCIES": [2412, 2437], "SCAN_SSIDS": [b""], "SCAN_FLAGS": 2},
    sequence=5,
    flags=REQUEST | ACK,
)
RANGING = Message(
    Command.PEER_MEASUREMENT_RESULT,
    {
        "COOKIE": 1 << 40,
        "PEER_MEASUREMENTS": {
            "PEERS": [
                {
                    "ADDR": bytes(6),
                    "RESP": {"STATUS": 0, "FINAL": True, "DATA": {"FTM": {"RTT_AVG": -5, "RSSI_AVG": -1}}},
                }
            ]
        },
    },
)
WIPHY = Message(Command.NEW_WIPHY, {"WIPHY_BANDS": [{"FREQS": [{"FREQ": 2412}, {"FREQ": 2467, "DISABLED": True}]}]})
LISTED = Message(
    Command.NEW_SCAN_RESULTS,
    {
        "IFINDEX": 3,
        "BSS": {"BSSID": bytes(6), "FREQUENCY": 2412, "INFORMATION_ELEMENTS": b"\0\3ap1\1\1\x82", "SIGNAL_MBM": -2300},
    },
)
WHOLE = [SCAN_TRIGGER, RANGING, WIPHY, LISTED]


@pytest.mark.parametrize("message", WHOLE, ids=lambda message: message.command.name)
def test_what_is_encoded_is_decoded(message):
    assert decode(encode(message, 28) + encode(message, 28)) == [message, message]


def test_a_trigger_is_the_bytes_a_kernel_expects():
    """Lengths, types and values by hand, from include/uapi/linux/nl80211.h; a list and its items are marked
    as nests (0x8000)."""
    expected = (
        "30000000 1c00 0500 05000000 00000000 21 01 0000 "
        "0800 0300 02000000 "
        "1400 2c80 0800 0180 6c090000 0800 0280 85090000"
    )
    frequencies = {"IFINDEX": 2, "SCAN_FREQUENCIES": [2412, 2437]}
    data = encode(SCAN_TRIGGER._replace(attributes=frequencies), 28)
    assert data.hex() == expected.replace(" ", "")


def test_our_numbers_are_those_of_pyroute2_where_it_has_the_name():
    from pyroute2.netlink import nl80211

    theirs = {name.removeprefix("NL80211_ATTR_"): number for number, (name, _) in enumerate(nl80211.nl80211cmd.nla_map)}
    for number, name, *_ in MESSAGE:
        assert theirs[name] == number, name
    ours = {command.name: command.value for command in Command}
    known = {name for name in ours if hasattr(nl80211, f"NL80211_CMD_{name}")}
    assert {name: getattr(nl80211, f"NL80211_CMD_{name}") for name in known} == {name: ours[name] for name in known}
    assert {"TRIGGER_SCAN", "GET_SCAN", "NEW_SCAN_RESULTS", "SCAN_ABORTED"} <= known


def test_an_end_says_why_in_numbers_and_words():
    (end,) = decode(encode_end(22, 7, {"MSG": "FTMs per burst must be set", "COOKIE": 9}))
    assert (end.errno, end.sequence) == (22, 7)
    assert end.attributes == {"MSG": "FTMs per burst must be set", "COOKIE": 9}
    (end,) = decode(encode_end(0, 7, dump=True))
    assert (end.errno, end.attributes) == (0, {})


def test_an_attribute_of_no_length_in_a_list_does_not_stop_the_reader():
    """pyroute2 would read such a list for ever."""
    data = bytearray(encode(WIPHY, 28))
    at = data.index((2412).to_bytes(4, "little")) - 8
    data[at : at + 2] = b"\0\0"
    with pytest.raises(ProtocolError):
        decode(bytes(data))


@given(st.binary(max_size=200))
@example(HEADER.pack(0, 28, 0, 0, 0))
@example(HEADER.pack(16, 2, 0x200, 0, 0))
@example(HEADER.pack(20, 28, 0, 0, 0) + b"\x22\0\0\0")
def test_any_bytes_are_messages_or_a_protocol_error(data):
    with suppress(ProtocolError):
        assert all(isinstance(message, Message) for message in decode(data))


@settings(max_examples=300)
@given(st.sampled_from(WHOLE), st.data())
def test_a_damaged_message_is_a_message_or_a_protocol_error(message, data):
    """Any few bytes of a real one changed, and its end cut off."""
    damaged = bytearray(encode(message, 28))
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(16, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    cut = damaged[: data.draw(st.integers(0, len(damaged)))]
    for one in (damaged, cut):
        with suppress(ProtocolError):
            messages = decode(bytes(one))
            read_entries(messages, 10**12)
            [read_attempts(message.attributes) for message in messages]


def test_listing_drivers_does_not_bring_pyroute2_in():
    modules = "sensors.wifi.rssi, sensors.wifi.rtt, sensors.wifi.nl80211_fake"
    code = f"import sys, {modules}; sys.exit('pyroute2' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
