"""The calibrated numbers in their files: the scenarios of the environments, and one table for all other fillings."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, MutableMapping
from importlib import resources
from pathlib import Path
from typing import Any

import fusion
from benchmarks.paper.assumptions import ALTERNATIVES, MAIN, Filling, Table, filled
from benchmarks.paper.fit_environments import SEEDS, Solved, solve_all
from benchmarks.paper.published import ENVIRONMENTS, ODOMETRY, WIFI, Environment
from fusion import FusionError, WorldError
from sensors.simulation.scenario import Scenario, scenario_text

COMMAND = "fusion reproduce --calibrate FOLDER"
ALTERNATIVES_FILE = "alternatives.toml"

Key = tuple[str, str, str]
"""Scenario, filling, estimator."""


def write_calibrated(
    folder: Path,
    *,
    scenarios: Path | None = None,
    seeds: range = SEEDS,
    workers: int = 1,
    report: Callable[[str], None] = lambda _: None,
) -> list[Path]:
    """Calibrate everything into ``folder``: the scenarios of the environments, and the numbers of the other fillings.

    ``scenarios``: a folder with scenario files to start from, None for the built-in ones. What is not solved for stays
    as it is written there, comments and all. The same command gives the same bytes.
    """
    texts = {env.scenario: scenario_text(env.place(scenarios)) for env in ENVIRONMENTS}
    tables = {name: tomllib.loads(text) for name, text in texts.items()}
    solved: dict[Key, Solved] = {}
    for (environment, filling, estimator), number in solve_all(tables, seeds, workers):
        solved[environment.scenario, filling.key, estimator] = number
        reached_cm = 100.0 * number.reached_m
        report(f"{environment.title}, {filling.title}: {estimator} errs {reached_cm:.1f} cm at {number.value:g}")
    written = [
        _write(folder / f"{environment.scenario}.toml", _main_text(environment, texts, tables, solved, seeds))
        for environment in ENVIRONMENTS
    ]
    return [*written, _write(folder / ALTERNATIVES_FILE, _alternatives_text(solved, seeds))]


def _write(path: Path, text: str) -> Path:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise FusionError(f"{path}: cannot be written ({error.strerror}); give another folder") from error
    return path


def _main_text(
    environment: Environment,
    texts: Mapping[str, str],
    tables: Mapping[str, Table],
    solved: Mapping[Key, Solved],
    seeds: range,
) -> str:
    import tomlkit

    odometry, wifi = (solved[environment.scenario, MAIN.key, estimator] for estimator in (ODOMETRY, WIFI))
    table = filled(tables[environment.scenario], MAIN, odometry.value, wifi.value)
    table["calibration"] = _provenance(seeds) | {
        "odometry_factor": odometry.value,
        "odometry_max_m": environment.odometry_max_m,
        "odometry_max_reached_m": odometry.reached_m,
        "shadowing_std_db": wifi.value,
        "wifi_max_m": environment.wifi_max_m,
        "wifi_max_reached_m": wifi.reached_m,
    }
    document = tomlkit.parse(texts[environment.scenario])
    _update(document, table)
    return tomlkit.dumps(document)


def _provenance(seeds: range) -> Table:
    return {
        "command": COMMAND,
        "target": "median over the seeds of the largest absolute coordinate error over the trial points",
        "seeds": [seeds.start, seeds.stop - 1],
        "fusion": fusion.__version__,
    }


def _alternatives_text(solved: Mapping[Key, Solved], seeds: range) -> str:
    import tomlkit

    document = tomlkit.document()
    document.add(tomlkit.comment("The calibrated numbers of every other filling: odometry's factor, and Wi-Fi's dB."))
    document["calibration"] = _provenance(seeds)
    for environment in ENVIRONMENTS:
        rows = {}
        for filling in ALTERNATIVES:
            source = {
                ODOMETRY: MAIN if filling.drives_like_main else filling,
                WIFI: MAIN if filling.receives_like_main else filling,
            }
            numbers = {
                estimator: solved[environment.scenario, each.key, estimator] for estimator, each in source.items()
            }
            rows[filling.key] = {
                "odometry_factor": numbers[ODOMETRY].value,
                "odometry_max_reached_m": numbers[ODOMETRY].reached_m,
                "wifi_db": numbers[WIFI].value,
                "wifi_max_reached_m": numbers[WIFI].reached_m,
            }
        document[environment.scenario] = rows
    return tomlkit.dumps(document)


def _update(document: MutableMapping[str, Any], solved: Table) -> None:
    """Put what differs into the document, and leave the rest of its text alone."""
    for key, value in solved.items():
        if isinstance(value, dict) and key in document:
            _update(document[key], value)
        elif key not in document or document[key] != value:
            document[key] = value


def calibrated_alternative(environment: Environment, filling: Filling, scenarios: Path | None = None) -> Scenario:
    """The environment's scenario in another filling, at its calibrated numbers; raises `WorldError`."""
    numbers = calibrated_numbers(environment, filling, scenarios)
    table = tomllib.loads(scenario_text(environment.place(scenarios)))
    changed = filled(table, filling, numbers["odometry_factor"], numbers["wifi_db"])
    return Scenario.from_table(f"{environment.scenario}, {filling.title}", changed)


def calibrated_numbers(environment: Environment, filling: Filling, scenarios: Path | None = None) -> dict[str, float]:
    """The calibrated numbers of another filling; raises `WorldError`."""
    folder = resources.files("benchmarks").joinpath("paper") if scenarios is None else scenarios
    try:
        stored = tomllib.loads(folder.joinpath(ALTERNATIVES_FILE).read_text(encoding="utf-8"))
        return dict(stored[environment.scenario][filling.key])
    except (OSError, ValueError, KeyError) as error:
        raise WorldError(
            f"{folder}/{ALTERNATIVES_FILE}: no numbers for {environment.scenario}, {filling.key} ({error!r}); "
            f"make it anew with `{COMMAND}`"
        ) from error
