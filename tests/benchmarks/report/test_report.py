"""The report of a suite: one page, no network, every part of it there, drawn by a real browser without errors."""

import html
import math
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from benchmarks.limits.fix_bound import rssi_fix_bound
from benchmarks.report.accuracy_figures import cost
from benchmarks.report.cell_links import SCRIPT
from benchmarks.report.report import FIGURES, as_page, report
from benchmarks.report.report_data import ReportData
from benchmarks.report.sensitivity import WITHOUT_TUNE
from benchmarks.report.tables import credibility, faults, fixes, outages
from benchmarks.report.worst import command, worst_moments
from benchmarks.review.review import review
from benchmarks.runner.plan import cells_of
from benchmarks.runner.results import by_estimator, read_results
from benchmarks.runner.run_suite import run_suite
from benchmarks.runner.store import Store
from benchmarks.runner.suite_file import load_suite
from fusion.cli.main import main
from fusion.output.html import as_html
from logs.reader import read_run
from logs.writer import RunWriter
from sensors.simulation.simulate import simulate
from tests.benchmarks.report.browser import CHROMIUM, chromium
from tests.benchmarks.suite_files import write_suite

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
    run_suite(write_suite(folder, SUITE), Store(folder / "store"), workers=1)
    return folder


@pytest.fixture(scope="module")
def data(place):
    suite, store = load_suite(place / "suite.toml"), Store(place / "store")
    return ReportData(suite, read_results(cells_of(suite, store), store), store)


@pytest.fixture(scope="module")
def plain(data):
    """The page, drawn once."""
    return report(data)


def test_page_holds_verdicts_tables_figures_and_provenance(data, plain):
    assert plain.count("data:image/png;base64,") == sum(len(list(draw(data))) for draw in FIGURES.values())
    for part in ("Leaderboard", "Pairs on pos_p75", "Faults", "Worst moments", "Lost cells", "Runs", "Estimators"):
        assert f"**{part}" in plain
    assert "wheels" in plain.splitlines()[2]
    assert f"fusion bench run {shlex.join(data.words)}" in plain
    assert "2 runs, 2 estimators, 1 fault, 1 seed: 8 cells" in plain


def test_cost_is_drawn_once_it_was_measured(place, capsys):
    words = [str(place / "suite.toml"), "--store", str(place / "store")]
    assert main(["bench", "time", *words, "--repeats", "1"]) == 0
    printed = capsys.readouterr().out
    assert "wheels" in printed
    assert "peak MB" in printed
    suite, store = load_suite(place / "suite.toml"), Store(place / "store")
    timed = ReportData(suite, read_results(cells_of(suite, store), store), store)
    assert timed.timing.keys() == {"wheels", "radio"}
    assert "Accuracy against cost" in report(timed)
    assert not list(cost(ReportData(suite, timed.results, Store(place / "never timed"))))


def test_distance_from_the_limit_is_shown_where_it_is_asked_for(data, plain):
    assert "Times the physical limit" not in plain
    page = report(data, limit=True)
    (row,) = re.findall(r"\| wheels \| \[([\d.]+)×\]\(#cell-\d+\) \| \[([\d.]+)×\]\(#cell-\d+\) \|", page)
    assert all(float(ratio) > 0.0 for ratio in row)
    assert "One perfect fix" in page


def test_efficiency_of_fixes_is_that_of_the_bound_at_the_true_places(data):
    cell = data.series["office", "radio"]
    world, bound_m = data.run("office").world, data.fix_bound_m(cell)
    x, y, heading = (float(column[7]) for column in (cell.instants.x, cell.instants.y, cell.instants.heading))
    assert bound_m[7] == pytest.approx(np.sqrt(np.trace(rssi_fix_bound(world, x, y, heading))), rel=1e-12)
    valid = cell.answers.valid
    ratio = np.sqrt(np.mean(bound_m[valid] ** 2) / np.mean(cell.error_m[valid] ** 2))
    (row,) = [row for row in fixes(data).rows if row[0] == "radio"]
    assert row[1] == f"{100.0 * ratio:.0f} %"


