"""The figures of a report: nothing cut, nothing shown by colour alone, and from every point a click that leads to its
cell, tried in a real browser.
"""

import html
import json
import math
import re
from io import BytesIO

import numpy as np
import pytest

from benchmarks.report.accuracy_figures import LEADING, accuracy, over_time
from benchmarks.report.consistency import consistency
from benchmarks.report.innovations import innovations
from benchmarks.report.maps import maps
from benchmarks.report.report import FIGURES, as_page
from benchmarks.report.report_data import ReportData
from benchmarks.report.sensitivity import curves, sweeps
from benchmarks.runner.run_suite import run_suite
from benchmarks.runner.store import Store
from fusion.cli.main import main
from fusion.output.figures import as_png, plain_colour
from tests.benchmarks.report.browser import CHROMIUM, chromium
from tests.benchmarks.suite_files import write_suite

SUITE = """
[suite]
name = "figures"
[[runs]]
id = "office"
scenario = "office"
duration_s = 20.0
[[runs]]
id = "mec"
scenario = "mec"
duration_s = 20.0
[[runs]]
id = "arena"
scenario = "arena"
duration_s = 20.0
split = "tune"
[[estimators]]
id = "wheels"
use = "dead_reckoning"
[[estimators]]
id = "ekf"
use = "ekf"
[[estimators]]
id = "radio"
use = "radio_only"
grid = { window_s = [1.0, 2.5] }
"""


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("figures")
    suite, store = write_suite(folder, SUITE), Store(folder / "store")
    results = run_suite(suite, store, workers=1)
    assert main(["bench", "time", str(folder / "suite.toml"), "--store", str(folder / "store"), "--repeats", "1"]) == 0
    return ReportData(suite, results, store)


@pytest.fixture(scope="module")
def panels(data):
    """All of them, by the name of their figure."""
    drawn = {name: list(draw(data)) for name, draw in FIGURES.items()}
    return drawn | {"parameters": list(curves(data, sweeps(data)))}


def targets_of(panel):
    """Targets of a panel, as the page has them."""
    return json.loads(html.unescape(re.search(r'data-targets="([^"]*)"', panel.block()).group(1)))


def entry_of(data, anchor):
    """Run and estimator of the cell that an anchor leads to."""
    (cell,) = (result.cell for result in data.results if data.anchor(result) == anchor)
    return cell.run.id, cell.estimator.id


def test_every_figure_is_drawn_whole(panels):
    assert {name: len(drawn) for name, drawn in panels.items()} == {
        "accuracy": 2,
        "consistency": 2,
        "over_time": 2,
        "maps": 2,
        "cost": 1,
        "parameters": 1,
    }
    for panel in (panel for drawn in panels.values() for panel in drawn):
        as_png(panel.figure)
        inked, (width, height) = panel.figure.get_tightbbox(), panel.figure.get_size_inches()
        assert inked.x0 >= 0.0, panel.title
        assert inked.y0 >= 0.0, panel.title
        assert inked.x1 <= width, panel.title
        assert inked.y1 <= height, panel.title


def test_every_panel_leads_to_cells_that_it_names(panels, data):
    for panel in (panel for drawn in panels.values() for panel in drawn):
        assert targets_of(panel)
        for anchor, caption, *_ in targets_of(panel):
            run_id, estimator = entry_of(data, anchor)
            assert estimator.partition("[")[0] in caption
            assert run_id in caption or panel.title == "Accuracy against cost"


def test_what_leads_lies_where_the_picture_has_ink_of_that_colour(panels, data):
    """The places are worked out apart from the picture: here they are looked up in it."""
    from matplotlib.image import imread

    for panel in (panels["accuracy"][1], *panels["consistency"], *panels["cost"]):
        pixels = imread(BytesIO(as_png(panel.figure)))[:, :, :3]
        for anchor, caption, xs, ys in targets_of(panel):
            colour = plain_colour(data.use(entry_of(data, anchor)[1]))
            row, column = (int(place * size / 1e4) for place, size in zip((ys[0], xs[0]), pixels.shape, strict=False))
            near = pixels[row - 2 : row + 3, column - 2 : column + 3].reshape(-1, 3)
            assert np.abs(near - colour).max(axis=1).min() < 0.1, caption


def test_line_over_time_leads_to_its_moments_the_worst_among_them(data):
    for panel, run_id in zip(over_time(data), data.scored_runs, strict=True):
        found = {entry_of(data, anchor): times for anchor, _, _, _, times in targets_of(panel)}
        assert {name for _, name in found} == set(data.estimators)
        for (run, name), times in found.items():
            result = data.series[run, name].result
            assert run == run_id
            assert len(times) <= LEADING
            assert min(abs(np.array(times) - result.worst_at_s)) < 0.006


def test_track_on_a_map_leads_to_the_moment_it_was_there(data):
    panel, series = next(maps(data)), data.series["office", data.estimators[0]]
    ((_, _, xs, ys, times),) = targets_of(panel)
    pixels = np.column_stack([xs, 1e4 - np.array(ys)]) / 1e4 * panel.figure.bbox.size
    there = panel.axes.transData.inverted().transform(pixels)
    at = [int(np.argmin(abs(series.time_s - time_s))) for time_s in times]
    assert there == pytest.approx(np.column_stack([series.answers.x[at], series.answers.y[at]]), abs=0.02)


