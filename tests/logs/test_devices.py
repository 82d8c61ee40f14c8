"""The computer and the devices of a recording."""

from fusion import Diagnostic, Level
from logs.device_messages import ClockSync
from logs.devices import complaints, devices, dropped, wall_clock

SECOND = 1_000_000_000
MIDNIGHT = 1_764_028_800 * SECOND


def sync(boot_s, wall_s, *, monotonic_s=None, synced=True):
    monotonic_s = boot_s if monotonic_s is None else monotonic_s
    return ClockSync(boot_s * SECOND, monotonic_s * SECOND, MIDNIGHT + wall_s * SECOND, synced)


def test_a_clock_that_runs_evenly_has_no_steps():
    clock = wall_clock([sync(100, 0), sync(110, 10), sync(120, 20)], 105 * SECOND)
    assert clock == {"began": "2025-11-25T00:00:05+00:00", "synced": True, "steps": [], "suspended_s": 0.0}


def test_a_step_of_the_wall_clock_is_reported_and_the_last_setting_believed():
    """A Pi without a clock of its own boots in the past, and NTP sets it while it records."""
    clock = wall_clock([sync(100, -5000, synced=False), sync(110, -4990, synced=False), sync(120, 20)], 100 * SECOND)
    assert clock["steps"] == [{"at_s": 20.0, "by_s": 5000.0}]
    assert (clock["began"], clock["synced"]) == ("2025-11-25T00:00:00+00:00", True)


def test_a_suspended_computer_is_reported():
    assert wall_clock([sync(100, 0), sync(400, 300, monotonic_s=130)], 0)["suspended_s"] == 270.0
    assert wall_clock([], 0) is None


def test_devices_complaints_and_drops_are_counted():
    def status(count):
        return Diagnostic(3, "gyro", Level.WARN, "status", (("dropped", str(count)),))

    diagnostics = [
        Diagnostic(1, "gyro", Level.OK, "opened", (("model", "MPU-6050"),)),
        Diagnostic(2, "gyro", Level.WARN, "gone"),
        Diagnostic(3, "gyro", Level.WARN, "gyro: gone"),
        Diagnostic(4, "gyro", Level.OK, "back"),
        status(0),
        status(7),
        Diagnostic(5, "wifi", Level.OK, "status", (("dropped", "0"),)),
    ]
    assert devices(diagnostics) == {"gyro": {"model": "MPU-6050"}}
    assert complaints(diagnostics) == [("gyro: gone", 2)]
    assert dropped(diagnostics) == {"gyro": 7}
