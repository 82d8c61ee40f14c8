"""The air between simulated radios (mac80211_hwsim): every frame passes here, and gets the RSSI of the world model.

While a medium is registered the kernel delivers nothing by itself. When it stops, the kernel's own medium takes over at
once and every RSSI becomes -30 dBm, so a test must assert values. Ranges by time of flight are answered here too.
Protocol: drivers/net/wireless/virtual/mac80211_hwsim.h of Linux.
"""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from kernel.guest.netlink import (
    Attributes,
    Family,
    Message,
    attribute,
    attributes,
    each,
    integer,
    nest,
    u8,
    u32,
    u64,
)
from kernel.guest.world import Air

REGISTER, FRAME, TX_INFO_FRAME, NEW_RADIO, START_PMSR, REPORT_PMSR = 1, 2, 3, 4, 9, 11
RECEIVER, TRANSMITTER, DATA, FLAGS, RX_RATE, SIGNAL, TX_INFO, COOKIE = 1, 2, 3, 4, 5, 6, 7, 8
NAME, FREQUENCY, PERMANENT_ADDRESS, PMSR_SUPPORT, PMSR_REQUEST, PMSR_RESULT = 17, 19, 22, 26, 27, 28
STAT_ACK = 4
SO_RCVBUFFORCE, PATIENCE_BYTES = 33, 1 << 24
"""socket(7): more than others may ask for. On a busy host the medium falls behind, and what does not fit is lost."""
PEER_MEASUREMENTS, PEERS, ADDRESS, RESPONSE = 0x111, 5, 1, 4


def address(radio: int) -> bytes:
    """The MAC address of a radio, 02:00:00:00:0k:00; number 0 is the robot's."""
    return bytes((2, 0, 0, 0, radio, 0))


def add_radios(count: int) -> None:
    """Make radios 0 to `count` - 1, which become wlan0, wlan1, ...; they can measure ranges if the kernel can.

    A radio made with a permanent address is known to the medium by that address, too.
    """
    with Family("MAC80211_HWSIM") as hwsim:
        for radio in range(count):
            name = attribute(NAME, f"radio{radio}".encode() + b"\0")
            hwsim.command(NEW_RADIO, name, attribute(PERMANENT_ADDRESS, address(radio)), _ranging_support())


def _ranging_support() -> bytes:
    """Ten peers; as soon as possible or scheduled, all preambles and bandwidths, 2^8 bursts of 31 frames."""
    measures = nest(1, attribute(1), attribute(2), u32(5, 0x1F), u32(6, 0xFFFF), u8(7, 8), u8(8, 31))
    return nest(PMSR_SUPPORT, u32(1, 10), nest(4, measures))


class Medium:
    """Carries frames between radios 0 to len(access points) of `air`, in a thread, until closed."""

    def __init__(self, air: Air) -> None:
        self.air = air
        self.error: Exception | None = None
        self._hwsim = Family("MAC80211_HWSIM")
        self._hwsim.socket.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, PATIENCE_BYTES)
        self._hwsim.command(REGISTER)
        self._radios = {address(radio): radio for radio in range(len(air.access_points) + 1)}
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._carry_on, name="medium", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop, and raise what stopped it before."""
        self._closing.set()
        self._thread.join()
        self._hwsim.socket.close()
        if self.error is not None:
            raise self.error

    def _carry_on(self) -> None:
        try:
            while not self._closing.is_set():
                with suppress(TimeoutError):
                    for message in self._hwsim.receive(0.1):
                        self._serve(message)
        except Exception as error:  # noqa: BLE001 - told by close, in the thread that waits for it
            self.error = error

    def _serve(self, message: Message) -> None:
        # Answers of kind ERROR pass by: EINVAL for a receiver that is down or on another channel is how radios are.
        if message.command == FRAME:
            self._frame(attributes(message.payload))
        elif message.command == START_PMSR:
            self._measure(attributes(message.payload))

    def _frame(self, frame: Attributes) -> None:
        self._acknowledge(frame)
        sender = self._radios[frame[TRANSMITTER]]
        for receiver_address, receiver in self._radios.items():
            rssi = None if receiver == sender else self.air.rssi_dbm(sender, receiver)
            if rssi is not None:
                self._hwsim.send(
                    FRAME,
                    attribute(RECEIVER, receiver_address),
                    attribute(DATA, frame[DATA]),
                    u32(RX_RATE, 0),
                    u32(SIGNAL, rssi),
                    attribute(FREQUENCY, frame[FREQUENCY]),
                )

    def _acknowledge(self, frame: Attributes) -> None:
        """Without this the sender's queue stands still."""
        self._hwsim.send(
            TX_INFO_FRAME,
            attribute(TRANSMITTER, frame[TRANSMITTER]),
            u32(FLAGS, integer(frame[FLAGS]) | STAT_ACK),
            u32(SIGNAL, -30),
            attribute(TX_INFO, frame[TX_INFO]),
            attribute(COOKIE, frame[COOKIE]),
        )

    def _measure(self, request: Attributes) -> None:
        wanted = attributes(request[PMSR_REQUEST])[PEER_MEASUREMENTS]
        # The kernel repeats one attribute per peer, side by side.
        peers = [attributes(data)[ADDRESS] for kind, data in each(wanted) if kind == PEERS]
        results = [nest(place, *self._range(peer)) for place, peer in enumerate(peers, 1)]
        self._hwsim.send(
            REPORT_PMSR,
            attribute(TRANSMITTER, request[TRANSMITTER]),
            nest(PMSR_RESULT, nest(PEERS, *results)),
        )

    def _range(self, peer: bytes) -> Iterator[bytes]:
        """A peer's answer: status 0, or 2 (timeout) from one that is silent or unknown."""
        number = self._radios.get(peer, 0)
        rssi = self.air.rssi_dbm(number, 0) if number else None
        yield attribute(ADDRESS, peer)
        status = (
            u32(2, 0 if rssi is not None else 2),
            u64(3, time.clock_gettime_ns(time.CLOCK_BOOTTIME)),
            attribute(5),
        )
        if rssi is None:
            yield nest(RESPONSE, *status)
            return
        trip_ps, distance_mm = self.air.round_trip_ps(number), round(1000.0 * self.air.distance_m(number))
        measured = nest(1, u32(9, 100 * rssi), u64(13, trip_ps), u64(14, 0), u64(16, distance_mm))
        yield nest(RESPONSE, *status, nest(1, measured))


@contextmanager
def registered(air: Air) -> Iterator[Medium]:
    """A medium that carries frames while the block runs; an error of its own is raised at the block's end."""
    medium = Medium(air)
    try:
        yield medium
    finally:
        medium.close()
