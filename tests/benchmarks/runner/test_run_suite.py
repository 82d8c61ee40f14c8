"""A suite is computed once: whatever the workers, the order, the shards, or how often it was interrupted."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
from collections import Counter
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.metrics.matching import match
from benchmarks.metrics.score import errors
from benchmarks.runner import reference
from benchmarks.runner.archive import from_bytes
from benchmarks.runner.execute import carry_out, faulty_run, stored_track
from benchmarks.runner.export import as_csv
from benchmarks.runner.leaderboard import suite_leaderboard
from benchmarks.runner.plan import cells_of, missing, shard
from benchmarks.runner.preflight import refuse_impossible
from benchmarks.runner.results import flat, read_results
from benchmarks.runner.run_source import open_run
from benchmarks.runner.run_suite import run_suite
from benchmarks.runner.store import Store
from benchmarks.runner.suite import EstimatorSpec
from benchmarks.runner.suite_file import load_suite
from fusion import FusionError, SuiteError, registered
from fusion.cli.main import main
from logs.prior import begin_ns
from logs.reader import read_run, read_world
from logs.truth import evaluation_instants
from sensors.simulation.simulate import simulate
from tests.benchmarks.suite_files import write_suite

SUITE = """
[suite]
name = "small"
seeds = 2
limits = { wall_s = 60.0, rss_mb = 2000.0 }
[[runs]]
id = "office"
scenario = "paper_office"
duration_s = 20.0
[[runs]]
id = "mec"
scenario = "paper_mec"
seed = 3
duration_s = 20.0
[[estimators]]
id = "wheels"
use = "dead_reckoning"
[[estimators]]
id = "pf"
use = "particle"
"""


def fault(table):
    """A suite's line where estimators begin, after a fault."""
    return f'[[faults]]\nid = "x"\napply = [{{ {table} }}]\n[[estimators]]'


@pytest.fixture
def suite(tmp_path):
    return write_suite(tmp_path, SUITE)


def everything(store):
    """Every file of a store with its bytes."""
    found = {}
    for path in sorted(path for path in store.folder.rglob("*") if path.is_file()):
        name = str(path.relative_to(store.folder))
        found[name] = path.read_bytes()
    return found


def digests(results):
    return [(str(result.cell), result.status, result.digest, dict(result.metrics)) for result in results]


def test_workers_and_shards_change_nothing(suite, tmp_path):
    alone, two, parts = (Store(tmp_path / name) for name in ("alone", "two", "parts"))
    expected = digests(run_suite(suite, alone, workers=1))
    assert len(expected) == 8
    assert digests(run_suite(suite, two, workers=2)) == expected
    cells = cells_of(suite, parts)
    own = [shard(cells, number, 3) for number in (1, 2, 3)]
    assert Counter(str(cell) for part in own for cell in part) == Counter(map(str, cells))
    for number in (3, 1, 2):
        results = run_suite(suite, parts, workers=1, part=(number, 3))
    assert digests(results) == expected
    assert everything(alone) == everything(two) == everything(parts)


def test_only_what_is_missing_runs_again(suite, tmp_path):
    store, seen = Store(tmp_path / "store"), []
    cells = cells_of(suite, store)
    carry_out((cells[0], store.folder))
    assert len(missing(cells, store).estimates) == 7
    run_suite(suite, store, workers=1, progress=lambda done, total, what: seen.append(total))
    assert seen == [7] * 7
    run_suite(suite, store, workers=1, progress=lambda done, total, what: seen.append(total))
    assert len(seen) == 7


def test_another_evaluation_scores_old_tracks_again_without_an_estimator(suite, tmp_path):
    store = Store(tmp_path / "store")
    run_suite(suite, store, workers=1)
    stricter = replace(suite, evaluation=replace(suite.evaluation, max_age_s=0.5))
    todo = missing(cells_of(stricter, store), store)
    assert (len(todo.estimates), len(todo.scores)) == (0, 8)
    assert len(run_suite(stricter, store, workers=1)) == 8


