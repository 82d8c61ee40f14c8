"""Models of radio readings: path loss, ranges, their inverses and derivatives."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion import RangeReading, Ranges, RssiReading, WifiScan, radio_readings
from fusion.radio import PathLoss, Ranging, free_space_loss_db
from tests.fusion.streams import world

reals = st.floats(-50.0, 50.0)
angles = st.floats(-3.0, 3.0)


@given(st.floats(1.0, 500.0), st.floats(1.2, 5.0))
@settings(derandomize=True)
def test_path_loss_inverts(distance_m, exponent):
    model = PathLoss(path_loss_exponent=exponent)
    assert float(model.distance(model.expected(distance_m))) == pytest.approx(distance_m, rel=1e-12)


def test_path_loss_is_held_below_the_reference_distance():
    model = PathLoss()
    assert float(model.expected(0.2)) == float(model.expected(1.0))
    assert float(model.slope(0.2)) == 0.0
    assert float(model.distance(100.0)) == 1.0


def test_free_space_loss_at_a_metre_is_that_of_friis():
    """20 log10(4 pi / 0.125 m) at 2.4 GHz (wavelength 0.1249 m): 40.05 dB."""
    assert free_space_loss_db(1.0, 2.4e9) == pytest.approx(40.05, abs=0.01)


def test_ranging_inverts():
    model = Ranging(scale=1.07, offset_m=0.3)
    assert float(model.distance(model.expected(4.2))) == pytest.approx(4.2, rel=1e-12)


@pytest.mark.parametrize("model", ["radio", "ranging"])
@given(x=reals, y=reals, heading=angles)
@settings(derandomize=True, max_examples=40)
def test_derivatives_of_a_radio_reading_are_those_of_finite_differences(model, x, y, heading):
    place = world(robot={"antenna_m": [0.3, -0.2, 0.5]})
    scan = (
        WifiScan(0, "w", 0, (RssiReading("a", -50.0),))
        if model == "radio"
        else Ranges(0, "r", 0, (RangeReading("a", 3.0),))
    )
    (reading,) = radio_readings(place, scan)
    antenna = place.robot.antenna_m
    here, step = reading.expect(x, y, heading, antenna), 1e-6
    if math.hypot(x, y) < 2.0:
        return
    for index, analytic in enumerate((here.by_x, here.by_y, here.by_heading)):
        moved = [x, y, heading]
        moved[index] += step
        ahead = reading.expect(*moved, antenna).value
        moved[index] -= 2 * step
        numeric = (ahead - reading.expect(*moved, antenna).value) / (2 * step)
        assert analytic == pytest.approx(numeric, abs=1e-5)
