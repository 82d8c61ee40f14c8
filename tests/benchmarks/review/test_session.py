"""A viewer that ends, falls silent or answers nonsense is one `ViewerError`, whatever its client raises."""

import io
import math
import subprocess
from pathlib import Path
from threading import Event

import pytest

from benchmarks.review.picture import MOST_PICTURES, NO_DRIVER, drawn
from benchmarks.review.session import PNG, Session
from benchmarks.review.viewer import NO_ANSWER, NO_VIEWER, Patience, Viewer
from fusion import ViewerError

states = pytest.importorskip("rerun.experimental", reason="needs the extra `review`")

CAUSE = "thread 'main' panicked at 'Failed to get render context'"
END_NS = 4_000_000_000
ANSWERS_OF_A_PICTURE = 6
"""The first, the recording, the time, two pictures that are alike, the views."""
PATIENT = Patience(pause_s=0.0)
LIVES_ON = PATIENT._replace(ending_s=0.01)
"""For a viewer that does not end, which is waited for in vain."""
SILENT = LIVES_ON._replace(answer_s=0.1)
"""For a viewer that never answers."""


class Panic(BaseException):
    """As PyO3's: no `Exception`."""


class StandIn:
    """A viewer, process and client in one, that answers so many questions and then ends, or does what ``then`` does."""

    def __init__(self, answers=math.inf, *, state=None, picture=PNG):
        self.process = subprocess.Popen(["sh", "-c", "read line; exit 102"], stdin=subprocess.PIPE)
        self.errors = io.BytesIO()
        self.left, self.then, self.released = answers, self.end, Event()
        self.state = state or state_of(timeline("t", END_NS))
        self.picture, self.cursor = picture, None

    def end(self):
        self.errors.write(f"{CAUSE}\nstack backtrace:\n  6: core::panicking\n".encode())
        self.process.communicate(b"\n")
        raise ConnectionError("transport error")

    def never(self):
        self.released.wait()

    def panic(self):
        raise Panic("called `Option::unwrap()` on a `None` value")

    def answer(self):
        if self.left == 0:
            self.then()
        self.left -= 1

    def get_state(self):
        self.answer()
        return self.state

    def set_time(self, timeline, *, duration, play_state):
        self.answer()
        self.cursor = timeline, int(duration.astype(int)), play_state

    def save_screenshot(self, file_path):
        self.answer()
        Path(file_path).write_bytes(self.picture)


def timeline(name, end):
    return states.Timeline(name, "duration", 0, end)


def state_of(*timelines, loading=(), reports=()):
    recording = states.Recording("run", "", list(timelines), None, None)
    view = states.View("1", "2D", "Tracks", "/", True, list(reports))
    return viewer_state([recording], list(loading), [view])


def viewer_state(recordings, loading, views):
    return states.ViewerState("", None, recordings, views, loading, None, "0.41.0")


@pytest.fixture
def begin():
    """Opens a session with a stand-in, and ends it after the test."""
    opened = []

    def _begin(stand_in, patience=PATIENT):
        opened.append(stand_in)
        viewer = Viewer(stand_in.process, stand_in.errors, 0, NO_DRIVER, patience)
        return Session.begin(viewer, lambda _port: stand_in)

    yield _begin
    for stand_in in opened:
        stand_in.released.set()
        if stand_in.process.poll() is None:
            stand_in.process.communicate(b"\n")
        stand_in.errors.close()


def test_viewer_that_answers_all_gives_a_picture_at_the_time_asked_for(begin):
    stand_in = StandIn(ANSWERS_OF_A_PICTURE)
    assert drawn(begin(stand_in), 2.5) == PNG
    assert stand_in.cursor == ("t", 2_500_000_000, "paused")
    assert stand_in.left == 0


@pytest.mark.parametrize("at_s", [None, 1e6])
def test_cursor_goes_no_further_than_the_end(begin, at_s):
    assert begin(StandIn()).go_to(at_s) == END_NS