def test_credibility_is_shown_where_there_are_enough_seeds(data, plain, tmp_path):
    """Every second reading drawn anew for each seed makes radio fixes err anew; wheels do not hear of it."""
    assert "Credibility" not in plain
    assert credibility(data).rows == (("wheels", "–"), ("radio", "–"))
    text = SUITE.replace('name = "page"', 'name = "page"\nseeds = 5').replace('"wifi" }', '"wifi", p = 0.5 }')
    text = text.replace("duration_s = 20.0", "duration_s = 10.0")
    suite, store = write_suite(tmp_path, text.replace('use = "radio_only"', 'use = "ekf"')), Store(tmp_path / "store")
    run_suite(suite, store, workers=1)
    seeded = ReportData(suite, read_results(cells_of(suite, store), store), store)
    assert "Credibility" in report(seeded)
    rows = {row[0]: row[1:] for row in credibility(seeded).rows}
    assert rows["wheels"] == ("–",)
    nci, incl = map(float, re.fullmatch(r"([\d.]+) \(([+-][\d.]+)\)", rows["radio"][0]).groups())
    assert 0.0 < abs(incl) <= nci


def test_fault_with_windows_is_shown_by_the_errors_inside(plain, tmp_path):
    assert "While a fault lasts" not in plain
    text = SUITE.replace('topic = "wifi" }', 'topic = "wifi", windows = [[5.0, 12.0]] }')
    suite, store = write_suite(tmp_path, text), Store(tmp_path / "store")
    results = run_suite(suite, store, workers=1)
    struck = ReportData(suite, results, store)
    assert "While a fault lasts" in report(struck)
    rows = {row[:2]: row[2:] for row in outages(struck).rows}
    assert rows["silence", "wheels"][0] == "100.0"
    inside = [one.metrics for one in by_estimator(results, "silence")["radio"]]
    for place, key in enumerate(("fault_availability", "fault_max_in_outage")):
        assert rows["silence", "radio"][place] == f"{100.0 * np.median([one[key] for one in inside]):.1f}"
    assert [row[-1] for row in rows.values()] == [row[1] for row in faults(struck).rows]


def test_comparison_within_a_run_is_shown_only_where_it_is_the_only_one(plain, tmp_path):
    assert "within this run" not in plain
    office, _, rest = SUITE.partition('[[runs]]\nid = "mec"')
    suite, store = write_suite(tmp_path, office + rest[rest.index("[[estimators]]") :]), Store(tmp_path / "store")
    run_suite(suite, store, workers=1)
    page = report(ReportData(suite, read_results(cells_of(suite, store), store), store))
    assert len(re.findall(r"- within this run, wheels beats radio by .*; other runs may differ", page)) == 1
    assert "inconclusive between wheels and radio" in page


def test_radio_without_radio_is_lost_and_listed(plain):
    assert re.search(r"\| radio \|.*∞", plain)
    assert "office radio silence 0" in plain


def test_worst_moments_are_the_largest_errors(data):
    found = worst_moments(data.results)
    largest = [result.metrics["pos_max"] for result in found]
    assert largest == sorted(largest, reverse=True)
    for result in found:
        series = data.series[result.cell.run.id, result.cell.estimator.id]
        at = np.argmax(np.where(np.isfinite(series.error_m), series.error_m, -1.0))
        assert result.metrics["pos_max"] == pytest.approx(series.error_m[at], rel=1e-12)
        assert result.worst_at_s == pytest.approx(series.time_s[at], abs=1e-6)


def test_command_of_a_cell_makes_that_cell_again_and_finds_its_worst_moment(data, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (result,) = (one for one in data.results if str(one.cell) == "office wheels silence 0")
    made, shown = (shlex.split(part)[1:] for part in command(result, data.words).split(" && "))
    assert main(made) == 0
    assert "the same to the bit as in the store" in capsys.readouterr().err
    found = review(Path(shown[1]), estimators=[shown[shown.index("--estimators") + 1]], worst=5).moments
    worst = result.worst_at_s, result.metrics["pos_max"]
    assert worst in [pytest.approx((one.at_s, one.error_m), abs=1e-6) for one in found]
    assert float(shown[shown.index("--at") + 1]) == pytest.approx(result.worst_at_s, abs=0.006)


def test_estimators_are_ordered_by_the_median_of_what_is_compared(data):
    assert data.estimators == ["wheels", "radio"]
    assert data.comparison.letters.keys() == {"wheels", "radio"}


def test_markdown_has_the_same_figures_but_nothing_to_click(place, tmp_path):
    target = tmp_path / "report.md"
    words = ["bench", "report", str(place / "suite.toml"), "--store", str(place / "store"), "--markdown", str(target)]
    assert main(words) == 0
    text = target.read_text()
    assert "data:image/png" in text
    assert "data-targets" not in text


def test_command_writes_one_file_that_needs_no_network(place, tmp_path, capsys):
    target = tmp_path / "page.html"
    words = ["bench", "report", str(place / "suite.toml"), "--store", str(place / "store"), "--html", str(target)]
    assert main(words) == 0
    assert capsys.readouterr().out == f"{target}\n"
    page = target.read_text(encoding="utf-8")
    assert not re.search(r'(src|href)="(?!data:|#)', page)
    # Every number leads somewhere, and every cell is there.
    assert set(re.findall(r'href="#([^"]+)"', page)) <= set(re.findall(r'id="([^"]+)"', page))
    assert len(re.findall(r'<li id="cell-\d+">', page)) == 8
    assert '<meta name="viewport"' in page


def rows_of(page, title):
    """The rows of the table under a title, as lists of cells."""
    table = page.partition(f"**{title}")[2].split("\n\n")[1].splitlines()[2:]
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in table]


