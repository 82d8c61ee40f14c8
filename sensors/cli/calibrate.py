"""``fusion calibrate``: the sensor stands beside the verb; without one, this explains it."""

from __future__ import annotations

import argparse

from fusion import ParameterError

SENSORS = ("radio", "odometry", "gyro")


def configure(parser: argparse.ArgumentParser) -> None:
    """The sensor, and nothing else: the options belong to the verbs under this one."""
    parser.add_argument("sensor", choices=SENSORS, help="what to calibrate, as the first word")


def run(arguments: argparse.Namespace) -> int:
    """Raises `ParameterError`: a sensor that is not the first word was given something before it."""
    raise ParameterError(f"put the sensor first: fusion calibrate {arguments.sensor} RUN")