@pytest.mark.parametrize("reading", ["causal", "interp"])
def test_scoring_anew_opens_no_run_and_gives_the_same(tmp_path, monkeypatch, reading):
    text = SUITE.replace("paper_", "").replace("seeds = 2", f'eval = {{ reading = "{reading}" }}')
    late = fault('kind = "kidnap", from_s = 5.0, until_s = 9.0')
    store = Store(tmp_path / "store")
    cells = cells_of(write_suite(tmp_path, text.replace("[[estimators]]", late, 1)), store)
    for cell in cells:
        carry_out((cell, store.folder))
    expected = digests(read_results(cells, store))
    assert all(metrics["availability"] > 0.9 for *_, metrics in expected)
    shutil.rmtree(store.folder / "scores")
    monkeypatch.setattr("benchmarks.runner.reference.open_run", lambda *_: pytest.fail("the truth is in the store"))
    monkeypatch.setattr("benchmarks.runner.execute.open_run", lambda *_: pytest.fail("the estimates are in the store"))
    reference._read.cache_clear()
    assert [carry_out((cell, store.folder)).status for cell in cells] == [status for _, status, *_ in expected]
    assert digests(read_results(cells, store)) == expected


def test_interpolated_evaluation_is_another_score_of_the_same_estimates(tmp_path):
    suite, store = write_suite(tmp_path, SUITE.replace("paper_", "")), Store(tmp_path / "store")
    causal = run_suite(suite, store, workers=1)
    offline = replace(suite, evaluation=replace(suite.evaluation, reading="interp"))
    again = run_suite(offline, store, workers=1)
    assert [result.digest for result in again] == [result.digest for result in causal]
    assert all(0.0 < result.metrics["availability"] <= 1.0 for result in again)
    assert [r.metrics["pos_rmse"] for r in again] != [r.metrics["pos_rmse"] for r in causal]


def test_a_key_depends_on_run_parameters_seed_and_nothing_else(suite, tmp_path):
    store = Store(tmp_path / "store")
    keys = [cell.estimate_key for cell in cells_of(suite, store)]
    assert len(set(keys)) == len(keys)
    renamed = write_suite(tmp_path, SUITE.replace('"small"', '"other"').replace('id = "pf"', 'id = "renamed"'))
    assert [cell.estimate_key for cell in cells_of(renamed, store)] == keys
    changed = write_suite(tmp_path, SUITE + "params = { particles = 300 }\n")
    different = [cell.estimate_key for cell in cells_of(changed, store)]
    assert [a == b for a, b in zip(keys, different, strict=True)] == [True, True, False, False] * 2


def test_faults_are_drawn_alike_for_every_estimator_and_leave_the_truth_alone(tmp_path):
    faults = '[[faults]]\nid = "noise"\napply = [{ kind = "rssi_noise", std_db = 6.0 }]\n'
    cells = cells_of(write_suite(tmp_path, SUITE + faults), Store(tmp_path / "store"))
    noisy = [cell for cell in cells if cell.fault.id == "noise" and cell.run.id == "office"]
    assert len(noisy) == 4
    assert len({cell.estimate_key for cell in cells}) == len(cells) == 16
    wheels, pf = (faulty_run(cell) for cell in noisy if cell.seed == 1)
    clean = open_run(noisy[0].run, noisy[0].folder)
    assert wheels.measurements == pf.measurements != clean.measurements
    assert wheels.truth is clean.truth


OUTAGES = """
[suite]
name = "outages"
[[runs]]
id = "office"
scenario = "office"
duration_s = 30.0
[[estimators]]
id = "radio"
use = "radio_only"
[[faults]]
id = "ap2-out"
apply = [{ kind = "drop", topic = "wifi", source = "ap2", windows = [[8.0, 16.0]] }]
[[faults]]
id = "silence"
apply = [{ kind = "drop", topic = "wifi", windows = [[8.0, 16.0]] }]
[[faults]]
id = "noise"
apply = [{ kind = "rssi_noise", std_db = 6.0 }]
"""


