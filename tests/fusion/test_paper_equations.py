"""Equations 1 to 4 and Fig. 3 of Moro & Mehrpouyan 2019, each with numbers worked out by hand."""

import numpy as np
import pytest

from fusion.odometry import LinearDistance
from fusion.radio import PathLoss, free_space_loss_db
from fusion.trilateration import closed_form


def test_equations_1_and_2_by_hand():
    """A (0, 0), B (4, 0), C (0, 4); from (1, 2): d1^2 = 5, d2^2 = 13, d3^2 = 5.

    First bracket: 5 - 13 + 16 = 8. Second: 13 - 5 - 16 + 16 = 8. Eq. 1: (8 * 8 - 8 * 0) / (8 * 8 - 0 * -8) = 1.
    Eq. 2 as printed: (8 * -8 - 8 * 8) / (0 * -8 - 8 * 8) = -128 / -64 = 2.
    """
    anchors = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]])
    assert closed_form(anchors, np.sqrt([5.0, 13.0, 5.0])) == pytest.approx((1.0, 2.0))


def test_equation_3_by_hand():
    """n = 2.27: ten times the reference distance costs 22.7 dB, a hundred times 45.4 dB."""
    office = PathLoss(path_loss_exponent=2.27, reference_rssi_dbm=-40.0)
    assert office.expected([1.0, 10.0, 100.0]) == pytest.approx([-40.0, -62.7, -85.4])
    assert office.distance([-40.0, -62.7, -85.4]) == pytest.approx([1.0, 10.0, 100.0])


def test_equation_4_by_hand():
    """At 2.437 GHz lambda = 0.123017 m: 20 log10(4 pi 1 m / 0.123017 m) = 20 log10(102.1515) = 40.1849 dB."""
    assert free_space_loss_db(1.0, 2.437e9) == pytest.approx(40.1849, abs=1e-4)
    assert PathLoss(frequency_hz=2.437e9, transmit_power_dbm=20.0).rssi_at_reference_dbm == pytest.approx(
        -20.1849, abs=1e-4
    )


def test_figure_3_by_hand():
    """Actual = 1.1 set + 5 cm: 2 m set are 2.25 m driven, either way, and no move stays none."""
    line = LinearDistance(1.1, 0.05)
    assert [line.true_distance(m) for m in (2.0, -2.0, 0.0)] == pytest.approx([2.25, -2.25, 0.0])
