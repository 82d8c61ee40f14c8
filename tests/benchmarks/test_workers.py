"""Tasks over processes: one that dies, hangs or eats memory costs itself and nothing else."""

import operator
import os
import time
from functools import partial

import pytest

from benchmarks.workers import Limits, Loss, compute

POWERS = [partial(pow, 2, k) for k in range(6)]


def lost(task, loss):
    return loss


def done(tasks, workers=2, **limits):
    return dict(compute(operator.call, lost, tasks, workers, Limits(**limits) if limits else None))


def with_second(task):
    return [*POWERS[:1], task, *POWERS[2:]]


def expected(second):
    return {0: 1, 1: second, 2: 4, 3: 8, 4: 16, 5: 32}


def die_once(marker):
    """Dies the first time, answers the second."""
    if marker.exists():
        return "second try"
    marker.touch()
    os._exit(1)


def take_memory(megabytes):
    held = bytearray(megabytes * 2**20)
    while held:
        time.sleep(1.0)


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_all_results_come_whatever_the_workers(workers):
    assert done(POWERS, workers) == {k: 2**k for k in range(6)}


def test_a_worker_that_dies_twice_costs_its_own_task_only():
    assert done(with_second(partial(os._exit, 1))) == expected(Loss.CRASHED)


def test_a_worker_that_dies_once_gets_another_try(tmp_path):
    assert done(with_second(partial(die_once, tmp_path / "was-here"))) == expected("second try")


def test_a_task_that_hangs_is_ended_and_costs_itself_only():
    assert done(with_second(partial(time.sleep, 3600.0)), wall_s=1.0) == expected(Loss.TIMEOUT)


def test_a_task_that_takes_too_much_memory_is_ended_and_costs_itself_only():
    assert done(with_second(partial(take_memory, 900)), rss_mb=600.0) == expected(Loss.OUT_OF_MEMORY)


def test_limits_hold_for_one_worker_too():
    assert done([partial(time.sleep, 3600.0)], 1, wall_s=1.0) == {0: Loss.TIMEOUT}


@pytest.mark.parametrize("workers", [1, 2])
def test_what_the_work_raises_is_raised_here(workers):
    with pytest.raises(ZeroDivisionError):
        done([partial(operator.truediv, 1, 0)], workers)


def test_workers_end_when_nobody_takes_results_any_more():
    results = compute(operator.call, lost, POWERS, 2)
    next(results)
    results.close()
    assert list(results) == []