def test_dropped_window_is_scored_by_itself(tmp_path):
    """Against the stored track: what is inside is what lies 8 s to 16 s after the first message."""
    suite, store = write_suite(tmp_path, OUTAGES), Store(tmp_path / "store")
    results = {result.cell.fault.id: result for result in run_suite(suite, store, workers=1)}
    run = open_run(suite.runs[0], suite.folder)
    elapsed_s = (evaluation_instants(run.truth).time_ns - begin_ns(run.measurements)) / 1e9
    errors_m = {}
    for name in ("clean", "ap2-out", "silence"):
        track, _ = from_bytes(store.read("estimates", results[name].cell.estimate_key, "track.npz"))
        instants = evaluation_instants(run.truth)
        errors_m[name] = errors(instants, match(instants, track)).position
    inside = (elapsed_s >= 8.0) & (elapsed_s < 16.0)
    assert (errors_m["ap2-out"] == errors_m["clean"])[elapsed_s < 8.0].all()
    for name in ("ap2-out", "silence"):
        found, own = results[name].metrics, errors_m[name][inside]
        assert found["fault_availability"] == np.isfinite(own).mean()
        assert found["fault_max_in_outage"] == own[np.isfinite(own)].max()
        assert found["fault_t_recover"] >= 0.0
    # The newest fix before the silence counts for another second, which one dropped anchor does not take away.
    assert results["silence"].metrics["fault_availability"] < 0.2 < results["ap2-out"].metrics["fault_availability"]
    assert results["ap2-out"].metrics["fault_max_in_outage"] != errors_m["clean"][inside].max()
    rows = {row["fault"]: row for row in csv.DictReader(as_csv([*results.values()]).decode().splitlines())}
    assert rows["clean"]["fault_availability"] == rows["noise"]["fault_availability"] == ""
    assert float(rows["silence"]["fault_availability"]) == results["silence"].metrics["fault_availability"]
    noise = flat(results["noise"])
    assert all(noise[name] is None for name in noise if name.startswith("fault_"))
    assert not any(name.startswith("fault_") for name in results["clean"].metrics)


def test_log_is_identified_by_its_content_not_by_its_name(tmp_path):
    simulate("paper_office", tmp_path / "a.mcap", seed=1, duration_s=10.0)
    (tmp_path / "b.mcap").write_bytes((tmp_path / "a.mcap").read_bytes())
    text = SUITE.replace('scenario = "paper_office"\nduration_s = 20.0', 'mcap = "a.mcap"')
    text = text.replace('scenario = "paper_mec"\nseed = 3\nduration_s = 20.0', 'mcap = "b.mcap"')
    cells = cells_of(write_suite(tmp_path, text), Store(tmp_path / "store"))
    assert [cell.estimate_key for cell in cells[:4]] == [cell.estimate_key for cell in cells[4:]]


def test_cut_run_ends_where_it_is_cut(suite):
    run = open_run(suite.runs[0], suite.folder)
    assert max(measurement.time_ns for measurement in run.measurements) <= 20_000_000_000
    assert run.truth.time_ns.max() <= 20_000_000_000


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('use = "particle"', 'use = "partcle"', "did you mean 'particle'"),
        ('use = "particle"', 'use = "particle"\nparams = { particels = 3 }', "did you mean 'particles'"),
        ("[[estimators]]", fault('kind = "dorp"'), "did you mean 'drop'"),
        (
            "[[estimators]]",
            fault('kind = "drop", topic = "wifi", source = "ap22"'),
            "fault 'x' (drop) on run 'office': the run has no 'ap22' on wifi; it has ap1, ap2, ap3, wifi; did you mean "
            "'ap2'?",
        ),
        ("[[estimators]]", fault('kind = "power_step", source = "pa1", step_db = 3.0'), "did you mean 'ap1'?"),
        (
            "[[estimators]]",
            fault('kind = "delay", topic = "ranges", mean_s = 1.0'),
            "'ranges'; it has gyro, odom, wifi",
        ),
        ("[[estimators]]", fault('kind = "freeze", wheel = "middle"'), "the run has no wheel 'middle'"),
        ('use = "particle"', 'use = "particle"\nparams = { particles = 0 }', "estimator pf: particle: particles is 0"),
        ('use = "particle"', 'use = "particle"\nparams = { particles = "9" }', "particles takes a int, got '9'"),
        (
            'use = "particle"',
            'use = "particle"\ngrid = { particles = [9, 0], outlier_share = [0.1, 0.2] }',
            "estimator pf[particles=0,outlier_share=0.1]: particle: particles is 0; give at least 1; so are refused "
            "pf[particles=0,outlier_share=0.2]\n",
        ),
        ('scenario = "paper_mec"\nseed = 3\nduration_s = 20.0', 'mcap = "none.mcap"', "none.mcap is not there"),
    ],
)
@pytest.mark.parametrize("verb", ["plan", "run"])
def test_what_cannot_run_is_refused_before_any_work(tmp_path, old, new, message, verb, capsys):
    (tmp_path / "suite.toml").write_text(SUITE.replace(old, new, 1), encoding="utf-8")
    assert main(["bench", verb, str(tmp_path / "suite.toml"), "--store", str(tmp_path / "store")]) == 1
    assert message in capsys.readouterr().err
    assert not (tmp_path / "store" / "estimates").exists()


