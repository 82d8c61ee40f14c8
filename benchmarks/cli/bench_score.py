"""``fusion bench score``: score one recorded track against another, without running anything."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import IO

from benchmarks.metrics.alignment import ALIGNMENTS
from benchmarks.metrics.catalogue import Column, column
from benchmarks.metrics.relative_pose import REACHES
from benchmarks.metrics.track_pair import MODES, PairScore, score_pair
from fusion.output.files import write_json
from fusion.output.tables import Table, print_tables


def print_score(score: PairScore, file: IO[str] | None = None) -> None:
    """As tables for people."""
    print_tables(tables(score), file)


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


POSITION = tuple(
    column(metric, title, decimals=decimals, separator=", ")
    for metric, title, decimals in (
        ("pos_rmse", "RMSE", 2),
        ("pos_mean", "mean", 2),
        ("pos_std", "standard deviation", 2),
        ("pos_min", "min", 2),
        ("pos_p50", "median", 2),
        ("pos_p75", "p75", 2),
        ("pos_p90", "p90", 2),
        ("pos_p95", "p95", 2),
        ("pos_p99", "p99", 2),
        ("pos_max", "max", 2),
        ("abs_x_mean", "mean of |x error|", 2),
        ("abs_y_mean", "mean of |y error|", 2),
        ("bias_x", "bias in x", 2),
        ("bias_y", "bias in y", 2),
        ("drms", "DRMS about the bias", 2),
        ("along_rmse", "RMSE along the way", 2),
        ("cross_rmse", "RMSE across the way", 2),
        ("head_mae", "heading, mean", 3),
        ("head_rmse", "heading, RMSE", 3),
        ("head_p95", "heading, p95", 3),
        ("vel_err", "velocity error, mean", 1),
        ("jump_rate", "jumps", 2),
        ("path_ratio", "path length over the true one", 4),
    )
)
QUALITY = tuple(
    column(metric, title, separator=", ")
    for metric, title in (
        ("n_valid", "poses compared"),
        ("head_n", "instants with a true heading"),
        ("availability", "availability"),
        ("age_p95", "age, p95"),
        ("dropout_s", "without an answer"),
        ("t_conv", "to convergence"),
        ("failures", "failures"),
        ("anees", "ANEES (1: honest)"),
        ("cover95", "inside the claimed 95 %"),
        ("nll_2d", "negative log-likelihood, position"),
        ("energy", "energy score"),
    )
)
RELATIVE = (
    ("n", "pairs", 0),
    ("rmse", "RMSE", 2),
    ("median", "median", 2),
    ("rot_rmse", "rotation RMSE", 3),
    ("rot_median", "rotation median", 3),
)


def tables(score: PairScore) -> Sequence[Table]:
    """Position and heading, the relative pose errors, and the counts they rest on."""
    return _absolute(score), _relative(score.metrics), _quality(score)


def _absolute(score: PairScore) -> Table:
    if score.aligned is None or score.map_from_estimate is None:
        note = "" if score.align == "none" else f", not alignable by {score.align}"
        rows = tuple((one.title, one.text(score.metrics)) for one in POSITION)
        return Table(f"{_title(score)}, raw{note}", ("error", "raw"), rows)
    x, y, yaw = score.map_from_estimate
    title = (
        f"{_title(score)}; {score.align} turns the estimate by {math.degrees(yaw):.4f}° "
        f"and moves it by ({x:.4f}, {y:.4f}) m: RMSE raw / aligned = {score.ratio:.2f}"
    )
    both = (score.metrics, score.aligned)
    return Table(title, ("error", "raw", "aligned"), tuple((c.title, *(c.text(v) for v in both)) for c in POSITION))


def _title(score: PairScore) -> str:
    return f"{Path(score.estimate).name} against {Path(score.truth).name}, {score.mode}"


def _relative(metrics: dict[str, float]) -> Table:
    rows = [_reach(reach) for reach in REACHES]
    texts = tuple((reach[2:], *(one.text(metrics) for one in row)) for reach, row in zip(REACHES, rows, strict=True))
    return Table("relative pose error after", ("reach", *(one.title for one in rows[0])), texts)


def _reach(reach: str) -> list[Column]:
    return [column(f"rpe_{reach}_{what}", title, decimals=n, separator=", ") for what, title, n in RELATIVE]


def _quality(score: PairScore) -> Table:
    rows = tuple((one.title, one.text(score.metrics)) for one in QUALITY)
    return Table("how far to trust this", ("what", "value"), rows)
