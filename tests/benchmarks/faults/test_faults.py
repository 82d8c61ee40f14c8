"""Every fault does what it is for to the messages it names, and to nothing else; chance is the same for all."""

import itertools
import math
from collections import Counter
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.faults.inject import apply_faults, fault_seed, outages, read_fault, stable_hash
from benchmarks.faults.message_faults import Clock, Delay, Drop, GyroDrop
from benchmarks.faults.motion_faults import BadStart, Freeze, GyroBias, Kidnap, Slip
from benchmarks.faults.radio_faults import Nlos, Outlier, PowerStep, RssiNoise
from benchmarks.metrics.matching import match
from benchmarks.metrics.score import errors
from benchmarks.runner.estimator_run import run_estimator
from fusion import (
    Gyro,
    MeasurementError,
    Odometry,
    ParameterError,
    Ranges,
    RssiReading,
    WheelTicks,
    WifiScan,
    built_in_names,
    load,
)
from fusion.conformance.synthetic_run import SyntheticRun
from fusion.odometry import Odometer
from fusion.plugins import FAULTS
from fusion.timeline import order
from fusion.values import nanoseconds, seconds
from logs.prior import starting_prior
from logs.run import Run
from logs.truth import evaluation_instants
from sensors.simulation.scenario import load_scenario
from sensors.simulation.simulate import simulated_run
from tests.fusion.streams import Steps

OFFICE = load_scenario("office")
SCENARIO = replace(
    OFFICE,
    world=replace(OFFICE.world, robot=replace(OFFICE.world.robot, turn_source="gyro")),
    route=replace(OFFICE.route, waypoints_m=OFFICE.route.waypoints_m[:4]),
    reality=replace(OFFICE.reality, range_hz=5.0),
)
RUN = simulated_run(SCENARIO, 3)
"""Wheel ticks, gyro, Wi-Fi and ranges; its first stamp is 0.02 s."""
DRIVE = SyntheticRun(noisy=True, duration_s=20.0)
INCREMENTS = Run(Path("drive.mcap"), "drive", DRIVE.world(), None, {}, DRIVE.measurements(), None, (), {})
"""Increments of odometry, gyro, Wi-Fi and ranges."""
START_NS = RUN.measurements[0].time_ns
WINDOWS = ((5.0, 9.0), (12.0, 14.0))


def with_faults(*faults, run=RUN, suite_seed=20240501, fault_id="f", seed=0):
    return apply_faults(run, faults, suite_seed=suite_seed, fault_id=fault_id, seed=seed)


def content(run):
    """Every field of a run: two runs themselves are equal only if they are one."""
    return {field.name: getattr(run, field.name) for field in fields(run)}


def of_kind(run, kind):
    return [measurement for measurement in run.measurements if isinstance(measurement, kind)]


def others(run, kind):
    return [measurement for measurement in run.measurements if not isinstance(measurement, kind)]


def is_in(measurement, windows=WINDOWS, start_ns=START_NS):
    return any(begin <= seconds(measurement.time_ns - start_ns) < end for begin, end in windows)


def values(run, kind):
    """Value of every reading, by message and anchor."""
    return {(m.seq, reading[0]): reading[1] for m in of_kind(run, kind) for reading in m.readings}


def test_run_of_these_tests_has_all_topics_and_lasts_longer_than_the_windows():
    assert {type(measurement) for measurement in RUN.measurements} == {WheelTicks, Gyro, WifiScan, Ranges}
    assert seconds(RUN.measurements[-1].time_ns) > 15.0
    assert nanoseconds(0.02) == START_NS


# --- reading ---------------------------------------------------------------------------------------------------------


def test_fault_of_a_suite_is_read_from_its_table():
    table = {"kind": "drop", "topic": "wifi", "source": "ap2", "windows": [[20, 50]]}
    assert read_fault(table, "faults[0]") == Drop("wifi", "ap2", ((20.0, 50.0),))