class Fussy:
    """Somebody's estimator, which knows none of our errors."""

    summary, tags = "never run", ()

    def __init__(self, world, share: float = 0.5):
        if not 0.0 < share <= 1.0 or world.name == self.hated:
            raise ValueError(f"share {share} in {world.name}")

    hated = ""

    def start(self, prior, seed):
        raise NotImplementedError

    step = estimate = start


@pytest.mark.parametrize(
    ("hated", "share", "refused"),
    [
        ("", 2.0, True),
        ("", 1.0, False),
        # It cannot be had there whatever its parameters: a result of that world, not a mistake in the suite.
        ("paper_office", 1.0, False),
    ],
)
def test_parameters_that_a_plug_in_refuses_in_its_own_way_are_refused(
    suite, tmp_path, monkeypatch, hated, share, refused
):
    monkeypatch.setattr(Fussy, "hated", hated)
    theirs = EstimatorSpec("theirs", "fussy", {"share": share})
    cells = [cell._replace(estimator=theirs) for cell in cells_of(suite, Store(tmp_path / "store"))]
    with (
        registered("fussy", Fussy),
        pytest.raises(SuiteError, match=r"theirs: .*share 2.0") if refused else nullcontext(),
    ):
        refuse_impossible(cells)


def test_log_gives_its_world_and_its_anchors_before_it_is_run(tmp_path, capsys):
    simulate("paper_office", tmp_path / "a.mcap", seed=1, duration_s=10.0)
    assert read_world(tmp_path / "a.mcap") == read_run(tmp_path / "a.mcap").world
    text = SUITE.replace('scenario = "paper_office"\nduration_s = 20.0', 'mcap = "a.mcap"')
    text = text.replace("[[estimators]]", fault('kind = "nlos", topic = "wifi", source = "AP1", mean = 3.0'), 1)
    (tmp_path / "suite.toml").write_text(text, encoding="utf-8")
    assert main(["bench", "plan", str(tmp_path / "suite.toml"), "--store", str(tmp_path / "store")]) == 1
    assert "on run 'office': the run has no 'AP1' on wifi; it has ap1, ap2, ap3" in capsys.readouterr().err


def test_what_is_in_the_store_is_not_tried_again(suite, tmp_path, monkeypatch):
    store = Store(tmp_path / "store")
    run_suite(suite, store, workers=1)
    monkeypatch.setattr("fusion.build", lambda *_: pytest.fail("nothing is missing"))
    assert len(run_suite(suite, store, workers=1)) == 8


