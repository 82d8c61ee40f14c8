"""A robot for tests: the simulated one, in a small room."""

import pytest

from sensors.onboard.robot_file import RobotFile
from tests.sensors.robot_files import robot_text


@pytest.fixture
def robot(tmp_path):
    """Writes a robot file with the options of `robot_text` and reads it."""

    def write(**options):
        path = tmp_path / "trolley.toml"
        path.write_text(robot_text(**options))
        return RobotFile.load(path)

    return write
