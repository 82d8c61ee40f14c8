"""The verbs of the command line: ours in a table, so that one starts without a search, then those of plug-ins.

A verb is a module with ``configure(parser)`` and ``run(arguments) -> exit code``, imported when the verb is used. A
plug-in declares its own as an entry point of `fusion.plugins.VERBS`; a name of ours stays ours.
"""

from __future__ import annotations

import importlib
from typing import Any, NamedTuple

from fusion import plugins


class Verb(NamedTuple):
    """The module of a verb, None for that of a plug-in, and one line about it."""

    module: str | None
    summary: str


VERBS = {
    "demo": Verb("benchmarks.cli.demo", "the whole promise in one command: simulate, record, score, show"),
    "simulate": Verb("sensors.cli.simulate", "drive a simulated robot and record it as an MCAP log"),
    "record": Verb("sensors.cli.record", "the sensors of a robot into logs, until it is stopped"),
    "live": Verb("sensors.cli.live", "where the robot is, now: sensors through an estimator, JSON lines"),
    "doctor": Verb("sensors.cli.doctor", "everything a recording needs, and the cure for what is wrong"),
    "sensors": Verb("sensors.cli.sensors", "the drivers that are installed, and the devices that are there"),
    "join": Verb("logs.cli.join", "the files of one recording become one log"),
    "import": Verb("logs.cli.import_", "turn a recording of another format into an MCAP log"),
    "export": Verb("logs.cli.export", "turn a log into CSV or TUM files"),
    "info": Verb("logs.cli.info", "what is in logs, what is odd about them, and which estimators could use them"),
    "repair": Verb("logs.cli.repair", "a log that a crash cut off, made whole again"),
    "calibrate": Verb("sensors.cli.calibrate", "the numbers of radio, wheels and gyro from recorded runs"),
    "bound": Verb("benchmarks.cli.bound", "the least error a fix can have over a floor, and where an anchor helps"),
    "bench": Verb("benchmarks.cli.bench", "score estimators on recorded runs"),
    "perf": Verb("benchmarks.cli.perf", "how fast the estimators are beside filterpy, and by which laws cost grows"),
    "replay": Verb("benchmarks.cli.replay", "run one estimator over a log and record its estimates"),
    "review": Verb("benchmarks.cli.review", "see a run and its estimators in Rerun"),
    "reproduce": Verb("benchmarks.cli.reproduce", "the paper's experiments run again, and its claims judged"),
    "estimators": Verb("fusion.cli.estimators", "the estimators that are installed, and their parameters"),
    "check": Verb("fusion.cli.check", "hold an estimator against the contract"),
}

GROUPS = {
    "bench": {
        "plan": Verb("benchmarks.cli.bench_plan", "what a suite would compute, and what of it is there"),
        "run": Verb("benchmarks.cli.bench_run", "compute what is missing of a suite"),
        "score": Verb("benchmarks.cli.bench_score", "score one track against another: TUM, CSV or MCAP files"),
        "time": Verb("benchmarks.cli.bench_time", "what each estimator costs, measured alone"),
        "report": Verb("benchmarks.cli.bench_report", "the results as one HTML page"),
        "compare": Verb("benchmarks.cli.bench_compare", "which estimator is better, or that the runs are inconclusive"),
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


def plugin_verbs() -> dict[str, Verb]:
    """The verbs of other distributions, with the summaries of these; nothing is imported."""
    found = {name: plugins.origins(name, plugins.VERBS) for name in plugins.names(plugins.VERBS)}
    return {name: Verb(None, " / ".join(map(str, origins))) for name, origins in found.items() if name not in VERBS}


def refused_verbs() -> list[str]:
    """One sentence for each verb of a plug-in that has the name of one of ours."""
    taken = [name for name in plugins.names(plugins.VERBS) if name in VERBS]
    return [
        f"the verb {name!r} of {origin.distribution} is left out, fusion has one of that name; uninstall that"
        for name in taken
        for origin in plugins.origins(name, plugins.VERBS)
    ]


def implementation(name: str, verb: Verb) -> Any:  # noqa: ANN401 - a module
    """The module of a verb; raises `PluginError` where that of a plug-in cannot be brought in."""
    return plugins.load(name, plugins.VERBS) if verb.module is None else importlib.import_module(verb.module)
