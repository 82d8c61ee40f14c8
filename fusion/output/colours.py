"""Colours of the review: fixed by name, so that one means the same in every picture.

Okabe & Ito (2008), distinguishable for colour-blind people too, on a dark ground; no pure white or black, for the
viewer's web edition may follow a light theme.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping

from fusion.world import World

Colour = tuple[int, int, int]

GROUND: Colour = (20, 22, 26)
TRUTH: Colour = (230, 230, 230)
WALL: Colour = (96, 104, 116)
ANCHOR: Colour = (240, 228, 66)

SKY, VERMILLION, ORANGE = (86, 180, 233), (213, 94, 0), (230, 159, 0)
PURPLE, BLUE, GREEN, GREY = (204, 121, 167), (0, 114, 178), (0, 158, 115), (150, 150, 150)
PALETTE: tuple[Colour, ...] = (SKY, VERMILLION, GREEN, PURPLE, ORANGE, BLUE, ANCHOR)

TAKEN, REFUSED, UNSURE, LOST = GREEN, VERMILLION, GREY, PURPLE
"""Of readings and of states: green and vermillion, which more eyes can distinguish than green and red."""

ESTIMATORS: Mapping[str, Colour] = {
    "dead_reckoning": GREY,
    "radio_only": ORANGE,
    "dynamic_weight": PURPLE,
    "bayes_weight": GREEN,
    "ekf": SKY,
    "particle": VERMILLION,
    "bayes_grid": BLUE,
    # The palette has seven colours; a variant or a baseline is a shade of the method it goes with.
    "dynamic_weight_repaired": (232, 184, 212),
    "filterpy_ekf": (168, 214, 240),
    "filterpy_ukf": (138, 138, 230),
}


def colour_of(estimator: str) -> Colour:
    """The colour of an estimator; one that has no fixed colour gets one by its name.

    >>> colour_of("ekf")
    (86, 180, 233)
    """
    return ESTIMATORS.get(estimator) or PALETTE[zlib.crc32(estimator.encode()) % len(PALETTE)]


def anchor_colour(world: World, anchor: str) -> Colour:
    """The colour of an anchor in plots; grey for what is no anchor of the world."""
    known = [item.id for item in world.anchors]
    return PALETTE[known.index(anchor) % len(PALETTE)] if anchor in known else GREY
