"""A pair is judged by its runs, a lost run is never dropped, and the sentence states how sure that is."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.statistics.verdict import by_percent, compare
from fusion import ParameterError

EASE = np.array([[1.0], [2.0], [4.0], [0.5], [3.0], [1.5], [2.5], [0.8]])
"""How hard each of eight runs is; its score of two estimators depends on their ratio alone."""
BETTER = EASE * np.exp([[-0.10], [-0.15], [-0.12], [-0.09], [-0.20], [-0.13], [-0.11], [-0.12]])
UNSURE = EASE * np.exp([[-0.30], [0.20], [-0.10], [0.25], [-0.40], [0.10], [-0.20], [0.15]])


def verdict_of(first, second):
    return compare({"ekf": first, "particle": second}, "pos_p75").verdicts[0]


def lost(scores, *runs):
    scores = scores.copy()
    scores[list(runs)] = math.inf
    return scores


def test_clear_pair_is_stated_with_percent_and_interval():
    """Mean of d -0.1275, standard deviation 0.034538; t(7, 0.975) = 2.364624, so +-0.028875."""
    verdict = verdict_of(BETTER, EASE)
    assert verdict.ratio == pytest.approx(tuple(np.exp([-0.1275, -0.1275 - 0.028875, -0.1275 + 0.028875])), rel=1e-4)
    assert verdict.sentence == "ekf beats particle by 12 % [9, 14] on pos_p75 (8 runs)"
    assert verdict.signed_rank.p == 2.0 / 2**8


def test_winner_stands_first_whatever_the_order():
    assert verdict_of(EASE, BETTER).sentence == "particle beats ekf by 12 % [9, 14] on pos_p75 (8 runs)"


def test_unclear_pair_states_how_many_runs_would_settle_it():
    """Mean of d -0.0375, standard deviation 0.24604: the half width is 0.2057, the detectable 0.2836, and with normal
    quantiles (1.960 + 0.842)^2 (0.24604 / 0.0375)^2 = 338 runs, a little more with those of t.
    """
    verdict = verdict_of(UNSURE, EASE)
    assert verdict.winner is None
    assert verdict.sentence == (
        "inconclusive between ekf and particle on pos_p75: ratio 0.96 [0.78, 1.18], needs at least 340 runs "
        "(8 runs show differences from 25 %)"
    )


def test_detectable_difference_is_that_of_the_formula():
    verdict = verdict_of(UNSURE, EASE)
    std = np.log(UNSURE / EASE).std(ddof=1)
    assert verdict.detectable == pytest.approx(1.0 - math.exp(-(2.364624 + 0.896030) / math.sqrt(8.0) * std), rel=1e-5)


def test_score_of_a_run_is_its_median_over_the_seeds():
    seeds = np.concatenate([BETTER, BETTER * 0.5, BETTER * 100.0], axis=1)
    assert verdict_of(seeds, EASE).ratio == verdict_of(BETTER, EASE).ratio


def test_run_is_lost_when_most_of_its_seeds_are():
    seeds = np.concatenate([BETTER, lost(BETTER, 0, 1), lost(BETTER, 0)], axis=1)
    assert (verdict_of(seeds, EASE).losses, verdict_of(seeds, EASE).compared) == (1, 7)


def test_lost_runs_are_counted_beside_the_ratio_of_the_others():
    verdict = verdict_of(lost(BETTER, 0, 7), lost(EASE, 1, 7))
    assert (verdict.runs, verdict.compared, verdict.wins, verdict.losses, verdict.ties) == (8, 5, 1, 1, 1)
    assert verdict.ratio[0] == pytest.approx(math.exp(-(0.12 + 0.09 + 0.20 + 0.13 + 0.11) / 5.0))
    assert "ekf wins 1 and loses 1 of 3" in verdict.sentence


def test_estimator_that_is_better_while_it_lives_does_not_beat_one_that_never_dies():
    alive = verdict_of(BETTER, EASE)
    dying = verdict_of(lost(BETTER, 0, 1, 2), EASE)
    assert (alive.winner, dying.winner) == ("ekf", None)
    assert dying.ratio[2] < 1.0


def test_estimator_that_is_always_lost_is_beaten_without_any_ratio():
    verdict = verdict_of(BETTER, lost(EASE, *range(8)))
    assert verdict.winner == "ekf"
    assert verdict.sentence == (
        "ekf beats particle on pos_p75: lost runs decide, ekf wins 8 and loses 0 of 8 "
        "(signed ranks of 8 runs, p 0.0078)"
    )


def test_run_that_both_lost_counts_nothing_and_leaves_the_t_interval_to_decide():
    verdict = verdict_of(lost(BETTER, 3), lost(EASE, 3))
    assert (verdict.winner, verdict.by_rank, verdict.ties) == ("ekf", False, 1)


def test_one_run_is_not_enough():
    verdict = verdict_of(BETTER[:1], EASE[:1])
    assert verdict.winner is None
    assert verdict.ratio[1:] == (0.0, math.inf)
    assert (verdict.detectable, verdict.runs_needed) == (1.0, None)
    assert "1 of 1 run can be compared" in verdict.sentence


def test_estimator_ties_with_its_own_copy():
    verdict = verdict_of(EASE, EASE)
    assert (verdict.winner, verdict.ratio, verdict.runs_needed) == (None, (1.0, 1.0, 1.0), None)


def test_many_pairs_are_held_to_a_stricter_measure():
    """t interval of the pair excludes 1, Holm over six pairs does not, and the sentence states it."""
    slightly = EASE * np.exp([[-0.10], [0.02], [-0.15], [-0.03], [-0.20], [-0.08], [0.03], [-0.12]])
    alone = verdict_of(slightly, EASE)
    crowd = compare({"ekf": slightly, "particle": EASE, "ukf": EASE * 1.0, "grid": UNSURE}, "pos_p75")
    among = crowd.verdicts[0]
    assert (alone.winner, among.winner) == ("ekf", None)
    assert (among.p, among.ratio) == (alone.p, alone.ratio)
    assert "among so many pairs may be chance" in among.sentence
    assert len(crowd.verdicts) == 6


def test_letters_and_friedman_stand_beside_the_pairs():
    comparison = compare({"ekf": BETTER, "particle": EASE, "copy": EASE.copy()}, "pos_p75")
    assert comparison.letters == {"ekf": "a", "particle": "b", "copy": "b"}
    # Ranks 1, 2.5, 2.5 in every run: all there is to say, chi-square 16 with two degrees of freedom.
    assert comparison.friedman_p == pytest.approx(math.exp(-8.0))
    assert compare({"ekf": BETTER, "particle": EASE}, "pos_p75").friedman_p is None


@pytest.mark.parametrize(
    ("scores", "message"),
    [
        ({"a": EASE, "b": EASE[:3]}, "different numbers of runs"),
        ({"a": EASE, "b": EASE[:, 0]}, "one row per run"),
        ({"a": EASE, "b": EASE * math.nan}, "a score is nan"),
        ({"a": EASE, "b": EASE * 0.0}, "a score is 0.0"),
        ({"a": EASE, "b": -EASE}, "a score is -1.0"),
    ],
)
def test_scores_that_do_not_belong_together_are_refused(scores, message):
    with pytest.raises(ParameterError, match=message):
        compare(scores, "pos_p75")


def test_level_that_is_no_share_is_refused():
    with pytest.raises(ParameterError, match="level 95"):
        compare({"a": EASE, "b": EASE}, "pos_p75", level=95)


def test_small_differences_keep_their_decimals():
    assert by_percent(0.995, 0.993, 0.997) == "by 0.50 % [0.30, 0.70]"
    assert by_percent(2.0, 1.25, 4.0) == "by 50 % [20, 75]"


run_scores = st.one_of(st.floats(0.01, 100.0), st.just(math.inf))
paired = st.lists(st.tuples(run_scores, run_scores), min_size=1, max_size=9)


@settings(derandomize=True)
@given(paired)
def test_swapping_the_two_inverts_the_ratio_and_keeps_the_winner(pairs):
    first, second = (np.array(column)[:, None] for column in zip(*pairs, strict=True))
    one, other = verdict_of(first, second), compare({"particle": second, "ekf": first}, "pos_p75").verdicts[0]
    assert other.winner == one.winner
    assert (other.wins, other.losses, other.ties) == (one.losses, one.wins, one.ties)
    assert (other.p, other.holm_p, other.runs_needed) == (one.p, one.holm_p, one.runs_needed)
    assert (-other.log_ratio.high, -other.log_ratio.low) == pytest.approx(
        (one.log_ratio.low, one.log_ratio.high), nan_ok=True
    )


@settings(derandomize=True)
@given(paired, st.sampled_from([0.01, 100.0, 57.3]))
def test_unit_of_the_scores_changes_nothing(pairs, unit):
    first, second = (np.array(column)[:, None] for column in zip(*pairs, strict=True))
    one, other = verdict_of(first, second), verdict_of(first * unit, second * unit)
    assert other.log_ratio.mean == pytest.approx(one.log_ratio.mean, abs=1e-9, nan_ok=True)
    assert (other.wins, other.losses, other.ties) == (one.wins, one.losses, one.ties)
    if one.log_ratio.std > 1e-6:
        assert other.ratio == pytest.approx(one.ratio, rel=1e-6)
        assert other.log_ratio.p == pytest.approx(one.log_ratio.p, abs=1e-9)
