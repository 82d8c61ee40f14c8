"""Pictures by the real viewer, and what is said where there is none."""

import struct
import sys

import pytest

from benchmarks import picture
from benchmarks.picture import SIZE, has_display, render
from benchmarks.review import review
from fusion import LogError, PluginError, ViewerError
from sensors.simulate import simulate


@pytest.fixture
def log(tmp_path):
    return simulate("office", tmp_path / "run.mcap", duration_s=10.0)


@pytest.mark.viewer
def test_review_is_drawn_by_the_real_viewer(log, tmp_path):
    image = tmp_path / "new folder" / "review.png"
    try:
        review(log, estimators=["dead_reckoning"], png=image, at_s=5.0)
    except ViewerError as error:
        # Only a machine that cannot draw is excused: a view's own error is not.
        if not str(error).startswith((picture.NO_DRIVER, picture.NO_RERUN)):
            raise
        pytest.skip(str(error))
    content = image.read_bytes()
    assert content.startswith(b"\x89PNG")
    assert struct.unpack(">II", content[16:24]) == SIZE
    assert len(content) > 40_000, "an empty window is a smaller picture"


def test_without_rerun_the_remedy_is_told(log, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(ViewerError, match=r"pip install 'fusion-localization\[review\]'"):
        review(log, save=tmp_path / "review.rrd")


def test_without_a_display_it_says_what_to_do_instead(log, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert not has_display()
    with pytest.raises(ViewerError, match=r"--png OUT\.png .* --save OUT\.rrd"):
        review(log)


def test_viewer_that_ends_at_once_is_told_with_the_remedy(tmp_path, monkeypatch):
    pytest.importorskip("rerun", reason="needs the extra `review`")
    scene = tmp_path / "review.rrd"
    scene.write_bytes(b"")
    monkeypatch.setattr(picture, "_program", lambda: "false")
    with pytest.raises(ViewerError, match="mesa-vulkan-drivers"):
        render(scene, tmp_path / "review.png")


def test_missing_scene_log_and_estimator_are_refused(log, tmp_path):
    pytest.importorskip("rerun", reason="needs the extra `review`")
    with pytest.raises(ViewerError, match="no such file"):
        render(tmp_path / "none.rrd", tmp_path / "review.png")
    with pytest.raises(LogError, match="no such file"):
        review(tmp_path / "none.mcap", save=tmp_path / "review.rrd")
    with pytest.raises(PluginError, match="did you mean 'ekf'"):
        review(log, estimators=["efk"], save=tmp_path / "review.rrd")
