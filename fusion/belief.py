"""Gaussian beliefs at the start, where the prior may leave position or heading open."""

from __future__ import annotations

import math

from fusion.geometry import Covariance, Pose
from fusion.values import Prior
from fusion.world import World

HEADING_KNOWN_STD = 0.5
"""A heading counts as known while its standard deviation is below this [rad]."""
UNKNOWN_HEADING_STD = math.pi / math.sqrt(3.0)
"""Standard deviation of a uniform heading [rad]."""


def starting_belief(world: World, prior: Prior) -> tuple[Pose, Covariance]:
    """Mean and covariance of the prior; what is unknown gets the moments of a uniform distribution over the floor,
    or over all headings (variance of a uniform: width squared over 12).
    """
    x, y, heading = prior.pose
    xx, xy, xh, yy, yh, hh = prior.covariance
    if not prior.position_known:
        bounds = world.bounds
        x, y = 0.5 * (bounds.x_min + bounds.x_max), 0.5 * (bounds.y_min + bounds.y_max)
        xx, xy, xh = (bounds.x_max - bounds.x_min) ** 2 / 12.0, 0.0, 0.0
        yy, yh = (bounds.y_max - bounds.y_min) ** 2 / 12.0, 0.0
    if not prior.heading_known:
        heading, xh, yh, hh = 0.0, 0.0, 0.0, math.tau**2 / 12.0
    return Pose(x, y, heading), Covariance(xx, xy, xh, yy, yh, hh)
