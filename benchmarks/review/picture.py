"""A picture of a review, made by the real Rerun viewer without a display."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from benchmarks.output import require_place
from benchmarks.review.viewer import PAUSE_S, go_to, require_rerun, start
from fusion import ViewerError

SIZE = (1800, 1100)
"""Width and height of the picture [pixels]."""
MOST_PICTURES = 6
"""Plots fill in lazily: pictures are taken until two are alike, at most this many."""
NO_DRIVER = (
    "the Rerun viewer cannot draw without a display here; give it a Vulkan driver, on Debian or Ubuntu by "
    "`apt-get install --no-install-recommends libvulkan1 mesa-vulkan-drivers libudev1`, or save the review with --save"
)


def render(files: Sequence[Path], output: Path, *, at_s: float | None = None) -> Path:
    """Draw Rerun files that belong together into the PNG file ``output``, the time cursor ``at_s`` after the start
    (None: at the end). Raises `ViewerError` when there is no viewer, no driver, or a view that reports an error, and
    `FusionError` for a place that cannot be written to.
    """
    require_rerun()
    for file in files:
        if not file.is_file():
            raise ViewerError(f"{file}: no such file; write one with `fusion review RUN.mcap --save {file}`")
    require_place(output)
    with headless_viewer(files) as client:
        go_to(client, at_s)
        _take_settled(client, output)
        _check_views(client)
    return output


@contextmanager
def headless_viewer(files: Sequence[Path]) -> Iterator[Any]:
    """A client of a viewer that has its own temporary folder, for it leaves files behind, and ends with the block."""
    with tempfile.TemporaryDirectory(prefix="fusion-picture-") as folder:
        words = ("--headless", "--window-size", "x".join(map(str, SIZE)), "--hide-welcome-screen")
        environment = {"XDG_RUNTIME_DIR": folder, "TMPDIR": folder, "RUST_LOG": "error"}
        viewer = start(files, *words, otherwise=NO_DRIVER, environment=environment)
        try:
            yield viewer.connected()
        finally:
            viewer.stop()


def _take_settled(client: Any, output: Path) -> None:  # noqa: ANN401 - Rerun's own value
    before = b""
    for _ in range(MOST_PICTURES):
        client.save_screenshot(str(output.resolve()))
        now = output.read_bytes()
        if now == before:
            return
        before = now
        time.sleep(5 * PAUSE_S)


def _check_views(client: Any) -> None:  # noqa: ANN401
    """Views report what they could not show."""
    reports = [(view.name, report) for view in client.get_state().views for report in view.reports]
    for name, report in reports:
        if report.severity == "error":
            raise ViewerError(f"the view {name!r} reports: {report.summary}; please report this as a bug")
