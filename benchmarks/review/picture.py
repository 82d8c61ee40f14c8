"""A picture of a review, made by the real Rerun viewer without a display."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from benchmarks.review.session import Session
from benchmarks.review.viewer import require_rerun, start
from fusion import ViewerError
from fusion.output.files import require_place, write

SIZE = (1800, 1100)
"""Width and height of the picture [pixels]."""
MOST_PICTURES = 6
"""Plots fill in lazily: pictures are taken until two are alike, at most this many."""
NO_DRIVER = (
    "the Rerun viewer cannot draw a picture here, usually for want of a Vulkan driver; on Debian or Ubuntu "
    "`apt-get install --no-install-recommends libvulkan1 mesa-vulkan-drivers libudev1` brings one, and a review saved "
    "with --save opens elsewhere with `rerun`"
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
    with headless_viewer(files) as session:
        content = drawn(session, at_s)
    write(output, content)
    return output


@contextmanager
def headless_viewer(files: Sequence[Path]) -> Iterator[Session]:
    """A viewer that has its own temporary folder, for it leaves files behind, and ends with the block."""
    with tempfile.TemporaryDirectory(prefix="fusion-viewer-") as folder:
        words = ("--headless", "--window-size", "x".join(map(str, SIZE)), "--hide-welcome-screen")
        viewer = start(files, *words, remedy=NO_DRIVER, environment={"XDG_RUNTIME_DIR": folder, "TMPDIR": folder})
        try:
            yield Session.begin(viewer)
        finally:
            viewer.stop()


def drawn(session: Session, at_s: float | None) -> bytes:
    """The picture at ``at_s``, once it settles, as a PNG file; raises `ViewerError`."""
    session.go_to(at_s)
    content = _settled(session)
    for name, summary in session.errors_of_views():
        raise ViewerError(f"the view {name!r} reports: {summary}; please report this as a bug")
    return content


def _settled(session: Session) -> bytes:
    before = session.screenshot()
    for _ in range(MOST_PICTURES - 1):
        time.sleep(5 * session.viewer.patience.pause_s)
        now = session.screenshot()
        if now == before:
            break
        before = now
    return before
