"""The truth that the cells of a run are scored against, kept in the store: opening a run takes longer than scoring."""

from __future__ import annotations

from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile

import numpy as np

from benchmarks.runner.plan import Cell
from benchmarks.runner.run_source import KEPT_RUNS, open_run
from benchmarks.runner.store import Store, key_of, to_json
from logs.prior import begin_ns
from logs.run import Run
from logs.truth import Instants, TruthTrack, evaluation_instants

KIND = "references"


class Reference(NamedTuple):
    """The truth of a run and the instants at which it is compared, both empty where there is none, and the first time
    that its measurements cover.
    """

    truth: TruthTrack
    instants: Instants
    begin_ns: int

    @classmethod
    @lru_cache(maxsize=KEPT_RUNS)
    def of(cls, run: Run) -> Reference:
        """The reference of a run by the usual rules: taken once, whatever the number of estimators."""
        truth = run.truth or TruthTrack.from_truths([])
        return cls(truth, evaluation_instants(truth), begin_ns(run.measurements))


def reference_of(cell: Cell, store: Store) -> Reference:
    """The reference of a cell's run, from the store once it is there; raises `FusionError` when that is damaged."""
    key = key_of(cell.content._asdict())
    if not store.has(KIND, key):
        store.write(KIND, key, _files(open_run(cell.run, cell.folder)))
    return _read(store.folder, key, cell.evaluation.hz, cell.evaluation.gap_s)


def _files(run: Run) -> dict[str, bytes]:
    buffer, truth = BytesIO(), run.truth or TruthTrack.from_truths([])
    np.savez(buffer, time_ns=truth.time_ns, x=truth.x, y=truth.y, heading=truth.heading)
    return {"truth.npz": buffer.getvalue(), "reference.json": to_json({"begin_ns": begin_ns(run.measurements)})}


@lru_cache(maxsize=KEPT_RUNS)
def _read(folder: Path, key: str, hz: float, gap_s: float) -> Reference:
    store = Store(folder)
    try:
        with np.load(BytesIO(store.read(KIND, key, "truth.npz")), allow_pickle=False) as stored:
            truth = TruthTrack(*(stored[name] for name in ("time_ns", "x", "y", "heading")))
    except (ValueError, KeyError, EOFError, BadZipFile) as error:
        raise store.damaged(KIND, key, "truth.npz", error) from error
    began_ns = store.read_json(KIND, key, "reference.json")["begin_ns"]
    return Reference(truth, evaluation_instants(truth, hz=hz, gap_s=gap_s), began_ns)