def test_runner_that_was_killed_leaves_a_store_that_is_gone_on_with(suite, tmp_path):
    """SIGKILL as soon as the first estimate is there."""
    store = Store(tmp_path / "store")
    command = [sys.executable, "-m", "fusion.cli.main", "bench", "run", str(tmp_path / "suite.toml")]
    process = subprocess.Popen([*command, "--store", str(store.folder), "-j", "2"], stdout=subprocess.DEVNULL)
    while not list(store.folder.glob("scores/*/*")):
        assert process.poll() is None or process.returncode == 0
        if process.poll() is not None:
            break
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    results = run_suite(suite, store, workers=1)
    assert digests(results) == digests(run_suite(suite, Store(tmp_path / "fresh"), workers=1))


def test_plan_and_run_report_what_they_did(suite, tmp_path, capsys):
    words = [str(tmp_path / "suite.toml"), "--store", str(tmp_path / "store")]
    assert main(["bench", "plan", *words]) == 0
    assert "2 runs x 2 estimators x 1 faults x 2 seeds = 8 cells" in capsys.readouterr().out
    assert main(["bench", "run", *words, "-j", "1"]) == 0
    printed = capsys.readouterr()
    assert "8 ok" in printed.err
    assert "clean: medians over cells" in printed.out
    assert main(["bench", "plan", *words, "--json"]) == 0
    counts = json.loads(capsys.readouterr().out)
    assert (counts["cells"], counts["cached"], counts["missing_estimates"]) == (8, 8, 0)


def test_leaderboard_puts_a_lost_estimator_last_whatever_its_other_cells(suite, tmp_path):
    results = run_suite(suite, Store(tmp_path / "store"), workers=1)
    best = suite_leaderboard(results).rows[0][0]
    spoilt = [
        result._replace(status="crashed") if result.cell.estimator.id == best and result.cell.seed == 0 else result
        for result in results
    ]
    rows = suite_leaderboard(spoilt).rows
    assert rows[-1][0] == best
    assert rows[-1][1] == "2/4"


def test_results_of_cells_without_a_score_are_left_out(suite, tmp_path):
    store = Store(tmp_path / "store")
    assert read_results(cells_of(suite, store), store) == []


def test_stored_metrics_are_the_numbers_of_the_score(suite, tmp_path):
    results = run_suite(suite, Store(tmp_path / "store"), workers=1)
    assert all(np.isfinite(result.metrics["pos_p75"]) for result in results)
    assert all(result.metrics["availability"] == 1.0 for result in results)


def test_run_reports_why_cells_were_lost(tmp_path, capsys):
    greedy = '[[estimators]]\nid = "none"\nuse = "particle"\nparams = { particles = 1_000_000_000_000_000 }\n'
    write_suite(tmp_path, SUITE + greedy)
    assert main(["bench", "run", str(tmp_path / "suite.toml"), "--store", str(tmp_path / "store"), "-j", "1"]) == 0
    printed = capsys.readouterr().err
    assert "4 crashed, 8 ok" in printed
    assert "none lost 4 of its cells: Particle failed at its start: MemoryError" in printed


def test_damaged_track_is_reported_not_traced(suite, tmp_path):
    store, cell = Store(tmp_path / "store"), cells_of(suite, Store(tmp_path / "store"))[0]
    carry_out((cell, store.folder))
    assert len(stored_track(cell, store)[0].time_ns) > 0
    path = store.place("estimates", cell.estimate_key) / "track.npz"
    whole = path.read_bytes()
    for broken in (b"", b"no archive", whole[:-100]):
        path.write_bytes(broken)
        with pytest.raises(FusionError, match="is damaged"):
            stored_track(cell, store)


def test_damaged_truth_is_reported_not_traced(suite, tmp_path):
    store, cell = Store(tmp_path / "store"), cells_of(suite, Store(tmp_path / "store"))[0]
    carry_out((cell, store.folder))
    (path,) = store.folder.glob("references/*/*/truth.npz")
    path.write_bytes(path.read_bytes()[:-100])
    reference._read.cache_clear()
    with pytest.raises(FusionError, match=r"truth\.npz: is damaged"):
        reference.reference_of(cell, store)


def test_missing_suite_is_one_sentence(tmp_path):
    with pytest.raises(SuiteError, match="cannot be read"):
        load_suite(tmp_path / "suite.toml")
