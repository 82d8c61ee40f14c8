"""The bias of a gyro is measured while the wheels stand, and only then."""

import math

import pytest

from fusion import Gyro, WheelTicks
from sensors.onboard.gyro_bias import Standstill


def stand(rates, *, moving=(), sensor="gyro"):
    """Diagnostics on ticks every half second and ten rates between; ``moving``: seconds in which the wheels count."""
    watch, biases, count = Standstill(), [], 0
    for half in range(len(rates) // 10):
        for i, rate in enumerate(rates[10 * half : 10 * half + 10]):
            biases += watch.take(Gyro(half * 500_000_000 + i * 50_000_000 + 1, sensor, i, rate))
        count += half // 2 in moving
        biases += watch.take(WheelTicks((half + 1) * 500_000_000, "wheels", half, (count, count)))
    return biases


def test_five_seconds_of_standing_give_the_bias():
    diagnostic, *_ = stand([0.004 + (0.001 if i % 2 else -0.001) for i in range(240)])
    values = {key: float(value) for key, value in diagnostic.values}
    assert (diagnostic.sensor, diagnostic.text) == ("gyro", "bias at standstill")
    assert values["bias_rad_s"] == pytest.approx(0.004)
    assert values["bias_std_rad_s"] == pytest.approx(0.001 / math.sqrt(values["samples"]), rel=0.02)


def test_moving_or_shaken_robots_give_none():
    assert stand([0.004] * 400, moving=(2, 6, 10, 14, 18)) == []
    assert stand([0.1 if i % 2 else -0.1 for i in range(240)]) == []


def test_a_hand_that_turns_the_standing_robot_is_no_bias():
    texts = [diagnostic.text for diagnostic in stand([0.004] * 130 + [0.1] * 230)]
    assert texts[0] == "bias at standstill"
    assert "turned while the wheels stood" in texts
