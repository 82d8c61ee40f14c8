"""Faults by name, read from a suite and written into a copy of a run.

Only what was measured is rewritten, and for `BadStart` the start; log, truth and world stay as they are. Every
estimator meets the same draw: chance comes from the suite's seed, the run, the fault and the seed of the repetition,
never from the estimator. A second fault leaves the draws of the first as they were; a fault with a greater ``p`` or
spread changes what the milder one changes, and more or harder.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from benchmarks.faults.fault import Fault
from benchmarks.faults.row_selection import Windows
from benchmarks.faults.run_columns import RunColumns
from fusion import FusionError, ParameterError, PluginError, WorldError, load, names
from fusion.plugins import FAULTS
from fusion.schema import read_record
from logs.run import Run

FAULT_STREAM = 1
"""First number of every key of random numbers that belong to faults; those of estimators have another."""


def read_fault(table: object, where: str) -> Fault:
    """A fault from its TOML table, ``{kind = "drop", topic = "wifi", source = "ap2", windows = [[20, 50]]}``; raises
    `ParameterError` that names ``where``. ``kind`` is the name of an installed fault (`fusion.plugins.FAULTS`).
    """
    if not isinstance(table, Mapping):
        raise ParameterError(f'{where}: expected a table such as {{kind = "drop", topic = "wifi"}}, got {table!r}')
    if "kind" not in table:
        raise ParameterError(f"{where}: kind is missing; add it, one of {', '.join(names(FAULTS))}")
    kind = str(table["kind"])
    try:
        made: type[Fault] = load(kind, FAULTS)
        return read_record(made, {key: table[key] for key in table if key != "kind"}, f"{where} ({kind})")
    except PluginError as error:
        raise ParameterError(f"{where}: {error}") from error
    except WorldError as error:  # the reader of world files, at work on something else
        raise ParameterError(str(error)) from error
    except FusionError:
        raise
    except Exception as error:
        raise PluginError(f"{where} ({kind}): cannot be made: {error!r}; correct that fault") from error


def apply_faults(run: Run, faults: Sequence[Fault], *, suite_seed: int, fault_id: str, seed: int) -> Run:
    """``run`` with all ``faults``, which together are called ``fault_id``, in the order given; ``seed`` counts the
    repetitions. Raises `ParameterError` for a topic, source or wheel that the run does not have.
    """
    return faulty_columns(run, faults, suite_seed=suite_seed, fault_id=fault_id, seed=seed).as_run()


def faulty_columns(run: Run, faults: Sequence[Fault], *, suite_seed: int, fault_id: str, seed: int) -> RunColumns:
    """The columns of ``run`` with the faults written into them; of what `apply_faults` does, all that it can refuse."""
    columns = RunColumns(run)
    applied: Counter[str] = Counter()
    for fault in faults:
        key = fault_seed(suite_seed, run.name, fault_id, seed)
        own = (*key.spawn_key, stable_hash(fault.place), applied[fault.place])
        random = np.random.Generator(np.random.PCG64(np.random.SeedSequence(suite_seed, spawn_key=own)))
        applied[fault.place] += 1
        try:
            fault.apply(columns, random)
        except ParameterError as error:
            raise ParameterError(f"fault {fault_id!r} ({fault.kind}) on run {run.name!r}: {error}") from error
    return columns


def outages(faults: Sequence[Fault]) -> Windows:
    """Windows of all ``faults`` that do not last the whole run, in order; those that overlap or touch are one."""
    merged: list[tuple[float, float]] = []
    for begin, end in sorted(window for fault in faults for window in fault.lasts):
        if merged and begin <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        else:
            merged.append((begin, end))
    return tuple(merged)


def fault_seed(suite_seed: int, run: str, fault: str, seed: int) -> np.random.SeedSequence:
    """The randomness of all faults called ``fault`` on ``run``; raises `ParameterError` for a negative seed."""
    if suite_seed < 0 or seed < 0:
        raise ParameterError(f"seeds {suite_seed} and {seed}: must not be negative; give 0, 1, 2 ...")
    return np.random.SeedSequence(suite_seed, spawn_key=(FAULT_STREAM, stable_hash(run), stable_hash(fault), seed))


def stable_hash(text: str) -> int:
    """The first eight bytes of SHA-256, most significant first; Python's own ``hash`` differs from process to process.

    >>> stable_hash("ap2-out")
    8665761871651810444
    """
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big")