TABLES = {
    "drop": {"topic": "wifi", "p_enter": 0.1, "p_exit": 0.5},
    "rssi_noise": {"std_db": 3},
    "power_step": {"source": "ap1", "step_db": -6.0, "from_s": 10},
    "nlos": {"topic": "ranges", "mean": 0.8, "p": 0.3},
    "outlier": {"topic": "ranges", "p": 0.5, "span": [0.5, 30]},
    "delay": {"topic": "wifi", "mean_s": 0.3, "jitter_s": 0.1},
    "clock": {"topic": "gyro", "offset_s": -0.05, "drift_ppm": 80},
    "slip": {"factor": 1.1, "wheel": "left"},
    "freeze": {"wheel": "left", "windows": [[5, 9]]},
    "gyro_bias": {"bias_deg_s": 2},
    "gyro_drop": {"windows": [[5, 9]]},
    "kidnap": {"from_s": 5, "until_s": 9},
    "bad_start": {"std_m": 1.0, "std_deg": 30},
}


KINDS = built_in_names(FAULTS)
WITH_WINDOWS = [kind for kind in KINDS if "windows" in load(kind, FAULTS).__dataclass_fields__]


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_can_be_read_and_changes_the_run(kind):
    fault = read_fault({"kind": kind, **TABLES[kind]}, "faults[0]")
    assert (fault.kind, type(fault)) == (kind, load(kind, FAULTS))
    assert content(with_faults(fault)) != content(RUN)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"kind": "dorp", "topic": "wifi"}, r"faults\[0\]: no fault named 'dorp' is installed; did you mean 'drop'\?"),
        ({"topic": "wifi"}, r"faults\[0\]: kind is missing; add it, one of bad_start"),
        ({"kind": ["drop"]}, r"no fault named \"\['drop'\]\""),
        ("drop", "expected a table such as"),
        ({"kind": "drop"}, r"faults\[0\] \(drop\): topic is missing"),
        ({"kind": "drop", "topic": "wfi"}, r"topic 'wfi' cannot have the fault drop; did you mean 'wifi'\?"),
        (
            {"kind": "nlos", "topic": "odom", "mean": 1.0},
            "'odom' cannot have the fault nlos; known: ranges, wifi",
        ),
        ({"kind": "drop", "topic": "wifi", "window": []}, r"unknown key 'window'; did you mean 'windows'\?"),
        ({"kind": "drop", "topic": "wifi", "p": 1.5}, "p: 1.5 must be a probability"),
        ({"kind": "drop", "topic": "wifi", "p_enter": 0.1}, "give both"),
        ({"kind": "drop", "topic": "wifi", "windows": [[9, 5]]}, "the end after the begin"),
        ({"kind": "drop", "topic": "wifi", "windows": [[-1, 5]]}, "in seconds from the run's start"),
        ({"kind": "drop", "topic": "wifi", "windows": [5, 9]}, "expected a list"),
        ({"kind": "rssi_noise", "std_db": -1.0}, "std_db: -1.0 must not be negative"),
        ({"kind": "outlier", "topic": "wifi", "p": 0.1, "span": [-40, -90]}, "lowest, highest"),
        ({"kind": "kidnap", "from_s": 9, "until_s": 5}, "until_s: 5.0 must be later than from_s, 9.0"),
    ],
)
def test_table_that_means_nothing_is_refused_with_a_hint(table, message):
    with pytest.raises(ParameterError, match=message):
        read_fault(table, "faults[0]")


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (Drop("command"), r"no topic 'command'; it has gyro, odom, ranges, wifi"),
        (Drop("wifi", "ap9"), r"no 'ap9' on wifi; it has ap1, ap2, ap3, wifi"),
        (Drop("gyro", "ap1"), r"no 'ap1' on gyro; it has gyro"),
        (PowerStep("ap9", 3.0), r"no 'ap9' on wifi; it has ap1, ap2, ap3"),
        (Nlos("ranges", 1.0, "uwb"), r"no 'uwb' on ranges; it has ap1, ap2, ap3"),
        (Clock("wifi", "ap1"), r"no 'ap1' on wifi; it has wifi"),
        (Freeze("middle"), r"no wheel 'middle'; its skid_steer drive has front_left, front_right"),
    ],
)
def test_what_the_run_does_not_have_is_refused_with_what_it_has(fault, message):
    with pytest.raises(ParameterError, match=rf"fault 'f' \({fault.kind}\) on run 'office-3': the run has {message}"):
        with_faults(fault)


def test_run_without_measurements_has_no_topic():
    with pytest.raises(ParameterError, match="it has no measurements at all"):
        with_faults(GyroBias(1.0), run=replace(RUN, measurements=()))


# --- chance ----------------------------------------------------------------------------------------------------------

