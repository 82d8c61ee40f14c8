"""A part of a job done by a user without any right, user 65534."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

NOBODY = 65534


class Nobody:
    """Runs ``action(connection)`` in a forked process; what it sends over `connection` is had from `receive`."""

    def __init__(self, action: Callable[[Connection], None]) -> None:
        processes = multiprocessing.get_context("fork")  # a fresh interpreter could not read root's environment
        self._here, there = processes.Pipe()
        self._process = processes.Process(target=_drop_rights_and, args=(action, there))
        self._process.start()
        there.close()

    def receive(self) -> Any:
        """The next thing sent; `EOFError` if the process died instead."""
        return self._here.recv()


def _drop_rights_and(action: Callable[[Connection], None], connection: Connection) -> None:
    os.setgroups([])
    os.setgid(NOBODY)
    os.setuid(NOBODY)
    action(connection)
