"""`fusion perf`: its tables have every row, answers are held against each other, and laws are what was put in."""

import json
import math
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import fusion
from benchmarks.performance.agreement import Answer, apart, beliefs, require_agreement
from benchmarks.performance.cost_laws import Law, late
from benchmarks.performance.drive import RANGE_STD_M, as_run, drive, site, write_log
from benchmarks.performance.filterpy_loops import ekf_loop, missing_filterpy, particle_loop
from benchmarks.performance.implementation import POSE_EKF, Subject
from benchmarks.performance.interleaved import Cost, interleaved
from benchmarks.performance.perf import Performance
from benchmarks.performance.row import DECODE, FLOORS, WHOLE, Floor, Row, Sense
from benchmarks.performance.table import markdown, tables, verdict
from fusion import Covariance, Decision, FusionError, Odometry, Pose, Ranges
from fusion.cli.main import main
from logs.reader import read_run


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    """The record of the verb over a log of 20 s, one round; its Markdown as one more key."""
    folder = tmp_path_factory.mktemp("perf")
    json_path, page = folder / "perf.json", folder / "perf.md"
    assert main(["perf", "--minutes", "0.34", "--rounds", "1", "--json", str(json_path), "--markdown", str(page)]) == 0
    return {**json.loads(json_path.read_text(encoding="utf-8")), "page": page.read_text(encoding="utf-8")}


def test_every_floor_has_its_row_and_every_row_a_figure(record):
    rows = {(row["quantity"], row["subject"]): row for row in record["rows"]}
    assert len(rows) == len(record["rows"])
    assert set(FLOORS) <= set(rows)
    for key, row in rows.items():
        assert row["value"] > 0.0 or "never received" in key[0], key
        assert (row["floor"] is None) == (row["holds"] is None), key


def test_page_has_every_row_and_names_what_is_below_its_floor(record):
    laws = {law["name"] for law in record["laws"]}
    for row in record["rows"]:
        name = row["quantity"] if row["quantity"] in laws else row["subject"]
        assert f"| {name} " in record["page"], name
    below = [row for row in record["rows"] if row["holds"] is False]
    assert all(f"{row['subject']}: {row['quantity']}" in record["page"] for row in below)


def test_page_of_the_docs_has_the_tables_of_today(record):
    page = (Path(__file__).resolve().parents[3] / "docs" / "performance-table.md").read_text(encoding="utf-8")
    for titles in (re.findall(r"^\*\*.+\*\*$", text, re.MULTILINE) for text in (record["page"], page)):
        assert titles == re.findall(r"^\*\*.+\*\*$", page, re.MULTILINE)
    for (quantity, subject), floor in FLOORS.items():
        bound = f"{floor.sense.value} {floor.bound:g}"
        name = quantity if f"| {quantity} " in page else subject
        assert re.search(rf"^\| {re.escape(name)} .*\| {bound}x? \|", page, re.MULTILINE), (quantity, subject)


def test_ratio_is_how_many_times_as_fast_as_filterpy(record):
    rows = {(row["quantity"], row["subject"]): row for row in record["rows"]}
    ours, theirs = rows[WHOLE, "ekf, 10 states"], rows[WHOLE, "filterpy's EKF"]
    assert ours["against"] == theirs["subject"]
    assert ours["ratio"] == theirs["value"] / ours["value"]


def test_our_filter_of_the_pose_answers_as_filterpy(record):
    (own,) = (answer for answer in record["answers"] if answer["name"] == "ekf, 3 states")
    assert 0.0 < own["apart"] < 1e-9
    assert {answer["apart"] for answer in record["answers"]} == {own["apart"], None}
    assert all(0.0 < answer["rmse_m"] < 0.5 for answer in record["answers"])


