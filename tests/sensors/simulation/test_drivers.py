"""The sensors of a simulated robot share one world, and go wrong as they are told to."""

import math

import pytest

from fusion.driver import VirtualClock
from fusion.errors import SettingError
from sensors.onboard.driver_lifecycle import DriverLifecycle, State
from sensors.simulation.drivers import SimulatedEncoders, SimulatedGyro, SimulatedTracker, SimulatedWifi
from sensors.simulation.robot import SimulatedRobot
from sensors.simulation.scenario import load_scenario

START_NS = 5_000_000_000


def heard(made, *, duration_s=20.0, **settings):
    """All that one sensor says, by the time since the robot's start."""
    clock = VirtualClock(START_NS)
    lifecycle = DriverLifecycle("s", made("s", clock, scenario="room", **settings), clock)
    received = []
    while clock.now_ns() - START_NS < duration_s * 1e9:
        received += lifecycle.step(0.1)
    return [one.output for one in received if isinstance(one.output, made.kind)]


def elapsed_s(said):
    return (said.time_ns - START_NS) / 1e9


def fault(kind, **more):
    return [{"kind": kind, **more}]


def test_all_sensors_say_what_the_simulator_writes_into_a_log():
    run = [said for said in SimulatedRobot(load_scenario("room"), 3).run() if said.time_ns < 15e9]
    for made in (SimulatedEncoders, SimulatedGyro, SimulatedWifi, SimulatedTracker):
        expected = [said for said in run if isinstance(said, made.kind)]
        said = heard(made, duration_s=15.0, seed=3)[: len(expected)]
        assert [s.time_ns - START_NS for s in said] == [e.time_ns for e in expected]
        if made is not SimulatedTracker:
            assert {s.sensor for s in said} == {"s"}
            assert [s.seq for s in said] == [e.seq for e in expected]


def test_sensors_on_one_clock_belong_to_one_robot():
    clock = VirtualClock(START_NS)
    encoders = SimulatedEncoders("e", clock, scenario="room")
    clock.sleep(1.0)
    assert SimulatedGyro("g", clock, scenario="room")._robot is encoders._robot
    assert SimulatedGyro("g", clock, scenario="room", seed=1)._robot is not encoders._robot


def test_a_drop_out_is_silence_and_nothing_else():
    said = heard(SimulatedWifi, faults=fault("drop_out", from_s=5.0, to_s=9.0))
    clean = heard(SimulatedWifi)
    assert said == [scan for scan in clean if not 5.0 <= elapsed_s(scan) < 9.0]


def test_an_unplugged_sensor_comes_back_when_it_is_plugged_in():
    times = [elapsed_s(said) for said in heard(SimulatedGyro, faults=fault("unplug", from_s=5.0, to_s=8.0))]
    assert not [t for t in times if 5.0 < t < 8.0]
    assert [t for t in times if 8.0 < t < 8.0 + 30.0]


def test_a_clock_that_jumps_shifts_the_stamps_alone():
    said, clean = heard(SimulatedGyro, faults=fault("clock_jump", from_s=4.0, amount=-2.0)), heard(SimulatedGyro)
    for one, other in zip(said, clean, strict=False):
        off_s = (one.time_ns - other.time_ns) / 1e9
        assert off_s == (-2.0 if elapsed_s(other) >= 4.0 else 0.0)
        assert one.rate_rad_s == other.rate_rad_s


@pytest.mark.parametrize(("kind", "share"), [("tick_loss", -0.25), ("slip", 0.5)])
def test_miscounted_ticks_stay_miscounted(kind, share):
    said = heard(SimulatedEncoders, faults=fault(kind, from_s=4.0, to_s=10.0, amount=abs(share)))
    clean = heard(SimulatedEncoders)
    by_time = {round(elapsed_s(ticks), 3): ticks.counts[0] for ticks in clean}
    first, last = by_time[3.95], by_time[9.95]
    end = said[-1]
    assert end.counts[0] - by_time[round(elapsed_s(end), 3)] == pytest.approx(share * (last - first), abs=1.0)
    assert [t.counts for t in said if elapsed_s(t) < 4.0] == [t.counts for t in clean if elapsed_s(t) < 4.0]


def test_an_access_point_that_is_off_is_listed_on_with_a_growing_age():
    said = heard(SimulatedWifi, faults=fault("stale_anchor", from_s=6.0, anchor="ap2"))
    before = [s for s in said if elapsed_s(s) < 6.0][-1]
    kept = next(r.rssi_dbm for r in before.readings if r.anchor == "ap2")
    after = [(elapsed_s(s), r) for s in said if elapsed_s(s) >= 6.0 for r in s.readings if r.anchor == "ap2"]
    assert len(after) > 10
    assert {reading.rssi_dbm for _, reading in after} == {kept}
    for at_s, reading in after:
        assert math.isclose(reading.age_ns / 1e9, at_s - elapsed_s(before))


@pytest.mark.parametrize(
    ("faults", "told"),
    [
        (fault("drop_uot"), "did you mean 'drop_out'"),
        (fault("drop_out", form_s=1.0), "did you mean 'from_s'"),
        (fault("slip"), "needs amount"),
        (fault("stale_anchor"), "needs anchor"),
    ],
)
def test_a_misspelt_fault_is_refused(faults, told):
    with pytest.raises(SettingError, match=told):
        SimulatedGyro("g", VirtualClock(), scenario="room", faults=faults)


def test_a_sensor_that_the_scenario_lacks_needs_a_person():
    clock = VirtualClock()
    lifecycle = DriverLifecycle("g", SimulatedGyro("g", clock, scenario="corridor"), clock)
    lifecycle.step(0.1)
    assert lifecycle.state is State.FAILED
    with pytest.raises(SettingError, match="did you mean 'corridor'"):
        SimulatedGyro("g", clock, scenario="coridor")
