"""The map of a site is really drawn, and shows what it should."""

import struct
import sys

import numpy as np
import pytest

from benchmarks.limits.floor_plan import plan_site
from fusion import FusionError
from fusion.cli.main import main

pytest.importorskip("matplotlib", reason="needs the extra `plots`")
from benchmarks.limits import floor_picture as site_picture
from fusion.output import figures as plotting


@pytest.fixture(scope="module")
def plan():
    return plan_site("office", add=True, move=True, step_m=0.5)


def texts(figure):
    from matplotlib.text import Text

    return [text.get_text() for text in figure.findobj(Text)]


def test_picture_is_a_png_with_a_drawing_in_it(tmp_path):
    output = tmp_path / "new" / "map.png"
    assert main(["bound", "office", "--add", "--step", "0.5", "--png", str(output)]) == 0
    content = output.read_bytes()
    assert content.startswith(b"\x89PNG")
    wide, high = struct.unpack(">II", content[16:24])
    assert wide == int(site_picture.WIDTH_IN * plotting.DOTS_PER_INCH)
    assert 500 < high < 1500
    assert len(content) > 40_000, "an empty page is a smaller picture"


def test_picture_is_the_same_for_the_same_plan(plan, tmp_path):
    for name in "ab":
        site_picture.draw(plan, tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_anchors_axes_colours_and_proposals_are_labelled(plan):
    shown = texts(site_picture.picture(plan))
    assert {"ap1", "ap2", "ap3", "x, m", "y, m", "root mean square error, m", "anchor"} <= set(shown)
    assert any(text.startswith("best place for one more") for text in shown)
    assert any(text.startswith("best move: ap1") for text in shown)
    assert any(text.endswith(" m") and text[0].isdigit() for text in shown), "contours are labelled"


def test_names_of_a_hundred_anchors_can_be_distinguished(tmp_path):
    table = "".join(
        f'[[anchors]]\nid = "a{i:02d}"\nposition_m = [{4.0 * (i % 10)}, {3.0 * (i // 10) + 0.7 * (i % 3)}]\n'
        for i in range(100)
    )
    (tmp_path / "w.toml").write_text(table)
    figure = site_picture.picture(plan_site(tmp_path / "w.toml", step_m=4.0))
    figure.draw_without_rendering()
    names = [text for text in figure.axes[0].texts if text.get_text().startswith("a")]
    boxes = [text.get_window_extent() for text in names]
    assert len(boxes) == 100
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


def test_map_walls_and_anchors_stand_in_their_places(plan):
    figure = site_picture.picture(plan)
    axes = figure.axes[0]
    (image,) = axes.images
    assert image.get_extent() == [0.0, 12.0, 0.0, 9.0]
    assert image.origin == "lower"
    assert np.asarray(image.get_array()).tolist() == plan.error_m.tolist()
    lines = [tuple(zip(*line.get_data(), strict=True)) for line in axes.lines]
    assert {tuple(map(tuple, wall)) for wall in plan.world.walls} <= set(lines)
    assert {((anchor.x, anchor.y),) for anchor in plan.world.anchors} <= set(lines)
    assert {((each.anchor.x, each.anchor.y),) for each in plan.proposals} <= set(lines)


def test_contour_labels_keep_apart_from_anchors(plan):
    from matplotlib.text import Text

    axes = site_picture.picture(plan).axes[0]
    labels = [t for t in axes.findobj(Text) if t.get_text().endswith(" m") and t.get_text()[0].isdigit()]
    assert labels
    for label in labels:
        away = [np.hypot(label.get_position()[0] - a.x, label.get_position()[1] - a.y) for a in plan.world.anchors]
        assert min(away) > 0.5


def test_floor_where_nothing_is_defined_is_drawn_grey_and_not_refused(tmp_path):
    world = tmp_path / "flat.toml"
    rows = "".join(
        f'[[anchors]]\nid = "{i}"\nposition_m = {place}\n' for i, place in enumerate(([0, 0], [9, 0], [0, 9]))
    )
    world.write_text(rows + "[radio]\nreference_distance_m = 500.0\n")
    site_picture.draw(plan_site(world, step_m=1.0), tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 10_000


def test_floor_of_one_cell_is_drawn(tmp_path):
    site_picture.draw(plan_site("office", step_m=100.0), tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 10_000


def test_without_matplotlib_the_remedy_is_reported_before_any_work(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert main(["bound", "no such site", "--png", str(tmp_path / "map.png")]) == 1
    assert "pip install 'fusion-localization[plots]'" in capsys.readouterr().err


def test_picture_that_cannot_be_written_is_reported(plan, tmp_path):
    with pytest.raises(FusionError, match="cannot be written"):
        site_picture.draw(plan, tmp_path)