def entry_of(page, number):
    """The entry of a cell that a number leads to."""
    anchor = re.fullmatch(r"\[.*\]\(#(cell-\d+)\)", number).group(1)
    return re.search(rf'<li id="{anchor}">(.*)</li>', page).group(1)


def test_numbers_lead_to_the_cells_they_come_from(data, plain):
    for run_id, *numbers in rows_of(plain, "Run by run"):
        for name, number in zip(data.estimators, numbers, strict=True):
            entry = entry_of(plain, number)
            assert entry.startswith(f"{run_id}: ")
            assert f" {run_id} {name} -o " in entry
            assert f"pos_p75 {re.match(r'.(.*?)]', number).group(1)} cm" in entry
    for name, number in rows_of(plain, "Faults"):
        assert f" {name} --fault silence " in entry_of(plain, number)
    for row in rows_of(plain, "Leaderboard"):
        p75 = entry_of(plain, row[9])
        assert f"pos_p75 {re.match(r'.(.*?)]', row[9]).group(1)} cm" in p75 or len(data.scored_runs) % 2 == 0
        worst = entry_of(plain, row[4])
        assert f"pos_p75 {re.match(r'.(.*?)]', row[4]).group(1)} cm" in worst
    (anchor,) = re.findall(r"^- .*\(\[where\]\(#(cell-\d+)\)\)$", plain, re.MULTILINE)
    assert " radio -o " in entry_of(plain, f"[x](#{anchor})")


CLICKED = """
<script>
addEventListener("load", () => {
  document.querySelector('td a[href="#cell-0"], td a[href="#cell-1"]').click();
  setTimeout(() => {
    const entry = document.getElementById(location.hash.slice(1));
    const button = entry.querySelector("button");
    button.click();
    const copied = `${button.textContent} ${getSelection()}`;
    document.body.dataset.found = [entry.matches(":target"), entry.closest("details").open, copied].join(";");
  }, 200);
});
</script>
"""


@CHROMIUM
def test_click_on_a_number_opens_its_cell_and_its_command_can_be_copied(plain, tmp_path):
    page = tmp_path / "page.html"
    page.write_bytes(as_html("page", plain, SCRIPT).replace(b"</body>", CLICKED.encode() + b"</body>"))
    done = chromium(tmp_path, "--virtual-time-budget=5000", "--dump-dom", page.as_uri())
    shown = html.unescape(re.search(r'data-found="([^"]*)"', done.stdout).group(1))
    assert re.fullmatch(r"true;true;(copied|press Ctrl-C) fusion bench replay .* --at [0-9.]+", shown)
    assert "CONSOLE" not in done.stderr


@CHROMIUM
def test_browser_draws_the_page_without_console_errors(place, tmp_path):
    target, picture = tmp_path / "page.html", tmp_path / "page.png"
    assert (
        main(["bench", "report", str(place / "suite.toml"), "--store", str(place / "store"), "--html", str(target)])
        == 0
    )
    done = chromium(tmp_path, "--window-size=420,2000", f"--screenshot={picture}", target.as_uri())
    assert "CONSOLE" not in done.stderr
    assert picture.stat().st_size > 20_000


def test_page_is_a_baseline_for_the_gate(place, data, tmp_path, capsys):
    page, gated = tmp_path / "page.html", tmp_path / "gated.toml"
    page.write_bytes(as_page(data))
    gated.write_text(SUITE + "[gate]\nratio = { pos_p75 = 0.05 }\n", encoding="utf-8")
    words = ["bench", "gate", str(gated), "--store", str(place / "store"), "--baseline", str(page)]
    assert main(words) == 0
    assert capsys.readouterr().out.count("pos_p75 is what it was") == len(data.estimators)
    text = page.read_text(encoding="utf-8")
    page.write_text(re.sub(r'"pos_p75": [\d.e-]+', '"pos_p75": 1e-9', text), encoding="utf-8")
    assert main(words) == 1
    page.write_text("<!doctype html>", encoding="utf-8")
    assert main(words) == 2
    assert "the page holds no numbers" in capsys.readouterr().out


