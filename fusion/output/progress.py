"""Progress of long work, for a person who waits for it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


class Progress(Protocol):
    """A receiver of progress: parts done, of how many, and which was last."""

    def __call__(self, done: int, total: int, what: str) -> None:
        """One more part is done."""


@contextmanager
def progress_bar(title: str) -> Iterator[Progress]:
    """A bar with the time left, on stderr where somebody looks at it."""
    from rich.console import Console
    from rich.progress import Progress as Bar

    with Bar(console=Console(stderr=True), disable=not sys.stderr.isatty(), transient=True) as bar:
        task = bar.add_task(title, total=None)

        def report(done: int, total: int, what: str) -> None:
            bar.update(task, completed=done, total=total, description=what)

        yield report
