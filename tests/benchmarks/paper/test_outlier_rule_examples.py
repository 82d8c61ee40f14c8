"""The two minimal examples: what they show, and that the repair cures both."""

import pytest

from benchmarks.paper.outlier_rule_examples import OFFSETS_M, SLIPPING_LEG, lock_out_example, origin_example


def test_origin_alone_decides_whether_a_fix_is_an_outlier():
    """0.5 m of x = 2, 3, 4, 7, 12 m are 25, 16.7, 12.5, 7.1, 4.2 %: more than ten, then less. The room is the same."""
    rows = origin_example()
    assert [row.offset_m for row in rows] == list(OFFSETS_M)
    assert [row.differs_percent for row in rows] == pytest.approx([25.0, 16.667, 12.5, 7.143, 4.167], abs=1e-3)
    assert [row.is_outlier for row in rows] == [True, True, True, False, False]
    assert [row.answer_x_m for row in rows] == pytest.approx([2.0, 2.0, 2.0, 2.25, 2.25])


def test_one_slip_locks_every_later_fix_out_though_all_are_exact():
    legs = lock_out_example()
    before, after = legs[: SLIPPING_LEG - 1], legs[SLIPPING_LEG - 1 :]
    assert [leg.proposed_m for leg in before] == pytest.approx([0.0] * len(before), abs=1e-9)
    assert [leg.proposed_m for leg in after] == pytest.approx([1.0] * len(after))
    assert [leg.refused_in_a_row for leg in after] == list(range(1, len(after) + 1))


def test_the_repair_refuses_the_slip_once_and_then_halves_it():
    after = [leg.repaired_m for leg in lock_out_example()][SLIPPING_LEG - 1 :]
    assert after == pytest.approx([0.5**k for k in range(len(after))], rel=1e-6)
