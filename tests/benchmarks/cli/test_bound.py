"""``fusion bound``: from a world file, a scenario or a log to tables, a record and the words beside them."""

import json
import math

import numpy as np
import pytest

from benchmarks.limits.fix_bound import fix_error
from benchmarks.limits.floor_plan import plan_site
from benchmarks.limits.floor_source import choose_radio, load_site
from benchmarks.limits.floor_tables import gain_m, record, tables
from fusion import LogError, ParameterError, WorldError
from fusion.cli.main import main
from sensors.simulation.scenario import load_scenario, scenario_text
from sensors.simulation.simulate import simulate

HALL = """
name = "hall"
[[anchors]]
id = "u1"
position_m = [0.0, 0.0, 2.5]
[[anchors]]
id = "u2"
position_m = [12.0, 0.0, 2.5]
[[anchors]]
id = "u3"
position_m = [6.0, 9.0, 2.5]
"""
RANGING = "[ranging]\nstd_m = 0.1\n"
RADIO = "[radio]\nshadowing_std_db = 3.0\n"


@pytest.fixture
def hall(tmp_path):
    path = tmp_path / "hall.toml"
    path.write_text(HALL + RANGING)
    return path


def test_world_scenario_and_log_of_one_site_have_one_plan(tmp_path):
    log = simulate("office", tmp_path / "run.mcap", duration_s=2.0)
    scenario = tmp_path / "mine.toml"
    scenario.write_text(scenario_text("office"))
    world = tmp_path / "world.toml"
    table = json.loads(load_scenario("office").world.table)
    anchors = "".join(f"[[anchors]]\nid = {a['id']!r}\nposition_m = {a['position_m']}\n" for a in table["anchors"])
    tables = [
        f"[{name}]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in table[name].items())
        for name in ("radio", "bounds")
    ]
    world.write_text(anchors + "".join(tables) + "[robot]\nantenna_m = [0.0, 0.0, 0.2]\n")
    plans = [plan_site(source, step_m=1.0) for source in ("office", scenario, log, world)]
    places = plans[0].grid.places(0.2)
    maps = [fix_error(plans[0].world.anchors, places, "rssi"), *(plan.error_m for plan in plans)]
    for other in maps[1:]:
        assert other.tolist() == maps[0].tolist()


def test_kind_of_radio_is_the_one_in_use(tmp_path, hall):
    assert load_site(hall).radios == {"range"}
    assert load_site("office").radios == {"rssi"}
    assert load_site(simulate("office", tmp_path / "run.mcap", duration_s=2.0)).radios == {"rssi"}
    own = tmp_path / "own.toml"
    own.write_text(HALL + "radio = { bias_std_db = 1.0 }\n")
    assert load_site(own).radios == {"rssi"}
    bare = tmp_path / "bare.toml"
    bare.write_text(HALL)
    assert load_site(bare).radios == set()


def test_where_the_site_does_not_decide_signal_strength_is_taken_with_a_remark():
    assert choose_radio(frozenset({"range"}))[0] == "range"
    for undecided in (frozenset(), frozenset({"rssi", "range"})):
        radio, why = choose_radio(undecided)
        assert radio == "rssi"
        assert "--radio range" in why


def test_radio_that_is_asked_for_wins(hall):
    plan = plan_site(hall, radio="rssi", step_m=1.0)
    assert plan.readings.radio == "rssi"
    assert plan.hdop is None
    assert not any("readings" in remark for remark in plan.remarks)
    assert plan_site(hall, step_m=1.0).hdop.shape == plan.error_m.shape


def test_numbers_are_those_of_the_map(hall):
    plan = plan_site(hall, limit_m=0.5)
    errors = np.sort(plan.error_m.ravel())
    assert plan.spread.median_m == pytest.approx(np.median(errors))
    assert plan.spread.p95_m == pytest.approx(np.quantile(errors, 0.95))
    assert plan.below_limit == np.mean(errors <= 0.5)
    x, y = plan.worst_place
    column, row = np.argmin(abs(plan.grid.x - x)), np.argmin(abs(plan.grid.y - y))
    assert plan.error_m[row, column] == errors[-1]


def test_more_scans_lower_the_error_and_an_unknown_offset_raises_it(hall):
    once = plan_site(hall, step_m=1.0).spread.median_m
    assert plan_site(hall, step_m=1.0, scans=10).spread.median_m < once
    assert plan_site(hall, step_m=1.0, offset_std=math.inf).spread.median_m > once


def test_record_is_strict_json_and_holds_what_the_tables_show(hall, tmp_path, capsys):
    output = tmp_path / "deep" / "plan.json"
    assert main(["bound", str(hall), "--add", "--move", "--step", "1", "--json", str(output)]) == 0
    stored, plan = json.loads(output.read_text()), plan_site(hall, add=True, move=True, step_m=1.0)
    assert stored == json.loads(json.dumps(record(plan), allow_nan=False))
    assert [(each["kind"], each["anchor"] == "new") for each in stored["proposals"]] == [
        ("add", True),
        ("move", False),
    ]
    assert [each["p95_gain_m"] for each in stored["proposals"]] == [gain_m(plan, each) for each in plan.proposals]
    assert np.array(stored["error_m"]).shape == (len(stored["y_m"]), len(stored["x_m"]))
    screen = capsys.readouterr().out
    assert f"{stored['p95_m']:.2f}" in screen
    assert "one more anchor at" in screen
    assert "u1" in screen


