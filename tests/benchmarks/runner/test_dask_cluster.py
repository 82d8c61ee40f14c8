"""The same suite on a real Dask cluster: same results, and what dies, hangs or eats memory costs itself only."""

import os
import signal
from contextlib import suppress

import pytest

from benchmarks.runner.plan import cells_of
from benchmarks.runner.results import read_results
from benchmarks.runner.run_suite import run_suite
from benchmarks.runner.store import Store
from fusion import FusionError
from tests.benchmarks.suite_files import write_suite

distributed = pytest.importorskip("distributed")
dask = pytest.importorskip("dask")
psutil = pytest.importorskip("psutil")

SUITE = """
[suite]
name = "cluster"
seeds = 3
[[runs]]
id = "office"
scenario = "paper_office"
duration_s = 15.0
[[estimators]]
id = "wheels"
use = "dead_reckoning"
[[estimators]]
id = "pf"
use = "particle"
"""
LIMITS = "limits = { wall_s = 8.0, rss_mb = 400.0 }"
TROUBLE = """
[[estimators]]
id = "hangs"
use = "hangs"
[[estimators]]
id = "eats"
use = "eats"
[[estimators]]
id = "exits"
use = "exits"
[[estimators]]
id = "faults"
use = "faults"
"""
PLUGIN = """
import os, pathlib, signal, time

class Hangs:
    summary, tags = "trouble", frozenset()
    def __init__(self, world): pass
    def start(self, prior, seed):
        while True: time.sleep(60.0)
    def step(self, state, motion, scan): raise NotImplementedError
    def estimate(self, state, motion, time_ns): raise NotImplementedError

class Eats(Hangs):
    def start(self, prior, seed):
        held = []
        while True: held.append(bytearray(20 * 2**20)); time.sleep(0.01)

class Exits(Hangs):
    def start(self, prior, seed): os._exit(3)

class Faults(Hangs):
    def start(self, prior, seed): os.kill(os.getpid(), signal.SIGSEGV)

class KillsItsParent(Hangs):
    def __init__(self, world, pid_file: str = ""): self.pid_file = pid_file
    def start(self, prior, seed):
        pathlib.Path(self.pid_file).write_text(str(os.getpid()))
        os.kill(os.getppid(), signal.SIGKILL)
        return super().start(prior, seed)
"""
ENTRY_POINTS = """
[fusion.estimators]
hangs = troublesome:Hangs
eats = troublesome:Eats
exits = troublesome:Exits
faults = troublesome:Faults
kills_its_parent = troublesome:KillsItsParent
"""


@pytest.fixture
def cluster():
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0") as running:
        yield running


@pytest.fixture(scope="module", autouse=True)
def troublesome(tmp_path_factory):
    """Estimators of a stranger, installed for whatever process starts from here."""
    site = tmp_path_factory.mktemp("site")
    (site / "troublesome.py").write_text(PLUGIN, encoding="utf-8")
    (site / "troublesome-1.dist-info").mkdir()
    (site / "troublesome-1.dist-info" / "METADATA").write_text("Name: troublesome\nVersion: 1\n", encoding="utf-8")
    (site / "troublesome-1.dist-info" / "entry_points.txt").write_text(ENTRY_POINTS, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(site)
        yield


@pytest.fixture
def lone_worker(troublesome):
    """One Dask worker with two threads, and one death of a worker is enough for Dask to give its tasks up."""
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        distributed.LocalCluster(n_workers=1, threads_per_worker=2, processes=True, dashboard_address=":0") as running,
    ):
        yield running


def with_limits(text, limits=LIMITS):
    return text.replace("seeds = 3", f"seeds = 1\n{limits}")


def digests(results):
    return [(str(result.cell), result.status, result.digest, dict(result.metrics)) for result in results]


def statuses(results):
    return {result.cell.estimator.id: result.status for result in results}


def everything(store):
    paths = (path for path in store.folder.rglob("*") if path.is_file())
    return {str(path.relative_to(store.folder)): path.read_bytes() for path in paths}


