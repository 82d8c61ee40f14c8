"""The bias from stop to stop, turns against the truth, and the Allan deviation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fusion.output.colours import BLUE, VERMILLION
from fusion.output.figures import label, panels, plain, plain_ticks
from fusion.values import NANOSECONDS
from sensors.calibration.gyro import GyroCalibration

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw(calibration: GyroCalibration) -> Figure:
    """Three panels."""
    figure, (bias, turns, curve) = panels(3, 3.6)
    _draw_bias(bias, calibration)
    _draw_turns(turns, calibration)
    _draw_allan(curve, calibration)
    return figure


def _draw_bias(axes: Axes, calibration: GyroCalibration) -> None:
    label(axes, "Bias at each standstill", "since the first, s", "mean rate at rest, °/s")
    stops, bias = calibration.standstills, calibration.bias
    middles = np.array([0.5 * (stop.from_ns + stop.until_ns) for stop in stops]) / NANOSECONDS
    reach = [stop.scatter / np.sqrt(stop.samples) for stop in stops]
    rates = np.degrees([stop.bias for stop in stops])
    axes.errorbar(middles - middles.min(), rates, np.degrees(reach), fmt="o", color=plain(BLUE), markersize=4)
    axes.axhline(float(np.degrees(bias.value)), color=plain(VERMILLION))
    if np.isfinite(bias.reach):
        low, high = np.degrees([bias.value - bias.reach, bias.value + bias.reach])
        axes.axhspan(low, high, color=plain(VERMILLION), alpha=0.15, linewidth=0)


def _draw_turns(axes: Axes, calibration: GyroCalibration) -> None:
    label(axes, "Turns: true minus gyro without bias", "true turn, °", "difference, °")
    axes.axhline(0.0, color="0.6", linewidth=0.8)
    if not calibration.turns or calibration.scale is None:
        return
    true = np.degrees([turn.true for turn in calibration.turns])
    measured = np.degrees([turn.raw - calibration.bias.value * turn.duration_s for turn in calibration.turns])
    axes.plot(true, true - measured, "o", color=plain(BLUE), markersize=4)
    reach = np.array([true.min(), true.max()])
    axes.plot(reach, reach * (1.0 - 1.0 / calibration.scale.value), color=plain(VERMILLION))
    axes.set_title(f"True minus gyro without bias, scale {calibration.scale.text(4)}", fontsize=10)


def _draw_allan(axes: Axes, calibration: GyroCalibration) -> None:
    label(axes, "Allan deviation of the longest standstill", "averaging time, s", "deviation, °/s")
    if calibration.allan is None:
        return
    tau, deviation, std, noise, *_ = calibration.allan
    axes.errorbar(tau, np.degrees(deviation), np.degrees(std), fmt="o-", color=plain(BLUE), markersize=3, linewidth=1.0)
    axes.plot(tau, np.degrees(noise.value / np.sqrt(tau)), color=plain(VERMILLION), label="white noise")
    axes.set_xscale("log")
    axes.set_yscale("log")
    plain_ticks(axes.xaxis)
    plain_ticks(axes.yaxis)
    axes.legend(fontsize=8)
