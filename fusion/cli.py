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
    "demo": Verb("benchmarks.demo", "the whole promise in one command: simulate, record, score, show"),
    "simulate": Verb("sensors.simulation.simulate", "drive a simulated robot and record it as an MCAP log"),
    "record": Verb("sensors.onboard.record", "the sensors of a robot into logs, until somebody says stop"),
    "live": Verb("sensors.onboard.live_verb", "where the robot is, now: sensors through an estimator, JSON lines"),
    "doctor": Verb("sensors.onboard.doctor", "everything a recording needs, and the cure for what is wrong"),
    "sensors": Verb("sensors.onboard.devices", "what drivers are installed, and which devices are there"),
    "join": Verb("logs.joining", "the files of one recording become one log"),
    "import": Verb("logs.importing", "turn a recording of another format into an MCAP log"),
    "export": Verb("logs.export", "turn a log into CSV or TUM files"),
    "info": Verb("logs.info", "what is in logs, what is odd about them, and which estimators could use them"),
    "repair": Verb("logs.repair", "a log that a crash cut off, made whole again"),
    "calibrate": Verb("benchmarks.calibration.calibrate", "the numbers of radio, wheels and gyro from recorded runs"),
    "bound": Verb("benchmarks.sites.site", "the least error a fix can have over a floor, and where an anchor helps"),
    "bench": Verb("benchmarks.bench", "score estimators on recorded runs"),
    "replay": Verb("benchmarks.replay", "run one estimator over a log and record what it said"),
    "review": Verb("benchmarks.review.review", "see a run and its estimators in Rerun"),
    "reproduce": Verb("benchmarks.paper.reproduce", "the paper's experiments run again, and its claims judged"),
    "estimators": Verb("fusion.listing", "what estimators are installed, and their parameters"),
    "check": Verb("fusion.check", "hold an estimator against the contract"),
}

GROUPS = {
    "bench": {
        "plan": Verb("benchmarks.runner.plan_verb", "what a suite would compute, and what of it is there"),
        "run": Verb("benchmarks.runner.run_verb", "compute what is missing of a suite"),
        "score": Verb("benchmarks.metrics.pair_verb", "score one track against another: TUM, CSV or MCAP files"),
        "time": Verb("benchmarks.runner.time_verb", "what each estimator costs, measured alone"),
        "report": Verb("benchmarks.report.verb", "the results as one HTML page"),
        "compare": Verb("benchmarks.runner.compare_verb", "which estimator is better, or that the runs cannot tell"),
        "gate": Verb("benchmarks.runner.gate_verb", "may a change land? judged against a baseline"),
        "replay": Verb("benchmarks.runner.replay_verb", "one cell again, as a log for review"),
        "verify": Verb("benchmarks.runner.verify_verb", "compute stored cells again, they must be the same"),
        "export": Verb("benchmarks.runner.export_verb", "results for other programs"),
    },
    "sensors": {"test": Verb("sensors.onboard.self_test", "run every sensor for a while: a report to attach")},
    "calibrate": {
        "radio": Verb("benchmarks.calibration.radio_verb", "path loss and shadowing, bias and scale of ranges"),
        "odometry": Verb("benchmarks.calibration.odometry_verb", "scale of either side and the effective track"),
        "gyro": Verb("benchmarks.calibration.gyro_verb", "bias, its drift, scale and noise"),
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
