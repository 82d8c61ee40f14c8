"""Planning: what an anchor's loss costs, where one more helps, and what must be so whatever the floor."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.limits.anchor_placement import (
    NEW,
    Grid,
    Readings,
    Spread,
    _candidates,
    best_addition,
    best_move,
    default_step,
    error_map,
    losses,
    new_anchor,
)
from benchmarks.limits.fix_bound import Places, fix_error
from fusion import Bounds, World

RANGES = Readings("range")


def floor(places, *, size=10.0, **tables):
    anchors = [{"id": f"ap{i}", "position_m": list(place)} for i, place in enumerate(places)]
    bounds = {"x_min": 0.0, "x_max": size, "y_min": 0.0, "y_max": size}
    return World.from_table({"anchors": anchors, "bounds": bounds, **tables})


THREE = floor(((0, 0, 2), (10, 0, 2), (5, 3, 2)), ranging={"scale_std": 0.0})


def places_of(world, step_m=0.5):
    return Grid.over(world.bounds, step_m).places(world.robot.antenna_m[2])


def test_grid_covers_the_floor_with_equal_cells_that_it_names_by_their_middles():
    grid = Grid.over(Bounds(-1.0, 3.0, 0.0, 1.0), 1.1)
    assert grid.x == pytest.approx([-0.5, 0.5, 1.5, 2.5])
    assert grid.y == pytest.approx([0.5])


@given(wide=st.floats(0.01, 1e5), deep=st.floats(0.01, 1e5))
@settings(derandomize=True, max_examples=100)
def test_default_step_cuts_any_floor_into_a_number_of_cells_that_is_neither_silly_nor_slow(wide, deep):
    bounds = Bounds(0.0, wide, 0.0, deep)
    grid = Grid.over(bounds, default_step(bounds))
    assert 100 <= len(grid.x) * len(grid.y) <= 8000


def test_undefined_places_count_as_infinite_errors():
    spread = Spread.of(np.array([[1.0, 2.0], [np.nan, 3.0]]))
    assert (spread.median_m, spread.p95_m, spread.worst_m, spread.undefined) == (2.5, math.inf, math.inf, 0.25)


def test_losing_an_anchor_leaves_the_errors_of_the_others():
    places = places_of(THREE)
    found = losses(THREE.anchors, RANGES, places)
    assert list(found) == ["ap0", "ap1", "ap2"]
    assert found["ap1"] == Spread.of(error_map((THREE.anchors[0], THREE.anchors[2]), RANGES, places))
    assert all(
        spread.median_m >= Spread.of(error_map(THREE.anchors, RANGES, places)).median_m for spread in found.values()
    )


def test_map_is_the_bound_at_every_place():
    grid = Grid.over(THREE.bounds, 2.0)
    found = error_map(THREE.anchors, RANGES, grid.places(0.0))
    alone = fix_error(THREE.anchors, Places(grid.x[3], grid.y[1], 0.0), "range")
    assert found.shape == (5, 5)
    assert found[1, 3] == pytest.approx(float(alone), rel=1e-12)


def test_one_more_anchor_stands_where_no_other_place_of_the_floor_would_be_better():
    places, found = places_of(THREE), best_addition(THREE, RANGES, places_of(THREE))
    assert found.anchor.id == NEW
    assert found.anchor.z == 2.0
    assert found.spread == Spread.of(error_map((*THREE.anchors, found.anchor), RANGES, places))
    for x, y in np.random.default_rng(1).uniform(0.0, 10.0, (60, 2)):
        other = found.anchor.__class__(NEW, x, y, 2.0, found.anchor.radio, found.anchor.ranging)
        assert Spread.of(error_map((*THREE.anchors, other), RANGES, places)).p95_m > 0.99 * found.spread.p95_m


def test_one_more_anchor_is_what_the_world_file_would_make_of_it():
    world = floor(
        ((0, 0, 1), (10, 0, 2), (5, 3, 7)),
        radio={"path_loss_exponent": 3.1},
        ranging={"std_m": 0.3},
    )
    found = best_addition(world, Readings("rssi"), places_of(world))
    assert (found.anchor.radio.path_loss_exponent, found.anchor.ranging.std_m, found.anchor.z) == (3.1, 0.3, 2.0)


def test_anchor_in_the_wrong_place_is_the_one_to_move():
    """Three stand around the floor, the fourth beside the first: it adds no information there."""
    world = floor(((0, 0), (10, 0), (0, 10), (0.1, 0.1)), ranging={"scale_std": 0.0})
    found = best_move(world, RANGES, places_of(world))
    assert found.anchor.id in {"ap0", "ap3"}
    assert found.anchor.x > 5.0
    assert found.anchor.y > 5.0
    after = [found.anchor, *(anchor for anchor in world.anchors if anchor.id != found.anchor.id)]
    assert found.spread.p95_m == pytest.approx(Spread.of(error_map(after, RANGES, places_of(world))).p95_m, rel=1e-9)
    assert found.spread.p95_m < Spread.of(error_map(world.anchors, RANGES, places_of(world))).p95_m


@pytest.mark.parametrize("places", [((0, 0), (10, 0)), ((0, 0), (10, 5)), ((0, 0), (10, 0), (0, 10))])
def test_no_place_is_tried_that_a_world_file_would_be_refused_for(places):
    """On another anchor, or on the line of all the others: three of them lie on floor and edges that are tried."""
    world = floor(places)
    tried = list(_candidates(world.bounds, new_anchor(world), world.anchors))
    assert len(tried) > 300
    for place in tried[::7] + [each for each in tried if each.x == each.y or each.y in {0.0, 0.5 * each.x}]:
        rows = [{"id": anchor.id, "position_m": [anchor.x, anchor.y]} for anchor in (*world.anchors, place)]
        assert len(World.from_table({"anchors": rows}).anchors) == len(rows)


def test_where_nothing_can_help_nothing_is_proposed():
    """A floor inside the reference distance of every place on it: signal strength is flat there."""
    world = floor(((0, 0), (1, 0), (0, 1)), size=1.0, radio={"reference_distance_m": 50.0})
    assert best_addition(world, Readings("rssi"), places_of(world, 0.2)) is None
    assert best_move(world, Readings("rssi"), places_of(world, 0.2)) is None


@given(angle=st.floats(0.1, 3.0))
@settings(derandomize=True, max_examples=20)
def test_turned_anchors_and_places_have_the_same_map(angle):
    c, s = math.cos(angle), math.sin(angle)
    turned = floor([(c * a.x - s * a.y, s * a.x + c * a.y, a.z) for a in THREE.anchors], ranging={"scale_std": 0.0})
    places = places_of(THREE)
    elsewhere = Places(c * places.x - s * places.y, s * places.x + c * places.y, 0.0)
    straight = error_map(THREE.anchors, RANGES, places)
    assert error_map(turned.anchors, RANGES, elsewhere) == pytest.approx(straight, rel=1e-6)
