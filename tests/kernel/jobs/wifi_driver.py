"""The driver `wifi` on simulated radios: a moving robot, every mode and refusal, scans that others cut or begin."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from typing import Any

from fusion.driver import BootClock, Diagnostic
from fusion.errors import DriverError
from fusion.values import WifiScan
from kernel.guest.nl80211 import Scanner
from kernel.guest.nobody import Nobody
from kernel.guest.radios import FREQUENCIES_MHZ, access_points, air_with_radios
from kernel.guest.system import set_link
from kernel.guest.world import Air, Point
from sensors.wifi.rssi import Wifi

ALL_CHANNELS_MHZ = tuple(range(2412, 2473, 5))
CLOCK = BootClock()
POLL_S = 0.2
POLLS = 300


def run(path: list[Point]) -> dict[str, Any]:
    """One fresh scan at each place of `path` [m], then the rest where the robot stands last."""
    air = Air()
    with air_with_radios(air):
        seen: dict[str, Any] = {"down": refusal(wifi().open)}
        set_link("wlan0", "up")
        with access_points(air):
            seen["scans"] = drive(air, path)
            seen["modes"] = {
                "active": first(wifi(mode="active")),
                "per channel": first(wifi(per_channel=True)),
                "named": first(wifi(names={"02:00:00:00:02:00": "two"}, only_named=True)),
            }
            seen["refusals"] = refusals()
            seen["info"] = {key: str(value) for key, value in opened_info().items()}
            seen["found"] = [(one.id, dict(one.settings)) for one in Wifi.discover()][:1]
            seen |= {"aborted": aborted(), "borrowed": borrowed(), "nobody": nobody()}
            air.silent = frozenset({2})
            seen["silent"] = first(wifi())
            seen |= {"link": link_down_and_up(), "gone": gone()}
    return seen


def wifi(**settings: Any) -> Wifi:
    """The driver as a robot has it, back to back."""
    return Wifi("wifi", CLOCK, period_s=0.0, **{"frequencies_mhz": FREQUENCIES_MHZ, **settings})


def said(driver: Wifi) -> Iterator[tuple[WifiScan | None, Diagnostic]]:
    """What an open driver says: each diagnostic with its scan, if it has one."""
    for _ in range(POLLS):
        batch = driver.poll(POLL_S)
        for diagnostic in (one for one in batch if isinstance(one, Diagnostic)):
            yield next((one for one in batch if isinstance(one, WifiScan)), None), diagnostic
    raise TimeoutError("the driver says nothing")


def told(heard: WifiScan | None, diagnostic: Diagnostic) -> dict[str, Any]:
    """For the host."""
    values = dict(diagnostic.values)
    return {
        "level": diagnostic.level.name,
        "text": diagnostic.text,
        **{key: values.get(key, "") for key in ("mode", "parts", "stamp", "stale", "heard")},
        "rssi": {} if heard is None else {one.anchor: one.rssi_dbm for one in heard.readings},
        "ages_s": [] if heard is None else [one.age_ns / 1e9 for one in heard.readings],
        "in_window": heard is not None and int(values["trigger_ns"]) <= heard.time_ns <= int(values["done_ns"]),
    }


def first(driver: Wifi) -> dict[str, Any]:
    """Its first word."""
    driver.open()
    try:
        return told(*next(said(driver)))
    finally:
        driver.close()


def drive(air: Air, path: list[Point]) -> list[dict[str, Any]]:
    """One long-lived driver on a moving robot: at each place its first scan that began there."""
    driver = wifi()
    driver.open()
    seen = []
    for place in path:
        air.robot = place
        moved_ns = CLOCK.now_ns()
        fresh = (words for words in said(driver) if int(dict(words[1].values).get("trigger_ns", 0)) >= moved_ns)
        seen.append(told(*next(fresh)))
    driver.close()
    return seen


def refusal(action: Callable[[], object]) -> list[str] | None:
    """The error that `action` ends with, and its hint."""
    try:
        action()
    except DriverError as error:
        return [type(error).__name__, error.what, error.hint]
    return None


def refusals() -> dict[str, Any]:
    """Of a driver that is opened with what cannot be."""
    return {
        "unknown interface": refusal(wifi(interface="wlan9").open),
        "frequency the card lacks": refusal(wifi(frequencies_mhz=(2499,)).open),
    }


def opened_info() -> dict[str, object]:
    """What it says of itself."""
    driver = wifi()
    info = driver.open()
    driver.close()
    return {"model": info.model, "serial": info.serial, **info.settings}


def aborted() -> list[dict[str, Any]]:
    """A scan that another program cuts, and the next."""
    driver = wifi(frequencies_mhz=ALL_CHANNELS_MHZ)
    driver.open()
    Scanner("wlan0").abort()
    words = said(driver)
    both = [told(*next(words)), told(*next(words))]
    driver.close()
    return both


def borrowed() -> list[dict[str, Any]]:
    """Another's scan runs when the driver is opened: its result, then the driver's own."""
    other = Scanner("wlan0")
    other.trigger(ALL_CHANNELS_MHZ)
    driver = wifi()
    driver.open()
    words = said(driver)
    both = [told(*next(words)), told(*next(words))]
    driver.close()
    return both


def nobody() -> dict[str, Any]:
    """A user without rights: refused, listening because told to, and listening because refused."""
    return {
        "scanning": Nobody(lambda connection: connection.send(refusal(wifi().open))).receive(),
        "found": Nobody(
            lambda connection: connection.send([dict(one.settings) for one in Wifi.discover()][:1])
        ).receive(),
        "listening": overheard(mode="listen"),
        "falling back": overheard(or_listen=True),
    }


def overheard(**settings: Any) -> dict[str, Any]:
    """What a driver of that user makes of a scan that we trigger."""

    def listen(connection: Connection) -> None:
        driver = wifi(**settings)
        driver.open()
        connection.send("open")
        connection.send(next(told(*words) for words in said(driver) if words[0] is not None))

    listener = Nobody(listen)
    listener.receive()
    Scanner("wlan0").scan(FREQUENCIES_MHZ)
    heard: dict[str, Any] = listener.receive()
    return heard


def link_down_and_up() -> dict[str, Any]:
    """The interface is taken down under an open driver, and up again."""
    driver = wifi()
    driver.open()
    set_link("wlan0", "down")
    seen: dict[str, Any] = {"polling": refusal(lambda: list(said(driver)))}
    driver.close()
    seen["opening"] = refusal(driver.open)
    set_link("wlan0", "up")
    seen["again"] = first(driver)
    return seen


def gone() -> dict[str, Any]:
    """The interface itself is removed under an open driver, as by an unplugged USB radio."""
    driver = wifi()
    driver.open()
    subprocess.run(["iw", "dev", "wlan0", "del"], check=True)
    seen = {"polling": refusal(lambda: list(said(driver)))}
    driver.close()
    return {**seen, "opening": refusal(driver.open), "listening": refusal(wifi(mode="listen").open)}
