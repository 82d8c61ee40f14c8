"""The smallest job: which kernel runs, with which interpreter, as whom, and what it was asked."""

from __future__ import annotations

import os
import sys


def run(greeting: str) -> dict[str, object]:
    """Say who answers."""
    print(f"{greeting} from the guest")
    return {"release": os.uname().release, "python": sys.executable, "user": os.getuid(), "greeting": greeting}
