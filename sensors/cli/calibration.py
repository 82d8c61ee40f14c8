"""Arguments and output that the three verbs of `fusion calibrate` have in common."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from fusion import LogError
from fusion.output.figures import as_png, require_matplotlib
from fusion.output.files import require_place, write, write_json
from fusion.output.tables import Table, print_tables
from logs.run import Run
from sensors.calibration.held_out import record
from sensors.calibration.provenance import load_runs, provenance
from sensors.calibration.world_file import TomlTable, calibrated_text, world_text, write_world

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Findings(NamedTuple):
    """Findings of a calibration: tables, sentences, a record for programs, a picture, and changes of a world.

    ``remarks`` warn or ask for more; ``changes`` None: these logs cannot calibrate a world, for reasons in ``remarks``.
    """

    name: str
    method: str
    samples: int
    residual_std: float
    tables: Sequence[Table]
    remarks: Sequence[str]
    result: object
    draw: Callable[[], Figure]
    changes: TomlTable | None
    anchors: dict[str, TomlTable]


def configure_common(parser: argparse.ArgumentParser) -> None:
    """Runs in, tables, record, picture and world out."""
    parser.add_argument("runs", metavar="RUN", type=Path, nargs="+", help="an MCAP log with ground truth")
    parser.add_argument("--world", type=Path, metavar="FILE", help="a world file in place of the one in the log")
    parser.add_argument("-o", "--output", type=Path, metavar="WORLD.toml", help="write the world with these numbers")
    parser.add_argument("--json", type=Path, metavar="OUT", help="write everything as one record; - for stdout")
    parser.add_argument("--png", type=Path, metavar="OUT", help="draw the fit (needs the extra `plots`)")


def calibrate(arguments: argparse.Namespace, findings_of: Callable[[list[Run]], Findings]) -> int:
    """Read, calibrate, report, write; what cannot be written is refused before any work."""
    if arguments.png is not None:
        require_matplotlib()
    for place in (arguments.output, arguments.json, arguments.png):
        if place is not None:
            require_place(place)
    runs = load_runs(arguments.runs, arguments.world)
    findings = findings_of(runs)
    for remark in (*(warning for run in runs for warning in run.warnings), *findings.remarks):
        sys.stderr.write(f"fusion calibrate {findings.name}: {remark}\n")
    about = provenance(runs, findings.method, findings.samples, findings.residual_std)
    if arguments.json != Path("-"):
        print_tables(findings.tables)
    if arguments.json is not None:
        header = {"calibrates": findings.name, "remarks": list(findings.remarks), "changes": findings.changes}
        write_json(
            arguments.json,
            record({**header, "anchors": findings.anchors, "result": findings.result, "about": asdict(about)}),
        )
    if arguments.png is not None:
        write(arguments.png, as_png(findings.draw()))
    if arguments.output is not None:
        if findings.changes is None:
            raise LogError(f"{arguments.output}: not written, for these logs cannot calibrate a world; see above why")
        text = world_text(runs[0].world, arguments.world)
        write_world(arguments.output, calibrated_text(text, findings.changes, findings.anchors, findings.name, about))
    return 0
