"""The runs of a suite, opened once for all the cells that need them, and identified by their content."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from benchmarks.runner.fingerprint import fingerprint
from benchmarks.runner.store import Store, key_of, to_json
from benchmarks.runner.suite import RunSource
from fusion import SuiteError, World
from fusion.values import nanoseconds
from logs.importers.rosbag import read_bag
from logs.reader import read_run, read_world
from logs.run import Run
from sensors.simulation.scenario import load_scenario, scenario_text
from sensors.simulation.simulate import simulated_run

KEPT_RUNS = 2
"""Open runs a worker keeps: cells come run by run."""


class Content(NamedTuple):
    """Hashes of a run: of all that estimators get of it, and of the truth they are scored on ("" for none)."""

    measured: str
    truth: str


def place_of(source: RunSource, folder: Path) -> Path:
    """The log or bag of a run, from the folder of its suite; raises `SuiteError` when it is not there."""
    path = folder / str(source.mcap)
    if not (path.is_file() or (source.world is not None and path.is_dir())):
        brought = f"; `fusion import` brings it, see {source.catalogue} in the catalogue" if source.catalogue else ""
        raise SuiteError(f"run {source.id}: {path} is not there{brought or '; give the path from the suite file'}")
    return path


def open_run(source: RunSource, folder: Path) -> Run:
    """The run, whole; the last few are kept open. Raises `SuiteError`, `LogError` or `WorldError`."""
    if source.scenario is not None:
        return _simulated(scenario_of(source.scenario, folder), source.seed, source.duration_s)
    path = place_of(source, folder)
    if source.world is not None:
        topics = tuple(sorted(source.topics.items()))
        return _bag(path, state_of(path), folder / source.world, topics, source.truth_to_map)
    return open_log(path)


def open_log(path: Path) -> Run:
    """The run in a log of ours; the last few are kept open while they do not change. Raises `LogError`."""
    return _read(path, state_of(path) if path.exists() else ())


State = tuple[tuple[str, int, int, int], ...]


def state_of(path: Path) -> State:
    """State of a log, or of a bag's files, to detect changes: name, size, time [ns] and place on the disk."""
    files = sorted(path.glob("*.mcap")) if path.is_dir() else [path]
    states = [(file.name, file.stat()) for file in files]
    return tuple((name, status.st_size, status.st_mtime_ns, status.st_ino) for name, status in states)


def open_world(source: RunSource, folder: Path) -> World:
    """The world of the run, without the run where that can be; raises as `open_run`."""
    if source.scenario is not None:
        return load_scenario(scenario_of(source.scenario, folder)).world
    path = place_of(source, folder)
    return read_world(path) if source.world is None else World.load(folder / source.world)


@lru_cache(maxsize=KEPT_RUNS)
def _read(path: Path, _state: State) -> Run:
    return read_run(path)


@lru_cache(maxsize=KEPT_RUNS)
def _bag(
    path: Path,
    _state: State,
    world: Path,
    topics: tuple[tuple[str, str], ...],
    truth_to_map: tuple[float, float, float],
) -> Run:
    return read_bag(path, World.load(world), dict(topics), truth_to_map=truth_to_map)


@lru_cache(maxsize=KEPT_RUNS)
def _simulated(scenario: str | Path, seed: int, duration_s: float | None) -> Run:
    run = simulated_run(load_scenario(scenario), seed)
    return run if duration_s is None else _cut(run, nanoseconds(duration_s))


def scenario_of(scenario: str, folder: Path) -> str | Path:
    """The name of a scenario of ours, or the place of a scenario file, from the folder of its suite."""
    return folder / scenario if scenario.endswith(".toml") else scenario


def _cut(run: Run, end_ns: int) -> Run:
    """The run up to ``end_ns``."""
    kept = tuple(measurement for measurement in run.measurements if measurement.time_ns <= end_ns)
    truth = run.truth and run.truth.at(run.truth.time_ns <= end_ns)
    return replace(run, measurements=kept, truth=truth)


def content_of(source: RunSource, folder: Path, store: Store) -> Content:
    """The content of a run. A log is read for it once; then its size, time and place on the disk identify it."""
    if source.scenario is not None:
        return _content_of_scenario(source, folder)
    path = place_of(source, folder)
    seen = key_of(
        {
            "path": str(path),
            "state": state_of(path),
            "read_as": [World.load(folder / source.world).table, dict(source.topics), source.truth_to_map]
            if source.world
            else None,
        }
    )
    if not store.has("runs", seen):
        measured = content_of_run(open_run(source, folder))
        store.write("runs", seen, {"content.json": to_json(measured._asdict())})
    return Content(**store.read_json("runs", seen, "content.json"))


def _content_of_scenario(source: RunSource, folder: Path) -> Content:
    """A simulated run follows from its scenario, its seed and the simulator."""
    text = scenario_text(scenario_of(str(source.scenario), folder))
    made = key_of({"text": text, "seed": source.seed, "duration_s": source.duration_s, "code": fingerprint("sensors")})
    return Content(made, made)


def content_of_run(run: Run) -> Content:
    """Hashes of everything an estimator sees, and of the truth."""
    measured = hashlib.sha256(run.world.table.encode())
    measured.update(repr(run.prior).encode())
    for measurement in run.measurements:
        measured.update(repr(measurement).encode())
    truth = hashlib.sha256()
    for column in () if run.truth is None else (run.truth.time_ns, run.truth.x, run.truth.y, run.truth.heading):
        truth.update(column.tobytes())
    return Content(measured.hexdigest(), "" if run.truth is None else truth.hexdigest())