def test_without_filterpy_one_sentence_stands_in_for_the_ratios(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, "filterpy", None)
    assert main(["perf", "--minutes", "0.05", "--rounds", "1", "--json", str(tmp_path / "perf.json")]) == 0
    written = capsys.readouterr().err.splitlines()
    assert [line for line in written if "filterpy" in line] == [f"fusion perf: {missing_filterpy()}"]
    assert "pip install 'fusion-localization[filterpy]'" in written[0]
    found = json.loads((tmp_path / "perf.json").read_text(encoding="utf-8"))
    assert found["missing"] == missing_filterpy()
    assert not [row for row in found["rows"] if "filterpy" in row["subject"] or "filterpy" in row["against"]]
    assert all(row["holds"] is None for row in found["rows"] if row["quantity"] == WHOLE)


@pytest.mark.parametrize("words", [["--minutes", "0"], ["--minutes", "long"], ["--rounds", "0"]])
def test_lengths_and_rounds_that_mean_nothing_are_refused(words):
    with pytest.raises(SystemExit, match="2"):
        main(["perf", *words])


def wrong(worse):
    """An ekf whose estimates are changed by ``worse``."""

    class Wrong(fusion.load("ekf")):
        def estimate(self, state, motion, time_ns):
            return worse(super().estimate(state, motion, time_ns))

    return Wrong


@pytest.mark.parametrize(
    "worse",
    [
        lambda e: e._replace(pose=e.pose._replace(x=e.pose.x + 1e-8)),
        lambda e: e._replace(pose=e.pose._replace(heading=e.pose.heading - 1e-8)),
        lambda e: e._replace(pose=e.pose._replace(y=math.nan)),
        lambda e: e._replace(covariance=e.covariance._replace(xy=e.covariance.xy + 1e-8)),
        lambda e: e._replace(covariance=None),
    ],
)
def test_a_wrong_filter_is_found_out(worse):
    driven = drive(1.0, site(calibrated=True))
    require_agreement(POSE_EKF.live(), ekf_loop(), driven)
    with fusion.registered("wrong", wrong(worse)), pytest.raises(FusionError, match=r"wrong and filterpy.s EKF answer"):
        require_agreement(Subject("wrong", "wrong", calibrated=True).live(), ekf_loop(), driven)


def test_filters_that_differ_by_their_model_are_apart():
    driven = drive(4.0, site())
    ours, theirs = beliefs(Subject("ekf", "ekf").live(), driven), beliefs(particle_loop(), driven)
    assert apart(ours, theirs) > 1e-4
    assert apart(ours, ours) == 0.0


def test_no_reading_of_the_drive_is_refused_and_all_are_near_the_truth():
    driven = drive(20.0, site(calibrated=True))
    tracker = POSE_EKF.tracker(driven)
    fates = [fate for one in driven.measurements for fate in tracker.push(one)[0].fates]
    assert len(fates) == 3 * len(driven.blocks) == 300
    assert {fate.decision for fate in fates} == {Decision.USED}
    places = {anchor.id: (anchor.x, anchor.y) for anchor in driven.world.anchors}
    for block, pose in zip(driven.blocks, driven.poses, strict=True):
        for reading in block.scan.readings:
            distance = math.dist(places[reading.anchor], pose[:2])
            assert abs(reading.range_m - distance) <= 2.5 * RANGE_STD_M + 1e-12


def test_drive_stays_within_its_circles_for_an_hour_and_both_sides_get_the_same_numbers():
    driven = drive(120.0, site(), seed=3)
    assert np.abs(driven.poses[:, 0]).max() < 2.1
    assert np.abs(driven.poses[:, 1]).max() < 4.1
    numbers = ekf_loop().blocks(driven)
    for block, (steps, (ranges, places)) in zip(driven.blocks, numbers, strict=True):
        assert [step[:2] for step in steps] == [(one.distance_m, one.turn_rad) for one in block.steps]
        assert ranges.tolist() == [one.range_m for one in block.scan.readings]
        assert len(places) == 3


