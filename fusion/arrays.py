"""Array types by element, their shapes stated in docstrings; points of the plane as complex numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]
Stamps = Whole
"""Times [ns]."""
Points = NDArray[np.complex128]
"""Points of the plane, x + iy [m]."""
Flags = NDArray[np.bool_]


def points(x: Floats, y: Floats) -> Points:
    """Points of the plane as complex numbers, (n,): x + iy."""
    plane = np.empty(len(x), dtype=np.complex128)
    plane.real, plane.imag = x, y
    return plane
