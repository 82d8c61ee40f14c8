"""The picture for machines on which Rerun cannot draw: its lines are the tracks and errors of the bench."""

import struct
import sys
from dataclasses import replace

import numpy as np
import pytest

import fusion
from benchmarks.review.drawing import SHOWN, drawings
from benchmarks.review.folding import fold
from benchmarks.review.plain_picture import draw_plainly, figure
from benchmarks.runner.adhoc_suite import bench
from fusion import FusionError
from fusion.output.colours import ANCHOR, TRUTH, colour_of
from fusion.output.figures import plain

NAMES = ("dead_reckoning", "ekf")


class Broken:
    """Ends in an error as soon as it starts."""

    summary, tags = "broken", frozenset()

    def __init__(self, world):
        pass

    def start(self, prior, seed):
        raise ZeroDivisionError("on purpose")


def folded(run, names):
    return fold(run, {name: {} for name in names}, 0)


def drawn(run, names):
    return figure(run, drawings(run, folded(run, names)))


def lines(axes, colour):
    return [line for line in axes.lines if line.get_color() == plain(colour) and line.get_linestyle() != "None"]


def test_each_estimator_has_a_floor_with_its_track_the_truth_and_the_anchors(run):
    pytest.importorskip("matplotlib")
    reviewed = folded(run, NAMES)
    *maps, _ = figure(run, drawings(run, reviewed)).axes
    assert len(maps) == len(NAMES)
    for axes, drawing in zip(maps, drawings(run, reviewed), strict=True):
        p75_cm = 100.0 * drawing.score.metrics["pos_p75"]
        assert axes.get_title() == f"{drawing.name}: 75 % of errors below {p75_cm:.1f} cm"
        (track,), (truth,) = lines(axes, drawing.colour), lines(axes, TRUTH)
        assert np.array_equal(track.get_xydata(), drawing.track.xy)
        assert np.array_equal(truth.get_xydata(), np.column_stack([run.truth.x, run.truth.y]))
        anchors = [line.get_xydata()[0].tolist() for line in axes.lines if line.get_color() == plain(ANCHOR)]
        assert anchors == [[anchor.x, anchor.y] for anchor in run.world.anchors]


def test_errors_over_time_are_those_of_the_bench(run, log):
    pytest.importorskip("matplotlib")
    axes = drawn(run, NAMES).axes[-1]
    for result in bench([log], estimators=NAMES, workers=1):
        (line,) = lines(axes, colour_of(result.estimator))
        assert np.sqrt(np.mean(line.get_ydata() ** 2)) == pytest.approx(result.metrics["pos_rmse"])
        assert 0.0 <= line.get_xdata()[0] < 1.0


def test_the_best_are_drawn_and_counted(run):
    pytest.importorskip("matplotlib")
    names = fusion.names()
    made = drawn(run, names)
    assert len(made.axes) == SHOWN + 1
    assert f"the {SHOWN} best of {len(names)} estimators" in made.get_suptitle()


def test_run_without_truth_and_estimator_that_crashed_are_drawn_as_far_as_they_go(run, tmp_path):
    pytest.importorskip("matplotlib")
    floor, errors = drawn(replace(run, truth=None), ["ekf"]).axes
    assert floor.get_title() == "ekf"
    assert not lines(floor, TRUTH)
    assert not errors.lines
    with fusion.registered("broken", Broken):
        floor, errors = drawn(run, ["broken"]).axes
        assert floor.get_title() == "broken: crashed"
        assert not errors.lines
        draw_plainly(run, folded(run, ["broken"]), tmp_path / "broken.png")


def test_file_is_the_same_picture_each_time(run, tmp_path):
    pytest.importorskip("matplotlib")
    reviewed = folded(run, NAMES)
    first, second = (draw_plainly(run, reviewed, tmp_path / name).read_bytes() for name in ("1.png", "2.png"))
    assert first == second
    width, height = struct.unpack(">II", first[16:24])
    assert width > 1000 < 2 * height


def test_without_matplotlib_the_remedy_is_named(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(FusionError, match=r"pip install 'fusion-localization\[plots\]'"):
        draw_plainly(run, [], tmp_path / "review.png")
