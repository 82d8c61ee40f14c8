"""``fusion check``: hold an estimator, or a driver, against every promise of its contract, one line each."""

from __future__ import annotations

import argparse
import json
import sys

from fusion.conformance.checks import Outcome, Verdict, run_checks
from fusion.conformance.driver_promises import run_driver_checks


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of `fusion check`."""
    parser.add_argument("name", metavar="NAME", help="the estimator; `fusion estimators` lists them")
    parser.add_argument("--driver", action="store_true", help="NAME is a driver; `fusion sensors` lists them")
    parser.add_argument("--json", action="store_true", help="as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Check, and print the verdicts; 1 when a promise is broken."""
    verdicts = run_driver_checks(arguments.name) if arguments.driver else run_checks(arguments.name)
    if arguments.json:
        rows = [verdict._asdict() | {"outcome": verdict.outcome.value} for verdict in verdicts]
        sys.stdout.write(json.dumps(rows, indent=2) + "\n")
    else:
        sys.stdout.write(_text(arguments.name, verdicts))
    return int(any(verdict.outcome is Outcome.BROKEN for verdict in verdicts))


def _text(name: str, verdicts: list[Verdict]) -> str:
    width = max(len(verdict.id) for verdict in verdicts)
    lines = []
    for verdict in verdicts:
        lines.append(f"{verdict.outcome.value:<7}  {verdict.id:<{width}}  {verdict.reason}")
        if verdict.detail:
            lines.append(f"{'':<7}  {'':<{width}}  ↳ {verdict.detail}")
    broken = sum(verdict.outcome is Outcome.BROKEN for verdict in verdicts)
    kept = sum(verdict.outcome is Outcome.KEPT for verdict in verdicts)
    lines.append(f"{name}: {kept} promises kept, {broken} broken, {len(verdicts) - kept - broken} skipped or excused")
    return "\n".join(lines) + "\n"