CHANCY = (
    Drop("wifi", p=0.3),
    Drop("odom", p_enter=0.2, p_exit=0.5),
    RssiNoise(2.0),
    Nlos("ranges", 0.5, p=0.5),
    Outlier("ranges", 0.1, (0.5, 9.0)),
    Delay("wifi", 0.2, 0.1),
    BadStart(1.0, 20.0),
)


def test_seed_has_the_values_that_every_implementation_must_find():
    checked = np.random.SeedSequence(20240501, spawn_key=(1, 2**63 + 5, 7))
    assert checked.generate_state(2).tolist() == [213811418, 4132163604]
    # The heads of what `printf office-3 | sha256sum` and `printf ap2-out | sha256sum` print.
    key = (1, 0xA0FF8479CBD8D3EA, 0x7842F88253EE2C8C, 7)
    assert fault_seed(20240501, "office-3", "ap2-out", 7).spawn_key == key


@pytest.mark.parametrize("fault", CHANCY, ids=lambda fault: fault.place)
def test_same_seed_is_the_same_draw_and_another_is_another(fault):
    once = with_faults(fault, seed=4)
    assert content(with_faults(fault, seed=4)) == content(once)
    for other in ({"seed": 5}, {"seed": 4, "suite_seed": 1}, {"seed": 4, "fault_id": "g"}):
        assert content(with_faults(fault, **other)) != content(once)
    renamed = with_faults(fault, run=replace(RUN, name="office-4"), seed=4)
    assert (renamed.measurements, renamed.prior) != (once.measurements, once.prior)


@pytest.mark.parametrize("second", [Drop("wifi", "ap1", p=0.5), GyroDrop(), Delay("odom", 0.1, 0.1), RssiNoise(1.0)])
@pytest.mark.parametrize("first_in_the_list", [True, False])
def test_second_fault_leaves_the_draws_of_the_first(second, first_in_the_list):
    first = Nlos("ranges", 0.5, p=0.5)
    both = with_faults(*((first, second) if first_in_the_list else (second, first)))
    assert values(both, Ranges) == values(with_faults(first), Ranges)


def test_lost_messages_leave_the_draws_of_those_that_are_left():
    noisy = values(with_faults(RssiNoise(2.0)), WifiScan)
    thinned = values(with_faults(Drop("wifi", p=0.5), Drop("wifi", "ap1", p=0.5), RssiNoise(2.0)), WifiScan)
    assert 0 < len(thinned) < len(noisy)
    assert thinned.items() <= noisy.items()


def test_two_faults_of_one_kind_and_place_draw_apart():
    twice = with_faults(Drop("gyro", p=0.5), Drop("gyro", p=0.5))
    share = len(of_kind(twice, Gyro)) / len(of_kind(RUN, Gyro))
    assert share == pytest.approx(0.25, abs=0.05)


def test_faults_of_different_places_draw_apart():
    """The whole topic and its only sensor; with the same draws, half of the messages would be left."""
    lost = with_faults(Drop("gyro", p=0.5), Drop("gyro", "gyro", p=0.5))
    assert len(of_kind(lost, Gyro)) / len(of_kind(RUN, Gyro)) == pytest.approx(0.25, abs=0.05)


def test_more_of_a_fault_changes_what_less_of_it_changes():
    few, many = (set(values(with_faults(Drop("wifi", "ap2", p=p)), WifiScan)) for p in (0.6, 0.2))
    assert few < many


@pytest.mark.parametrize("seeds", [{"suite_seed": -1}, {"seed": -1}])
def test_negative_seed_is_refused(seeds):
    with pytest.raises(ParameterError, match="must not be negative"):
        with_faults(GyroDrop(), **seeds)


# --- what stays ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("run", [RUN, INCREMENTS], ids=lambda run: run.name)
def test_no_fault_changes_nothing(run):
    assert content(with_faults(run=run)) == content(run)


@pytest.mark.parametrize("kind", WITH_WINDOWS)
@pytest.mark.parametrize("windows", [[], [[1e6, 2e6]]], ids=["none", "past the end"])
def test_windows_without_messages_change_nothing(kind, windows):
    fault = read_fault({"kind": kind, **TABLES[kind], "windows": windows}, "faults[0]")
    assert content(with_faults(fault)) == content(RUN)


