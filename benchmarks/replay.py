"""``fusion replay``: run one estimator over a log again, and keep everything it said beside the measurements."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Mapping
from pathlib import Path

import fusion
from benchmarks.arguments import not_negative
from benchmarks.cell import cached_run
from benchmarks.lane import Lane, run_lane
from benchmarks.metrics.track import Track
from fusion import LogError, ParameterError, PluginError, Truth
from fusion.options import parse_options
from logs.reader import read_run
from logs.run import Run, TruthTrack
from logs.writer import RunWriter


def replay(
    run: Path,
    estimator: str,
    output: Path | None = None,
    *,
    options: Mapping[str, object] | None = None,
    seed: int = 0,
    verify: Path | None = None,
) -> str:
    """Fold ``run`` through ``estimator`` and answer the digest of all it said.

    ``output``: a new log with the measurements and truth of ``run`` and the estimates and Fates as channels; the same
    arguments give the same bytes. ``verify``: an earlier replay whose digest must be the same. Raises `LogError`,
    `PluginError` or `ParameterError`.
    """
    if output is not None and output.resolve() == run.resolve():
        raise LogError(f"{output}: this is the log being replayed; give the output another name")
    recorded = cached_run(run)
    fusion.build(estimator, recorded.world, options)
    lane = run_lane(recorded, estimator, options, seed)
    if lane.error is not None:
        raise PluginError(f"{estimator} did not survive {run}: {lane.error}")
    if verify is not None:
        _verify(verify, lane)
    if output is not None:
        certificate = {"digest": lane.digest, "estimator": estimator, "seed": str(seed)}
        certificate["parameters"] = json.dumps(dict(options or {}), sort_keys=True)
        write_replay(recorded, lane, output, {**recorded.metadata, **certificate})
    return lane.digest


def _verify(earlier: Path, lane: Lane) -> None:
    metadata = read_run(earlier).metadata
    kept = metadata.get("digest") or json.loads(metadata.get("live_digests", "{}")).get(lane.name)
    if kept is None:
        raise LogError(
            f"{earlier}: holds no digest of {lane.name}; give a log that `fusion replay` or `fusion live -o` wrote"
        )
    if kept != lane.digest:
        raise LogError(
            f"{earlier}: its digest is {kept}, this replay's is {lane.digest}; compare seed, parameters and versions"
        )


def write_replay(run: Run, lane: Lane, output: Path, metadata: Mapping[str, str]) -> None:
    """A log of the messages in the order they came in, each followed by what the estimator said to it; from where it
    crashed on, of the messages alone.
    """
    truths = _truths(run.truth) if run.truth is not None else []
    now_ns, answered = 0, 0
    with RunWriter(output, run.world, name=run.name, prior=run.prior, metadata=metadata) as writer:
        for update, received_ns in zip(lane.updates, Track.of(lane.updates).received_ns.tolist(), strict=True):
            _write_until(writer, truths, received_ns)
            # The host answers every message with one update of its own; those after it are revisions.
            if not update.revised:
                now_ns, answered = max(received_ns, 0), answered + 1
                writer.write(update.measurement, log_time_ns=now_ns)
            writer.write_update(lane.name, update)
        for measurement in run.measurements[answered:]:
            now_ns = max(now_ns, measurement.time_ns)
            _write_until(writer, truths, now_ns)
            writer.write(measurement, log_time_ns=now_ns)
        _write_until(writer, truths, None)


def _write_until(writer: RunWriter, truths: list[Truth], time_ns: int | None) -> None:
    """Take the true poses up to a time, or all, off the end of ``truths``."""
    while truths and (time_ns is None or truths[-1].time_ns <= time_ns):
        writer.write_truth(truths.pop())


def _truths(track: TruthTrack) -> list[Truth]:
    """The true poses, the last one first; a heading that is not a number is not known."""
    columns = (track.time_ns.tolist(), track.x.tolist(), track.y.tolist(), track.heading.tolist())
    rows = zip(*columns, strict=True)
    return [Truth(t, x, y, None if math.isnan(heading) else heading) for t, x, y, heading in rows][::-1]


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion replay``."""
    parser.add_argument("run", type=Path, metavar="RUN", help="an MCAP log")
    parser.add_argument("--estimator", required=True, metavar="NAME", help="`fusion estimators` lists them")
    parser.add_argument("-o", "--output", type=Path, metavar="OUT", help="the log to write")
    parser.add_argument("--seed", type=not_negative, default=0, help="of an estimator that draws random numbers")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="a parameter of the estimator; repeatable"
    )
    parser.add_argument("--verify", type=Path, metavar="LOG", help="fail unless this earlier replay said the same")


def run(arguments: argparse.Namespace) -> int:
    """Replay, and print the digest."""
    if arguments.output is None and arguments.verify is None:
        raise ParameterError("nothing to do with what the estimator says; give -o OUT.mcap, --verify LOG or both")
    digest = replay(
        arguments.run,
        arguments.estimator,
        arguments.output,
        options=parse_options(arguments.set),
        seed=arguments.seed,
        verify=arguments.verify,
    )
    for warning in cached_run(arguments.run).warnings:
        sys.stderr.write(f"fusion replay: {warning}\n")
    sys.stdout.write(f"{digest}\n")
    return 0
