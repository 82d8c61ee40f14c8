"""ROS 2 of two releases, to write bags with."""

import pytest
from rosbags.typesys import Stores

from tests.logs.importers.foreign_bags import Ros


@pytest.fixture(scope="session")
def ros():
    return Ros(Stores.ROS2_HUMBLE)


@pytest.fixture(scope="session")
def newer_ros():
    return Ros(Stores.ROS2_JAZZY)
