"""Agreement with evo, run as a program where it is installed: it is GPL, so it is never imported or shipped.

Put `evo_ape` and `evo_rpe` on the PATH to run this.
"""

import json
import os
import shutil
import subprocess
import zipfile

import numpy as np
import pytest

from benchmarks.metrics.alignment import align
from benchmarks.metrics.matching import match
from benchmarks.metrics.relative_pose import Poses, relative_errors
from benchmarks.metrics.score import errors, metrics
from benchmarks.metrics.track_files import read_track, read_truth
from logs.truth import Instants

pytestmark = pytest.mark.skipif(shutil.which("evo_ape") is None, reason="evo is not installed")
N = 400


@pytest.fixture
def files(tmp_path, write_tum):
    """A curve with a wrong estimate that has the same stamps, without random numbers."""
    t = 0.1 * np.arange(N)
    x, y = 5.0 * np.sin(0.1 * t), 2.5 * np.sin(0.2 * t)
    yaw = np.unwrap(np.arctan2(0.5 * np.cos(0.2 * t), 0.5 * np.cos(0.1 * t)))
    write_tum(tmp_path / "truth.tum", t, x, y, yaw)
    said = x + 0.3 + 0.05 * np.sin(1.7 * t), y - 0.1 + 0.05 * np.cos(2.3 * t), yaw + 0.02 * np.sin(0.9 * t)
    write_tum(tmp_path / "estimate.tum", t, *said)
    return tmp_path / "truth.tum", tmp_path / "estimate.tum"


@pytest.fixture
def pair(files):
    true, _ = read_truth(files[0])
    instants = Instants(true.time_ns, true.x, true.y, true.heading)
    return instants, match(instants, read_track(files[1]))


def evo(program, files, folder, *options):
    """The statistics that evo writes."""
    archive = folder / "result.zip"
    words = [program, "tum", *map(str, files), *options, "--save_results", str(archive), "--no_warnings"]
    subprocess.run(words, check=True, capture_output=True, env={"HOME": str(folder), "PATH": os.environ["PATH"]})
    with zipfile.ZipFile(archive) as content:
        return json.loads(content.read("stats.json"))


def test_absolute_errors_agree(files, pair, tmp_path):
    theirs, ours = evo("evo_ape", files, tmp_path), metrics(errors(*pair))
    for name in ("rmse", "mean", "std", "min", "max"):
        assert ours[f"pos_{name}"] == pytest.approx(theirs[name], rel=1e-9), name
    assert ours["pos_p50"] == pytest.approx(theirs["median"], rel=1e-9)


def test_heading_errors_agree(files, pair, tmp_path):
    theirs, ours = evo("evo_ape", files, tmp_path, "-r", "angle_rad"), metrics(errors(*pair))
    assert ours["head_rmse"] == pytest.approx(theirs["rmse"], rel=1e-9)


@pytest.mark.parametrize(("option", "how"), [("-a", "se2"), ("--align_origin", "origin")])
def test_aligned_errors_agree(files, pair, tmp_path, option, how):
    instants, answers = pair
    ours = metrics(errors(instants, align(instants, answers, how).answers))
    assert ours["pos_rmse"] == pytest.approx(evo("evo_ape", files, tmp_path, option)["rmse"], rel=1e-9)


@pytest.mark.parametrize(("part", "row"), [("trans_part", 0), ("angle_rad", 1)])
@pytest.mark.parametrize("frames", [1, 10])
def test_relative_errors_agree(files, pair, tmp_path, part, row, frames):
    options = ("-r", part, "--delta", str(frames), "--delta_unit", "f", "--all_pairs")
    theirs = evo("evo_rpe", files, tmp_path, *options)
    ours = relative_errors(Poses.of(errors(*pair)), slice(N - frames), np.arange(frames, N))[row]
    assert np.sqrt(np.mean(ours**2)) == pytest.approx(theirs["rmse"], rel=1e-9)
    assert np.median(ours) == pytest.approx(theirs["median"], rel=1e-9)
