"""Runs one job inside the guest: ``python -m kernel.guest.runner NAME``."""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path

SHARE = Path("/run/job")


def main(name: str) -> None:
    """Call the job with the host's arguments and leave its answer in the share."""
    arguments = json.loads((SHARE / "arguments.json").read_text())
    answer = importlib.import_module(f"kernel.jobs.{name}").run(**arguments)
    (SHARE / "answer.json").write_text(json.dumps(answer))


if __name__ == "__main__":
    main(sys.argv[1])
