"""A recording whose truth is not known in every row, through every door: import, info, bench, review, export, suite."""

import json

import numpy as np
import pytest

from fusion import Truth
from fusion.cli.main import main
from fusion.conformance.synthetic_run import SyntheticRun
from fusion.values import NANOSECONDS
from logs.cli.export import export_csv
from logs.reader import read_run
from logs.writer import RunWriter

DRIVE = SyntheticRun(duration_s=10.0)
COUNT = 21
"""True poses, two a second."""
ESTIMATORS = ("dead_reckoning", "ekf", "filterpy_ukf", "particle")
SUITE = '[suite]\nname = "unknown"\n[[runs]]\nid = "walk"\nmcap = "walk.mcap"\n' + "".join(
    f'[[estimators]]\nid = "{name}"\nuse = "{name}"\n' for name in ("dead_reckoning", "ekf")
)
FIRST, MIDDLE, ALL = range(1), range(10, 15), range(COUNT)


def bundle(folder, spoil):
    """The CSV bundle of the conformance kit's noiseless drive, each row of its truth as ``spoil`` makes it."""
    log = folder.with_suffix(".mcap")
    with RunWriter(log, DRIVE.world(), name="drive") as writer:
        for measurement in DRIVE.measurements():
            writer.write(measurement)
        for k in range(COUNT):
            writer.write_truth(Truth(k * NANOSECONDS // 2, *DRIVE.pose(k * NANOSECONDS // 2)))
    export_csv(log, folder)
    head, *rows = (folder / "truth.csv").read_text(encoding="utf-8").splitlines()
    spoilt = [",".join(spoil(k, row.split(","))) for k, row in enumerate(rows)]
    (folder / "truth.csv").write_text("\n".join([head, *spoilt]) + "\n", encoding="utf-8")
    return folder


def imported(folder, log):
    assert main(["import", "csv", str(folder), "-o", str(log), "--force"]) == 0
    return read_run(log)


def records(log, capsys):
    capsys.readouterr()
    assert main(["bench", str(log), "--estimators", ",".join(ESTIMATORS), "--workers", "1", "--json", "-"]) == 0
    printed = capsys.readouterr()
    return json.loads(printed.out), printed.err


@pytest.mark.parametrize("text", ["", "nan"])
@pytest.mark.parametrize("unknown", [FIRST, MIDDLE, ALL], ids=["first", "middle", "all"])
def test_headings_that_are_not_known_spoil_nothing(tmp_path, capsys, unknown, text):
    folder = bundle(tmp_path / "walk", lambda k, row: [*row[:3], text if k in unknown else row[3]])
    log, known = tmp_path / "walk.mcap", COUNT - len(unknown)
    run = imported(folder, log)
    assert np.flatnonzero(np.isnan(run.truth.heading)).tolist() == list(unknown)
    assert run.prior.heading_known
    assert tuple(run.prior.pose) == pytest.approx(tuple(DRIVE.pose(0)), abs=0.05)

    assert main(["info", str(log)]) == 0
    assert f"the heading known at {known or 'none'} of them" in capsys.readouterr().out

    found, printed = records(log, capsys)
    for record in found:
        assert (record["estimator"], record["status"], record["error"]) == (record["estimator"], "ok", None)
        assert record["pos_rmse"] < 0.2
        assert record["head_n"] == known
        assert (record["head_rmse"] is None) == (known == 0)
        assert (record["head_rmse"] or 0.0) < 0.1
    assert (f"the true heading is known at {known} of {COUNT} instants" in printed) == (known > 0)

    assert main(["export", str(log), "--csv", "-o", str(tmp_path / "again")]) == 0
    again = imported(tmp_path / "again", tmp_path / "again.mcap")
    np.testing.assert_allclose(again.truth.heading, run.truth.heading, atol=1e-15)
    assert again.prior == run.prior


@pytest.mark.parametrize("text", ["", "nan"])
def test_positions_that_are_not_known_are_left_out_and_counted(tmp_path, capsys, text):
    folder = bundle(tmp_path / "walk", lambda k, row: [row[0], text, *row[2:]] if k in (0, 15, 16) else row)
    run = imported(folder, tmp_path / "walk.mcap")
    sentence = f"3 of {COUNT} true poses have no position, and are left out"
    assert sentence in capsys.readouterr().err
    assert len(run.truth) == COUNT - 3
    assert (run.prior.time_ns, tuple(run.prior.pose)) == (
        NANOSECONDS // 2,
        pytest.approx(tuple(DRIVE.pose(NANOSECONDS // 2))),
    )
    found, printed = records(tmp_path / "walk.mcap", capsys)
    assert [(record["status"], record["n"]) for record in found] == [("ok", COUNT - 3.0)] * len(ESTIMATORS)
    assert sentence in printed
    assert main(["info", str(tmp_path / "walk.mcap")]) == 0
    assert sentence in capsys.readouterr().out


def test_truth_without_any_position_is_none(tmp_path, capsys):
    folder = bundle(tmp_path / "walk", lambda _, row: [row[0], "nan", "", row[3]])
    run = imported(folder, tmp_path / "walk.mcap")
    assert (run.truth, run.prior) == (None, None)
    found, printed = records(tmp_path / "walk.mcap", capsys)
    assert {record["status"] for record in found} == {"unscored"}
    assert f"none of the {COUNT} true poses has a position" in printed


def test_suite_and_review_take_such_a_run(tmp_path, capsys):
    folder = bundle(tmp_path / "walk", lambda k, row: [*row[:3], "" if k in {*FIRST, *MIDDLE} else row[3]])
    imported(folder, tmp_path / "walk.mcap")
    (tmp_path / "suite.toml").write_text(SUITE, encoding="utf-8")
    words = [str(tmp_path / "suite.toml"), "--store", str(tmp_path / "store")]
    assert main(["bench", "run", *words, "-j", "1"]) == 0
    printed = capsys.readouterr().err
    assert "2 ok" in printed
    assert f"walk: the true heading is known at {COUNT - 6} of {COUNT} instants" in printed
    scene = tmp_path / "review.rrd"
    assert (
        main(["review", str(tmp_path / "walk.mcap"), "--estimators", "ekf", "--save", str(scene), "--worst", "1"]) == 0
    )
    assert scene.stat().st_size > 0
    assert "ekf" in capsys.readouterr().out
