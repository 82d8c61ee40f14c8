"""The Rerun viewer as a process of its own: found, started, asked, ended.

It may end at any moment, fall silent, or answer nonsense: without a Vulkan driver it answers once or twice and ends.
Its client then raises anything, or never returns. So all questions go through `Viewer.ask`, which raises one error
alone.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent import futures
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import IO, Any, NamedTuple, TypeVar

from fusion import ViewerError

LOCAL = "127.0.0.1"
"""Nobody else on the network is to see a run."""
NO_RERUN = "Rerun is not installed; `pip install 'fusion-localization[review]'` brings it in"
NO_VIEWER = "the Rerun viewer does not run here; save the review with --save, and open it elsewhere with `rerun`"
NO_ANSWER = (
    "the Rerun viewer does not answer as it should; try again, or save the review with --save and open it elsewhere "
    "with `rerun`"
)

Answer = TypeVar("Answer")


class Patience(NamedTuple):
    """Time limits of a viewer on a slow, loaded machine [s]."""

    answer_s: float = 90.0
    """For an answer; for starting or loading, too, however often it is asked meanwhile."""
    ending_s: float = 10.0
    """From a failure to its end: it writes down the cause first."""
    pause_s: float = 0.1
    """Between two questions for the same thing."""


def require_rerun() -> Any:  # noqa: ANN401 - the module
    """The Rerun package; raises `ViewerError` with the remedy where it is missing."""
    try:
        import rerun
    except ImportError as error:
        raise ViewerError(f"{NO_RERUN} ({error})") from error
    return rerun


def program() -> str:
    """The viewer inside the installed package: the command of that name on the PATH may be another version."""
    require_rerun()
    import rerun_cli

    name = "rerun.exe" if sys.platform == "win32" else "rerun"
    return str(Path(rerun_cli.__file__).with_name(name))


class Viewer(NamedTuple):
    """A viewer that runs, or is about to: its process, its standard error, and its port on this machine."""

    process: subprocess.Popen[bytes]
    errors: IO[bytes]
    port: int
    remedy: str = NO_VIEWER
    """The remedy where it ends by itself: the start of that error's message."""
    patience: Patience = Patience()

    def ask(self, wanted: str, question: Callable[[], Answer]) -> Answer:
        """The answer to ``question``, which asks for what is ``wanted``. Raises `ViewerError` where none comes in time,
        or it raises anything: it checks the answer, too.
        """
        return self._ask(wanted, question, self.patience.answer_s)

    def _ask(self, wanted: str, question: Callable[[], Answer], limit_s: float) -> Answer:
        answer: futures.Future[Answer] = futures.Future()
        # Not by an executor, which waits for its threads when the program ends.
        Thread(target=_answer, args=(question, answer), daemon=True).start()
        futures.wait([answer], limit_s)
        if not answer.done():
            raise self._silence(wanted)
        if (error := answer.exception()) is not None:
            raise self._failure(f"asked for {wanted}: {type(error).__name__}: {error}") from error
        return answer.result()

    def until(self, wanted: str, question: Callable[[], Answer | None]) -> Answer:
        """The first answer that is not None; raises `ViewerError` as `ask` does."""
        deadline = time.monotonic() + self.patience.answer_s
        while (left_s := deadline - time.monotonic()) > 0.0:
            if (ending := self._ending()) is not None:
                raise ViewerError(ending)
            answer = self._ask(wanted, question, left_s)
            if answer is not None:
                return answer
            time.sleep(self.patience.pause_s)
        raise self._silence(wanted)

    def _silence(self, wanted: str) -> ViewerError:
        return self._failure(f"asked for {wanted}: nothing within {self.patience.answer_s:g} s")

    def _failure(self, what: str) -> ViewerError:
        """The error to raise: that it ended if it did, for then that is the cause of the rest."""
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(self.patience.ending_s)
        return ViewerError(self._ending() or f"{NO_ANSWER} ({what})")

    def _ending(self) -> str | None:
        """The remedy, and the cause that it has left behind; None while it runs."""
        code = self.process.poll()
        if code is None:
            return None
        self.errors.seek(0)
        # Its first line is the cause; a long trace and where to report it follow.
        first = self.errors.read().decode(errors="replace").strip().partition("\n")[0]
        ended = f"signal {-code}" if code < 0 else f"exit code {code}"
        return f"{self.remedy} (it ended with {ended}: {first or 'no message'})"

    def stop(self) -> None:
        """End it."""
        self.errors.close()
        self.process.terminate()
        try:
            self.process.wait(self.patience.ending_s)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def _answer(question: Callable[[], Answer], answer: futures.Future[Answer]) -> None:
    try:
        answer.set_result(question())
    except BaseException as error:  # noqa: BLE001 - a panic of Rerun's is no Exception; interrupts are for the main thread
        answer.set_exception(error)


def start(
    files: Sequence[Path], *words: str, remedy: str = NO_VIEWER, environment: Mapping[str, str] | None = None
) -> Viewer:
    """Start the viewer on Rerun files that belong together; it outlives this program unless stopped."""
    port = free_port()
    command = [program(), *words, "--port", str(port), "--bind", LOCAL, *(str(file.resolve()) for file in files)]
    errors = tempfile.TemporaryFile()  # noqa: SIM115 - the viewer writes into it for as long as it runs
    try:
        process = subprocess.Popen(  # noqa: S603 - no shell, our own words
            command,
            # What it writes shall begin with the cause of its end.
            env={**os.environ, "RUST_LOG": "error", **(environment or {})},
            stdout=subprocess.DEVNULL,
            stderr=errors,
            start_new_session=True,
        )
    except OSError as error:
        errors.close()
        raise ViewerError(f"{remedy} ({error})") from error
    return Viewer(process, errors, port, remedy)


def free_port() -> int:
    """A port on this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind((LOCAL, 0))
        return int(probe.getsockname()[1])
