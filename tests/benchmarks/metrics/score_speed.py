"""What it costs to score: one pair of 1 000 poses in a warm process, by kinds of metrics, and stored cells scored anew;
and two files of 100 000 poses by ``fusion bench score``, a process of its own.

Run it from the top folder, with one thread: ``OMP_NUM_THREADS=1 python tests/benchmarks/metrics/score_speed.py``. Times
are processor time, the least of many rounds over pairs that differ; the last column is a multiple of the anchor, one
transform of eight series as long as the pair and back, timed in the same rounds.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.consistency import Claimed, consistency_metrics, distribution_metrics
from benchmarks.metrics.convergence import dynamic_metrics
from benchmarks.metrics.drift import drift_metrics
from benchmarks.metrics.errors import Errors, errors
from benchmarks.metrics.estimate_track import Track
from benchmarks.metrics.fates import FateColumns
from benchmarks.metrics.intervals import interval_metrics
from benchmarks.metrics.matching import match
from benchmarks.metrics.position import axis_metrics, heading_metrics, position_metrics, track_metrics
from benchmarks.metrics.relative_pose import trajectory_metrics
from benchmarks.metrics.score import for_json, metrics
from benchmarks.runner.archive import from_bytes, to_bytes
from benchmarks.runner.store import to_json
from fusion.quantiles import Ordered
from logs.truth import Instants, TruthTrack, evaluation_instants

RATE_HZ = 10.0
KINDS: dict[str, Callable[[Errors, Ordered, Claimed], object]] = {
    "position": lambda measured, ordered, _: position_metrics(measured, ordered),
    "axes": lambda measured, *_: axis_metrics(measured),
    "along and across": lambda measured, *_: track_metrics(measured),
    "heading": lambda measured, *_: heading_metrics(measured),
    "trajectory": lambda measured, *_: trajectory_metrics(measured),
    "drift": lambda measured, *_: drift_metrics(measured),
    "consistency": lambda measured, _, claimed: consistency_metrics(measured, claimed),
    "distribution": lambda measured, *_: distribution_metrics(measured),
    "dynamics": lambda measured, *_: dynamic_metrics(measured),
    "intervals": interval_metrics,
}
ANCHOR, RESCORED = "transform of eight series", "one stored cell scored anew"
PAIR, SCORED = "one pair, matched and scored", "of it errors and metrics"


class Pair(NamedTuple):
    """A figure of eight, and a track beside it whose errors last for two seconds."""

    instants: Instants
    track: Track

    @classmethod
    def drawn(cls, poses: int, seed: int):
        """At 10 Hz, with a covariance that is about honest and a radio fix every two seconds."""
        t = np.arange(poses) / RATE_HZ
        x, y = 5.0 * np.sin(0.1 * t), 2.5 * np.sin(0.2 * t)
        heading = np.arctan2(np.cos(0.2 * t), np.cos(0.1 * t))
        error = np.random.default_rng(seed).normal(size=(poses, 3))
        for k in range(1, poses):
            error[k] = 0.95 * error[k - 1] + 0.31 * error[k]
        error *= 0.2, 0.15, 0.02
        time_ns = np.rint(1e9 * t).astype(np.int64)
        said = Track.of_poses(time_ns, x + error[:, 0], y + error[:, 1], heading + error[:, 2])
        instants = evaluation_instants(TruthTrack(time_ns, x, y, heading))
        claimed = np.tile([0.04, 0.0, 0.0, 0.0225, 0.0, 0.0004], (poses, 1))
        fixes_ns = time_ns // 2_000_000_000 * 2_000_000_000
        return cls(instants, said._replace(covariance=claimed, fix_ns=fixes_ns))


class Cost(NamedTuple):
    """Processor time of one pair [µs], and as a multiple of the anchor's."""

    what: str
    least_us: float
    ratio: float