@pytest.mark.parametrize("kind", KINDS)
def test_log_truth_and_world_are_never_touched(kind):
    faulty = with_faults(read_fault({"kind": kind, **TABLES[kind]}, "faults[0]"))
    assert faulty.truth is RUN.truth
    assert faulty.world is RUN.world
    changed = {} if kind == "bad_start" else {"prior": RUN.prior}
    restored = replace(faulty, measurements=RUN.measurements, prior=RUN.prior, true_stamps={})
    assert content(restored) == content(RUN)
    assert all(getattr(faulty, name) == value for name, value in changed.items())


TOUCHED = {
    "drop": WifiScan,
    "rssi_noise": WifiScan,
    "power_step": WifiScan,
    "nlos": Ranges,
    "outlier": Ranges,
    "delay": WifiScan,
    "clock": Gyro,
    "slip": WheelTicks,
    "freeze": WheelTicks,
    "gyro_bias": Gyro,
    "gyro_drop": Gyro,
    "kidnap": WheelTicks | Gyro | WifiScan | Ranges,
    "bad_start": (),
}


@pytest.mark.parametrize("kind", KINDS)
def test_other_topics_are_never_touched(kind):
    faulty = with_faults(read_fault({"kind": kind, **TABLES[kind]}, "faults[0]"))
    assert others(faulty, TOUCHED[kind]) == others(RUN, TOUCHED[kind])


@pytest.mark.parametrize("kind", WITH_WINDOWS)
def test_messages_outside_the_windows_are_never_touched(kind):
    """Wheel ticks apart: they are sums, so what was lost in a window stays lost."""
    fault = read_fault({"kind": kind, **TABLES[kind], "windows": WINDOWS}, "faults[0]")
    faulty = with_faults(fault)
    kept = [m for m in RUN.measurements if not is_in(m) and not isinstance(m, WheelTicks)]
    assert [m for m in faulty.measurements if not is_in(m) and not isinstance(m, WheelTicks)] == kept
    assert faulty != RUN
    assert fault.lasts == WINDOWS


@pytest.mark.parametrize(
    ("fault", "lasts"),
    [
        (Kidnap(5.0, 9.0), ((5.0, 9.0),)),
        (PowerStep("ap1", -6.0, 10.0), ((10.0, math.inf),)),
        (PowerStep("ap1", -6.0), ()),
        (Drop("wifi"), ()),
        (Drop("wifi", windows=()), ()),
        (BadStart(1.0, 30.0), ()),
        (Clock("gyro", offset_s=1.0), ()),
    ],
)
def test_fault_states_when_it_lasts_unless_that_is_always(fault, lasts):
    assert fault.lasts == lasts


def test_faults_together_last_as_long_as_any_of_them():
    apart = Drop("wifi", windows=((40.0, 50.0), (1.0, 2.0)))
    together = (apart, RssiNoise(3.0), Kidnap(45.0, 48.0), GyroDrop(((50.0, 55.0),)), Freeze(windows=((2.5, 3.0),)))
    assert outages(together) == ((1.0, 2.0), (2.5, 3.0), (40.0, 55.0))
    assert outages((RssiNoise(3.0),)) == ()


@pytest.fixture(scope="module")
def short_run():
    """The first eleven seconds, and what a filter makes of them undamaged."""
    run = replace(RUN, measurements=tuple(m for m in RUN.measurements if is_in(m, ((0.0, 11.0),))))
    return run, run_estimator(run, "ekf")


@pytest.mark.parametrize("kind", KINDS)
def test_filter_lives_through_every_fault_and_answers_otherwise_than_without(kind, short_run):
    run, undamaged = short_run
    faulty = with_faults(read_fault({"kind": kind, **TABLES[kind]}, "faults[0]"), run=run)
    estimator_run = run_estimator(faulty, "ekf")
    assert estimator_run.error is None
    assert len(estimator_run.updates) >= len(faulty.measurements) > 0
    assert estimator_run.digest != undamaged.digest


# --- messages --------------------------------------------------------------------------------------------------------


def test_dropped_topic_is_gone_in_its_windows():
    assert of_kind(with_faults(Drop("gyro", windows=WINDOWS)), Gyro) == [m for m in of_kind(RUN, Gyro) if not is_in(m)]
    assert with_faults(GyroDrop(WINDOWS)).measurements == with_faults(Drop("gyro", windows=WINDOWS)).measurements


def test_dropped_anchor_is_gone_and_the_others_are_received():
    faulty = with_faults(Drop("wifi", "ap2", windows=((0.0, 9.0),)))
    for before, after in zip(of_kind(RUN, WifiScan), of_kind(faulty, WifiScan), strict=True):
        expected = tuple(r for r in before.readings if r.anchor != "ap2" or not is_in(before, ((0.0, 9.0),)))
        assert after == replace(before, readings=expected)


