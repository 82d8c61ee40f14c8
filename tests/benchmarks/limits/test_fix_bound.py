"""The bound of a fix: published closed forms, what information must obey, and where nothing can be said."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.limits.fix_bound import (
    Places,
    Shared,
    anchor_information,
    dilution,
    eff_crlb,
    fix_covariance,
    fix_error,
    position_information,
    rssi_fix_bound,
)
from fusion import World

CORNERS = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
UNKNOWN = math.inf


def world(places=CORNERS, *, std_db=4.0, antenna_m=(0.0, 0.0, 0.0), radio=None, ranging=None):
    """Exponent 3, nothing but white noise, unless told otherwise."""
    anchors = [{"id": f"ap{i}", "position_m": list(place)} for i, place in enumerate(places)]
    radio = {"path_loss_exponent": 3.0, "shadowing_std_db": std_db, "bias_std_db": 0.0, **(radio or {})}
    ranging = {"std_m": 0.1, "bias_std_m": 0.0, "scale_std": 0.0, **(ranging or {})}
    robot = {"antenna_m": list(antenna_m)}
    bounds = {"x_min": -50, "x_max": 50, "y_min": -50, "y_max": 50}
    return World.from_table({"anchors": anchors, "radio": radio, "ranging": ranging, "robot": robot, "bounds": bounds})


def at(*points, height=0.0):
    x, y = np.array(points, dtype=float).T
    return Places(x, y, height)


CENTRE_AND_SIDE = at((5, 5), (2, 2))


@pytest.mark.parametrize(
    ("std_db", "once", "ten_times"),
    [
        (2.0, (1.085449, 1.121248), (0.343249, 0.354570)),
        (4.0, (2.170898, 2.242496), (0.686498, 0.709140)),
        (6.0, (3.256347, 3.363744), (1.029747, 1.063709)),
    ],
)
def test_square_of_four_has_the_known_bounds(std_db, once, ten_times):
    anchors = world(std_db=std_db).anchors
    assert fix_error(anchors, CENTRE_AND_SIDE, "rssi") == pytest.approx(once, abs=5e-7)
    assert fix_error(anchors, CENTRE_AND_SIDE, "rssi", scans=10) == pytest.approx(ten_times, abs=5e-7)


@given(std_db=st.floats(0.1, 20.0))
@settings(derandomize=True, max_examples=20)
def test_centre_of_the_square_follows_the_closed_form(std_db):
    closed = math.sqrt(50.0) * std_db * math.log(10.0) / 30.0
    assert fix_error(world(std_db=std_db).anchors, at((5, 5)), "rssi") == pytest.approx(closed, rel=1e-12)


def test_unknown_power_costs_little_off_the_centre_and_nothing_at_it():
    found = fix_error(world().anchors, CENTRE_AND_SIDE, "rssi", shared=Shared(UNKNOWN))
    assert found == pytest.approx([2.170898, 2.247918], abs=5e-7)


def test_power_and_exponent_both_unknown_leave_the_centre_undefined_and_a_prior_settles_it():
    both = Shared(UNKNOWN, UNKNOWN)
    centre, side = fix_error(world().anchors, CENTRE_AND_SIDE, "rssi", shared=both)
    assert math.isnan(centre)
    assert math.isfinite(side)
    settled = fix_error(world().anchors, CENTRE_AND_SIDE, "rssi", shared=Shared(UNKNOWN, 0.5))
    assert settled[0] == pytest.approx(2.170898, abs=5e-7)
    assert settled[1] < side


def test_schur_complement_is_what_the_inverse_of_the_whole_says():
    anchors = world(((0, 0), (9, 1), (7, 8), (1, 6)), radio={"exponent_std": 0.4}).anchors
    whole = anchor_information(anchors, at((3, 4)), "rssi", shared=Shared(2.0)).sum(axis=0)
    expected = np.linalg.inv(whole[0] + np.diag([0.0, 0.0, 1.0, 1.0]))[:2, :2]
    assert fix_covariance(whole, Shared(2.0))[0] == pytest.approx(expected, rel=1e-10)


def test_common_errors_known_to_a_degree_act_like_correlated_noise():
    """Readings with covariance R + offset² 11ᵀ + gain² ggᵀ have information Hᵀ(...)⁻¹H: no Schur complement in it."""
    told = world(((0, 0), (9, 1), (7, 8), (1, 6)), ranging={"bias_std_m": 0.2, "scale_std": 0.05})
    away = np.array([(3.0 - anchor.x, 4.0 - anchor.y) for anchor in told.anchors])
    distance = np.hypot(*away.T)
    noise = np.eye(4) * (0.1**2 / 5 + 0.2**2) + 0.3**2 + 0.05**2 * np.outer(distance, distance)
    rows = away / distance[:, None]
    expected = rows.T @ np.linalg.inv(noise) @ rows
    found = anchor_information(told.anchors, at((3, 4)), "range", scans=5, shared=Shared(0.3)).sum(axis=0)
    assert position_information(found, Shared(0.3))[0] == pytest.approx(expected, rel=1e-10)


def test_more_scans_do_not_average_the_common_error_of_an_anchor_away():
    anchors = world(radio={"bias_std_db": 3.0}).anchors
    many = fix_error(anchors, at((5, 5)), "rssi", scans=10**9)
    assert many == pytest.approx(fix_error(world(std_db=3.0).anchors, at((5, 5)), "rssi"), rel=1e-6)


def test_derivatives_are_those_of_the_model():
    """Information of one anchor against finite differences of what it should read, height and antenna included."""
    told = world([(1.0, 2.0, 3.0)], antenna_m=(0.2, 0.1, 0.4))
    (anchor,) = told.anchors

    def expected(x, y):
        reach = math.sqrt((x - 1.0) ** 2 + (y - 2.0) ** 2 + 2.6**2)
        return float(anchor.radio.expected(reach))

    places = Places.of_poses(told, 5.0, 6.0, math.pi / 2)
    x, y = float(places.x), float(places.y)
    assert (x, y) == pytest.approx((4.9, 6.2))
    step = 1e-5
    slope = np.array([expected(x + step, y) - expected(x - step, y), expected(x, y + step) - expected(x, y - step)])
    (found,) = anchor_information(told.anchors, places, "rssi")
    assert found[:2, :2] == pytest.approx(np.outer(slope, slope) / (2 * step) ** 2 / 16.0, rel=1e-6)


def test_anchor_overhead_says_nothing_of_where_the_robot_is():
    assert anchor_information(world([(5.0, 5.0, 3.0)]).anchors, at((5, 5)), "range")[0, 0, :2, :2].max() == 0.0


@pytest.mark.parametrize("radio", ["rssi", "range"])
@pytest.mark.parametrize(
    ("places", "shared"),
    [
        (CORNERS[:1], Shared()),
        (((0, 0), (8, 4)), Shared(UNKNOWN)),
        (CORNERS[:3], Shared(UNKNOWN, UNKNOWN)),
    ],
)
def test_fewer_readings_than_unknowns_leave_the_bound_undefined(places, shared, radio):
    assert np.isnan(fix_error(world(places).anchors, at((3, 7), (6, 1)), radio, shared=shared)).all()


@given(angle=st.floats(-3.0, 3.0))
@settings(derandomize=True, max_examples=30)
def test_on_the_line_through_two_anchors_the_bound_is_undefined_whichever_way_it_runs(angle):
    c, s = math.cos(angle), math.sin(angle)
    anchors = world(((0, 0), (10 * c, 10 * s))).anchors
    assert np.isnan(fix_error(anchors, at((4 * c, 4 * s)), "range")).all()
    assert np.isfinite(fix_error(anchors, at((4 * c - s, 4 * s + c)), "range")).all()


def test_inside_the_reference_distance_signal_strength_says_nothing():
    anchors = world(((0, 0), (0.5, 0), (0, 0.5)), radio={"reference_distance_m": 1.0}).anchors
    assert np.isnan(fix_error(anchors, at((0.2, 0.2)), "rssi")).all()


layouts = st.lists(st.tuples(st.floats(-20, 20), st.floats(-20, 20)), min_size=4, max_size=7, unique=True).filter(
    lambda places: min(math.dist(a, b) for i, a in enumerate(places) for b in places[:i]) > 1.0
)
points = st.tuples(st.floats(-20, 20), st.floats(-20, 20))


def anchors_of(places, **options):
    """Anchors one by one, for a world of three on a line is refused."""
    return [world([place], **options).anchors[0] for place in places]


@given(places=layouts, point=points, radio=st.sampled_from(["rssi", "range"]), offset=st.sampled_from([0.0, 1.0]))
@settings(derandomize=True, max_examples=100)
def test_one_more_anchor_never_raises_the_bound(places, point, radio, offset):
    anchors, shared = anchors_of(places, ranging={"scale_std": 0.05}), Shared(offset)
    before = fix_error(anchors[:-1], at(point), radio, shared=shared)[0]
    after = fix_error(anchors, at(point), radio, shared=shared)[0]
    assert math.isnan(before) or after <= before * (1.0 + 1e-6)


@given(places=layouts, point=points, angle=st.floats(-3.0, 3.0), radio=st.sampled_from(["rssi", "range"]))
@settings(derandomize=True, max_examples=100)
def test_turned_world_has_the_turned_bound(places, point, angle, radio):
    rotation = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    shared = Shared(1.0)

    def covariance(places, point):
        return fix_covariance(anchor_information(anchors_of(places), at(point), radio, shared=shared).sum(0), shared)[0]

    straight = covariance(places, point)
    turned = covariance([tuple(rotation @ place) for place in places], rotation @ point)
    if np.isfinite(straight).all() and np.trace(straight) < 1e4:
        assert turned == pytest.approx(rotation @ straight @ rotation.T, rel=1e-5, abs=1e-5)


def test_many_places_at_once_say_what_each_says_alone():
    told = world(((0, 0, 2), (9, 1, 3), (7, 8, 2)), antenna_m=(0.3, 0.0, 0.2), radio={"exponent_std": 0.3})
    x, y = np.meshgrid(np.linspace(0.5, 9, 4), np.linspace(0.5, 8, 3))
    together = fix_covariance(anchor_information(told.anchors, Places.of_poses(told, x, y, 0.7), "rssi").sum(axis=0))
    assert together.shape == (3, 4, 2, 2)
    for row in range(3):
        for column in range(4):
            alone = rssi_fix_bound(told, x[row, column], y[row, column], 0.7)
            assert together[row, column] == pytest.approx(alone, rel=1e-9)


def test_dilution_of_a_square_is_known_and_that_of_a_line_is_not():
    found = dilution(world().anchors, CENTRE_AND_SIDE)
    assert found.hdop[0] == pytest.approx(1.0, rel=1e-12)
    assert found.gdop[0] == pytest.approx(math.sqrt(1.25), rel=1e-12)
    rows = np.array([(2.0 - x, 2.0 - y) for x, y in CORNERS])
    rows = np.column_stack([rows / np.hypot(*rows.T)[:, None], np.ones(4)])
    assert found.gdop[1] == pytest.approx(math.sqrt(np.trace(np.linalg.inv(rows.T @ rows))), rel=1e-12)
    line = dilution(anchors_of([(0, 0), (3, 0), (7, 0)]), at((5, 0)))
    assert np.isnan([*line.hdop, *line.gdop]).all()


def test_dilution_times_the_noise_is_the_bound_of_ranges():
    anchors = world().anchors
    assert fix_error(anchors, at((3, 8)), "range") == pytest.approx(0.1 * dilution(anchors, at((3, 8))).hdop, rel=1e-12)


def test_fix_as_good_as_the_bound_has_efficiency_one():
    """20 000 fixes of least squares, linear in good approximation: what the bound says is what is scattered."""
    told = world(ranging={"std_m": 0.02})
    (information,) = anchor_information(told.anchors, at((3, 8)), "range").sum(axis=0)
    away = np.array([(3.0 - anchor.x, 8.0 - anchor.y) for anchor in told.anchors])
    rows = away / np.hypot(*away.T)[:, None]
    noise = np.random.default_rng(3).normal(0.0, 0.02, (20_000, 4))
    errors = np.hypot(*np.linalg.lstsq(rows, noise.T, rcond=None)[0])
    bounds = np.full(20_000, math.sqrt(np.trace(np.linalg.inv(information[:2, :2]))))
    assert eff_crlb(errors, bounds) == pytest.approx(1.0, abs=0.02)
    assert eff_crlb(2.0 * errors, bounds) == pytest.approx(0.5, abs=0.01)


def test_efficiency_leaves_out_failed_fixes_and_undefined_bounds():
    errors, bounds = np.array([2.0, np.inf, 1.0]), np.array([1.0, 1.0, np.nan])
    assert eff_crlb(errors, bounds) == 0.5
    assert math.isnan(eff_crlb(errors[1:], bounds[1:]))
    assert math.isnan(eff_crlb(np.zeros(3), np.ones(3)))
