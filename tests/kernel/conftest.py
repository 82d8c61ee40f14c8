"""The machine, once per session, and a way to run a job in it."""

import pytest

from kernel import boot, initramfs
from kernel.machine import MachineMissingError, find


@pytest.fixture(scope="session")
def machine():
    """The emulated machine; without its parts the tests skip and say what to install."""
    try:
        return find()
    except MachineMissingError as missing:
        pytest.skip(f"kernel tier: {missing}")


@pytest.fixture(scope="session")
def first_files(machine, tmp_path_factory):
    """The initramfs of this machine."""
    target = tmp_path_factory.mktemp("kernel") / "initramfs.gz"
    initramfs.build(machine, target)
    return target


@pytest.fixture(scope="session")
def gpio(machine):
    """For tests that need simulated GPIO lines: they skip where those could not be built."""
    if machine.without_gpio:
        pytest.skip(f"kernel tier: {machine.without_gpio}")


@pytest.fixture
def run_job(machine, first_files, tmp_path):
    """``run_job(name, **arguments)``: boots a guest for that job alone, returns its `boot.Result`."""

    def run(name, **arguments):
        return boot.run(machine, first_files, tmp_path, name, **arguments)

    return run
