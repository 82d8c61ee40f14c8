"""Cramer-Rao bound of a position fix, which no unbiased method can beat, at one place or at thousands at once.

Fisher's information of independent Gaussian readings is the sum of h hᵀ / variance, h the derivatives of the expected
reading by what is not known (Kay 1993, section 3.9; Patwari et al. 2003, section III, for signal strength). Here that
is the position, and two errors that the readings of all anchors share: an offset (a receiver that reads 3 dB low, a
clock that is late) and the gain (path-loss exponent, scale of ranges). Both are taken out by Schur complement, so
what is left is information on the position alone, with no more known of the two than the standard deviations state.
Each anchor's own common error is inside its variance: n readings have 1 / (std^2 / n + bias_std^2) between them.

The bound is local: it does not include the mirror image that two anchors leave. Priors and motion can beat it;
`benchmarks.limits.posterior_bound` is the bound of a filter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fusion import Anchor, World
from fusion.arrays import Floats
from fusion.radio import RadioKind

POSITION, OFFSET = slice(0, 2), 2
"""Rows and columns of an information matrix; the gain follows the offset."""
SINGULAR = 1e-12
"""A determinant below this share of what it would be with all directions alike is rounding: nothing is known."""


class Places(NamedTuple):
    """Places of the robot's antenna: x, y of any one shape (...), and height above the floor; all [m], map frame."""

    x: Floats
    y: Floats
    height: float

    @classmethod
    def of_poses(cls, world: World, x: ArrayLike, y: ArrayLike, heading: ArrayLike = 0.0) -> Places:
        """The antenna's places with the robot's base at these poses ([m], [rad], any one shape)."""
        forward, left, height = world.robot.antenna_m
        c, s = np.cos(heading), np.sin(heading)
        return cls(np.add(x, c * forward - s * left), np.add(y, s * forward + c * left), height)


class Shared(NamedTuple):
    """Standard deviations of the errors that all anchors share: 0 known, infinite not known at all.

    ``offset_std`` [dB or m]; ``gain_std`` None: that of each anchor's model.
    """

    offset_std: float = 0.0
    gain_std: float | None = None


AS_STATED = Shared()
"""No common offset, and the gain as well known as the world states."""


def anchor_information(
    anchors: Sequence[Anchor], places: Places, radio: RadioKind, *, scans: int = 1, shared: Shared = AS_STATED
) -> Floats:
    """Information of ``scans`` readings of each anchor, all from one place: (m, ..., 4, 4), to be summed over anchors.

    Rows: x, y [1/m], then offset and gain, each in units of its standard deviation (as it stands, where infinite).
    """
    information = np.empty((len(anchors), *np.shape(places.x), 4, 4))
    for own, anchor in zip(information, anchors, strict=True):
        model, (ux, uy, distance) = anchor.model(radio), _sight(anchor, places)
        slope = model.slope(distance)
        gain_std = model.gain_std if shared.gain_std is None else shared.gain_std
        offset = np.full_like(distance, _unit(shared.offset_std))
        derivatives = np.stack([slope * ux, slope * uy, offset, model.by_gain(distance) * _unit(gain_std)], axis=-1)
        variance = model.std**2 / scans + model.bias_std**2
        own[...] = derivatives[..., :, None] * derivatives[..., None, :] / variance
    return information


def _sight(anchor: Anchor, places: Places) -> tuple[Floats, Floats, Floats]:
    """Horizontal part of the unit vector from anchor to antenna (...), (...), and the distance between them [m]."""
    dx, dy, dz = places.x - anchor.x, places.y - anchor.y, places.height - anchor.z
    distance = np.maximum(np.sqrt(dx * dx + dy * dy + dz * dz), 1e-6)
    return dx / distance, dy / distance, distance


def _unit(std: float) -> float:
    return std if math.isfinite(std) else 1.0


def position_information(information: Floats, shared: Shared = AS_STATED) -> Floats:
    """Summed `anchor_information` (..., 4, 4) without offset and gain: (..., 2, 2) [1/m^2].

    NaN where those two, both unknown, cannot be separated, as at equal distance from all anchors.
    """
    own, crossed = information[..., POSITION, POSITION], information[..., POSITION, OFFSET:]
    known = np.diag([float(math.isfinite(shared.offset_std)), float(math.isfinite(shared.gain_std or 0.0))])
    errors = information[..., OFFSET:, OFFSET:] + known
    inverse = _inverse(errors, errors[..., 0, 0] * errors[..., 1, 1])
    return np.asarray(own - crossed @ inverse @ np.swapaxes(crossed, -1, -2))


