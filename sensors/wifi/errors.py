"""Errors for the kernel's refusals, with their cures: one row per errno, for scans and for ranging.

Measured on real kernels (6.1, 6.12) where the kernel tier's jobs meet them; the rest is from their source.
"""

from __future__ import annotations

import errno
import importlib.util
import os
from typing import NamedTuple

from fusion.errors import (
    BusyError,
    DeviceLostError,
    DriverError,
    NotFoundError,
    NotPermittedError,
    SettingError,
    UnsupportedError,
)
from sensors.device_errors import missing_package

NETWORK_MANAGER = "NetworkManager scans by itself: `nmcli dev set {interface} managed no`, or a second USB radio"
CAPABILITY = (
    "give the service AmbientCapabilities=CAP_NET_ADMIN; by hand: sudo setpriv --reuid $USER --init-groups "
    '--inh-caps +net_admin --ambient-caps +net_admin fusion …; or set mode = "listen"'
)
STUCK = (
    "its firmware is stuck: reload the driver (`modprobe -r {driver} && modprobe {driver}`) or restart the machine; "
    "`dmesg` has more"
)

PASSING = frozenset({errno.EAGAIN, errno.ENOBUFS, errno.ENOMEM, errno.EINTR})
"""The driver is connecting, or short of memory: ask again a little later."""
FIRMWARE = frozenset({errno.EIO, errno.ETIMEDOUT})
"""The firmware did not answer; when it goes on, only a person can help."""


class Row(NamedTuple):
    """One errno: the error, its text, and the hint, with the places {interface}, {wish} and {driver}."""

    kind: type[DriverError]
    what: str
    hint: str


REFUSALS: dict[int, Row] = {
    errno.EPERM: Row(NotPermittedError, "this user may not use {interface}: CAP_NET_ADMIN is missing", CAPABILITY),
    errno.EACCES: Row(NotPermittedError, "this user may not use {interface}", CAPABILITY),
    errno.ENODEV: Row(NotFoundError, "there is no interface {interface}", "plug it in; `iw dev` lists what is there"),
    errno.ENETDOWN: Row(
        NotFoundError, "{interface} is down", "ip link set {interface} up (if that fails: rfkill unblock wifi)"
    ),
    errno.EINVAL: Row(
        SettingError, "{interface} refuses {wish}", "`iw phy` lists what it offers; correct the robot file"
    ),
    errno.EOPNOTSUPP: Row(UnsupportedError, "{interface} cannot do that: {wish}", "use another radio"),
    errno.EBUSY: Row(BusyError, "the radio of {interface} is in use by another program", NETWORK_MANAGER),
    errno.EAGAIN: Row(BusyError, "{interface} is connecting or being set up", NETWORK_MANAGER),
    errno.EIO: Row(DeviceLostError, "{interface} does not answer", STUCK),
    errno.ETIMEDOUT: Row(DeviceLostError, "{interface} does not answer", STUCK),
    errno.ENOENT: Row(UnsupportedError, "this kernel has no Wi-Fi (nl80211)", "load the driver of a Wi-Fi radio"),
}

UNKNOWN = Row(DeviceLostError, "{interface}: {wish}: {code}", "`dmesg` may have the reason")


def refused(refusal: OSError, interface: str, wish: str, driver: str = "") -> DriverError:
    """The error for a kernel's refusal; ``wish`` is what was asked for, in words. The kernel's own words are added."""
    code = refusal.errno or 0
    row = REFUSALS.get(code, UNKNOWN)
    places = {"interface": interface, "wish": wish, "driver": driver or "its_module"}
    places["code"] = f"{os.strerror(code)} ({errno.errorcode.get(code, code)})"
    words = refusal.strerror or ""
    added = f" (the kernel: {words})" if words not in ("", os.strerror(code)) else ""
    return row.kind(row.what.format(**places) + added, row.hint.format(**places))


def lost(error: DriverError) -> DriverError:
    """The same, of a device that was there a moment ago."""
    return DeviceLostError(error.what, error.hint) if isinstance(error, NotFoundError) else error


def stuck(interface: str, driver: str, failures: int, last: str) -> DriverError:
    """The error of a radio that will not come back by itself."""
    hint = STUCK.format(driver=driver or "its_module")
    return UnsupportedError(f"{interface} has failed {failures} times in a row, the last time: {last}", hint)


def require_pyroute2() -> None:
    """Raises `DependencyError` where it is not installed."""
    if importlib.util.find_spec("pyroute2") is None:
        raise missing_package("pyroute2")
