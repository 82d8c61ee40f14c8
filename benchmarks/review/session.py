"""A viewer that answers: its state, its time cursor, its picture. Each question is one to `Viewer.ask`."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np

from benchmarks.review.frame import TIMELINE
from benchmarks.review.viewer import LOCAL, Viewer
from fusion.values import nanoseconds

PNG = b"\x89PNG\r\n\x1a\n"


class Client(Protocol):
    """The part of `rerun.experimental.ViewerClient` that is used."""

    def get_state(self) -> Any:  # noqa: ANN401 - Rerun's own value
        """The recordings, whether more is loading, and the views."""

    def set_time(self, timeline: str, *, duration: np.timedelta64, play_state: Literal["paused"]) -> None:
        """Move the time cursor."""

    def save_screenshot(self, file_path: str) -> None:
        """Write what it shows into a PNG file."""


def connect(port: int) -> Client:
    """Rerun's own client of the viewer at a port of this machine."""
    from rerun.experimental import ViewerClient

    client: Client = ViewerClient.connect(f"rerun+http://{LOCAL}:{port}/proxy")
    return client


class Session(NamedTuple):
    """A viewer and a client of it. Every method raises `ViewerError` where the viewer fails."""

    viewer: Viewer
    client: Client

    @classmethod
    def begin(cls, viewer: Viewer, connect: Callable[[int], Client] = connect) -> Session:
        """Wait for the first answer."""

        def first_answer() -> Client | None:
            try:
                client = connect(viewer.port)
                client.get_state()
            except Exception:  # noqa: BLE001 - not there yet, in any of the words gRPC has for that
                return None
            return client

        return cls(viewer, viewer.until("a first answer", first_answer))

    def go_to(self, at_s: float | None) -> int:
        """Wait for the recording and put the time cursor ``at_s`` after its start (None: at its end), which is answered
        in ns.
        """
        end_ns = self.viewer.until("the recording", self._end_ns)
        at_ns = end_ns if at_s is None else min(max(nanoseconds(at_s), 0), end_ns)

        def move() -> None:
            self.client.set_time(TIMELINE, duration=np.timedelta64(at_ns, "ns"), play_state="paused")

        self.viewer.ask("another time", move)
        return at_ns

    def _end_ns(self) -> int | None:
        """The end of the first recording on our timeline; None while it is loading."""
        state = self.client.get_state()
        if state.loading or not state.recordings:
            return None
        lines = state.recordings[0].timelines
        return max((int(line.end or 0) for line in lines if line.name == TIMELINE), default=0)

    def screenshot(self) -> bytes:
        """Its picture, as a PNG file."""
        return self.viewer.ask("a picture", self._picture)

    def _picture(self) -> bytes:
        with tempfile.TemporaryDirectory(prefix="fusion-picture-") as folder:
            place = Path(folder, "picture.png")
            self.client.save_screenshot(str(place))
            content = place.read_bytes()
        if not content.startswith(PNG):
            raise ValueError(f"{len(content)} bytes that are no PNG file")
        return content

    def errors_of_views(self) -> list[tuple[str, str]]:
        """Views that could not show something, by name, with their reports of that."""
        return self.viewer.ask("the state of its views", self._errors_of_views)

    def _errors_of_views(self) -> list[tuple[str, str]]:
        reports = [(view.name, report) for view in self.client.get_state().views for report in view.reports]
        return [(name, report.summary) for name, report in reports if report.severity == "error"]
