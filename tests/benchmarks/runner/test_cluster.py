"""The same suite on a real Dask cluster: same results, and a worker that is killed takes no other cell with it."""

import os
import signal

import pytest

from benchmarks.runner.definition import load_suite
from benchmarks.runner.run_verb import run_suite
from benchmarks.runner.store import Store
from fusion import FusionError

distributed = pytest.importorskip("distributed")

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


@pytest.fixture
def cluster():
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as running:
        yield running


def digests(results):
    return [(str(result.cell), result.status, result.digest, dict(result.metrics)) for result in results]


def test_cluster_gives_the_results_of_one_process_though_a_worker_is_killed(cluster, tmp_path):
    path = tmp_path / "suite.toml"
    path.write_text(SUITE, encoding="utf-8")
    suite = load_suite(path)
    first_worker = next(iter(cluster.workers.values())).pid
    killed = []

    def kill_once(done, total, what):
        if not killed:
            killed.append(first_worker)
            os.kill(first_worker, signal.SIGKILL)

    on_cluster = run_suite(suite, Store(tmp_path / "cluster"), dask=cluster.scheduler_address, progress=kill_once)
    assert killed
    assert digests(on_cluster) == digests(run_suite(suite, Store(tmp_path / "alone"), workers=1))


def test_scheduler_that_does_not_answer_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr("benchmarks.runner.cluster.PATIENCE_S", 1.0)
    path = tmp_path / "suite.toml"
    path.write_text(SUITE, encoding="utf-8")
    with pytest.raises(FusionError, match="no scheduler answers"):
        run_suite(load_suite(path), Store(tmp_path / "store"), dask="tcp://127.0.0.1:9")
