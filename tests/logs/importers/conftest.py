"""The rows of a bag in which every role is played."""

import pytest

from tests.logs.importers.hall import POSES, SECOND


@pytest.fixture
def drive(ros):
    """Rows of a drive with every role played once, each message 1 ms late."""
    rows = [("/odom", ros.odometry(t * SECOND, x, y, heading), t) for t, x, y, heading in POSES]
    rows += [("/imu/data", ros.imu(t * SECOND, 0.1 * t), t) for t in range(1, 5)]
    rows += [("/uwb/a", ros.range(2 * SECOND, "a", 2.5), 2), ("/uwb/b", ros.range(2 * SECOND, "b", 4.5), 2)]
    rows += [("/wifi", ros.scan(3 * SECOND, a=-40.5, b=-60.0), 3)]
    rows += [("/mocap", ros.pose(t * SECOND, x, y, heading), t) for t, x, y, heading in POSES]
    return [(topic, t * SECOND + 1_000_000, message) for topic, message, t in rows]
