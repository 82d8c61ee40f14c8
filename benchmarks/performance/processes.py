"""Costs of whole processes: the start of Python with the ekf built, and a suite on two workers beside one."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.performance.drive import as_run, drive, site, write_log
from benchmarks.performance.interleaved import Cost, Job, interleaved
from benchmarks.performance.row import START_CPU, START_RSS, WORKERS, Row
from fusion import FusionError

CELLS_OF = ("dead_reckoning", "dynamic_weight", "ekf", "particle")
RUNS = 4

STARTED = """
import sys, time
{work}
cpu_s = time.process_time()
try:
    lines = open("/proc/self/status", encoding="ascii").readlines()
    peak_mib = int(next(line for line in lines if line.startswith("VmHWM")).split()[1]) / 1024.0
except OSError:
    peak_mib = float("nan")
sys.stdout.write(f"{{cpu_s}} {{peak_mib}}")
"""
BUILT = """
import fusion
world = fusion.World.from_table({"anchors": [{"id": "a", "position_m": [0, 0]}, {"id": "b", "position_m": [9, 0]}]})
fusion.build("ekf", world)
"""


def start_rows(rounds: int) -> list[Row]:
    """Processor time above that of bare Python, and peak memory with it, of fresh processes."""
    jobs: dict[str, Job] = {"bare": lambda: _fresh("pass"), "built": lambda: _fresh(BUILT)}
    found = interleaved(jobs, rounds, warm_up=False)
    (bare_cpu, _), (cpu, peak) = found["bare"], found["built"]
    above = Cost(cpu.least - bare_cpu.least, cpu.median - bare_cpu.median)
    rows = [Row(START_CPU, "fresh process", "CPU s above bare Python", *above)]
    if math.isnan(peak.least):  # no /proc here
        return rows
    return [*rows, Row(START_RSS, "fresh process", "MiB", *peak)]


def _fresh(work: str) -> tuple[float, float]:
    out = _output([sys.executable, "-c", STARTED.format(work=work)])
    cpu_s, peak_mib = map(float, out.split())
    return cpu_s, peak_mib


def worker_rows(seconds: float, rounds: int) -> list[Row]:
    """The suite of 16 cells, each time from nothing: four estimators on four logs of that length."""
    with tempfile.TemporaryDirectory(prefix="fusion-perf-") as name:
        suite = _suite(Path(name), seconds)
        jobs: dict[int, Job] = {count: _suite_job(suite, count) for count in (1, 2)}
        found = interleaved(jobs, rounds, warm_up=False)
    ((one,), (two,)) = found[1], found[2]
    return [Row(WORKERS, "processor time", "CPU s", *two, two.least / one.least, "1 worker")]


def _suite(folder: Path, seconds: float) -> Path:
    lines = ["[suite]", 'name = "workers"']
    for number in range(RUNS):
        log = folder / f"drive-{number}.mcap"
        write_log(as_run(drive(seconds, site(), seed=number)), log)
        lines += ["[[runs]]", f'id = "drive-{number}"', f'mcap = "{log.name}"']
    for estimator in CELLS_OF:
        lines += ["[[estimators]]", f'id = "{estimator}"', f'use = "{estimator}"']
    path = folder / "workers.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _suite_job(suite: Path, workers: int) -> Job:
    def job() -> tuple[float]:
        with tempfile.TemporaryDirectory(dir=suite.parent) as store:
            before_s = _children_s()
            words = ["bench", "run", str(suite), "--store", store, "--workers", str(workers)]
            _output([sys.executable, "-m", "fusion.cli.main", *words])
            return (_children_s() - before_s,)

    return job


def _children_s() -> float:
    """Processor time of the processes that this one has awaited, and of theirs [s]."""
    times = os.times()
    return times.children_user + times.children_system


def _output(command: list[str]) -> str:
    """Standard output of a process; raises `FusionError` where it fails."""
    ended = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - our own command
    if ended.returncode:
        raise FusionError(f"{' '.join(command[:4])} ... failed: {ended.stderr.strip().splitlines()[-1:]}")
    return ended.stdout
