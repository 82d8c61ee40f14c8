"""Worlds: refused with the remedy where they cannot be, and one hash for one content."""

import json
import math

import pytest

from fusion import World, WorldError
from tests.fusion.streams import ANCHORS


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"anchor": []}, "did you mean 'anchors'"),
        ({"anchors": [*ANCHORS, ANCHORS[0]]}, "stands twice"),
        ({"anchors": [*ANCHORS, {"id": "d", "position_m": [0, 0, 2]}]}, "remove one"),
        ({"anchors": [{"id": i, "position_m": [k, k]} for k, i in enumerate("abc")]}, "one line"),
        ({"anchors": [{"id": "a", "position_m": [0, math.nan]}]}, "not a finite number"),
        ({"radio": {"path_los_exponent": 2.0}}, "did you mean 'path_loss_exponent'"),
        ({"robot": {"drive": "hover"}}, "none of"),
        ({"robot": {"track_width_m": 0.0}}, "greater than zero"),
        ({"robot": {"diameter_ratio": -1.0}}, "greater than zero"),
        ({"calibration": {"radio": {"metod": "by eye"}}}, "did you mean 'method'"),
        ({"anchors": []}, "add"),
    ],
)
def test_world_that_cannot_be_is_refused_with_the_remedy(change, message):
    with pytest.raises(WorldError, match=message):
        World.from_table({"anchors": ANCHORS, **change})


def test_hash_of_a_world_does_not_depend_on_the_order_of_its_keys():
    table = {"name": "x", "anchors": ANCHORS}
    assert World.from_table(table).hash == World.from_table(dict(reversed(table.items()))).hash
    assert json.loads(World.from_table(table).table) == table
