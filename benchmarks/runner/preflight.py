"""Checks before a plan is carried out: a cell that fails for such a reason would report it much later."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import fusion
from benchmarks.faults.inject import faulty_columns
from benchmarks.runner.plan import Cell, read_faults
from benchmarks.runner.run_source import open_run, open_world
from benchmarks.runner.suite import CLEAN, EstimatorSpec
from fusion import FusionError, ParameterError, SuiteError, World


def refuse_impossible(cells: Sequence[Cell]) -> None:
    """Raise `SuiteError` for parameters that an estimator refuses, in a corner of a grid too, and `ParameterError` for
    a fault of what its run does not have: a topic, an anchor, a sensor, a wheel.
    """
    _refuse_parameters(cells)
    _refuse_faults(cells)


def _refuse_parameters(cells: Sequence[Cell]) -> None:
    """Build every estimator once in each world it is to run in."""
    one_each = {cell.run.id: cell for cell in cells}
    worlds = {run: open_world(cell.run, cell.folder) for run, cell in one_each.items()}
    asked = {(cell.estimator.id, worlds[cell.run.id].hash): cell for cell in cells}.values()
    refusals = {cell.estimator.id: _refusal(cell.estimator, worlds[cell.run.id]) for cell in asked}
    refused = {name: why for name, why in refusals.items() if why is not None}
    if refused:
        first, *others = refused
        more = f"; so are refused {', '.join(others)}" if others else ""
        raise SuiteError(f"estimator {first}: {refused[first]}{more}")


def _refusal(estimator: EstimatorSpec, world: World) -> str | None:
    """Reason why the parameters are refused, None when they are not. An estimator that cannot be had in that world
    whatever its parameters is not refused: that is a result, of cells that are lost.
    """
    try:
        fusion.build(estimator.use, world, estimator.params)
    except ParameterError as error:
        return str(error)
    except FusionError as error:
        return str(error) if estimator.params and _can_be_built(estimator.use, world) else None
    return None


def _can_be_built(name: str, world: World) -> bool:
    try:
        fusion.build(name, world)
    except FusionError:
        return False
    return True


def _refuse_faults(cells: Sequence[Cell]) -> None:
    """Write each fault of a run into it once."""
    for cell in {(cell.run.id, cell.fault.id): cell for cell in cells if cell.fault.id != CLEAN}.values():
        run = replace(open_run(cell.run, cell.folder), name=cell.run.id)
        faulty_columns(run, read_faults(cell.fault), suite_seed=cell.suite_seed, fault_id=cell.fault.id, seed=cell.seed)
