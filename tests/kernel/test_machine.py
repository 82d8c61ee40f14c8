"""The machine itself: it boots, runs our interpreter, brings answers back, and failures come back as failures."""

import sys

import pytest

from kernel import fetch, machine
from kernel.boot import GuestError


@pytest.mark.kernel
def test_a_guest_boots_debians_kernel_and_runs_this_interpreter(run_job, machine):
    result = run_job("hello", greeting="good morning")
    assert result.answer == {
        "release": machine.release,
        "python": sys.executable,
        "user": 0,
        "greeting": "good morning",
    }
    assert result.output == "good morning from the guest\n"


@pytest.mark.kernel
def test_a_job_that_fails_in_the_guest_fails_here_with_its_traceback(run_job):
    with pytest.raises(GuestError, match="missing 1 required positional argument: 'greeting'"):
        run_job("hello")


@pytest.mark.kernel
def test_a_guest_that_does_not_end_is_ended_and_told_of(run_job):
    with pytest.raises(GuestError, match=r"hello had not ended after 0.1 s"):
        run_job("hello", greeting="good night", limit_s=0.1)


def test_a_host_without_the_emulator_is_told_what_to_install(monkeypatch):
    monkeypatch.setitem(machine.HOST_TOOLS, "qemu-system-vax", "qemu-system-x86")
    with pytest.raises(machine.MachineMissingError, match=r"qemu-system-vax.* apt-get install qemu-system-x86 "):
        machine.tool("qemu-system-vax")


def test_kernels_are_compared_by_number_not_by_letters():
    assert fetch.version_of("linux-image-6.1.0-50-amd64") < fetch.OLDEST_KERNEL
    assert fetch.version_of("linux-image-6.12.95+deb12-amd64") > fetch.OLDEST_KERNEL
