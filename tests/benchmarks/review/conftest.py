"""The recording that reviews are made of."""

import pytest

from logs.reader import read_run
from sensors.simulation.simulate import simulate


@pytest.fixture(scope="session")
def log(tmp_path_factory):
    """Half a minute in the office, as a log; not to be changed."""
    return simulate("office", tmp_path_factory.mktemp("review") / "run.mcap", duration_s=30.0)


@pytest.fixture(scope="session")
def run(log):
    """The same, read."""
    return read_run(log)
