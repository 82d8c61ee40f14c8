"""The report of a suite: one page, no network, every part of it there, drawn by a real browser without errors."""

import argparse
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from benchmarks.metrics.bound import rssi_fix_bound
from benchmarks.report.figures import FIGURES
from benchmarks.report.material import Material
from benchmarks.report.tables import credibility, faults, fixes, outages
from benchmarks.report.verb import report
from benchmarks.report.worst import as_log, worst_moments
from benchmarks.review.review import review
from benchmarks.runner.definition import RunSource, load_suite
from benchmarks.runner.plan import cells_of
from benchmarks.runner.results import by_contestant, read_results
from benchmarks.runner.run_verb import run_suite
from benchmarks.runner.store import Store
from fusion.cli import main
from logs import importing

SUITE = """
[suite]
name = "page"
[[runs]]
id = "office"
scenario = "office"
duration_s = 20.0
[[runs]]
id = "mec"
scenario = "mec"
duration_s = 20.0
[[estimators]]
id = "wheels"
use = "dead_reckoning"
[[estimators]]
id = "radio"
use = "radio_only"
[[faults]]
id = "silence"
apply = [{ kind = "drop", topic = "wifi" }]
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    (folder / "suite.toml").write_text(SUITE, encoding="utf-8")
    run_suite(load_suite(folder / "suite.toml"), Store(folder / "store"), workers=1)
    return folder


@pytest.fixture(scope="module")
def material(place):
    suite, store = load_suite(place / "suite.toml"), Store(place / "store")
    return Material(suite, read_results(cells_of(suite, store), store), store)


def test_page_holds_verdicts_tables_figures_and_provenance(material):
    page = report(material, "fusion bench run suite.toml")
    assert page.count("data:image/png;base64,") == len(FIGURES) - (not material.timing)
    for part in ("Leaderboard", "Pairs on pos_p75", "Faults", "Worst moments", "Lost cells", "Runs", "Estimators"):
        assert f"**{part}" in page
    assert "wheels" in page.splitlines()[2]
    assert "fusion bench run suite.toml" in page


def test_cost_is_drawn_once_it_was_measured(place, capsys):
    words = [str(place / "suite.toml"), "--store", str(place / "store")]
    assert main(["bench", "time", *words, "--repeats", "1"]) == 0
    printed = capsys.readouterr().out
    assert "wheels" in printed
    assert "peak MB" in printed
    suite, store = load_suite(place / "suite.toml"), Store(place / "store")
    timed = Material(suite, read_results(cells_of(suite, store), store), store)
    assert timed.timing.keys() == {"wheels", "radio"}
    assert report(timed, "").count("data:image/png;base64,") == len(FIGURES)


def test_distance_from_the_limit_is_told_where_it_is_asked_for(material):
    assert "Times the physical limit" not in report(material, "")
    page = report(material, "", limit=True)
    (row,) = re.findall(r"\| wheels \| ([\d.]+)× \| ([\d.]+)× \|", page)
    assert all(float(ratio) > 0.0 for ratio in row)
    assert "One perfect fix" in page


def test_efficiency_of_fixes_is_that_of_the_bound_at_the_true_places(material):
    cell = material.series["office", "radio"]
    world, bound_m = material.run("office").world, material.fix_bound_m(cell)
    x, y, heading = (float(column[7]) for column in cell.instants[1:])
    assert bound_m[7] == pytest.approx(np.sqrt(np.trace(rssi_fix_bound(world, x, y, heading))), rel=1e-12)
    valid = cell.answers.valid
    ratio = np.sqrt(np.mean(bound_m[valid] ** 2) / np.mean(cell.error_m[valid] ** 2))
    (row,) = [row for row in fixes(material).rows if row[0] == "radio"]
    assert row[1] == f"{100.0 * ratio:.0f} %"


def test_credibility_is_told_where_seeds_can_tell_it(material, tmp_path):
    """Every second reading drawn anew for each seed makes radio fixes err anew; wheels do not hear of it."""
    assert "Credibility" not in report(material, "")
    assert credibility(material).rows == (("wheels", "–"), ("radio", "–"))
    text = SUITE.replace('name = "page"', 'name = "page"\nseeds = 6').replace('"wifi" }', '"wifi", p = 0.5 }')
    (tmp_path / "seeds.toml").write_text(text.replace('use = "radio_only"', 'use = "ekf"'), encoding="utf-8")
    suite, store = load_suite(tmp_path / "seeds.toml"), Store(tmp_path / "store")
    run_suite(suite, store, workers=1)
    seeded = Material(suite, read_results(cells_of(suite, store), store), store)
    assert "Credibility" in report(seeded, "")
    rows = {row[0]: row[1:] for row in credibility(seeded).rows}
    assert rows["wheels"] == ("–",)
    nci, incl = map(float, re.fullmatch(r"([\d.]+) \(([+-][\d.]+)\)", rows["radio"][0]).groups())
    assert 0.0 < abs(incl) <= nci


def test_fault_with_windows_is_told_by_what_happened_inside(material, tmp_path):
    assert "While a fault lasts" not in report(material, "")
    text = SUITE.replace('topic = "wifi" }', 'topic = "wifi", windows = [[5.0, 12.0]] }')
    (tmp_path / "windows.toml").write_text(text, encoding="utf-8")
    suite, store = load_suite(tmp_path / "windows.toml"), Store(tmp_path / "store")
    results = run_suite(suite, store, workers=1)
    struck = Material(suite, results, store)
    assert "While a fault lasts" in report(struck, "")
    rows = {row[:2]: row[2:] for row in outages(struck).rows}
    assert rows["silence", "wheels"][0] == "100.0"
    inside = [one.metrics for one in by_contestant(results, "silence")["radio"]]
    for place, key in enumerate(("fault_availability", "fault_max_in_outage")):
        assert rows["silence", "radio"][place] == f"{100.0 * np.median([one[key] for one in inside]):.1f}"
    assert [row[-1] for row in rows.values()] == [row[1] for row in faults(struck).rows]


def test_what_one_run_says_of_itself_is_told_only_where_it_is_the_only_one(material, tmp_path):
    assert "within this run" not in report(material, "")
    office, _, rest = SUITE.partition('[[runs]]\nid = "mec"')
    (tmp_path / "one.toml").write_text(office + rest[rest.index("[[estimators]]") :], encoding="utf-8")
    suite, store = load_suite(tmp_path / "one.toml"), Store(tmp_path / "store")
    run_suite(suite, store, workers=1)
    page = report(Material(suite, read_results(cells_of(suite, store), store), store), "")
    assert len(re.findall(r"- within this run, wheels beats radio by .*; says nothing of other runs", page)) == 1
    assert "cannot tell wheels from radio" in page


def test_radio_without_radio_is_lost_and_said_to_be(material):
    page = report(material, "")
    assert re.search(r"\| radio \|.*∞", page)
    assert "office radio silence 0" in page


def test_worst_moments_are_the_largest_errors(material):
    moments = worst_moments(material)
    assert [moment.error_m for moment in moments] == sorted((moment.error_m for moment in moments), reverse=True)
    for moment in moments:
        error_m = material.series[moment.run.id, moment.contestant.id].error_m
        assert moment.error_m == error_m[np.isfinite(error_m)].max()


def test_command_of_a_worst_moment_finds_that_moment(material, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    moment = worst_moments(material)[0]
    made, shown = (shlex.split(part)[1:] for part in moment.command(material.suite.folder).split(" && "))
    assert main(made) == 0
    found = review(Path(shown[1]), estimators=[moment.contestant.use], worst=5).moments
    assert (moment.at_s, moment.error_m) in [pytest.approx((one.at_s, one.error_m), abs=1e-6) for one in found]
    assert float(shown[shown.index("--at") + 1]) == pytest.approx(moment.at_s, abs=0.006)


def test_logs_are_named_from_where_the_suite_is_named_and_bags_are_imported_first(tmp_path):
    log = tmp_path / "run.mcap"
    log.touch()
    assert as_log(RunSource("mine", mcap="run.mcap"), tmp_path) == ([], log)
    bag = RunSource("bag", mcap="run.mcap", world="w.toml", topics={"odom": "/odom"}, truth_to_map=(1.0, 2.0, 0.5))
    words, made = as_log(bag, tmp_path)
    assert made == Path("bag.mcap")
    parser = argparse.ArgumentParser()
    importing.configure(parser)
    arguments = parser.parse_args(words[2:])
    assert (arguments.kind, arguments.folder) == ("rosbag", log)
    assert (arguments.world, arguments.output) == (tmp_path / "w.toml", made)
    assert arguments.topic == ["odom=/odom"]
    assert arguments.truth_to_map == [1.0, 2.0, 0.5]


def test_contestants_are_ordered_by_the_median_of_what_is_compared(material):
    assert material.contestants == ["wheels", "radio"]
    assert material.comparison.letters.keys() == {"wheels", "radio"}


def test_command_writes_one_file_that_needs_no_network(place, tmp_path, capsys):
    target = tmp_path / "page.html"
    words = ["bench", "report", str(place / "suite.toml"), "--store", str(place / "store"), "--html", str(target)]
    assert main(words) == 0
    assert capsys.readouterr().out == f"{target}\n"
    html = target.read_text(encoding="utf-8")
    assert not re.search(r'(src|href)="(?!data:)', html)
    assert '<meta name="viewport"' in html


@pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium to look at the page with")
def test_browser_draws_the_page_without_console_errors(place, tmp_path):
    target, picture = tmp_path / "page.html", tmp_path / "page.png"
    assert (
        main(["bench", "report", str(place / "suite.toml"), "--store", str(place / "store"), "--html", str(target)])
        == 0
    )
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--window-size=420,2000"]
    done = subprocess.run(
        ["chromium", *options, f"--user-data-dir={tmp_path}/profile", f"--screenshot={picture}", target.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    assert "CONSOLE" not in done.stderr
    assert picture.stat().st_size > 20_000
