"""Tasks over processes: one that dies, hangs or eats memory costs itself and nothing else."""

import operator
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial

import pytest

from benchmarks.runner.worker_process import peak_rss_bytes
from benchmarks.runner.workers import Limits, TaskFailure, WorkerPool, compute

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


def die_once_and_hang(marker, fifo):
    """Goes on the second time when somebody reads its output, and then no more."""
    fifo.write_text(die_once(marker), encoding="ascii")
    time.sleep(3600.0)


@contextmanager
def pool_of(**options):
    pool = WorkerPool(operator.call, lost, Limits(), **options)
    try:
        yield pool
    finally:
        pool.dismiss()


def take_memory_briefly(megabytes):
    """Answers as soon as it has taken that much, before anybody looks; Linux counts to half a megabyte or so."""
    held = []
    while peak_rss_bytes() <= megabytes * 2**20:
        held.append(b"x" * 2**20)
    return len(held)


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_all_results_come_whatever_the_workers(workers):
    assert done(POWERS, workers) == {k: 2**k for k in range(6)}


def test_a_worker_that_dies_twice_costs_its_own_task_only():
    assert done(with_second(partial(os._exit, 1))) == expected(TaskFailure.CRASHED)


def test_a_worker_that_dies_once_gets_another_try(tmp_path):
    assert done(with_second(partial(die_once, tmp_path / "was-here"))) == expected("second try")


def test_a_task_that_hangs_is_ended_and_costs_itself_only():
    assert done(with_second(partial(time.sleep, 3600.0)), wall_s=1.0) == expected(TaskFailure.TIMEOUT)


def test_a_task_that_takes_too_much_memory_is_ended_and_costs_itself_only():
    assert done(with_second(partial(take_memory, 900)), rss_mb=600.0) == expected(TaskFailure.OUT_OF_MEMORY)


def test_memory_that_was_taken_for_a_moment_is_not_charged_to_the_next_task():
    tasks = [partial(take_memory_briefly, 154), *POWERS[1:]]
    assert done(tasks, 1, rss_mb=150.0) == {0: TaskFailure.OUT_OF_MEMORY} | {k: 2**k for k in range(1, 6)}


def test_limits_hold_for_one_worker_too():
    assert done([partial(time.sleep, 3600.0)], 1, wall_s=1.0) == {0: TaskFailure.TIMEOUT}


@pytest.mark.parametrize("workers", [1, 2])
def test_what_the_work_raises_is_raised_here(workers):
    with pytest.raises(ZeroDivisionError):
        done([partial(operator.truediv, 1, 0)], workers)


def test_workers_end_when_nobody_takes_results_any_more():
    results = compute(operator.call, lost, POWERS, 2)
    next(results)
    results.close()
    assert list(results) == []


def test_crew_keeps_its_process_for_the_next_tasks():
    with pool_of() as pool:
        assert list(pool.compute([os.getpid], 1)) == list(pool.compute([os.getpid], 1)) != [(0, os.getpid())]


def test_process_that_died_between_tasks_costs_the_next_one_no_try(tmp_path):
    with pool_of() as pool:
        ((_, pid),) = pool.compute([os.getpid], 1)
        os.kill(pid, signal.SIGKILL)
        os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
        assert list(pool.compute([partial(die_once, tmp_path / "was-here")], 1)) == [(0, "second try")]


def test_process_with_nothing_to_do_ends_and_another_takes_the_next_task():
    with pool_of(idle_s=1.0) as pool:
        ((_, first),) = pool.compute([os.getpid], 1)
        os.waitid(os.P_PID, first, os.WEXITED | os.WNOWAIT)
        ((_, second),) = pool.compute([os.getpid], 1)
        assert first != second


def test_task_of_a_pool_that_is_dismissed_is_not_lost_but_cancelled(tmp_path):
    os.mkfifo(tmp_path / "fifo")
    with ThreadPoolExecutor() as threads, pool_of() as pool:
        task = partial(die_once_and_hang, tmp_path / "was-here", tmp_path / "fifo")
        results = threads.submit(list, pool.compute([task], 1))
        assert (tmp_path / "fifo").read_text(encoding="ascii") == "second try"
        pool.dismiss()
        assert isinstance(results.exception(), CancelledError)
        with pytest.raises(CancelledError):
            list(pool.compute(POWERS, 1))


def test_words_hash_alike_whatever_the_environment_sets(monkeypatch):
    command = [sys.executable, "-c", "print(hash('anchor'))"]
    unsalted = subprocess.run(command, env=os.environ | {"PYTHONHASHSEED": "0"}, check=True, capture_output=True)
    monkeypatch.setenv("PYTHONHASHSEED", "6640")
    assert done([partial(hash, "anchor")], wall_s=60.0) == {0: int(unsalted.stdout)}
