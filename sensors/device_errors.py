"""Errors for the kernel's refusals of a device: one table for every driver that opens a file under /dev or /sys."""

from __future__ import annotations

import errno

from fusion import (
    BusyError,
    DependencyError,
    DeviceLostError,
    DriverError,
    NotFoundError,
    NotPermittedError,
    UnsupportedError,
)

ABSENT = (errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.EREMOTEIO)
"""No such file, no such device, or no chip at that address of the bus (EREMOTEIO; ENXIO on some adapters)."""
DENIED = (errno.EACCES, errno.EPERM)
INSTALL = 'python3 -m pip install "fusion-localization[sensors]"'
"""Command that installs the packages of the drivers."""


def missing_package(name: str) -> DependencyError:
    """The error of a driver whose package ``name`` is not installed."""
    return DependencyError(f"the package {name} is missing", INSTALL)


def device_error(what: str, error: OSError, *, group: str, absent: str, busy: str) -> DriverError:
    """The error of our tree for ``error`` of the device ``what``: the group of users that may, what to do where the
    device is absent, and where it is busy.
    """
    if error.errno in ABSENT:
        return NotFoundError(f"{what} is not there", absent)
    if error.errno in DENIED:
        return NotPermittedError(f"{what} may not be opened", f"sudo usermod -aG {group} $USER, and log in again")
    if error.errno in (errno.EBUSY, errno.EAGAIN):
        return BusyError(f"{what} is in use", busy)
    if error.errno in (errno.EOPNOTSUPP, errno.ENOTTY):
        return UnsupportedError(f"{what} cannot do this ({error})", "take another device, or another driver for it")
    return DeviceLostError(f"{what} went away ({error})", "look at its cable; it is opened again by itself")
