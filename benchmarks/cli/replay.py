"""``fusion replay``: run one estimator over a log again, and keep all its updates beside the measurements."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from pathlib import Path

import fusion
from benchmarks.runner.estimator_run import EstimatorRun, run_estimator
from benchmarks.runner.replay_log import write_replay
from benchmarks.runner.run_source import open_log
from fusion import LogError, ParameterError, PluginError
from fusion.cli.arguments import not_negative
from fusion.cli.options import parse_options
from logs.reader import read_run


def replay(
    run: Path,
    estimator: str,
    output: Path | None = None,
    *,
    options: Mapping[str, object] | None = None,
    seed: int = 0,
    verify: Path | None = None,
) -> str:
    """Fold ``run`` through ``estimator`` and answer the digest of its updates.

    ``output``: a new log with the measurements and truth of ``run`` and the estimates and Fates as channels; the same
    arguments give the same bytes. ``verify``: an earlier replay whose digest must be the same. Raises `LogError`,
    `PluginError` or `ParameterError`.
    """
    if output is not None and output.resolve() == run.resolve():
        raise LogError(f"{output}: this is the log being replayed; give the output another name")
    recorded = open_log(run)
    fusion.build(estimator, recorded.world, options)
    made = run_estimator(recorded, estimator, options, seed)
    if made.error is not None:
        raise PluginError(f"{estimator} did not survive {run}: {made.error}")
    if verify is not None:
        _verify(verify, made)
    if output is not None:
        write_replay(recorded, made, output, options=options, seed=seed)
    return made.digest


def _verify(earlier: Path, made: EstimatorRun) -> None:
    metadata = read_run(earlier).metadata
    kept = metadata.get("digest") or json.loads(metadata.get("live_digests", "{}")).get(made.name)
    if kept is None:
        raise LogError(
            f"{earlier}: holds no digest of {made.name}; give a log that `fusion replay` or `fusion live -o` wrote"
        )
    if kept != made.digest:
        raise LogError(
            f"{earlier}: its digest is {kept}, this replay's is {made.digest}; compare seed, parameters and versions"
        )


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion replay``."""
    parser.add_argument("run", type=Path, metavar="RUN", help="an MCAP log")
    parser.add_argument("--estimator", required=True, metavar="NAME", help="`fusion estimators` lists them")
    parser.add_argument("-o", "--output", type=Path, metavar="OUT", help="the log to write")
    parser.add_argument("--seed", type=not_negative, default=0, help="of an estimator that draws random numbers")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="a parameter of the estimator; repeatable"
    )
    parser.add_argument(
        "--verify", type=Path, metavar="LOG", help="fail unless the digest of this earlier replay is the same"
    )


def run(arguments: argparse.Namespace) -> int:
    """Replay, and print the digest."""
    if arguments.output is None and arguments.verify is None:
        raise ParameterError("nothing to do with the estimates; give -o OUT.mcap, --verify LOG or both")
    digest = replay(
        arguments.run,
        arguments.estimator,
        arguments.output,
        options=parse_options(arguments.set),
        seed=arguments.seed,
        verify=arguments.verify,
    )
    for warning in open_log(arguments.run).warnings:
        sys.stderr.write(f"fusion replay: {warning}\n")
    sys.stdout.write(f"{digest}\n")
    return 0