def test_anchors_that_are_not_received_change_no_number():
    few, many = drive(2.0, site(3)), drive(2.0, site(40))
    assert [one.steps for one in few.blocks] == [one.steps for one in many.blocks]
    for one, other in zip(few.blocks, many.blocks, strict=True):
        assert [r.range_m for r in one.scan.readings] == pytest.approx([r.range_m for r in other.scan.readings])


def test_log_of_the_drive_reads_back_as_its_run(tmp_path):
    run = as_run(drive(2.0, site()))
    count = write_log(run, tmp_path / "drive.mcap")
    back = read_run(tmp_path / "drive.mcap")
    assert back.measurements == run.measurements
    assert count == len(run.measurements) + len(run.truth.time_ns) == 231


def test_late_scans_arrive_so_many_steps_later():
    driven = drive(2.0, site())
    messages = late(driven, 15)
    place = next(k for k, one in enumerate(messages) if isinstance(one, Ranges))
    assert messages[place - 1].time_ns - messages[place].time_ns == 150_000_000
    assert isinstance(messages[place - 1], Odometry)
    assert set(messages) == set(driven.measurements)


def test_jobs_take_turns_and_the_round_to_warm_up_does_not_count():
    order, costs = [], iter([9.0, 9.0, 3.0, 5.0, 1.0, 7.0, 2.0, 6.0])

    def job(name):
        def work():
            order.append(name)
            return (next(costs),)

        return work

    found = interleaved({"a": job("a"), "b": job("b")}, 3)
    assert order == ["a", "b"] * 4
    assert found == {"a": (Cost(1.0, 2.0),), "b": (Cost(5.0, 6.0),)}


def test_law_is_the_line_through_the_least_costs():
    law = Law("anchors", "ekf", "µs", (1, 2, 4), (Cost(5.0, 9.0), Cost(7.0, 9.0), Cost(11.0, 12.0)))
    assert law.line == pytest.approx((2.0, 3.0))
    assert law.row.ratio == pytest.approx(2.2)
    assert law.row.subject == "ekf, 4 for 1"


@pytest.mark.parametrize(
    ("floor", "held", "broken"),
    [(Floor(Sense.AT_LEAST, 2.0), 2.0, 1.99), (Floor(Sense.AT_MOST, 2.0), 2.0, 2.01)],
)
def test_floor_is_a_bound_on_its_side(floor, held, broken):
    assert floor.holds(held)
    assert not floor.holds(broken)


def test_table_shows_floor_and_whether_it_is_held():
    rows = (
        Row(WHOLE, "ekf, 3 states", "s", 1.0, 1.5, 12.0, "filterpy's EKF"),
        Row(WHOLE, "dead_reckoning", "s", 1.0, 1.5, 7.9, "filterpy's EKF"),
        Row(WHOLE, "particle, 1000", "s", 1.0, 1.5),
        Row(DECODE, "messages", "M/s", 0.6, 0.5),
    )
    measured = Performance({"log": "1 minute"}, (Answer("ekf, 3 states", 0.03, 1e-15),), rows, (), None)
    _, whole, decode, _ = tables(measured)
    assert [row[-2:] for row in whole.rows] == [("≥ 10x", "yes"), ("≥ 8x", "no"), ("≥ 4x", "–")]
    assert decode.rows == (("messages", "0.6", "0.5", "–", "–", "≥ 0.5", "yes"),)
    assert verdict(measured) == f"2 of 3 floors are held; not: dead_reckoning: {WHOLE}"
    assert "| dead_reckoning | 1 | 1.5 | 7.9x |" in markdown(measured)


def test_belief_of_the_loops_is_a_pose_and_its_covariance():
    driven = drive(1.0, site(calibrated=True))
    for loop in (ekf_loop(), particle_loop()):
        pose, covariance = beliefs(loop, driven)[-1]
        assert isinstance(pose, Pose)
        assert isinstance(covariance, Covariance)
        assert 0.0 < covariance.xx < 0.1
