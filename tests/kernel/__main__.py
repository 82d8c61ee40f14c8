"""Run one job by hand: ``PYTHONPATH=tests python -m kernel hello '{"greeting": "hello"}'``."""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path

from kernel import boot, initramfs
from kernel.machine import MachineMissingError, find


def main() -> None:
    """Boot, run, print what the job printed and what it answered."""
    parser = argparse.ArgumentParser(prog="python -m kernel", description="Run one job in an emulated machine.")
    parser.add_argument("job", help="a module of kernel.jobs")
    parser.add_argument("arguments", nargs="?", type=json.loads, default={}, help="its arguments, as a JSON object")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        first_files, share = Path(folder, "initramfs.gz"), Path(folder, "share")
        share.mkdir()
        try:
            machine = find()
            initramfs.build(machine, first_files)
            result = boot.run(machine, first_files, share, asked.job, **asked.arguments)
        except (MachineMissingError, boot.GuestError) as error:
            sys.exit(str(error))
    print(result.output, end="")
    print(json.dumps(result.answer, indent=1))


if __name__ == "__main__":
    main()
