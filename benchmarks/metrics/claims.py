"""What each answer claimed, as a Gaussian, against what was true: NEES and the proper scores, instant by instant."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.metrics.track import Flags, Floats

DIRECTIONS = 8
"""Of the energy score: a mean over instants is then right to 0.2 %, of hopeless claims to 0.6 %."""
ANGLES = (np.arange(DIRECTIONS)[:, None] + 0.5) * (np.pi / DIRECTIONS)
REACH = np.abs(np.cos(ANGLES))
"""How much of the error lies in each direction, (directions, 1)."""
HARMONICS = np.hstack([np.ones_like(ANGLES), np.cos(2.0 * ANGLES), -np.sin(2.0 * ANGLES)])
"""A variance in each direction from its mean and its second harmonic, (directions, 3)."""
LOG_TAU = float(np.log(2.0 * np.pi))


class Claims(NamedTuple):
    """Squared Mahalanobis distance, negative log density [nat] and energy score [m] of the errors, all (n,).

    ``nees`` and ``nll`` are those of the pose, NaN where a heading is missing; ``_2d`` and ``energy`` of the position.
    All NaN where no covariance was claimed; a singular one makes the first four infinite.
    """

    nees: Floats
    nees_2d: Floats
    nll: Floats
    nll_2d: Floats
    energy: Floats


def judge(dx: Floats, dy: Floats, turn: Floats, covariance: Floats) -> Claims:
    """Of signed errors (n,) [m, m, rad], NaN where there was no answer, and covariances (n, 3, 3), NaN without claim.

    eᵀ P⁻¹ e (Bar-Shalom, Li & Kirubarajan 2001) by P = L D Lᵀ, written out: one stacked solve costs ten times more.
    """
    if not np.isfinite(covariance[:, 0, 0]).any():
        return Claims(*[np.full(len(dx), np.nan)] * 5)
    xx, xy, xh, yy, yh, hh = (covariance[:, i, j] for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        by_x, heading_by_x = xy / xx, xh / xx
        pivot_y = yy - by_x * xy
        heading_by_y = (yh - by_x * xh) / pivot_y
        pivot_h = hh - heading_by_x * xh - heading_by_y * heading_by_y * pivot_y
        across = dy - by_x * dx
        nees_2d = dx * dx / xx + across * across / pivot_y
        rest = turn - heading_by_x * dx - heading_by_y * across
        nees = nees_2d + rest * rest / pivot_h
        area = xx * pivot_y
        nll_2d = LOG_TAU + 0.5 * (np.log(area) + nees_2d)
        nll = 1.5 * LOG_TAU + 0.5 * (np.log(area * pivot_h) + nees)
    flat = ~((xx > 0.0) & (pivot_y > 0.0))
    void = flat | ~(pivot_h > 0.0)
    claimed_2d = np.isfinite(xx + xy + yy + dx)
    claimed = claimed_2d & np.isfinite(xh + yh + hh + turn)
    return Claims(
        _settled(nees, void, claimed),
        _settled(nees_2d, flat, claimed_2d),
        _settled(nll, void, claimed),
        _settled(nll_2d, flat, claimed_2d),
        energy_scores(dx, dy, xx, xy, yy),
    )


def _settled(values: Floats, singular: Flags, claimed: Flags) -> Floats:
    return np.where(claimed, np.where(singular, np.inf, values), np.nan)


def energy_scores(dx: Floats, dy: Floats, xx: Floats, xy: Floats, yy: Floats) -> Floats:
    """Energy score (Gneiting & Raftery 2007, eq. 22) of the position each answer claimed, (n,) [m]: smaller is better.

    E‖X - p‖ - E‖X - X'‖ / 2 needs no draws. In the plane ‖v‖ is pi / 2 times the mean of |v . u| over all directions
    u, so the score is pi / 2 times the mean over directions of the one-dimensional score, which for a Gaussian has
    the closed form below (ibid., section 4.2). A mean over equally spaced directions, counted from that of the error
    so that no frame is preferred, converges exponentially.
    """
    offset = dx + 1j * dy
    error = np.abs(offset)
    ahead = np.divide(offset, error, out=np.ones_like(offset), where=error > 0.0)
    turned = (0.5 * (xx - yy) - 1j * xy) * (ahead * ahead)
    std = np.sqrt(np.maximum(HARMONICS @ np.array([0.5 * (xx + yy), turned.real, turned.imag]), 1e-300))
    by_std = REACH * error / std
    spread = np.exp(-0.5 * by_std * by_std) * (np.sqrt(2.0 / np.pi) - by_std * _tail(by_std)) - np.sqrt(1.0 / np.pi)
    return np.asarray(0.5 * np.pi / DIRECTIONS * (REACH.sum() * error + np.add.reduce(std * spread, axis=0)))


def _tail(by_std: Floats) -> Floats:
    """(1 - erf(z / √2)) / exp(-z² / 2) for z >= 0, to 1.5e-7: Abramowitz & Stegun 1964, 7.1.26.

    Without branches it takes a tenth of the time of an exact erf, for this is half of what a score costs.
    """
    t = 1.0 / (1.0 + 0.3275911 * np.sqrt(0.5) * by_std)
    return np.asarray(t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429)))))
