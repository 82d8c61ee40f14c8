"""Letters show exactly which names cannot be distinguished."""

import itertools

from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.statistics.letters import letters

NAMES = ("ekf", "grid", "particle", "ukf", "weights")
PAIRS = tuple(itertools.combinations(NAMES, 2))


def test_names_that_are_all_alike_share_one_letter():
    assert set(letters(NAMES, []).values()) == {"a"}


def test_names_that_are_all_different_have_a_letter_each_in_the_order_given():
    assert letters(NAMES, PAIRS) == dict(zip(NAMES, "abcde", strict=True))


def test_no_names_have_no_letters():
    assert letters([], []) == {}


def test_letters_go_on_after_z():
    names = [str(i) for i in range(28)]
    assert letters(names, list(itertools.combinations(names, 2)))["27"] == "bb"


@settings(derandomize=True)
@given(st.sets(st.sampled_from(PAIRS)))
def test_two_names_share_a_letter_exactly_when_they_are_not_apart(apart):
    given_letters = letters(NAMES, sorted(apart))
    for pair in PAIRS:
        shared = set(given_letters[pair[0]]) & set(given_letters[pair[1]])
        assert bool(shared) == (pair not in apart)
