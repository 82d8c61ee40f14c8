"""``fusion bench score``: score one recorded track against another, without running anything."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import IO

from benchmarks.metrics.alignment import ALIGNMENTS
from benchmarks.metrics.catalogue import Column, as_text
from benchmarks.metrics.track_pair import MODES, PairScore, score_pair
from fusion.output.files import write_json
from fusion.output.tables import Sheet, print_sheets
from logs.truth import DISTANCES_M, DURATIONS_S


def print_score(score: PairScore, file: IO[str] | None = None) -> None:
    """As tables for people."""
    print_sheets(sheets(score), file)


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion bench score``."""
    track = "a TUM file, a CSV (time_s,x_m,y_m,heading_rad) or an MCAP log"
    parser.add_argument("--truth", required=True, metavar="FILE", help=track)
    parser.add_argument("--estimate", required=True, metavar="FILE", help=f"{track}; run.mcap:ekf chooses a lane of it")
    parser.add_argument("--mode", choices=MODES, default=MODES[0], help="causal, or truth interpolated at the estimate")
    parser.add_argument("--align", choices=("none", *ALIGNMENTS), default="none", help="beside the raw score")
    parser.add_argument("--json", type=Path, metavar="OUT", help="write everything as one record; - for stdout")


def run(arguments: argparse.Namespace) -> int:
    """Score, print the tables, write the record."""
    score = score_pair(arguments.truth, arguments.estimate, mode=arguments.mode, alignment=arguments.align)
    for warning in score.warnings:
        sys.stderr.write(f"fusion bench score: {warning}\n")
    if arguments.json != Path("-"):
        print_score(score)
    if arguments.json is not None:
        write_json(arguments.json, score.record(), indent=1)
    return 0


DEGREES = math.degrees(1.0)
POSITION = (
    Column("pos_rmse", "RMSE, cm", 100.0, 2),
    Column("pos_mean", "mean, cm", 100.0, 2),
    Column("pos_std", "standard deviation, cm", 100.0, 2),
    Column("pos_min", "min, cm", 100.0, 2),
    Column("pos_p50", "median, cm", 100.0, 2),
    Column("pos_p75", "p75, cm", 100.0, 2),
    Column("pos_p90", "p90, cm", 100.0, 2),
    Column("pos_p95", "p95, cm", 100.0, 2),
    Column("pos_p99", "p99, cm", 100.0, 2),
    Column("pos_max", "max, cm", 100.0, 2),
    Column("abs_x_mean", "mean of |x error|, cm", 100.0, 2),
    Column("abs_y_mean", "mean of |y error|, cm", 100.0, 2),
    Column("bias_x", "bias in x, cm", 100.0, 2),
    Column("bias_y", "bias in y, cm", 100.0, 2),
    Column("drms", "DRMS about the bias, cm", 100.0, 2),
    Column("along_rmse", "RMSE along the way, cm", 100.0, 2),
    Column("cross_rmse", "RMSE across the way, cm", 100.0, 2),
    Column("head_mae", "heading, mean, °", DEGREES, 3),
    Column("head_rmse", "heading, RMSE, °", DEGREES, 3),
    Column("head_p95", "heading, p95, °", DEGREES, 3),
    Column("vel_err", "velocity error, mean, m/s", 1.0, 3),
    Column("jump_rate", "jumps per minute", 1.0, 2),
    Column("path_ratio", "path length over the true one", 1.0, 4),
)
QUALITY = (
    Column("n_valid", "poses compared", 1.0, 0),
    Column("head_n", "instants with a true heading", 1.0, 0),
    Column("availability", "availability, %", 100.0, 1),
    Column("age_p95", "age, p95, s", 1.0, 3),
    Column("dropout_s", "without an answer, s", 1.0, 1),
    Column("t_conv", "to convergence, s", 1.0, 1),
    Column("failures", "failures", 1.0, 0),
    Column("anees", "ANEES (1: honest)", 1.0, 2),
    Column("cover95", "inside the claimed 95 %, %", 100.0, 1),
    Column("nll_2d", "negative log-likelihood, position, nat", 1.0, 3),
    Column("energy", "energy score, cm", 100.0, 2),
)
RELATIVE = (
    Column("n", "pairs", 1.0, 0),
    Column("rmse", "RMSE, cm", 100.0, 2),
    Column("median", "median, cm", 100.0, 2),
    Column("rot_rmse", "rotation RMSE, °", DEGREES, 3),
    Column("rot_median", "rotation median, °", DEGREES, 3),
)


def sheets(score: PairScore) -> Sequence[Sheet]:
    """Position and heading, the relative pose errors, and what tells how far to trust them."""
    return _absolute(score), _relative(score.metrics), _quality(score)


def _absolute(score: PairScore) -> Sheet:
    if score.aligned is None or score.map_from_estimate is None:
        note = "" if score.align == "none" else f", not alignable by {score.align}"
        rows = tuple((column.title, as_text(column, score.metrics)) for column in POSITION)
        return Sheet(f"{_title(score)}, raw{note}", ("error", "raw"), rows)
    x, y, yaw = score.map_from_estimate
    title = (
        f"{_title(score)}; {score.align} turns the estimate by {math.degrees(yaw):.4f}° "
        f"and moves it by ({x:.4f}, {y:.4f}) m: RMSE raw / aligned = {score.ratio:.2f}"
    )
    both = (score.metrics, score.aligned)
    return Sheet(title, ("error", "raw", "aligned"), tuple((c.title, *(as_text(c, v) for v in both)) for c in POSITION))


def _title(score: PairScore) -> str:
    return f"{Path(score.estimate).name} against {Path(score.truth).name}, {score.mode}"


def _relative(metrics: dict[str, float]) -> Sheet:
    reaches = [f"d_{reach}m" for reach in DISTANCES_M] + [f"t_{reach}s" for reach in DURATIONS_S]
    rows = [
        (reach[2:], *(as_text(column._replace(key=f"rpe_{reach}_{column.key}"), metrics) for column in RELATIVE))
        for reach in reaches
    ]
    return Sheet("relative pose error after", ("reach", *(column.title for column in RELATIVE)), tuple(rows))


def _quality(score: PairScore) -> Sheet:
    rows = tuple((column.title, as_text(column, score.metrics)) for column in QUALITY)
    return Sheet("how far to trust this", ("what", "value"), rows)
