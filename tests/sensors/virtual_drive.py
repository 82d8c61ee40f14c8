"""A robot file recorded on a virtual clock: a drive of a minute in a second or two, the same each time."""

from dataclasses import replace

from fusion.driver import VirtualClock
from sensors.onboard.driver_lifecycle import DriverLifecycle
from sensors.onboard.recorder import Recorder
from sensors.onboard.robot_file import build_driver
from sensors.onboard.sensor_loop import Batch

STEP_S = 0.01
START_NS = 5_000_000_000


def virtual_drive(robot, folder, duration_s, *, after_tick=lambda _now_ns: None):
    """The logs of a robot whose sensors are all simulated, after so many seconds on its own clock; ``after_tick`` is
    called each time the recorder has taken a batch.
    """
    clock = VirtualClock(START_NS)
    lifecycles = [
        DriverLifecycle(sensor.name, build_driver(sensor, clock), clock, seed=number)
        for number, sensor in enumerate(robot.sensors)
    ]
    spacious = replace(robot, policy=replace(robot.policy, min_free_mb=0.0))
    with Recorder(spacious, folder, robot.start.prior(clock.now_ns(), robot.world)) as recorder:
        while clock.now_ns() < START_NS + duration_s * 1e9:
            received = [one for lifecycle in lifecycles for one in lifecycle.step(0.0)]
            recorder.take(Batch(clock.now_ns(), received, tick=False, report=None))
            after_tick(clock.now_ns())
            clock.sleep(STEP_S)
    assert recorder.trouble == ""
    return recorder.paths
