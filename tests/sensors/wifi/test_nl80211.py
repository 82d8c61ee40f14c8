"""The way to nl80211: answers apart from events, dumps whole, and a kernel that falls silent."""

import errno
import socket
from contextlib import suppress

import pytest

from sensors.wifi.nl80211 import TRIES, KernelTransport, Nl80211
from sensors.wifi.nl80211_fake import FAMILY, INDEX, FakeKernel
from sensors.wifi.nl80211_message import INTERRUPTED, MULTIPART, Command, Message, decode, encode, encode_end

EVENT = Message(Command.SCAN_ABORTED, {"IFINDEX": 9})


class Scripted:
    """A transport that answers each request with the next datagrams of its script; {n} is the request's number."""

    def __init__(self, *script):
        self.script, self.waiting, self.sent = list(script), [], []

    def open(self, groups):
        return FAMILY

    def send(self, data):
        self.sent.append(decode(data)[0])
        self.waiting += [one(self.sent[-1].sequence) for one in self.script.pop(0)]

    def receive(self, timeout_s):
        return self.waiting.pop(0) if self.waiting else None

    def close(self):
        pass


def part(flags=MULTIPART):
    return lambda number: encode(Message(Command.NEW_INTERFACE, {"IFINDEX": number}, number, flags), FAMILY)


def end(code=0, *, dump=True):
    return lambda number: encode_end(code, number, dump=dump)


def event(_):
    return encode(EVENT, FAMILY)


def link(*script):
    transport = Scripted(*script)
    nl80211 = Nl80211(transport)
    nl80211.open()
    return nl80211, transport


def test_events_that_come_among_answers_are_kept_for_later():
    nl80211, _ = link([event, part(), event, part(), end()])
    assert len(nl80211.ask(Command.GET_INTERFACE, {}, dump=True)) == 2
    assert [nl80211.event(0.0) for _ in range(3)] == [EVENT, EVENT, None]


def test_an_answer_to_an_older_request_is_no_answer():
    nl80211, _ = link([lambda _: encode_end(errno.EBUSY, 77), part(), end()])
    assert len(nl80211.ask(Command.GET_INTERFACE, {}, dump=True)) == 1


def test_a_dump_that_was_interrupted_is_begun_anew():
    torn = [part(MULTIPART | INTERRUPTED), end()]
    nl80211, transport = link(torn, [part(), part(), end()])
    assert len(nl80211.ask(Command.GET_SCAN, {}, dump=True)) == 2
    assert len(transport.sent) == 2
    nl80211, transport = link(*[torn] * 5)
    nl80211.ask(Command.GET_SCAN, {}, dump=True)
    assert len(transport.sent) == TRIES, "a list that never rests is taken as it is"


def test_a_kernel_that_does_not_answer_is_a_timeout():
    nl80211, _ = link([])
    with pytest.raises(OSError, match="timed out") as caught:
        nl80211.ask(Command.GET_POWER_SAVE, {"IFINDEX": INDEX})
    assert caught.value.errno == errno.ETIMEDOUT


def test_a_refusal_carries_the_kernel_s_number_and_words():
    kernel = FakeKernel(refusals={Command.GET_SCAN: errno.EINVAL})
    nl80211 = Nl80211(kernel)
    nl80211.open()
    with pytest.raises(OSError, match="Invalid") as caught:
        nl80211.ask(Command.GET_SCAN, {"IFINDEX": INDEX}, dump=True)
    assert caught.value.errno == errno.EINVAL


def test_a_closed_transport_refuses_and_closes_again():
    transport = KernelTransport()
    transport.close()
    with pytest.raises(OSError, match="descriptor"):
        transport.send(b"")
    with pytest.raises(OSError, match="descriptor"):
        transport.receive(0.0)


@pytest.mark.skipif(not hasattr(socket, "AF_NETLINK"), reason="no netlink: not a Linux")
def test_this_machine_s_kernel_is_asked_and_whatever_it_has_nothing_stays_open():
    """With Wi-Fi or without: a family's number, or ENOENT; warnings of unclosed sockets are errors here."""
    transport = KernelTransport()
    with suppress(FileNotFoundError, PermissionError):  # no Wi-Fi, or a container that forbids to ask
        assert transport.open(["scan"]) >= 16
    transport.close()
    assert transport._socket is None
