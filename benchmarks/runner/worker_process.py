"""The other side of `benchmarks.runner.workers`: the loop of one process, and the watches that end it."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from multiprocessing import parent_process
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from fusion.collection import collect_seldom

OUT_OF_MEMORY = 77
"""Exit code of a worker whose task took more memory than it may."""
WATCH_S = 0.05


class Answer(NamedTuple):
    """Answer of a worker: a value, or the exception raised instead."""

    value: Any
    raised: BaseException | None = None

    def result(self) -> Any:  # noqa: ANN401 - whatever the work answers
        """The value, or what was raised, raised again."""
        if self.raised is not None:
            raise self.raised
        return self.value


def serve(connection: Connection, work: Callable[[Any], Any], rss_mb: float | None, idle_s: float | None) -> None:
    """The life of a worker: report that it is ready, then answer task after task until nobody asks any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    collect_seldom()
    threading.Thread(target=_watch_parent, daemon=True).start()
    if rss_mb is not None:
        threading.Thread(target=_watch_memory, args=(rss_mb,), daemon=True).start()
    connection.send("ready")
    while connection.poll(idle_s):
        try:
            task = connection.recv()
        except EOFError:
            return
        try:
            answer = Answer(work(task))
        except Exception as error:  # noqa: BLE001 - it is raised where the result is asked for
            answer = Answer(None, error)
        if rss_mb is not None:
            _require_within(rss_mb)  # between two looks of the watch, and the next task would pay for it
        connection.send(answer)


def _watch_parent() -> NoReturn:
    """End the process, whatever it is at, when the one that asks ends, however that happens."""
    parent = parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)


def _watch_memory(rss_mb: float) -> NoReturn:
    """End the process once it has ever held more than it may."""
    while True:
        _require_within(rss_mb)
        time.sleep(WATCH_S)


def _require_within(rss_mb: float) -> None:
    if peak_rss_bytes() > rss_mb * 2**20:
        os._exit(OUT_OF_MEMORY)


def peak_rss_bytes() -> int:
    """The most memory that this process ever held. Linux's own resource usage would count what the parent held, too."""
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
        return 1024 * int(next(line for line in lines if line.startswith("VmHWM")).split()[1])
    except (OSError, StopIteration):
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