def test_scan_of_one_anchor_goes_with_it():
    """Every message of the simulated ranging holds one anchor."""
    faulty = with_faults(Drop("ranges", "ap1"))
    assert of_kind(faulty, Ranges) == [m for m in of_kind(RUN, Ranges) if m.readings[0].anchor != "ap1"]


def test_sensor_can_be_dropped_by_its_name():
    assert of_kind(with_faults(Drop("wifi", "wifi")), WifiScan) == []


def test_scan_without_readings_is_kept():
    silent = replace(of_kind(RUN, WifiScan)[0], readings=())
    run = replace(RUN, measurements=(*RUN.measurements, replace(silent, time_ns=RUN.measurements[-1].time_ns + 1)))
    assert with_faults(Drop("wifi", "ap1"), run=run).measurements[-1].readings == ()


def test_share_of_messages_that_are_lost_is_the_probability():
    """Three standard errors of about a thousand messages."""
    count, left = len(of_kind(RUN, Gyro)), len(of_kind(with_faults(Drop("gyro", p=0.3)), Gyro))
    assert abs(left / count - 0.7) < 3.0 * math.sqrt(0.3 * 0.7 / count)


def test_burst_losses_are_as_many_and_as_long_as_by_their_probabilities():
    """In the long run the share lost is p_enter / (p_enter + p_exit) = 0.2, the mean burst 1 / p_exit = 4."""
    gyros = [Gyro(nanoseconds(0.01 * i), "gyro", i, 0.0) for i in range(20_000)]
    faulty = with_faults(Drop("gyro", p_enter=0.0625, p_exit=0.25), run=replace(RUN, measurements=tuple(gyros)))
    kept = np.array([m.seq for m in faulty.measurements])
    gaps = np.diff(kept) - 1
    assert 1.0 - len(kept) / len(gyros) == pytest.approx(0.2, abs=0.02)
    assert gaps[gaps > 0].mean() == pytest.approx(4.0, rel=0.1)


def test_burst_that_never_begins_loses_nothing_and_one_that_never_ends_all_that_follows():
    assert content(with_faults(Drop("gyro", p_enter=0.0, p_exit=0.5))) == content(RUN)
    left = [m.seq for m in of_kind(with_faults(Drop("gyro", p_enter=0.02, p_exit=0.0)), Gyro)]
    assert 0 < len(left) < len(of_kind(RUN, Gyro))
    assert left == [m.seq for m in of_kind(RUN, Gyro)][: len(left)]


def test_late_messages_keep_their_stamp_and_lose_their_place():
    faulty = with_faults(Delay("wifi", 0.25))
    assert Counter(faulty.measurements) == Counter(RUN.measurements)
    for scan in of_kind(RUN, WifiScan)[:-1]:
        before = faulty.measurements[: faulty.measurements.index(scan)]
        assert max(m.time_ns for m in before if not isinstance(m, WifiScan)) - scan.time_ns == nanoseconds(0.24)


def test_jitter_lets_messages_overtake_one_another_but_never_come_early():
    faulty = with_faults(Delay("gyro", 0.05, 0.1))
    stamps = [m.time_ns for m in of_kind(faulty, Gyro)]
    assert stamps != sorted(stamps)
    place = {m: i for i, m in enumerate(faulty.measurements)}
    for earlier in of_kind(RUN, WheelTicks):
        following = [m for m in of_kind(RUN, Gyro) if m.time_ns > earlier.time_ns][:3]
        assert all(place[m] > place[earlier] for m in following)


def test_wrong_clock_shifts_stamps_and_not_the_order_of_arrival():
    faulty = with_faults(Clock("wifi", "wifi", offset_s=0.5, drift_ppm=1000.0))
    for before, after in zip(RUN.measurements, faulty.measurements, strict=True):
        elapsed_ns = before.time_ns - START_NS
        ahead_ns = nanoseconds(0.5) + round(1e-3 * elapsed_ns) if isinstance(before, WifiScan) else 0
        assert after == replace(before, time_ns=before.time_ns + ahead_ns)


