"""The Rerun viewer as a process of its own: found, started and spoken to; in a window or in a browser."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, NamedTuple, TypeVar
from urllib.parse import quote
from urllib.request import urlopen

import numpy as np

from benchmarks.review.frame import TIMELINE
from fusion import ViewerError
from fusion.values import nanoseconds

TIMEOUT_S = 90.0
"""The viewer may take this long for each step on a slow, loaded machine."""
PAUSE_S = 0.1
LOCAL = "127.0.0.1"
"""Nobody else on the network is to see a run."""
NO_RERUN = "Rerun is not installed; `pip install 'fusion-localization[review]'` brings it in"
NO_VIEWER = "the Rerun viewer did not start; save the review with --save, and open it elsewhere with `rerun`"

Answer = TypeVar("Answer")


def require_rerun() -> Any:  # noqa: ANN401 - the module
    """The Rerun package; raises `ViewerError` with the remedy where it is missing."""
    try:
        import rerun
    except ImportError as error:
        raise ViewerError(f"{NO_RERUN} ({error})") from error
    return rerun


def has_display() -> bool:
    """Whether a window could be opened."""
    return sys.platform in ("darwin", "win32") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def program() -> str:
    """The viewer inside the installed package: the command of that name on the PATH may be another version."""
    require_rerun()
    import rerun_cli

    name = "rerun.exe" if sys.platform == "win32" else "rerun"
    return str(Path(rerun_cli.__file__).with_name(name))


class Viewer(NamedTuple):
    """A viewer that runs, or is about to: its process, what it said of errors, and its port on this machine."""

    process: subprocess.Popen[bytes]
    errors: IO[bytes]
    port: int
    otherwise: str
    """What is told, with a remedy, when it does not come up."""

    def connected(self) -> Any:  # noqa: ANN401 - Rerun's own value
        """A client once the viewer answers; raises `ViewerError` when it has ended instead."""
        return wait(self._answer, self.otherwise)

    def _answer(self) -> Any | None:  # noqa: ANN401
        self.check()
        from rerun.experimental import ViewerClient

        try:
            client = ViewerClient.connect(f"rerun+http://{LOCAL}:{self.port}/proxy")
            client.get_state()
        except Exception:  # noqa: BLE001 - not there yet, in any of the words gRPC has for that
            return None
        return client

    def check(self) -> None:
        """Raise `ViewerError` when the process has ended."""
        if self.process.poll() is not None:
            self.errors.seek(0)
            # Its first line is the cause; a long trace and where to report it follow.
            said = self.errors.read().decode(errors="replace").strip().partition("\n")[0]
            raise ViewerError(f"{self.otherwise} (the viewer said: {said or 'nothing'})")

    def stop(self) -> None:
        """End it."""
        self.errors.close()
        self.process.terminate()
        try:
            self.process.wait(timeout=10.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def start(
    files: Sequence[Path], *words: str, otherwise: str = NO_VIEWER, environment: Mapping[str, str] | None = None
) -> Viewer:
    """Start the viewer on Rerun files that belong together; it outlives this program unless stopped."""
    port = free_port()
    errors = tempfile.TemporaryFile()  # noqa: SIM115 - the viewer writes into it for as long as it runs
    process = subprocess.Popen(  # noqa: S603 - no shell, our own words
        [program(), *words, "--port", str(port), "--bind", LOCAL, *(str(file.resolve()) for file in files)],
        env={**os.environ, **(environment or {})},
        stdout=subprocess.DEVNULL,
        stderr=errors,
        start_new_session=True,
    )
    return Viewer(process, errors, port, otherwise)


def free_port() -> int:
    """A port on this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind((LOCAL, 0))
        return int(probe.getsockname()[1])


def wait(ask: Callable[[], Answer | None], otherwise: str) -> Answer:
    """Ask until there is an answer; raises `ViewerError` after `TIMEOUT_S`."""
    deadline = time.monotonic() + TIMEOUT_S
    while time.monotonic() < deadline:
        answer = ask()
        if answer is not None:
            return answer
        time.sleep(PAUSE_S)
    raise ViewerError(f"{otherwise} (after {TIMEOUT_S:.0f} s)")


def go_to(client: Any, at_s: float | None) -> int:  # noqa: ANN401
    """Wait for the recording and put the time cursor ``at_s`` after its start (None: at its end); answers it in ns."""

    def loaded() -> Any | None:  # noqa: ANN401
        state = client.get_state()
        return state.recordings[0] if state.recordings and not state.loading else None

    recording = wait(loaded, "the recording is not loaded")
    end_ns = max((line.end or 0 for line in recording.timelines if line.name == TIMELINE), default=0)
    at_ns = end_ns if at_s is None else min(max(nanoseconds(at_s), 0), end_ns)
    client.set_time(TIMELINE, duration=np.timedelta64(at_ns, "ns"), play_state="paused")
    return at_ns


def open_viewer(files: Sequence[Path], *, at_s: float | None = None) -> None:
    """Show Rerun files in a window that outlives this program, the time cursor at ``at_s`` (None: the end)."""
    viewer = start(files, "--hide-welcome-screen")
    with viewer.errors:
        go_to(viewer.connected(), at_s)


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
        viewer.check()
        try:
            with urlopen(f"http://{LOCAL}:{page}/", timeout=TIMEOUT_S):
                return True
        except OSError:
            return None

    try:
        wait(answered, NO_VIEWER)
        yield Served(f"http://{LOCAL}:{page}/?url={source}", viewer.process)
    finally:
        viewer.stop()
