"""Counterfactuals: the same run with something taken out, for estimates that are drawn thin beside the real ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from benchmarks.review.frame import Frame
from fusion import Measurement, ParameterError, Ranges, WifiScan
from fusion.errors import did_you_mean
from fusion.values import nanoseconds, seconds
from logs.run import Run


class Counterfactual(NamedTuple):
    """A run that did not happen; ``suffix`` states the difference, behind an estimator's name."""

    suffix: str
    run: Run


def counterfactuals(run: Run, without: Sequence[str], reject_s: Sequence[float]) -> list[Counterfactual]:
    """One for each anchor of ``without`` and each time of ``reject_s``, each of them once; raises `ParameterError`."""
    chosen = [without_anchor(run, anchor) for anchor in without] + [without_radio_at(run, at_s) for at_s in reject_s]
    return list({counterfactual.suffix: counterfactual for counterfactual in chosen}.values())


def without_anchor(run: Run, anchor: str) -> Counterfactual:
    """``run`` as if the radio had never received ``anchor``; raises `ParameterError` when it never did."""
    received = {
        reading.anchor for scan in run.measurements if isinstance(scan, WifiScan | Ranges) for reading in scan.readings
    }
    if anchor not in received:
        raise ParameterError(
            f"--without {anchor}: {run.path} holds no reading of that anchor; {did_you_mean(anchor, received)}"
        )
    kept = tuple(left for measurement in run.measurements if (left := _less(measurement, anchor)) is not None)
    return Counterfactual(f"without {anchor}", replace(run, measurements=kept))


def _less(measurement: Measurement, anchor: str) -> Measurement | None:
    """``measurement`` without the readings of ``anchor``; None when nothing is left of it."""
    if isinstance(measurement, WifiScan):
        rssi = tuple(reading for reading in measurement.readings if reading.anchor != anchor)
        return replace(measurement, readings=rssi) if rssi else None
    if isinstance(measurement, Ranges):
        ranges = tuple(reading for reading in measurement.readings if reading.anchor != anchor)
        return replace(measurement, readings=ranges) if ranges else None
    return measurement


def without_radio_at(run: Run, at_s: float) -> Counterfactual:
    """``run`` without the radio measurement nearest to ``at_s`` after its start, of two the earlier one; raises
    `ParameterError` when there is none, or the time is not one of the run.
    """
    frame = Frame.around(run)
    radio = [(m.time_ns, i) for i, m in enumerate(run.measurements) if isinstance(m, WifiScan | Ranges)]
    if not radio:
        raise ParameterError(f"--reject {at_s:g}: {run.path} holds no radio measurement that could be taken out")
    require_within(run, at_s, "--reject")
    wanted_ns = frame.start_ns + nanoseconds(at_s)
    time_ns, place = min(radio, key=lambda entry: (abs(entry[0] - wanted_ns), entry))
    kept = run.measurements[:place] + run.measurements[place + 1 :]
    return Counterfactual(f"reject {seconds(time_ns - frame.start_ns):.2f} s", replace(run, measurements=kept))


def require_within(run: Run, at_s: float, option: str) -> None:
    """Raises `ParameterError`, which names the option, for a time that is none of the run's."""
    duration_s = Frame.around(run).duration_s
    if not 0.0 <= at_s <= duration_s:
        raise ParameterError(
            f"{option} {at_s:g}: {run.path} lasts from 0 to {duration_s:.2f} s; give a time in between"
        )
