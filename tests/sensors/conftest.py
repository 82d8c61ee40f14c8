"""Robots for tests: the simulated one in a small room, and drives of one whose calibration is known."""

import subprocess
import sys

import pytest

from sensors.onboard.robot_file import RobotFile
from tests.sensors.robot_files import robot_text
from tests.sensors.simulated_drive import simulated_drive


@pytest.fixture
def robot_file(tmp_path):
    """Writes a robot file with the options of `robot_text`; its path."""

    def write(**options):
        path = tmp_path / "trolley.toml"
        path.write_text(robot_text(**options))
        return path

    return write


@pytest.fixture
def robot(robot_file):
    """Writes a robot file with the options of `robot_text` and reads it."""
    return lambda **options: RobotFile.load(robot_file(**options))


@pytest.fixture
def start_recording(robot_file, tmp_path):
    """Starts `fusion record` of a robot into ``out``, in a process of its own, and waits until it writes: with the
    first status line all sensors are open and the log is begun.
    """
    processes = []

    def start(*words, **options):
        places = [str(robot_file(**options)), "-o", str(tmp_path / "out")]
        command = [sys.executable, "-m", "fusion.cli.main", "record", *places, *words]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        processes.append(process)
        process.stderr.readline()
        return process

    yield start
    for process in processes:
        process.kill()
        process.communicate()


@pytest.fixture(scope="session")
def drive():
    """A simulated drive of lines, spins and squares in both senses; noise by keyword."""
    return simulated_drive
