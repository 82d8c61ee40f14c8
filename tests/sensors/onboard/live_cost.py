"""What a live pose costs: processor seconds a second, of the whole process with its simulated sensors.

Gyro at 100 Hz, which gives the turn, encoders at 20 Hz, Wi-Fi at 2 Hz, a pose 10 times a second. Run it from the top
folder: ``python tests/sensors/onboard/live_cost.py [SECONDS]``.
"""

import sys
import tempfile
import threading
import time
from pathlib import Path

from sensors.onboard.live import live
from sensors.onboard.robot_file import RobotFile
from sensors.onboard.sensor_loop import SensorLoop
from sensors.simulation.scenario import scenario_text


def robot(folder):
    scenario = folder / "fast.toml"
    text = scenario_text("office").replace('turn_source = "wheels"', 'turn_source = "gyro"')
    scenario.write_text(text.replace("[reality]", "[reality]\ngyro_hz = 100.0"))
    rows = [f"[world]\n{text.partition('[route]')[0].partition('[world]')[2]}"]
    rows += ["[start]", "position_m = [1.0, 1.0]", "heading_deg = 0.0", "[record]", "min_free_mb = 0.0"]
    for name in ("encoders", "gyro", "wifi"):
        rows += [f'[[sensors]]\nname = "{name}"\nuse = "simulated_{name}"\nsettings = {{ scenario = "{scenario}" }}']
    path = folder / "robot.toml"
    path.write_text("\n".join(rows))
    return RobotFile.load(path)


def cost(work):
    """Processor seconds a second of ``work``, from its first step on: building the simulation is not counted."""
    steps = iter(work)
    next(steps)
    cpu_s, wall_s = time.process_time(), time.monotonic()
    for _ in steps:
        pass
    return (time.process_time() - cpu_s) / (time.monotonic() - wall_s)


def sensors_alone(trolley, duration_s):
    with SensorLoop(trolley) as loop:
        loop.await_open(10.0, threading.Event())
        yield from loop.batches(threading.Event(), duration_s, 0.1)


def main(duration_s):
    with tempfile.TemporaryDirectory() as name:
        trolley = robot(Path(name))
        rows = {
            "sensors and loop": lambda: sensors_alone(trolley, duration_s),
            "and ekf, 10 poses a second": lambda: live(trolley, "ekf", duration_s=duration_s),
            "and a recording": lambda: live(trolley, "ekf", duration_s=duration_s, folder=Path(name)),
        }
        for about, work in rows.items():
            sys.stdout.write(f"{about:<28} {cost(work()):.3f} CPU s/s\n")


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 20.0)
