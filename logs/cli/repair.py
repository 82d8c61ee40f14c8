"""`fusion repair`: what is left of a log that a crash cut off, or that was damaged, as a whole MCAP file.

The broken file is never touched, and the new one appears only when it is complete.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, NamedTuple

from mcap.records import Metadata

from fusion import LogError
from logs.message_stream import REPAIR_RECORD, open_mcap
from logs.salvage.damage import Damage
from logs.salvage.rebuild import Rebuilder
from logs.salvage.scan import Salvage

LOSSY = 3
"""Exit code where something is lost; as the `mcap` tool's own `recover` has it."""


class Repaired(NamedTuple):
    """The result of a repair: the messages of ``broken`` kept in ``good``, and the damage."""

    broken: Path
    good: Path
    messages: int
    damage: Damage

    def record(self) -> dict[str, Any]:
        """The same as plain values; times in seconds, null where not known."""
        return {
            "broken": str(self.broken),
            "good": str(self.good),
            "lossy": self.damage.is_lossy,
            "messages_kept": self.messages,
            **self.damage.record(),
        }


def repair(broken: Path, good: Path, *, force: bool = False) -> Repaired:
    """Write what is sound in the MCAP file ``broken`` as the whole file ``good``, and state what is lost.

    A file that is whole is copied with its index built anew. Raises `LogError` for what is no MCAP file, and where
    ``good`` is ``broken``, exists (unless ``force``) or cannot be written; nothing is left behind then.
    """
    with open_mcap(broken) as stream:
        _check_place(broken, good, force=force)
        unfinished = good.with_name(f".{good.name}.{os.getpid()}.unfinished")
        salvage = Salvage(stream)
        try:
            with unfinished.open("xb") as new:
                mend(salvage, new)
                new.flush()
                os.fsync(new.fileno())
            unfinished.replace(good)
        except OSError as error:
            raise LogError(f"{good}: cannot be written ({error}); choose another place, or free some space") from error
        finally:
            with suppress(OSError):  # it is not there: renamed, or never made
                unfinished.unlink()
    _sync(good.parent)
    return Repaired(broken, good, salvage.messages, salvage.damage)


def _check_place(broken: Path, good: Path, *, force: bool) -> None:
    if good.exists() and good.samefile(broken):
        raise LogError(f"{good}: this is the broken file, which is never touched; give the repaired one another name")
    if good.exists() and not (force and good.is_file()):
        raise LogError(f"{good}: exists already; choose another name, or write over a file with --force")


def mend(salvage: Salvage, stream: IO[bytes]) -> None:
    """Write what ``salvage`` finds as a whole MCAP file into ``stream``; a metadata record states what is lost."""
    rebuilder = Rebuilder(stream)
    for piece in salvage:
        rebuilder.add(piece)
    if salvage.damage.is_lossy:
        rebuilder.add_record(Metadata(REPAIR_RECORD, {"lost": str(salvage.damage)}))
    rebuilder.finish()


def _sync(folder: Path) -> None:
    """Have the new name on the disk too; not every system can sync a folder."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of `fusion repair`."""
    parser.add_argument("broken", metavar="BROKEN", type=Path, help="the MCAP file; it is only read")
    parser.add_argument("-o", "--output", metavar="GOOD", type=Path, required=True, help="the whole file to write")
    parser.add_argument("--force", action="store_true", help="write over GOOD if it exists")
    parser.add_argument("--json", action="store_true", help="as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Repair, and print the damage; 0 where nothing is lost, 3 where something is."""
    repaired = repair(arguments.broken, arguments.output, force=arguments.force)
    sys.stdout.write(json.dumps(repaired.record(), indent=2) + "\n" if arguments.json else _text(repaired))
    return LOSSY if repaired.damage.is_lossy else 0


def _text(repaired: Repaired) -> str:
    kept = f"{repaired.good}: {repaired.messages} messages kept"
    return f"{kept}\n{repaired.broken}: {str(repaired.damage) or 'was whole, nothing is lost'}\n"