def fix_covariance(information: Floats, shared: Shared = AS_STATED) -> Floats:
    """Least covariance (..., 2, 2) [m^2] of an unbiased fix, from `anchor_information` summed over anchors (..., 4, 4).

    NaN where the bound is undefined: some direction, or one that would separate the shared errors, is not measured.
    """
    # Rounding leaves of nothing what is small beside what was there before the complement.
    return _inverse(position_information(information, shared), _alike(information[..., POSITION, POSITION]))


def _alike(matrix: Floats) -> Floats:
    """The determinant (...) that (..., 2, 2) of the same trace has when all directions are alike."""
    return np.asarray((0.5 * (matrix[..., 0, 0] + matrix[..., 1, 1])) ** 2)


def _inverse(matrix: Floats, scale: Floats) -> Floats:
    """The inverse of symmetric (..., 2, 2), NaN where the determinant is nothing beside ``scale`` (...)."""
    a, b, c = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 1]
    determinant = a * c - b * b
    determinant = np.where(determinant > SINGULAR * scale, determinant, np.nan)
    return np.stack([np.stack([c, -b], axis=-1), np.stack([-b, a], axis=-1)], axis=-2) / determinant[..., None, None]


def fix_error(
    anchors: Sequence[Anchor], places: Places, radio: RadioKind, *, scans: int = 1, shared: Shared = AS_STATED
) -> Floats:
    """Least root mean square error (...) [m] of an unbiased fix: the root of the trace of `fix_covariance`."""
    information = anchor_information(anchors, places, radio, scans=scans, shared=shared).sum(axis=0)
    return root_trace(fix_covariance(information, shared))


def root_trace(covariance: Floats) -> Floats:
    """Root mean square distance (...) of errors of that covariance (..., 2, 2)."""
    return np.asarray(np.sqrt(covariance[..., 0, 0] + covariance[..., 1, 1]))


class Dilution(NamedTuple):
    """Error of a fix as a multiple of that of one range, all ranges alike: of the position, and of the position and
    a common clock error together (Langley 1999). NaN where the geometry is singular.
    """

    hdop: Floats
    gdop: Floats


def dilution(anchors: Sequence[Anchor], places: Places) -> Dilution:
    """Horizontal and geometric dilution of precision (...) at ``places``."""
    sights = np.stack([np.stack(_sight(anchor, places)[:2], axis=-1) for anchor in anchors])
    own, mean = np.einsum("m...i,m...j->...ij", sights, sights), sights.mean(axis=0)
    clocked = _inverse(own - len(anchors) * mean[..., :, None] * mean[..., None, :], _alike(own))
    # The clock's own variance: the lower corner of the inverse of the whole, by the same Schur complement.
    clock = 1.0 / len(anchors) + np.einsum("...i,...ij,...j->...", mean, clocked, mean)
    return Dilution(root_trace(_inverse(own, _alike(own))), np.sqrt(root_trace(clocked) ** 2 + clock))


def rssi_fix_bound(world: World, x: float, y: float, heading: float = 0.0) -> Floats:
    """Least covariance (2, 2) [m^2] of a position fix from one scan at a pose (map frame; [m], [rad]).

    The noise is the one of the world: shadowing, a common error of each anchor's readings, and of the exponent.

    >>> square = [{"id": n, "position_m": p} for n, p in zip("abcd", ([0, 0], [10, 0], [10, 10], [0, 10]))]
    >>> radio = {"path_loss_exponent": 3.0, "shadowing_std_db": 4.0, "bias_std_db": 0.0}
    >>> world = World.from_table({"anchors": square, "radio": radio})
    >>> round(float(np.sqrt(np.trace(rssi_fix_bound(world, 5.0, 5.0)))), 6)
    2.170898
    """
    places = Places.of_poses(world, x, y, heading)
    return fix_covariance(anchor_information(world.anchors, places, "rssi").sum(axis=0))


def eff_crlb(error_m: Floats, bound_m: Floats) -> float:
    """Efficiency of fixes: root mean square bound over RMSE, at most 1 for an unbiased method; (n,), (n,) [m].

    Fixes that failed (infinite) and places where the bound is undefined are left out: read it beside the availability.
    NaN where nothing is left. Above 1, motion, a prior, tuning on the test data or a fault is at work.
    """
    counted = np.isfinite(error_m) & np.isfinite(bound_m)
    if not counted.any() or not error_m[counted].any():
        return math.nan
    return math.sqrt(float(np.mean(bound_m[counted] ** 2)) / float(np.mean(error_m[counted] ** 2)))
