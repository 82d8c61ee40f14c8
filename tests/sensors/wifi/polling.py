"""The driver `wifi` on a stand-in kernel and a virtual clock, polled for a while."""

from fusion.driver import Diagnostic
from fusion.values import WifiScan, nanoseconds
from sensors.wifi.rssi import Wifi

POLL_S = 0.1


def wifi(kernel, **given):
    """The driver `wifi` on a stand-in kernel, not yet open."""
    return Wifi("wifi", kernel.clock, device=kernel, **given)


def opened(kernel, **given):
    """The same, open."""
    driver = wifi(kernel, **given)
    driver.open()
    return driver


def poll_for(driver, span_s, outputs=None):
    """All outputs of that time, added to ``outputs``; no poll may take longer than it was given."""
    clock, outputs = driver._clock, [] if outputs is None else outputs
    until_ns = clock.now_ns() + nanoseconds(span_s)
    while clock.now_ns() < until_ns:
        before_ns = clock.now_ns()
        outputs += driver.poll(POLL_S)
        assert clock.now_ns() - before_ns <= nanoseconds(POLL_S)
    return outputs


def scans(outputs):
    """The measurements among outputs."""
    return [one for one in outputs if isinstance(one, WifiScan)]


def diagnostics(outputs, level=None):
    """The diagnostics among outputs, all or of one level."""
    return [one for one in outputs if isinstance(one, Diagnostic) and level in (None, one.level)]


def asked(kernel, command):
    """Attributes of the requests of one kind that the kernel got."""
    return [one.attributes for one in kernel.asked if one.command == command]
