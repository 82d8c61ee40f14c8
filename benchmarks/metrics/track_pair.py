"""Score of a track in one file against the truth in another."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.alignment import ALIGNMENTS, align
from benchmarks.metrics.matching import MAX_AGE_S, match, meet
from benchmarks.metrics.score import absolute_metrics, errors, for_json, metrics
from benchmarks.metrics.track_files import read_track, read_truth
from fusion import LogError, ParameterError, Pose
from fusion.errors import did_you_mean
from fusion.values import nanoseconds
from logs.truth import GAP_S, RATE_HZ, TruthTrack, evaluation_instants, known_truth

MODES = ("causal", "interp")


class PairScore(NamedTuple):
    """The score of one track: ``metrics`` raw; those of position and heading ``aligned``, after ``map_from_estimate``
    moved the estimate.

    The latter are None without alignment; where one was asked for and is impossible, ``align`` states so all the same.
    ``warnings``: what of the truth is left out, in sentences.
    """

    truth: str
    estimate: str
    mode: str
    align: str
    metrics: dict[str, float]
    aligned: dict[str, float] | None = None
    map_from_estimate: Pose | None = None
    warnings: tuple[str, ...] = ()

    @property
    def ratio(self) -> float:
        """RMSE raw over aligned: how much of the error alignment hides; NaN without alignment."""
        if self.aligned is None:
            return math.nan
        return float(np.divide(self.metrics["pos_rmse"], self.aligned["pos_rmse"]))

    def record(self) -> dict[str, object]:
        """Everything for strict JSON, in m, s and rad; what is infinite or does not exist is None."""
        aligned = None
        if self.aligned is not None and self.map_from_estimate is not None:
            transform = dict(zip(("x_m", "y_m", "yaw_rad"), self.map_from_estimate, strict=True))
            aligned = {**transform, **for_json({"ratio": self.ratio, **self.aligned})}
        head = {"truth": self.truth, "estimate": self.estimate, "mode": self.mode, "align": self.align}
        return {**head, "warnings": list(self.warnings), **for_json(self.metrics), "aligned": aligned}


def score_pair(
    truth: str | Path,
    estimate: str | Path,
    *,
    mode: str = "causal",
    alignment: str = "none",
    hz: float = RATE_HZ,
    max_age_s: float = MAX_AGE_S,
    gap_s: float = GAP_S,
) -> PairScore:
    """Score the track in ``estimate`` against ``truth``: TUM, CSV or MCAP files (`benchmarks.metrics.track_files`).

    ``causal``: at each instant of the truth counts the newest answer, not older than ``max_age_s``. ``interp``: the
    truth is interpolated at the stamps of the estimate. Raises `LogError` and `ParameterError`.
    """
    for given, known in ((mode, MODES), (alignment, ("none", *ALIGNMENTS))):
        if given not in known:
            raise ParameterError(f"{given!r} does not exist; {did_you_mean(given, known)}")
    (true, warnings), track = read_truth(truth), read_track(estimate)
    if track.flaw:
        raise LogError(f"{estimate}: {track.flaw}")
    weight, availability = None, {}
    if mode == "interp":
        instants, answers, weight, share = meet(true, track, gap_s=gap_s)
        availability = {"availability": share}
    else:
        instants = evaluation_instants(true, hz=hz, gap_s=gap_s)
        answers = match(instants, track, max_age_s=max_age_s)
    if not answers.valid.any():
        raise LogError(f"{estimate}: {_nothing_met(true, mode, gap_s)} (truth: {truth})")
    raw = {**metrics(errors(instants, answers, weight)), **availability}
    score = PairScore(str(truth), str(estimate), mode, alignment, raw, warnings=warnings)
    moved = None if alignment == "none" else align(instants, answers, alignment)
    if moved is None:
        return score
    aligned = {**absolute_metrics(errors(instants, moved.answers, weight)), **availability}
    return score._replace(aligned=aligned, map_from_estimate=moved.map_from_estimate)


def _nothing_met(truth: TruthTrack, mode: str, gap_s: float) -> str:
    """The reason why nothing could be compared, and the remedy."""
    if mode != "interp":
        return "no pose can be compared with the truth; see that both have the same clock"
    known = known_truth(truth)
    if len(known) > 1 and np.diff(known.time_ns).min() > nanoseconds(gap_s):
        return f"truth is interpolated over {gap_s:g} s at most, and this one is sparser everywhere; use --mode causal"
    return "fewer than two poses lie within the truth, and one stands for no time; see that both have the same clock"
