"""The command line: one word, verbs under it. A verb's module is imported when the verb is used.

Each module has ``configure(parser)`` and ``run(arguments) -> exit code``; what it does is also one function with
keyword arguments. Exit codes: 0 done, 1 a known error told in one sentence, 2 wrong usage, 130 interrupted.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence
from typing import Any, NamedTuple, NoReturn

from fusion.errors import FusionError, did_you_mean


class Verb(NamedTuple):
    """Where a verb lives and what it does, in one line."""

    module: str
    summary: str


VERBS = {
    "demo": Verb("benchmarks.cli.demo", "the whole promise in one command: simulate, record, score, show"),
    "simulate": Verb("sensors.cli.simulate", "drive a simulated robot and record it as an MCAP log"),
    "record": Verb("sensors.cli.record", "the sensors of a robot into logs, until somebody says stop"),
    "live": Verb("sensors.cli.live", "where the robot is, now: sensors through an estimator, JSON lines"),
    "doctor": Verb("sensors.cli.doctor", "everything a recording needs, and the cure for what is wrong"),
    "sensors": Verb("sensors.cli.sensors", "what drivers are installed, and which devices are there"),
    "join": Verb("logs.cli.join", "the files of one recording become one log"),
    "import": Verb("logs.cli.import_", "turn a recording of another format into an MCAP log"),
    "export": Verb("logs.cli.export", "turn a log into CSV or TUM files"),
    "info": Verb("logs.cli.info", "what is in logs, what is odd about them, and which estimators could use them"),
    "repair": Verb("logs.cli.repair", "a log that a crash cut off, made whole again"),
    "calibrate": Verb("sensors.cli.calibrate", "the numbers of radio, wheels and gyro from recorded runs"),
    "bound": Verb("benchmarks.cli.bound", "the least error a fix can have over a floor, and where an anchor helps"),
    "bench": Verb("benchmarks.cli.bench", "score estimators on recorded runs"),
    "replay": Verb("benchmarks.cli.replay", "run one estimator over a log and record what it said"),
    "review": Verb("benchmarks.cli.review", "see a run and its estimators in Rerun"),
    "reproduce": Verb("benchmarks.cli.reproduce", "the paper's experiments run again, and its claims judged"),
    "estimators": Verb("fusion.cli.estimators", "what estimators are installed, and their parameters"),
    "check": Verb("fusion.cli.check", "hold an estimator against the contract"),
}

GROUPS = {
    "bench": {
        "plan": Verb("benchmarks.cli.bench_plan", "what a suite would compute, and what of it is there"),
        "run": Verb("benchmarks.cli.bench_run", "compute what is missing of a suite"),
        "score": Verb("benchmarks.cli.bench_score", "score one track against another: TUM, CSV or MCAP files"),
        "time": Verb("benchmarks.cli.bench_time", "what each estimator costs, measured alone"),
        "report": Verb("benchmarks.cli.bench_report", "the results as one HTML page"),
        "compare": Verb("benchmarks.cli.bench_compare", "which estimator is better, or that the runs cannot tell"),
        "gate": Verb("benchmarks.cli.bench_gate", "may a change land? judged against a baseline"),
        "replay": Verb("benchmarks.cli.bench_replay", "one cell again, as a log for review"),
        "verify": Verb("benchmarks.cli.bench_verify", "compute stored cells again, they must be the same"),
        "export": Verb("benchmarks.cli.bench_export", "results for other programs"),
    },
    "sensors": {"test": Verb("sensors.cli.sensors_test", "run every sensor for a while: a report to attach")},
    "calibrate": {
        "radio": Verb("sensors.cli.calibrate_radio", "path loss and shadowing, bias and scale of ranges"),
        "odometry": Verb("sensors.cli.calibrate_odometry", "scale of either side and the effective track"),
        "gyro": Verb("sensors.cli.calibrate_gyro", "bias, its drift, scale and noise"),
    },
}
"""Verbs under verbs; without one of them the verb itself is meant (`fusion bench RUN`)."""


class _Parser(argparse.ArgumentParser):
    """An argument parser that answers unknown verbs with the nearest one."""

    def error(self, message: str) -> NoReturn:
        self.print_usage(sys.stderr)
        self.exit(2, f"{self.prog}: {message}\n")


def _verb_parser(name: str, verb: Verb, module: Any) -> argparse.ArgumentParser:  # noqa: ANN401 - a module
    group = "\n".join(f"  fusion {name} {word:<8} {sub.summary}" for word, sub in GROUPS.get(name, {}).items())
    parser = _Parser(
        prog=f"fusion {name}",
        description=verb.summary,
        epilog=group,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    module.configure(parser)
    return parser


def _usage() -> str:
    width = max(map(len, VERBS))
    rows = "\n".join(f"  {name:<{width}}  {verb.summary}" for name, verb in VERBS.items())
    return (
        "usage: fusion VERB ...\n\nWhich filter should run on my robot, and can I trust it?\n\n"
        f"{rows}\n\n`fusion VERB --help` tells more of each; `fusion demo` is the place to start.\n"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command line; answers its exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if not words or words[0] in ("-h", "--help"):
        sys.stdout.write(_usage())
        return 0 if words else 2
    if words[0] == "--version":
        from fusion import __version__

        sys.stdout.write(f"fusion {__version__}\n")
        return 0
    if words[0] not in VERBS:
        sys.stderr.write(f"fusion: there is no verb {words[0]!r}; {did_you_mean(words[0], VERBS)}\n")
        return 2
    group = GROUPS.get(words[0], {})
    if len(words) > 1 and words[1] in group:
        return _run(" ".join(words[:2]), group[words[1]], words[2:])
    return _run(words[0], VERBS[words[0]], words[1:])


def _run(name: str, verb: Verb, words: Sequence[str]) -> int:
    module = importlib.import_module(verb.module)
    parsed = _verb_parser(name, verb, module).parse_intermixed_args(words)
    try:
        return int(module.run(parsed))
    except FusionError as error:
        sys.stderr.write(f"fusion {name}: {error}\n")
        return 1
    except KeyboardInterrupt:
        sys.stderr.write(f"fusion {name}: interrupted\n")
        return 130
    except BrokenPipeError:
        # The reader of our output went away (`fusion info RUN | head`): nothing is wrong here.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


if __name__ == "__main__":
    sys.exit(main())
