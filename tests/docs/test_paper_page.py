"""The page about the paper is what `fusion reproduce` says today: its code exists, its numbers come again."""

import importlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks.paper.claims import CLAIMS, Judged, in_words, verdict
from benchmarks.paper.published import ENVIRONMENTS, ODOMETRY, WIFI
from benchmarks.paper.summary import Share
from benchmarks.paper.tables import spread_cm
from benchmarks.paper.trial import run_trial

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
RECORD = json.loads((ROOT / "docs" / "paper.json").read_text(encoding="utf-8"))
COMMAND = "fusion reproduce --markdown docs/paper.md --json docs/paper.json"


@pytest.mark.parametrize(
    "place", sorted(set(re.findall(r"`(fusion\.\w+|estimators\.\w+):([\w.]+)`", PAGE))), ids=":".join
)
def test_code_named_for_an_equation_exists(place):
    module, name = place
    found = importlib.import_module(module)
    for part in name.split("."):
        found = getattr(found, part)


def test_page_was_made_of_at_least_200_runs():
    assert RECORD["trials"] >= 200


@pytest.mark.parametrize(("k", "place"), [(0, 0), (1, 0), (2, 0), (0, -1)])
def test_recorded_runs_come_again(k, place):
    """The first run of each environment and the last of one, every lane. Where this fails an estimator or the simulator
    has changed: write the page anew with its command.
    """
    environment, record = ENVIRONMENTS[k], RECORD["environments"][k]
    seeds = range(RECORD["first_seed"], RECORD["first_seed"] + RECORD["trials"])
    trial = run_trial((environment.scenario, seeds[place]))
    assert set(record["largest_m"]) == set(trial.errors), COMMAND
    for lane, errors in trial.errors.items():
        assert record["largest_m"][lane][place] == pytest.approx(np.abs(errors).max(), abs=1e-4), COMMAND


@pytest.mark.parametrize("k", range(3))
def test_page_shows_what_the_record_holds(k):
    for lane in (ODOMETRY, WIFI):
        largest = np.array(RECORD["environments"][k]["largest_m"][lane], dtype=float)
        assert f"| {spread_cm(largest)} |" in PAGE, COMMAND


def test_page_counts_the_verdicts_of_the_record():
    judged = []
    for claim, found in zip(CLAIMS, RECORD["claims"], strict=True):
        shares = {title: Share.of(np.arange(held["of"]) < held["runs"]) for title, held in found["held"].items()}
        assert verdict([*shares.values()]) == found["verdict"], COMMAND
        judged.append(Judged(claim, shares, found["verdict"], found["reason"]))
    assert in_words(judged) in PAGE, COMMAND


@pytest.mark.parametrize("k", range(3))
@pytest.mark.parametrize("lane", [ODOMETRY, WIFI])
def test_calibration_holds_on_seeds_it_has_not_seen(k, lane):
    """Medians of the largest error of odometry alone and of Wi-Fi alone: within a tenth of the published ones."""
    found = np.median(RECORD["environments"][k]["largest_m"][lane])
    assert found == pytest.approx(ENVIRONMENTS[k].maxima_m[lane], rel=0.1)
