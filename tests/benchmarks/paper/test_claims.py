"""Claims and verdicts on outcomes made by hand: each claim is kept by some runs and broken by others."""

import numpy as np
import pytest

from benchmarks.paper import evidence
from benchmarks.paper.claims import CLAIMS, FEWEST_RUNS, Judged, in_words, judge, runs_to_decide, verdict
from benchmarks.paper.experiment import Outcome
from benchmarks.paper.interpretation_study import effects, literal_of_scale, rank
from benchmarks.paper.interpretations import INTERPRETATIONS, MISSING_VALUES, ORIGINS_M
from benchmarks.paper.published import ENVIRONMENTS, ODOMETRY, PROPOSED, WIFI
from benchmarks.paper.straight_moves import MOVES_M
from benchmarks.paper.summary import Share, Spread
from sensors.simulation.scenario import load_scenario

OFFICE, MEC, ARENA = ENVIRONMENTS


def outcome(odometry, wifi, proposed, environment=OFFICE, **more):
    """Errors along x alone, (runs, points) [m] each."""
    curves = {ODOMETRY: odometry, WIFI: wifi, PROPOSED: proposed}
    errors = {
        estimator: np.stack([np.array(rows, float), np.zeros_like(rows, float)], axis=2)
        for estimator, rows in curves.items()
    }
    n, p, _ = errors[PROPOSED].shape
    parts = {
        "refused": np.zeros((n, p), bool),
        "interpretations": np.tile(errors[PROPOSED].max(axis=(1, 2))[:, None], (1, len(INTERPRETATIONS))),
        "missing": np.ones((n, len(MISSING_VALUES))),
        "origins": np.ones((n, len(ORIGINS_M))),
        "moves": np.tile(np.array(MOVES_M) * 1.02, (n, 1)),
        "alternatives": {},
        "bound": np.tile(np.eye(2), (p, 1, 1)),
        "crashes": {},
    }
    return Outcome(environment, load_scenario(environment.scenario), tuple(range(n)), errors, **(parts | more))


ONE = [[0.1, 0.1, 0.2]]


@pytest.mark.parametrize(
    ("proposed", "better", "halves_larger", "halves_both"),
    [(0.9, True, False, False), (1.0, False, False, False), (0.5, True, True, True), (0.75, True, True, False)],
)
def test_better_and_half_are_of_the_largest_errors(proposed, better, halves_larger, halves_both):
    """Odometry errs 1 m at most, Wi-Fi 1.6 m."""
    found = outcome([[0.2, 1.0]], [[1.6, 0.1]], [[proposed, 0.0]])
    assert evidence.beats_both(found).tolist() == [better]
    assert evidence.halves_larger(found).tolist() == [halves_larger]
    assert evidence.halves_both(found).tolist() == [halves_both]


def test_a_method_that_refused_every_fix_does_not_beat_odometry_by_rounding():
    assert evidence.beats_both(outcome([[0.2]], [[0.9]], [[0.2 - 1e-12]])).tolist() == [False]


def test_the_larger_coordinate_counts_not_the_distance():
    found = outcome(ONE, ONE, ONE)
    found.errors[PROPOSED][0, 1] = (0.3, -0.4)
    assert found.largest(PROPOSED).tolist() == [0.4]
    assert found.coordinate(PROPOSED)[0].tolist() == [0.1, 0.4, 0.2]
    assert found.euclidean(PROPOSED)[0].tolist() == pytest.approx([0.1, 0.5, 0.2])


@pytest.mark.parametrize(("largest", "kept"), [(0.05, True), (0.0501, False)])
def test_published_maximum_may_be_reached(largest, kept):
    assert evidence.within_maximum(outcome(ONE, ONE, [[0.0, largest]])).tolist() == [kept]


@pytest.mark.parametrize(
    ("errors", "paper", "fingerprints"),
    [
        ([0.1, 0.8], False, True),  # mean 0.45
        ([0.1, 0.5], True, True),  # mean 0.3
        ([0.0, 0.0, 0.9], False, True),  # mean 0.3, maximum 0.9
        ([0.2, 1.2], False, True),  # mean 0.7
        ([0.0, 0.0, 1.7], False, False),
    ],
)
def test_table_1_needs_mean_and_maximum(errors, paper, fingerprints):
    found = outcome([errors], [errors], [errors], ARENA)
    assert evidence.within_table_1(found).tolist() == [paper]
    assert evidence.as_good_as_fingerprints(found).tolist() == [fingerprints]