GRID = """
[suite]
name = "grid"
[[runs]]
id = "office"
scenario = "office"
duration_s = 10.0
split = "tune"
[[runs]]
id = "mec"
scenario = "mec"
duration_s = 10.0
[[runs]]
id = "arena"
scenario = "arena"
duration_s = 10.0
[[estimators]]
id = "radio"
use = "radio_only"
grid = { window_s = [1.0, 2.5] }
"""


@pytest.fixture(scope="module")
def grids(tmp_path_factory):
    """A folder whose store keeps the cells that these suites have in common."""
    return tmp_path_factory.mktemp("grids")


def grid_of(folder, text):
    suite, store = write_suite(folder, text), Store(folder / "store")
    run_suite(suite, store, workers=1)
    return ReportData(suite, read_results(cells_of(suite, store), store), store)


def test_parameters_of_a_grid_are_compared_with_the_default_tune_runs_apart(plain, grids):
    assert "**Parameters" not in plain
    grid = grid_of(grids, GRID)
    page = report(grid)
    first, second = rows_of(page, "Parameters")
    assert second == ["radio", "window_s", "2.5 (default)", "–", "–"]
    p75 = {(one.cell.run.id, one.cell.estimator.id): one.metrics["pos_p75"] for one in grid.results}
    ratio = {
        run: p75[run, "radio[window_s=1.0]"] / p75[run, "radio[window_s=2.5]"] for run in ("office", "mec", "arena")
    }
    assert first[3].startswith(f"[{ratio['office']:.2f}×](")
    assert first[4].startswith(f"[{math.sqrt(ratio['mec'] * ratio['arena']):.2f}× [")
    assert "radio: on the tune runs window_s = " in page
    assert [row[0] for row in rows_of(page, "Run by run")] == ["mec", "arena"]
    assert "office (tune)" in page
    assert WITHOUT_TUNE not in page


def test_grid_without_tune_runs_warns_that_it_flatters(grids):
    assert WITHOUT_TUNE in report(grid_of(grids, GRID.replace('split = "tune"', "")))


def test_suite_of_nothing_but_tune_runs_warns_of_it(grids):
    _, head, rest = GRID.partition("[[estimators]]")
    runs = GRID[: GRID.index('[[runs]]\nid = "mec"')]
    assert "**All runs are for tuning**" in report(grid_of(grids, runs + head + rest))


LOST = """
[suite]
name = "lost"
[[runs]]
id = "office"
scenario = "office"
duration_s = 6.0
[[estimators]]
id = "broken"
use = "particle"
params = { particles = 1_000_000_000_000_000 }
"""


def test_estimator_that_crashed_everywhere_leaves_a_page_that_states_why_and_draws_nothing(tmp_path):
    page = report(grid_of(tmp_path, LOST))
    ((cell, status, why),) = rows_of(page, "Lost cells")
    assert (status, cell) == ("crashed", "[office broken clean 0](#cell-0)")
    assert why.startswith("`")
    assert "Particle failed at its start: MemoryError" in why
    assert "data:image" not in page
    assert "1 run, 1 estimator, no faults, 1 seed: 1 cell." in page


def test_runs_without_truth_rank_nobody_and_are_named(tmp_path):
    seen = read_run(simulate("office", tmp_path / "seen.mcap", duration_s=10.0))
    with RunWriter(tmp_path / "blind.mcap", seen.world, name="blind", prior=seen.prior) as log:
        for measurement in seen.measurements:
            log.write(measurement)
    blind = '[[runs]]\nid = "blind"\nmcap = "blind.mcap"\n'
    estimators = "".join(
        f'[[estimators]]\nid = "{name}"\nuse = "{name}"\n' for name in ("dead_reckoning", "radio_only")
    )
    alone = report(grid_of(tmp_path, f'[suite]\nname = "blind"\n{blind}{estimators}'))
    assert "Nothing can be compared" in alone
    assert "∞" not in alone
    assert "data:image" not in alone
    beside = f'[suite]\nname = "both"\n{blind}[[runs]]\nid = "seen"\nmcap = "seen.mcap"\n{estimators}'
    page = report(grid_of(tmp_path, beside))
    assert "Without ground truth, and so without an error: blind." in page
    assert [row[0] for row in rows_of(page, "Run by run")] == ["seen"]
    assert all(row[2].startswith("[1/1]") for row in rows_of(page, "Leaderboard"))
