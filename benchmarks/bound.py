"""What no unbiased method can beat: the Cramer-Rao bound of a position fix from one reading of each anchor.

Fisher's information of independent Gaussian readings is the sum of h hᵀ / sigma^2, h the derivative of the expected
reading by the position (Patwari et al. 2003, section III, for signal strength). Priors and motion can do better.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fusion import RssiReading, WifiScan, World, sightings

Floats = NDArray[np.float64]


def rssi_fix_bound(world: World, x: float, y: float, heading: float = 0.0) -> Floats:
    """Least covariance (2, 2) [m^2] of a position fix from one scan at a pose (map frame; [m], [rad]).

    The noise is what the world says: shadowing, and a common error of each anchor's readings.

    >>> square = [{"id": n, "position_m": p} for n, p in zip("abcd", ([0, 0], [10, 0], [10, 10], [0, 10]))]
    >>> radio = {"path_loss_exponent": 3.0, "shadowing_std_db": 4.0, "bias_std_db": 0.0}
    >>> world = World.from_table({"anchors": square, "radio": radio})
    >>> round(float(np.sqrt(np.trace(rssi_fix_bound(world, 5.0, 5.0)))), 6)
    2.170898
    """
    scan = WifiScan(0, "", 0, tuple(RssiReading(anchor.id, 0.0) for anchor in world.anchors))
    information = np.zeros((2, 2))
    for sighting in sightings(world, scan):
        expected = sighting.expect(x, y, heading, world.robot.antenna_m)
        slope = np.array([expected.by_x, expected.by_y])
        information += np.outer(slope, slope) / (sighting.variance + sighting.model.bias_std**2)
    return np.asarray(np.linalg.inv(information))
