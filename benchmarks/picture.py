"""A picture of a review, made by the real Rerun viewer without a display, and the viewer itself where there is one."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from fusion import ViewerError
from fusion.values import nanoseconds

SIZE = (1800, 1100)
"""Width and height of the picture [pixels]."""
TIMEOUT_S = 90.0
"""The viewer may take this long for each step on a slow, loaded machine."""
PAUSE_S = 0.1
MOST_PICTURES = 6
"""Plots fill in lazily: pictures are taken until two are alike, at most this many."""
NO_RERUN = "Rerun is not installed; `pip install 'fusion-localization[review]'` brings it in"
NO_DRIVER = (
    "the Rerun viewer cannot draw without a display here; give it a Vulkan driver, on Debian or Ubuntu by "
    "`apt-get install --no-install-recommends libvulkan1 mesa-vulkan-drivers libudev1`, or save the review with --save"
)

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


def open_viewer(scene: Path) -> None:
    """Show a Rerun file in a window that outlives this program."""
    quiet = subprocess.DEVNULL
    words = [_program(), str(scene.resolve())]
    subprocess.Popen(words, stdout=quiet, stderr=quiet, start_new_session=True)  # noqa: S603 - no shell, our own words


def render(scene: Path, output: Path, *, at_s: float | None = None) -> Path:
    """Draw the Rerun file ``scene`` into the PNG file ``output``, the time cursor ``at_s`` after the start (None: at
    the end). Raises `ViewerError` when there is no viewer, no driver, or a view that reports an error.
    """
    require_rerun()
    if not scene.is_file():
        raise ViewerError(f"{scene}: no such file; write one with `fusion review RUN.mcap --save {scene}`")
    output.parent.mkdir(parents=True, exist_ok=True)
    with _headless_viewer(scene) as viewer:
        recording = _wait(lambda: _loaded(viewer), "the recording is not loaded")
        end_ns = max((timeline.end or 0 for timeline in recording.timelines if timeline.name == "t"), default=0)
        at_ns = end_ns if at_s is None else min(max(nanoseconds(at_s), 0), end_ns)
        viewer.set_time("t", duration=np.timedelta64(at_ns, "ns"), play_state="paused")
        _take_settled(viewer, output)
        _check_views(viewer, scene)
    return output


def _program() -> str:
    """The viewer inside the installed package: the command of that name on the PATH may be another version."""
    require_rerun()
    import rerun_cli

    name = "rerun.exe" if sys.platform == "win32" else "rerun"
    return str(Path(rerun_cli.__file__).with_name(name))


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def _headless_viewer(scene: Path) -> Iterator[Any]:
    """A connected viewer that has its own temporary folder, for it leaves files behind, and ends with the block."""
    port = _free_port()
    with tempfile.TemporaryDirectory(prefix="fusion-picture-") as folder, Path(folder, "errors").open("w+b") as errors:
        environment = {**os.environ, "XDG_RUNTIME_DIR": folder, "TMPDIR": folder, "RUST_LOG": "error"}
        size = "x".join(map(str, SIZE))
        words = ["--headless", "--window-size", size, "--port", str(port), "--bind", "127.0.0.1"]
        process = subprocess.Popen(  # noqa: S603 - no shell, our own words
            [_program(), *words, "--hide-welcome-screen", str(scene.resolve())],
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=errors,
        )
        try:
            yield _wait(lambda: _connected(process, port, Path(folder, "errors")), NO_DRIVER)
        finally:
            process.terminate()
            try:
                process.wait(timeout=10.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _connected(process: subprocess.Popen[bytes], port: int, errors: Path) -> Any | None:  # noqa: ANN401
    """The client once the viewer answers; raises `ViewerError` when the viewer has ended instead."""
    if process.poll() is not None:
        # Its first line is the cause; a long trace and where to report it follow.
        said = errors.read_text(errors="replace").strip().partition("\n")[0]
        raise ViewerError(f"{NO_DRIVER} (the viewer said: {said or 'nothing'})")
    from rerun.experimental import ViewerClient

    try:
        client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        client.get_state()
    except Exception:  # noqa: BLE001 - not there yet, in any of the words gRPC has for that
        return None
    return client


def _loaded(viewer: Any) -> Any | None:  # noqa: ANN401
    state = viewer.get_state()
    return state.recordings[0] if state.recordings and not state.loading else None


def _wait(ask: Callable[[], Answer | None], otherwise: str) -> Answer:
    """Ask until there is an answer; raises `ViewerError` after `TIMEOUT_S`."""
    deadline = time.monotonic() + TIMEOUT_S
    while time.monotonic() < deadline:
        answer = ask()
        if answer is not None:
            return answer
        time.sleep(PAUSE_S)
    raise ViewerError(f"{otherwise} (after {TIMEOUT_S:.0f} s)")


def _take_settled(viewer: Any, output: Path) -> None:  # noqa: ANN401
    before = b""
    for _ in range(MOST_PICTURES):
        viewer.save_screenshot(str(output.resolve()))
        now = output.read_bytes()
        if now == before:
            return
        before = now
        time.sleep(5 * PAUSE_S)


def _check_views(viewer: Any, scene: Path) -> None:  # noqa: ANN401
    """Views report what they could not show."""
    reports = [(view.name, report) for view in viewer.get_state().views for report in view.reports]
    for name, report in reports:
        if report.severity == "error":
            raise ViewerError(f"{scene}: the view {name!r} reports: {report.summary}; please report this as a bug")
