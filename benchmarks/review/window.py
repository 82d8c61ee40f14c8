"""A review in the viewer's own window, or in a browser."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from http.client import HTTPException
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote
from urllib.request import urlopen

from benchmarks.review.session import Session
from benchmarks.review.viewer import LOCAL, free_port, start


def has_display() -> bool:
    """True where a window can be opened."""
    return sys.platform in ("darwin", "win32") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def open_viewer(files: Sequence[Path], *, at_s: float | None = None) -> None:
    """Show Rerun files in a window that outlives this program, the time cursor at ``at_s`` (None: the end)."""
    viewer = start(files, "--hide-welcome-screen")
    with viewer.errors:
        Session.begin(viewer).go_to(at_s)


class Served(NamedTuple):
    """A web viewer: where it is, and the server's process."""

    address: str
    process: subprocess.Popen[bytes]


@contextmanager
def serve_web(files: Sequence[Path]) -> Iterator[Served]:
    """The web viewer on Rerun files, for browsers on this machine, as long as the block lasts."""
    page = free_port()
    viewer = start(files, "--serve-web", "--web-viewer-port", str(page))
    source = quote(f"rerun+http://{LOCAL}:{viewer.port}/proxy", safe="")

    def answered() -> bool | None:
        try:
            with urlopen(f"http://{LOCAL}:{page}/", timeout=viewer.patience.answer_s):
                return True
        except (OSError, HTTPException):
            return None

    try:
        viewer.until("its page", answered)
        yield Served(f"http://{LOCAL}:{page}/?url={source}", viewer.process)
    finally:
        viewer.stop()