def test_wrong_clock_leaves_the_true_stamps_with_the_run():
    faulty = with_faults(Clock("wifi", offset_s=0.5), Clock("wifi", offset_s=0.2))
    assert set(faulty.true_stamps) == {order(m) for m in of_kind(faulty, WifiScan)}
    assert [faulty.true_stamps[order(m)] for m in of_kind(faulty, WifiScan)] == [
        m.time_ns for m in of_kind(RUN, WifiScan)
    ]
    assert with_faults(Drop("gyro"), run=faulty).true_stamps == faulty.true_stamps
    assert with_faults(Delay("wifi", 0.3)).true_stamps == {}


@pytest.fixture(scope="module")
def by_wheels():
    """A run whose turns are those of the wheels, and the dead reckoning of it."""
    run = replace(RUN, world=replace(RUN.world, robot=replace(RUN.world.robot, turn_source="wheels")))
    return run, run_estimator(run, "dead_reckoning")


@pytest.mark.parametrize(
    ("topic", "offset_s"), [("gyro", 0.4), ("gyro", -0.4), ("wifi", 0.5), ("wifi", -0.5), ("wifi", 1.5)]
)
def test_score_is_that_of_the_clean_run_for_who_ignores_the_sensor_with_the_wrong_clock(by_wheels, topic, offset_s):
    """Odometry alone, its turns from the wheels: answers are as many, as early and as good, whatever clock is wrong."""
    run, clean = by_wheels
    faulty = run_estimator(with_faults(Clock(topic, offset_s=offset_s), run=run), "dead_reckoning")
    instants = evaluation_instants(run.truth)
    expected, got = (errors(instants, match(instants, estimator_run.track)) for estimator_run in (clean, faulty))
    assert faulty.digest != clean.digest
    assert np.isfinite(expected.position).all()
    np.testing.assert_allclose(got.position, expected.position, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(got.nees, expected.nees, rtol=1e-9)


def test_increments_still_meet_under_a_wrong_clock():
    odometry = of_kind(with_faults(Clock("odom", offset_s=0.1, drift_ppm=-123.0), run=INCREMENTS), Odometry)
    assert odometry[0].from_ns == nanoseconds(0.1)
    assert all(one.time_ns == other.from_ns for one, other in itertools.pairwise(odometry))


def test_windows_keep_to_the_true_time_whatever_the_clock_shows():
    shifted = with_faults(Clock("gyro", offset_s=3.0), GyroDrop(WINDOWS))
    assert [m.seq for m in of_kind(shifted, Gyro)] == [m.seq for m in of_kind(RUN, Gyro) if not is_in(m)]


# --- radio -----------------------------------------------------------------------------------------------------------


def test_noise_has_the_spread_asked_for():
    before, after = values(RUN, WifiScan), values(with_faults(RssiNoise(3.0)), WifiScan)
    noise = np.array([after[key] - value for key, value in before.items()])
    assert noise.std() == pytest.approx(3.0, rel=0.15)
    assert abs(noise.mean()) < 3.0 * 3.0 / math.sqrt(len(noise))


def test_noise_of_one_anchor_leaves_the_others():
    before, after = values(RUN, WifiScan), values(with_faults(RssiNoise(3.0, "ap1")), WifiScan)
    assert {anchor for (_, anchor), value in after.items() if value != before[_, anchor]} == {"ap1"}


def in_steps(step):
    """The run with signal strengths moved up by 0.323 dB, then rounded to ``step``, if any."""

    def coarse(reading):
        moved = reading.rssi_dbm + 0.323
        return reading._replace(rssi_dbm=step * round(moved / step) if step else moved)

    scans = {m: replace(m, readings=tuple(map(coarse, m.readings))) for m in of_kind(RUN, WifiScan)}
    return replace(RUN, measurements=tuple(scans.get(m, m) for m in RUN.measurements))


@pytest.mark.parametrize("fault", [RssiNoise(3.0), Nlos("wifi", 5.0), Outlier("wifi", 0.5, (-90.0, -30.0))])
def test_noisy_strengths_are_as_coarse_as_those_of_the_log(fault):
    for step in (1.0, 0.5):
        after = np.array(list(values(with_faults(fault, run=in_steps(step)), WifiScan).values()))
        assert (after / step == np.rint(after / step)).all()
        assert not (after / (2.0 * step) == np.rint(after / (2.0 * step))).all()
    fine = np.array(list(values(with_faults(fault, run=in_steps(None)), WifiScan).values()))
    assert not (fine == np.round(fine, 1)).any()


def test_power_step_is_a_constant_from_its_time_on():
    before, after = of_kind(RUN, WifiScan), of_kind(with_faults(PowerStep("ap2", -6.0, 7.0)), WifiScan)
    for one, other in zip(before, after, strict=True):
        step = -6.0 if not is_in(one, ((0.0, 7.0),)) else 0.0
        expected = tuple(r._replace(rssi_dbm=r.rssi_dbm + step * (r.anchor == "ap2")) for r in one.readings)
        assert other == replace(one, readings=expected)


def test_detour_makes_ranges_longer_only():
    before, after = values(RUN, Ranges), values(with_faults(Nlos("ranges", 0.8)), Ranges)
    excess = np.array([after[key] - value for key, value in before.items()])
    assert excess.min() > 0.0
    assert excess.mean() == pytest.approx(0.8, abs=3.0 * 0.8 / math.sqrt(len(excess)))


def test_obstruction_makes_strengths_weaker_and_changes_its_share():
    before, after = values(RUN, WifiScan), values(with_faults(Nlos("wifi", 6.0, p=0.4)), WifiScan)
    loss = np.array([value - after[key] for key, value in before.items()])
    assert loss.min() == 0.0
    assert np.mean(loss > 0.0) == pytest.approx(0.4, abs=3.0 * math.sqrt(0.24 / len(loss)))


def test_outliers_lie_in_their_span():
    before, after = values(RUN, Ranges), values(with_faults(Outlier("ranges", 0.5, (100.0, 200.0))), Ranges)
    wild = [value for key, value in after.items() if value != before[key]]
    assert 0.0 < len(wild) < len(before)
    assert 100.0 <= min(wild) < 120.0
    assert 180.0 < max(wild) <= 200.0


def test_reading_keeps_what_a_fault_does_not_change():
    scan = WifiScan(nanoseconds(1.0), "wifi", 0, (RssiReading("ap1", -50.0, 7), RssiReading("ap2", math.nan)))
    faulty = with_faults(PowerStep("ap1", 2.0), run=replace(RUN, measurements=(scan,))).measurements[0]
    assert faulty.readings == (RssiReading("ap1", -48.0, 7), scan.readings[1])


# --- motion ----------------------------------------------------------------------------------------------------------


def steps(run):
    return np.diff([m.counts for m in of_kind(run, WheelTicks)], axis=0)


STEP_IN = np.array([is_in(m) for m in of_kind(RUN, WheelTicks)][1:])


def test_frozen_wheel_counts_nothing_in_its_windows_and_goes_on_after():
    expected = steps(RUN)
    expected[STEP_IN, 1] = 0
    assert (steps(with_faults(Freeze("front_right", WINDOWS))) == expected).all()
    assert expected[~STEP_IN].sum() < steps(RUN).sum()


def test_slipping_side_counts_more_and_no_tick_is_lost_in_rounding():
    """Sums of whole ticks: they are never further from the scaled sum than half a tick."""
    faulty = np.array([m.counts for m in of_kind(with_faults(Slip(1.37, "left")), WheelTicks)])
    counted = np.array([m.counts for m in of_kind(RUN, WheelTicks)])
    assert np.abs(faulty[:, [0, 2]] - counted[0, [0, 2]] - 1.37 * (counted - counted[0])[:, [0, 2]]).max() <= 0.5
    assert (faulty[:, [1, 3]] == counted[:, [1, 3]]).all()
    assert all(isinstance(count, int) for m in of_kind(with_faults(Slip(1.37)), WheelTicks) for count in m.counts)


def test_slip_of_a_wheel_that_is_dead_is_nothing():
    assert (steps(with_faults(Freeze(windows=WINDOWS), Slip(3.0, windows=WINDOWS)))[STEP_IN] == 0).all()


def test_ticks_that_were_lost_still_slipped():
    whole = {m.seq: m for m in of_kind(with_faults(Slip(1.3)), WheelTicks)}
    thinned = of_kind(with_faults(Drop("odom", p=0.5), Slip(1.3)), WheelTicks)
    assert 0 < len(thinned) < len(whole)
    assert all(whole[m.seq] == m for m in thinned)


def test_increment_slips_as_the_wheels_it_was_made_of_would():
    """Left 0.10 m and right 0.12 m at a track of 0.15 m; the left side at half."""
    odometry = Odometry(nanoseconds(1.0), "wheels", 0, 0, 0.11, 0.02 / 0.15)
    (half,) = with_faults(Slip(0.5, "left"), run=replace(RUN, measurements=(odometry,))).measurements
    assert (half.distance_m, half.turn_rad) == pytest.approx((0.085, 0.07 / 0.15))
    (one_of_two,) = with_faults(Slip(0.5, "rear_left"), run=replace(RUN, measurements=(odometry,))).measurements
    assert one_of_two.distance_m == pytest.approx(0.5 * (0.075 + 0.12))


def test_increments_of_a_robot_without_wheels_slip_as_a_whole():
    world = replace(RUN.world, robot=replace(RUN.world.robot, drive="none"))
    run = replace(INCREMENTS, world=world)
    for before, after in zip(of_kind(run, Odometry), of_kind(with_faults(Slip(0.5), run=run), Odometry), strict=True):
        assert (after.distance_m, after.turn_rad) == pytest.approx((0.5 * before.distance_m, 0.5 * before.turn_rad))
    with pytest.raises(ParameterError, match="its none drive has no wheels"):
        with_faults(Slip(0.5, "left"), run=run)


def test_ticks_of_other_wheels_than_the_world_has_are_refused():
    world = replace(RUN.world, robot=replace(RUN.world.robot, drive="differential"))
    with pytest.raises(MeasurementError, match="'encoders' does not count 2 wheels"):
        with_faults(Slip(0.5), run=replace(RUN, world=world))


def test_gyro_bias_is_added_in_degrees_a_second():
    for before, after in zip(of_kind(RUN, Gyro), of_kind(with_faults(GyroBias(2.0, WINDOWS)), Gyro), strict=True):
        assert after.rate_rad_s == before.rate_rad_s + math.radians(2.0) * is_in(before)


@pytest.mark.parametrize("run", [RUN, INCREMENTS], ids=lambda run: run.name)
def test_kidnapped_robot_measures_no_motion_and_hears_nothing(run):
    start_ns = min(getattr(m, "from_ns", m.time_ns) for m in run.measurements)
    carried = [((5.0, 9.0),), start_ns]
    faulty = with_faults(Kidnap(5.0, 9.0), run=run)
    odometer, moved = Odometer(run.world.robot, start_ns), Steps()
    for measurement in faulty.measurements:
        if isinstance(measurement, WifiScan | Ranges):
            odometer.hold(measurement.time_ns, Steps())
        else:
            odometer.advance(measurement, moved)
    moved = [step for step in moved if is_in(step, *carried)]
    assert moved
    assert all(abs(m.distance_m) + abs(m.turn_rad) < 1e-12 for m in moved[1:])
    assert {m.rate_rad_s for m in of_kind(faulty, Gyro) if is_in(m, *carried)} == {run.world.robot.gyro_bias_rad_s}
    radio = WifiScan | Ranges
    assert of_kind(faulty, radio) == [m for m in of_kind(run, radio) if not is_in(m, *carried)]


def test_kidnapped_robot_moves_on_as_before():
    after = np.array([m.time_ns >= START_NS + nanoseconds(9.0) for m in of_kind(RUN, WheelTicks)][1:])
    assert (steps(with_faults(Kidnap(5.0, 9.0)))[after] == steps(RUN)[after]).all()


def test_bad_start_displaces_the_prior_alone():
    faulty = with_faults(BadStart(1.0, 20.0))
    assert faulty.measurements == RUN.measurements
    assert faulty.prior == replace(RUN.prior, pose=faulty.prior.pose)
    short = replace(RUN, measurements=())
    poses = [with_faults(BadStart(1.0, 20.0), run=short, seed=seed).prior.pose for seed in range(300)]
    off = np.array(poses) - RUN.prior.pose
    assert off.std(axis=0) == pytest.approx([1.0, 1.0, math.radians(20.0)], rel=0.15)


def test_bad_start_of_a_run_without_prior_displaces_the_one_it_would_have_had():
    bare = replace(RUN, prior=None)
    faulty = with_faults(BadStart(1.0), run=bare)
    assert faulty.prior == replace(starting_prior(bare), pose=faulty.prior.pose)
    assert faulty.prior.pose != starting_prior(bare).pose


def test_hash_of_a_name_is_the_head_of_its_sha256():
    """FIPS 180-2, appendix B.1: SHA-256 of "abc" begins with ba7816bf 8f01cfea."""
    assert stable_hash("abc") == 0xBA7816BF8F01CFEA
