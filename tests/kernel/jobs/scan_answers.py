"""What the kernel answers to a scan that it refuses, that is cut short, or that somebody else began."""

from __future__ import annotations

from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from kernel.guest.nl80211 import Scanner
from kernel.guest.nobody import Nobody
from kernel.guest.radios import FREQUENCIES_MHZ, access_points, air_with_radios
from kernel.guest.system import set_link
from kernel.guest.world import Air

ALL_CHANNELS_MHZ = tuple(range(2412, 2473, 5))
NO_SUCH_INTERFACE = 999


def run() -> dict[str, Any]:
    """Errnos by situation, and the events and readings of the situations without one."""
    air = Air()
    with air_with_radios(air):
        down = refusal(lambda: Scanner("wlan0").trigger(FREQUENCIES_MHZ))
        set_link("wlan0", "up")
        with access_points(air):
            scanner = Scanner("wlan0")
            return {
                "errno": {"interface down": down, **refusals(scanner)},
                "event": events(scanner),
                "listener": listener(scanner),
                "silent access point": silence(scanner, air),
            }


def refusal(action: Callable[[], object]) -> int | None:
    """The errno that `action` ends with."""
    try:
        action()
    except OSError as error:
        return error.errno
    return None


def refusals(scanner: Scanner) -> dict[str, Any]:
    """The errno of each refused command."""
    found = {
        "unknown interface": refusal(lambda: Scanner(NO_SUCH_INTERFACE).trigger(FREQUENCIES_MHZ)),
        "frequency the card lacks": refusal(lambda: scanner.trigger((2499,))),
        "abort without a scan": refusal(scanner.abort),
        "no capability": Nobody(try_to_trigger).receive(),
    }
    scanner.trigger(FREQUENCIES_MHZ)
    found["second trigger"] = refusal(lambda: scanner.trigger(FREQUENCIES_MHZ))
    scanner.wait()
    return found


def try_to_trigger(connection: Connection) -> None:
    """As a user without CAP_NET_ADMIN."""
    connection.send(refusal(lambda: Scanner("wlan0").trigger(FREQUENCIES_MHZ)))


def events(scanner: Scanner) -> dict[str, int]:
    """The event that ends each scan."""
    found = {}
    scanner.trigger(FREQUENCIES_MHZ)
    found["whole"] = scanner.wait()
    scanner.trigger(ALL_CHANNELS_MHZ)
    scanner.abort()
    found["aborted"] = scanner.wait()
    scanner.trigger(ALL_CHANNELS_MHZ)
    set_link("wlan0", "down")
    found["link down"] = scanner.wait()
    set_link("wlan0", "up")
    return found


def listener(scanner: Scanner) -> dict[str, Any]:
    """What a user without any right hears and reads of a scan that we trigger."""
    nobody = Nobody(listen)
    nobody.receive()
    scanner.scan(FREQUENCIES_MHZ)
    event, bssids = nobody.receive()
    return {"event": event, "bssids": bssids}


def listen(connection: Connection) -> None:
    """Join, say so, wait for somebody's scan, read it."""
    scanner = Scanner("wlan0")
    connection.send("joined")
    event = scanner.wait()
    connection.send((event, [reading.bssid for reading in scanner.readings()]))


def silence(scanner: Scanner, air: Air) -> dict[str, list[str]]:
    """The access points listed after number 2 was switched off."""
    scanner.scan(FREQUENCIES_MHZ)
    air.silent = frozenset({2})
    return {
        "without flush": [reading.ssid for reading in scanner.scan(FREQUENCIES_MHZ, flush=False)],
        "with flush": [reading.ssid for reading in scanner.scan(FREQUENCIES_MHZ)],
    }
