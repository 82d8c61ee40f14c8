"""Real recordings against the figures published with them; nothing here was tuned on them."""

import dataclasses
from pathlib import Path

import pytest

from fusion import World
from fusion.radio import Ranging
from logs.cli.import_ import import_recordings
from logs.reader import read_run
from sensors.calibration.odometry import calibrate_odometry
from sensors.calibration.radio import calibrate_radio

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"


def recorded(kind, folder, output):
    if not (DATA / folder).is_dir():
        pytest.skip(f"the recordings of {folder} are not here")
    return [read_run(path) for path in import_recordings(kind, DATA / folder, output)]


def uncalibrated(run):
    """The run as if nobody had known its ranges' scale and offset."""
    anchors = tuple(dataclasses.replace(anchor, ranging=Ranging()) for anchor in run.world.anchors)
    assert isinstance(run.world, World)
    return dataclasses.replace(run, world=dataclasses.replace(run.world, anchors=anchors))


def rms_left_out(found):
    return next(score for score in found.scores if score.what == "block of places left out: reading, rms")


def test_ranges_of_plaza_read_seven_percent_long(tmp_path):
    """Published with it: range = 1.0693 distance + 0.032 m, 0.505 m left."""
    (run,) = recorded("plaza", "plaza", tmp_path)
    found = calibrate_radio([uncalibrated(run)], "range")
    assert found.line.gain_interval().holds(1.0693)
    assert found.line.level_interval().holds(0.032)
    score = rms_left_out(found)
    assert score.before > 2.5
    assert score.after < 0.6


def test_ranges_of_the_labyrinth_read_a_decimetre_long(tmp_path):
    """Published with it: 0.118 m too long on average, over distances of about two metres."""
    (run,) = recorded("tuc", "tuc_labyrinth_uwb", tmp_path)
    found = calibrate_radio([uncalibrated(run)], "range")
    middle = found.readings.distance_m.mean()
    assert found.line.gain * middle + found.line.level - middle == pytest.approx(0.118, abs=0.03)
    score = rms_left_out(found)
    assert score.after < 0.8 * score.before


def test_wheels_of_plaza_are_told_better_on_the_other_half(tmp_path):
    (run,) = recorded("plaza", "plaza", tmp_path)
    length = next(score for score in calibrate_odometry([run]).scores if score.what == "length of a piece")
    assert length.after < 0.6 * length.before