@pytest.mark.parametrize("answers", range(ANSWERS_OF_A_PICTURE))
def test_viewer_that_ends_after_any_answer_is_reported_with_cause_and_remedy(begin, answers):
    with pytest.raises(ViewerError, match="mesa-vulkan-drivers") as caught:
        drawn(begin(StandIn(answers)), None)
    assert str(caught.value) == f"{NO_DRIVER} (it ended with exit code 102: {CAUSE})"


@pytest.mark.parametrize("answers", range(ANSWERS_OF_A_PICTURE))
def test_viewer_that_falls_silent_is_reported_when_its_time_is_over(begin, answers):
    stand_in = StandIn(answers)
    stand_in.then = stand_in.never
    with pytest.raises(ViewerError, match=r"asked for .*: nothing within 0\.1 s") as caught:
        drawn(begin(stand_in, SILENT), None)
    assert str(caught.value).startswith(NO_ANSWER)


def test_viewer_that_never_ends_loading_is_reported_when_its_time_is_over(begin):
    session = begin(StandIn(state=state_of(timeline("t", None), loading=["review.rrd"])), SILENT)
    with pytest.raises(ViewerError, match=r"asked for the recording: nothing within 0\.1 s"):
        session.go_to(None)


@pytest.mark.parametrize("answers", range(1, ANSWERS_OF_A_PICTURE))
def test_panic_of_the_client_is_reported_too(begin, answers):
    stand_in = StandIn(answers)
    stand_in.then = stand_in.panic
    with pytest.raises(ViewerError, match="Panic: called") as caught:
        drawn(begin(stand_in, LIVES_ON), None)
    assert str(caught.value).startswith(NO_ANSWER)


NONSENSE = [
    "no state",
    7,
    viewer_state(5, [], []),
    viewer_state([None], [], []),
    state_of(timeline("t", "soon")),
    state_of(timeline("t", math.nan)),
    state_of(timeline("t", END_NS), reports=[None]),
]


@pytest.mark.parametrize("state", NONSENSE, ids=range(len(NONSENSE)))
def test_nonsense_for_a_state_is_no_answer(begin, state):
    session = begin(StandIn(state=state), LIVES_ON)
    with pytest.raises(ViewerError, match=r"asked for .*: (Attribute|Type|Value)Error"):
        drawn(session, None)


@pytest.mark.parametrize("picture", [b"", b"<html>"])
def test_nonsense_for_a_picture_is_no_answer(begin, picture):
    session = begin(StandIn(picture=picture), LIVES_ON)
    with pytest.raises(ViewerError, match=f"asked for a picture: ValueError: {len(picture)} bytes that are no PNG"):
        session.screenshot()


def test_picture_that_never_settles_is_the_last_one(begin):
    taken = []

    class Restless(StandIn):
        def save_screenshot(self, file_path):
            taken.append(file_path)
            Path(file_path).write_bytes(PNG + bytes([len(taken)]))

    assert drawn(begin(Restless()), None) == PNG + bytes([MOST_PICTURES])


def test_view_that_reports_an_error_is_named(begin):
    warning, error = (states.ViewReport(severity, f"a {severity}", None) for severity in ("warning", "error"))
    assert drawn(begin(StandIn(state=state_of(timeline("t", END_NS), reports=[warning]))), None) == PNG
    with pytest.raises(ViewerError, match="the view 'Tracks' reports: a error"):
        drawn(begin(StandIn(state=state_of(timeline("t", END_NS), reports=[warning, error]))), None)


def test_remedy_is_that_of_the_viewer_that_ended():
    process = subprocess.Popen(["sh", "-c", "kill -9 $$"])
    with io.BytesIO() as errors, pytest.raises(ViewerError) as caught:
        Session.begin(Viewer(process, errors, 0), lambda _port: None)
    assert str(caught.value) == f"{NO_VIEWER} (it ended with signal 9: no message)"