def test_record_on_stdout_stands_alone(hall, capsys):
    assert main(["bound", str(hall), "--step", "2", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["radio"] == "range"


def test_gains_are_what_the_proposals_save(hall):
    plan = plan_site(hall, add=True, step_m=1.0)
    (proposal,) = plan.proposals
    assert 0.0 < gain_m(plan, proposal) == plan.spread.p95_m - proposal.spread.p95_m


def test_anchors_whose_loss_leaves_a_mirror_image_are_named(tmp_path, hall):
    assert any("without u1 or u2 or u3 every fix has a mirror image" in each for each in plan_site(hall).remarks)
    four = tmp_path / "four.toml"
    four.write_text(HALL + '[[anchors]]\nid = "u4"\nposition_m = [6.0, 0.0]\n')
    assert any("without u3 every fix" in each for each in plan_site(four).remarks)


def test_two_anchors_are_planned_with_a_warning_and_fewer_are_refused(tmp_path):
    path, rows = tmp_path / "few.toml", HALL.split("[[anchors]]")
    path.write_text("[[anchors]]".join(rows[:3]))
    plan = plan_site(path)
    assert any("two mirror images" in remark for remark in plan.remarks)
    assert plan.losses["u1"].undefined == 1.0
    assert tables(plan)[1].rows[0][1:] == ("∞", "∞", "∞", "∞")
    path.write_text("[[anchors]]".join(rows[:2]))
    with pytest.raises(WorldError, match="1 anchor; a fix needs the distance to two at least"):
        plan_site(path)
    path.write_text('name = "empty"\n[bounds]\nx_min = 0\nx_max = 1\ny_min = 0\ny_max = 1\n')
    with pytest.raises(WorldError, match="no anchors; a fix needs"):
        plan_site(path)


def test_anchors_on_one_line_are_refused_by_name(tmp_path, capsys):
    path = tmp_path / "line.toml"
    path.write_text(HALL.replace("9.0", "0.0"))
    assert main(["bound", str(path)]) == 1
    assert "u1, u2, u3 lie on one line" in capsys.readouterr().err


def test_floor_without_any_information_is_reported_and_has_no_proposal(tmp_path):
    path = tmp_path / "flat.toml"
    path.write_text(HALL + "[radio]\nreference_distance_m = 500.0\n")
    plan = plan_site(path, add=True, step_m=2.0)
    assert plan.proposals == ()
    assert any("undefined on 100.0% of the floor" in remark for remark in plan.remarks)
    assert any("no place on the floor" in remark for remark in plan.remarks)
    assert record(plan)["p95_m"] is None
    assert tables(plan)[1].rows[0][-1] == "–"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scans": 0}, "0 scans"),
        ({"step_m": 0.0}, "step 0.0 m"),
        ({"step_m": math.nan}, "step nan m"),
        ({"step_m": 1e-9}, "finer|longer"),
        ({"limit_m": -1.0}, "limit -1.0 m"),
        ({"offset_std": -1.0}, "offset std -1.0"),
        ({"offset_std": math.nan}, "offset std nan"),
    ],
)
def test_options_that_mean_nothing_are_refused(hall, options, message):
    with pytest.raises(ParameterError, match=message):
        plan_site(hall, **options)


def test_source_that_is_not_there_is_named(tmp_path):
    with pytest.raises(WorldError, match="did you mean 'office'"):
        plan_site("ofice")
    with pytest.raises(WorldError, match=r"none\.toml"):
        plan_site(tmp_path / "none.toml")
    with pytest.raises(LogError, match=r"none\.mcap"):
        plan_site(tmp_path / "none.mcap")
    broken = tmp_path / "broken.toml"
    broken.write_text("name = ")
    with pytest.raises(WorldError, match=r"broken\.toml: not TOML"):
        plan_site(broken)


def test_record_that_cannot_be_written_is_reported(hall, tmp_path, capsys):
    assert main(["bound", str(hall), "--step", "2", "--json", str(tmp_path)]) == 1
    assert "cannot be written" in capsys.readouterr().err


def test_of_many_anchors_those_that_would_be_missed_most_are_in_the_table(tmp_path, capsys):
    ring = [(math.cos(k), math.sin(2.0 * k)) for k in range(20)]
    rows = "".join(f'[[anchors]]\nid = "a{i}"\nposition_m = [{9 * x}, {9 * y}]\n' for i, (x, y) in enumerate(ring))
    (tmp_path / "w.toml").write_text(rows)
    plan = plan_site(tmp_path / "w.toml", step_m=2.0)
    (table,) = [each for each in tables(plan) if each.title.startswith("When one anchor falls silent")]
    shown = {row[0] for row in table.rows}
    assert table.title.endswith("(the worst 12 of 20)")
    assert len(shown) == 12
    left_out = max(spread.p95_m for name, spread in plan.losses.items() if name not in shown)
    assert left_out <= min(plan.losses[name].p95_m for name in shown)
