"""Simulated radios and access points: wlan0 is the robot's, wlan1, wlan2, ... are access points run by hostapd."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from kernel.guest.medium import Medium, add_radios, registered
from kernel.guest.system import load, wait_until
from kernel.guest.world import Air

CHANNELS = (1, 6, 11)
FREQUENCIES_MHZ = (2412, 2437, 2462)

LARGEST_BUFFER = Path("/proc/sys/net/core/rmem_max")

CONFIGURATION = """\
interface=wlan{number}
driver=nl80211
ssid=ap{number}
hw_mode=g
channel={channel}
ctrl_interface=/run/hostapd
"""


@contextmanager
def air_with_radios(air: Air) -> Iterator[Medium]:
    """Radios for the robot and each access point of `air`, and the medium between them; all interfaces down."""
    LARGEST_BUFFER.write_text(str(1 << 24))  # on a busy host frames queue up; when they are lost, the medium is
    load("mac80211_hwsim", "radios=0")
    add_radios(1 + len(air.access_points))
    with registered(air) as medium:
        yield medium


@contextmanager
def access_points(air: Air) -> Iterator[None]:
    """hostapd on wlan1, wlan2, ...: ap1 on channel 1, ap2 on 6, ap3 on 11, and so on round."""
    with tempfile.TemporaryDirectory() as folder:
        files = [_configure(Path(folder), number) for number in range(1, 1 + len(air.access_points))]
        log = Path(folder) / "log"
        with log.open("w") as output:
            hostapd = subprocess.Popen(["hostapd", *files], stdout=output, stderr=subprocess.STDOUT)
        try:
            wait_until(lambda: log.read_text().count("AP-ENABLED") == len(files), "hostapd's access points")
            yield
        finally:
            hostapd.terminate()
            hostapd.wait()
            print(log.read_text())


def _configure(folder: Path, number: int) -> Path:
    path = folder / f"ap{number}.conf"
    path.write_text(CONFIGURATION.format(number=number, channel=CHANNELS[(number - 1) % len(CHANNELS)]))
    return path