def test_point_of_a_distribution_leads_to_the_instant_with_that_error(data):
    panel = next(accuracy(data))
    for anchor, _, xs, _, times in targets_of(panel):
        series = data.series[entry_of(data, anchor)]
        pixels = np.column_stack([xs, np.zeros(len(xs))]) / 1e4 * panel.figure.bbox.size
        error_cm = panel.axes.transData.inverted().transform(pixels)[:, 0]
        at = [int(np.argmin(abs(series.time_s - time_s))) for time_s in times]
        assert error_cm == pytest.approx(100.0 * series.error_m[at], rel=0.01)


def test_consistency_draws_what_the_tables_show_and_crosses_what_lies_outside(data):
    answers, readings = consistency(data)
    cells = [one for one in data.results if one.cell.run.split == "test" and np.isfinite(one.metrics["anees"])]
    assert {anchor for anchor, *_ in targets_of(answers)} == {data.anchor(one) for one in cells}
    means = [mean for row in innovations(data).rows for mean in row[3:]]
    assert means
    assert [link_of(*target[:2]) for target in targets_of(readings)] == [mean.replace("**", "") for mean in means]
    bands = [[one.metrics[f"anees{key}"] for key in ("_band_low", "", "_band_high")] for one in cells]
    outside = sum(band != sorted(band) for band in bands)
    assert 0 < outside < len(cells)
    assert (markers(answers, crosses=True), markers(answers, crosses=False)) == (outside, len(cells) - outside)


def link_of(anchor, caption):
    """A point of the figure as the table has it."""
    mean, band = caption.partition("wifi ")[2].split(" ", 1)
    return f"[{mean}](#{anchor}) {band}"


def markers(panel, *, crosses):
    """How many there are; a cross is two strokes, a dot has more corners."""
    from matplotlib.collections import PathCollection

    drawn = [one for one in panel.axes.collections if isinstance(one, PathCollection)]
    return sum(len(one.get_offsets()) for one in drawn if (len(one.get_paths()[0].vertices) == 4) == crosses)


CLICKS = """
<script>
function click(figure, [cell, caption, xs, ys, times]) {
  const k = Math.floor(xs.length / 2), image = figure.firstElementChild;
  image.scrollIntoView({ block: "center" });
  const box = image.getBoundingClientRect();
  const x = box.left + box.width * xs[k] / 1e4, y = box.top + box.height * ys[k] / 1e4;
  const at = { clientX: x, clientY: y, bubbles: true };
  const hit = document.elementFromPoint(x, y);
  hit.dispatchEvent(new PointerEvent("pointermove", at));
  hit.dispatchEvent(new MouseEvent("click", at));
  dispatchEvent(new HashChangeEvent("hashchange"));  // the browser's own comes after the load, when all is over
  const hint = figure.querySelector("small").textContent;
  const hash = location.hash.slice(1), entry = document.getElementById(hash);
  const moment = entry.querySelector(".moment code")?.textContent;
  const place = entry.getBoundingClientRect();
  const shown = entry.checkVisibility() && place.top >= 0 && place.bottom <= innerHeight;
  const size = [box.width, box.height];
  return { title: image.alt, x: xs[k], y: ys[k], size, hash, hint, shown, moment };
}
addEventListener("load", () => {
  const found = [];
  for (const figure of document.querySelectorAll("[data-targets]")) {
    for (const target of JSON.parse(figure.dataset.targets)) found.push(click(figure, target));
  }
  document.body.dataset.found = JSON.stringify(found);
});
</script>
"""


@CHROMIUM
@pytest.mark.parametrize("size", ["1200,900", "500,800"])
def test_click_on_any_point_shows_its_cell_and_the_command_for_its_moment(data, panels, tmp_path, size):
    page = tmp_path / "page.html"
    page.write_bytes(as_page(data).replace(b"</body>", CLICKS.encode() + b"</body>"))
    words = (f"--window-size={size}", "--dump-dom", page.as_uri())
    done = chromium(tmp_path, *words)
    assert "CONSOLE" not in done.stderr
    clicked = json.loads(html.unescape(re.search(r'data-found="([^"]*)"', done.stdout).group(1)))
    drawn = {panel.title: targets_of(panel) for every in panels.values() for panel in every}
    assert {one["title"] for one in clicked} == drawn.keys()
    for one in clicked:
        near = near_to(one, drawn[one["title"]])
        assert one["shown"]
        time_s = float(one["moment"].partition("--at ")[2].split()[0]) if one["hint"].endswith(" s") else None
        assert (one["hash"], time_s) in near
        assert time_s is None or one["hint"].endswith(f", at {time_s:.2f} s")


def near_to(clicked, targets):
    """Anchors and times of what may be nearest to a click: a program's hits whole pixels only, up to the square root of
    two beside what it aims at, and something else may lie no farther on the other side.
    """
    width, height = clicked["size"]
    return {
        (anchor, times[0][k] if times else None)
        for anchor, _, xs, ys, *times in targets
        for k in range(len(xs))
        if np.hypot(width * (xs[k] - clicked["x"]), height * (ys[k] - clicked["y"])) <= 2.0 * math.sqrt(2.0) * 1e4
    }