def worker_of(cluster):
    return psutil.Process(cluster.workers[0].pid)


def test_cluster_gives_the_results_of_one_process_though_a_worker_is_killed(cluster, tmp_path):
    suite = write_suite(tmp_path, SUITE)
    first_worker = next(iter(cluster.workers.values())).pid
    killed = []

    def kill_once(done, total, what):
        if not killed:
            killed.append(first_worker)
            os.kill(first_worker, signal.SIGKILL)

    on_cluster = run_suite(suite, Store(tmp_path / "cluster"), dask=cluster.scheduler_address, progress=kill_once)
    assert killed
    assert digests(on_cluster) == digests(run_suite(suite, Store(tmp_path / "alone"), workers=1))


def test_cell_that_hangs_dies_or_eats_memory_costs_itself_only(lone_worker, tmp_path):
    """To the byte what a run on this machine stores, and the Dask worker is the one it was."""
    suite, worker = write_suite(tmp_path, with_limits(SUITE + TROUBLE)), worker_of(lone_worker)
    here, there = Store(tmp_path / "here"), Store(tmp_path / "there")
    found = run_suite(suite, there, dask=lone_worker.scheduler_address)
    lost = {"hangs": "timeout", "eats": "oom", "exits": "crashed", "faults": "crashed"}
    assert statuses(found) == {"wheels": "ok", "pf": "ok", **lost}
    assert worker == worker_of(lone_worker)
    assert worker.children() == []
    assert digests(run_suite(suite, here, workers=2)) == digests(found)
    assert everything(here) == everything(there)


def test_interrupted_run_leaves_no_process_and_a_store_that_is_gone_on_with(lone_worker, tmp_path):
    text, store, address = SUITE + TROUBLE, Store(tmp_path / "store"), lone_worker.scheduler_address
    patient = write_suite(tmp_path, with_limits(text, "limits = { wall_s = 3600.0, rss_mb = 400.0 }"))
    reported = []

    def interrupt(done, total, what):
        reported.append((done, total))
        raise KeyboardInterrupt

    with suppress(KeyboardInterrupt):
        run_suite(patient, store, dask=address, progress=interrupt)
    assert reported == [(1, 6)]
    assert worker_of(lone_worker).children() == []
    assert "hangs" not in statuses(read_results(cells_of(patient, store), store))
    resumed = run_suite(write_suite(tmp_path, with_limits(text)), store, dask=address)
    assert sorted(statuses(resumed).values()) == ["crashed", "crashed", "ok", "ok", "oom", "timeout"]


def test_cell_whose_dask_worker_died_is_not_done_rather_than_crashed(lone_worker, tmp_path):
    """What the cluster loses is no failure of the estimator; and a cell does not outlive its Dask worker."""
    store, pid_file = Store(tmp_path / "store"), tmp_path / "pid"
    use = f'use = "kills_its_parent"\nparams = {{ pid_file = "{pid_file}" }}\n'
    suite = write_suite(tmp_path, f'{with_limits(SUITE, "")}\n[[estimators]]\nid = "killer"\n{use}')
    with pytest.raises(FusionError, match="died with them"):
        run_suite(suite, store, dask=lone_worker.scheduler_address)
    assert "killer" not in statuses(read_results(cells_of(suite, store), store))
    with suppress(psutil.NoSuchProcess):
        psutil.Process(int(pid_file.read_text("ascii"))).wait(60.0)
    healthy = write_suite(tmp_path, with_limits(SUITE, ""))
    assert statuses(run_suite(healthy, store, dask=lone_worker.scheduler_address)) == {"wheels": "ok", "pf": "ok"}


def test_scheduler_that_does_not_answer_is_reported(tmp_path, monkeypatch):
    monkeypatch.setattr("benchmarks.runner.dask_cluster.PATIENCE_S", 1.0)
    with pytest.raises(FusionError, match="no scheduler answers"):
        run_suite(write_suite(tmp_path, SUITE), Store(tmp_path / "store"), dask="tcp://127.0.0.1:9")