def measure(poses: int = 1000, rounds: int = 200, pairs: int = 4) -> list[Cost]:
    """The anchor, a pair with all its metrics, each kind of them by itself, and a stored cell."""
    drawn = [Pair.drawn(poses, seed) for seed in range(pairs)]
    met = [(pair.instants, match(pair.instants, pair.track)) for pair in drawn]
    measured = [in_order(errors(*one)) for one in met]
    stored = [(pair.instants, to_bytes(pair.track, FateColumns.of([]))) for pair in drawn]
    series = [np.random.default_rng(seed).normal(size=(8, poses)) for seed in range(pairs)]
    jobs: list[tuple[str, Callable, list]] = [
        (ANCHOR, lambda rows: np.fft.irfft(np.fft.rfft(rows)), series),
        (PAIR, lambda pair: metrics(errors(pair.instants, match(pair.instants, pair.track))), drawn),
        (SCORED, lambda one: metrics(errors(*one)), met),
        ("match", lambda pair: match(pair.instants, pair.track), drawn),
        ("errors", lambda one: errors(*one), met),
        ("in order", lambda one: in_order(one[0]), measured),
        *((name, lambda one, kind=kind: kind(*one), measured) for name, kind in KINDS.items()),
        (RESCORED, rescore, stored),
    ]
    least = {name: np.inf for name, _, _ in jobs}
    for _ in range(rounds):
        for name, work, inputs in jobs:
            least[name] = min(least[name], _each_us(work, inputs))
    return [Cost(name, us, us / least[ANCHOR]) for name, us in least.items()]


def in_order(measured: Errors) -> tuple[Errors, Ordered, Claimed]:
    """What `metrics` makes of the errors once for all its kinds."""
    return measured, Ordered.of(measured.position, measured.weight), Claimed.of(measured)


def rescore(stored: tuple[Instants, bytes]) -> bytes:
    """What `benchmarks.runner.execute.score` does with one stored estimate, but for the disk."""
    instants, content = stored
    track, _ = from_bytes(content)
    return to_json(for_json(metrics(errors(instants, match(instants, track)))))


def _each_us(work: Callable, inputs: list) -> float:
    started_ns = time.process_time_ns()
    for one in inputs:
        work(one)
    return (time.process_time_ns() - started_ns) / len(inputs) / 1e3


class FilesCost(NamedTuple):
    """Processor time [s] and peak resident memory [MB] of one ``fusion bench score``."""

    cpu_s: float
    rss_mb: float


def measure_files(poses: int = 100_000, rounds: int = 3, words: tuple[str, ...] = ()) -> FilesCost:
    """The least of each over ``rounds`` processes that read and score two TUM files of a pair as `measure` draws it."""
    instants, track = Pair.drawn(poses, seed=1)
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / name for name in ("truth.tum", "estimate.tum")]
        truth = instants.x, instants.y, instants.heading
        for file, (x, y, heading) in zip(files, (truth, track.pose.T), strict=True):
            z = np.zeros(poses)
            rows = [1e-9 * track.time_ns, x, y, z, z, z, np.sin(heading / 2.0), np.cos(heading / 2.0)]
            np.savetxt(file, np.column_stack(rows), fmt="%.6f")
        pair = ["--truth", str(files[0]), "--estimate", str(files[1]), *words]
        costs = [_process([sys.executable, "-m", "fusion.cli.main", "bench", "score", *pair]) for _ in range(rounds)]
    return FilesCost(min(cost.cpu_s for cost in costs), min(cost.rss_mb for cost in costs))


def _process(command: list[str]) -> FilesCost:
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(command)} failed")
    return FilesCost(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024.0)


if __name__ == "__main__":
    for cost in measure(*map(int, sys.argv[1:])):
        sys.stdout.write(f"{cost.what:30s} {cost.least_us:8.0f} µs {cost.ratio:7.2f}\n")
    for words in ((), ("--mode", "interp"), ("--align", "se2")):
        files = measure_files(words=words)
        sys.stdout.write(f"{' '.join(('files', *words)):30s} {files.cpu_s:8.2f} s  {files.rss_mb:7.0f} MB\n")