@pytest.mark.parametrize(("largest", "kept"), [(0.31, True), (0.29, False)])
def test_an_outlier_is_three_times_the_median(largest, kept):
    assert evidence.has_wifi_outliers(outcome(ONE, [[0.1, 0.1, largest]], ONE)).tolist() == [kept]


@pytest.mark.parametrize(("last", "kept"), [(0.4, True), (0.39, False)])
def test_growth_compares_the_last_third_with_the_first(last, kept):
    """Seven points: two in each outer third."""
    errors = [[0.1, 0.3, 9.0, 9.0, 9.0, last, 0.4]]
    assert evidence.odometry_grows(outcome(errors, errors, errors)).tolist() == [kept]


def test_moves_on_a_line_are_linear_and_scattered_ones_are_not():
    assert evidence.is_linear(outcome(ONE, ONE, ONE)).tolist() == [True]
    scattered = np.array([MOVES_M]) + np.tile([0.3, -0.3], len(MOVES_M) // 2)
    assert evidence.is_linear(outcome(ONE, ONE, ONE, moves=scattered)).tolist() == [False]


def test_refusals_are_weighed_against_what_was_refused():
    """Fixes: better and refused, worse and refused, better and taken, worse and taken."""
    found = outcome([[0.5, 0.5, 0.5, 0.5]], [[0.1, 0.9, 0.1, 0.9]], [[0.5, 0.5, 0.3, 0.7]])
    found = found._replace(refused=np.array([[True, True, False, False]]))
    assert evidence.refused_share(found) == 0.5
    assert evidence.refused_though_better(found) == 0.5
    assert evidence.taken_though_worse(found) == 0.5


@pytest.mark.parametrize(
    ("shares", "expected"),
    [
        pytest.param([(100, 100), (99, 100)], "reproduced", id="nearly always everywhere"),
        pytest.param([(0, 100), (1, 100)], "not reproduced", id="nearly never everywhere"),
        pytest.param([(0, 100), (100, 100)], "reproduced in 50 %", id="always here, never there"),
        pytest.param([(90, 100), (90, 100)], "reproduced in 90 %", id="the interval reaches below 90 %"),
        pytest.param([(0, 24), (0, 100)], "inconclusive from 24 runs", id="too few runs in one environment"),
        pytest.param([(0, 25)], "not reproduced", id="just enough"),
    ],
)
def test_verdict(shares, expected):
    assert verdict([Share.of(np.arange(total) < held) for held, total in shares]) == expected


def shares_of(*held):
    return {str(k): Share.of(np.arange(total) < kept) for k, (kept, total) in enumerate(held)}


def judged_of(*held):
    shares = shares_of(*held)
    return Judged(CLAIMS[0], shares, verdict([*shares.values()]), "")


@pytest.mark.parametrize("held", [[(20, 20)], [(0, 20)], [(10, 20)], [(20, 20), (0, 20)]])
def test_clear_shares_are_decided_by_the_fewest_runs(held):
    assert runs_to_decide([*shares_of(*held).values()]) == FEWEST_RUNS == 25


@pytest.mark.parametrize("held", [[(19, 20)], [(1, 20)], [(17, 20)], [(19, 20), (20, 20)], [(19, 20), (17, 20)]])
def test_so_many_runs_at_the_same_shares_decide_and_one_twentieth_fewer_do_not(held):
    """By the intervals themselves: each on one side of both limits, or the verdict is one of the two."""
    needed = runs_to_decide([*shares_of(*held).values()])
    assert np.isfinite(needed)
    assert needed > FEWEST_RUNS
    for total, decided in ((20 * int(np.ceil(needed / 20)), True), (20 * int((needed - 1e-9) // 20), False)):
        again = judged_of(*((kept * total // 20, total) for kept, _ in held))
        assert again.is_decided == decided
        possible = (
            min(share.high for share in again.shares.values()) > 0.9,
            max(share.low for share in again.shares.values()) < 0.1,
        )
        clear = again.verdict in ("reproduced", "not reproduced") or not any(possible)
        assert clear == decided


def test_share_at_a_limit_is_decided_by_no_number_of_runs():
    assert runs_to_decide([*shares_of((18, 20)).values()]) == np.inf


@pytest.mark.parametrize(
    ("claims", "sentence"),
    [
        pytest.param(
            [judged_of((20, 20)), judged_of((10, 20)), judged_of((1, 20))],
            "Of 3 claims 0 hold in nearly every run, 0 in nearly none, 0 in a part of the runs or not in every "
            "environment; undecided: 3, which 25 to 98 runs would decide.",
            id="too few runs",
        ),
        pytest.param(
            [judged_of((200, 200)), judged_of((0, 200)), judged_of((100, 200)), judged_of((18, 200))],
            "Of 4 claims 1 hold in nearly every run, 1 in nearly none, 1 in a part of the runs or not in every "
            "environment; undecided: 1, which about 2 500 runs would decide.",
            id="one near a limit",
        ),
        pytest.param(
            [judged_of((18, 20)), judged_of((0, 20))],
            "Of 2 claims 0 hold in nearly every run, 0 in nearly none, 0 in a part of the runs or not in every "
            "environment; undecided: 2, which 25 runs or more would decide.",
            id="one at a limit",
        ),
        pytest.param(
            [judged_of((30, 30))],
            "Of 1 claims 1 hold in nearly every run, 0 in nearly none, 0 in a part of the runs or not in every "
            "environment; undecided: 0.",
            id="none",
        ),
    ],
)
def test_claims_in_words_count_the_undecided_and_what_would_decide_them(claims, sentence):
    assert in_words(claims) == sentence


def test_every_claim_is_judged_on_its_environments_with_a_reason():
    made = [outcome(*[[[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]] * 30] * 3, environment) for environment in ENVIRONMENTS]
    judged = judge(made)
    assert [each.claim for each in judged] == list(CLAIMS)
    assert all(each.reason.endswith(".") for each in judged)
    about = {each.claim.key: set(each.shares) for each in judged}
    assert about.pop("table_1") == about.pop("fingerprints") == {ARENA.title}
    assert all(titles == {each.title for each in ENVIRONMENTS} for titles in about.values())


def test_spread_counts_runs_without_an_answer_as_infinite():
    assert Spread.of(np.array([1.0, 2.0, 3.0, np.inf])) == (2.5, pytest.approx(1.15), np.inf)


def test_interpretations_are_ranked_by_how_far_they_are_from_the_paper():
    """One reading hits every published maximum, one is twice as far everywhere, the others ten times."""
    exact, twice = 17, literal_of_scale("floor")
    made = []
    for environment in ENVIRONMENTS:
        made_m = np.full((3, len(INTERPRETATIONS)), 10.0 * environment.proposed_max_m)
        made_m[:, exact], made_m[:, twice] = environment.proposed_max_m, environment.proposed_max_m / 2.0
        made.append(outcome(*[[[0.1]] * 3] * 3, environment, interpretations=made_m))
    ranked = rank(made)
    assert [each.interpretation for each in ranked[:2]] == [INTERPRETATIONS[exact], INTERPRETATIONS[twice]]
    assert [each.factor for each in ranked[:3]] == pytest.approx([1.0, 2.0, 10.0])


def test_effect_of_an_option_is_the_geometric_mean_over_all_others():
    """Feedback alone decides: 2 m with, 8 m without."""
    row = [2.0 if each.options["feedback"] else 8.0 for each in INTERPRETATIONS]
    made = [
        outcome(*[[[0.1]] * 3] * 3, environment, interpretations=np.array([row] * 3)) for environment in ENVIRONMENTS
    ]
    found = {effect.option: effect for effect in effects(made)}
    assert found["feedback"].medians_m == {"True": pytest.approx((2.0,) * 3), "False": pytest.approx((8.0,) * 3)}
    assert found["feedback"].ratio == pytest.approx((4.0,) * 3)
    assert found["epsilon"].ratio == pytest.approx((1.0,) * 3)
    assert found["epsilon"].medians_m["3"] == pytest.approx((4.0,) * 3)
