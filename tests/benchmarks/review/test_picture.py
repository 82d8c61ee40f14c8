"""Pictures by the real viewer, and what is reported where there is none."""

import struct
import sys
from contextlib import contextmanager
from urllib.request import urlopen

import pytest

from benchmarks.review import blueprint, picture, viewer
from benchmarks.review.picture import SIZE, headless_viewer, render
from benchmarks.review.review import review
from benchmarks.review.window import has_display, open_viewer, serve_web
from fusion import FusionError, LogError, PluginError, ViewerError


@contextmanager
def excused():
    """Only a machine that cannot draw is excused: a view's own error is not."""
    try:
        yield
    except ViewerError as error:
        if not str(error).startswith((picture.NO_DRIVER, viewer.NO_RERUN)):
            raise
        pytest.skip(str(error))


@pytest.mark.viewer
def test_review_with_a_counterfactual_is_drawn_by_the_real_viewer(log, tmp_path):
    image = tmp_path / "new folder" / "review.png"
    with excused():
        review(log, estimators=["dead_reckoning", "ekf"], png=image, at_s=5.0, without=["ap1"])
    content = image.read_bytes()
    assert content.startswith(b"\x89PNG")
    assert struct.unpack(">II", content[16:24]) == SIZE
    assert len(content) > 40_000, "an empty window is a smaller picture"


@pytest.mark.viewer
def test_pages_behind_the_first_are_drawn_without_an_error_of_a_view(log, tmp_path, monkeypatch):
    rrb = pytest.importorskip("rerun.blueprint", reason="needs the extra `review`")

    def all_pages(frame, run, drawn):
        pages = (blueprint._readings(run, drawn), blueprint._motion(run), blueprint.table_view(drawn))
        return rrb.Grid(*pages, blueprint.event_view("radio_only"))

    monkeypatch.setattr(blueprint, "_overview", all_pages)
    with excused():
        review(log, estimators=["ekf", "radio_only"], png=tmp_path / "pages.png")
    assert (tmp_path / "pages.png").stat().st_size > 40_000


@pytest.mark.viewer
def test_layers_are_one_recording_and_the_cursor_goes_where_it_is_sent(log, tmp_path):
    files = review(log, estimators=["dead_reckoning", "ekf"], save=tmp_path / "layers").files
    with excused(), headless_viewer([files[0], files[2]]) as session:
        assert session.go_to(4.25) == 4_250_000_000
        until, client = session.viewer.until, session.client
        recording = until("the cursor there", lambda: stands_at(client, 4_250_000_000))
        assert session.go_to(1e6) == recording.timelines[0].end
        paths = until("the layer", lambda: paths_with(client, "/map/estimate/ekf/path"))
        assert "/map/truth/path" in paths
        assert "/map/estimate/dead_reckoning/path" not in paths


def stands_at(client, time_ns):
    (recording,) = client.get_state().recordings
    return recording if recording.current_time == time_ns else None


def paths_with(client, path):
    paths = {entity.entity_path for entity in client.get_recording_schema(paths_only=True).entities}
    return paths if path in paths else None


def test_web_viewer_answers_on_this_machine_and_ends_with_the_block(log, tmp_path):
    pytest.importorskip("rerun", reason="needs the extra `review`")
    files = review(log, estimators=["dead_reckoning"], save=tmp_path / "review.rrd").files
    with serve_web(files) as served:
        assert served.address.startswith("http://127.0.0.1:")
        assert b"<html" in urlopen(served.address).read()
    assert served.process.poll() is not None


def test_without_rerun_the_remedy_is_reported(log, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(ViewerError, match=r"pip install 'fusion-localization\[review\]'"):
        review(log, save=tmp_path / "review.rrd")


def test_without_a_display_it_proposes_what_to_do_instead(log, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert not has_display()
    with pytest.raises(ViewerError, match=r"--png OUT\.png .* --save OUT\.rrd .* --web"):
        review(log)


def test_viewer_that_ends_at_once_is_reported_with_the_remedy(tmp_path, monkeypatch):
    pytest.importorskip("rerun", reason="needs the extra `review`")
    scene = tmp_path / "review.rrd"
    scene.write_bytes(b"")
    stub = tmp_path / "viewer"
    stub.write_text("#!/bin/sh\nexit 1\n")
    stub.chmod(0o755)
    monkeypatch.setattr(viewer, "program", lambda: str(stub))
    with pytest.raises(ViewerError, match=r"mesa-vulkan-drivers.*it ended with exit code 1: no message"):
        render([scene], tmp_path / "review.png")
    assert not (tmp_path / "review.png").exists()
    with pytest.raises(ViewerError, match=r"open it elsewhere .*it ended with exit code 1: no message"):
        open_viewer([scene])
    with (
        pytest.raises(ViewerError, match=r"open it elsewhere .*it ended with exit code 1: no message"),
        serve_web([scene]),
    ):
        pass
    monkeypatch.setattr(viewer, "program", lambda: str(scene))
    with pytest.raises(ViewerError, match="Permission denied"):
        open_viewer([scene])


def test_picture_that_cannot_be_written_is_reported(tmp_path):
    pytest.importorskip("rerun", reason="needs the extra `review`")
    (tmp_path / "scene.rrd").write_bytes(b"")
    (tmp_path / "file").write_bytes(b"")
    for nowhere in (tmp_path / "file" / "review.png", tmp_path):
        with pytest.raises(FusionError, match="cannot be written"):
            render([tmp_path / "scene.rrd"], nowhere)


def test_missing_scene_log_and_estimator_are_refused(log, tmp_path):
    pytest.importorskip("rerun", reason="needs the extra `review`")
    with pytest.raises(ViewerError, match="no such file"):
        render([tmp_path / "none.rrd"], tmp_path / "review.png")
    with pytest.raises(LogError, match="no such file"):
        review(tmp_path / "none.mcap", save=tmp_path / "review.rrd")
    with pytest.raises(PluginError, match="did you mean 'ekf'"):
        review(log, estimators=["efk"], save=tmp_path / "review.rrd")
