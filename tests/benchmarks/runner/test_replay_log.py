"""A cell is made again as a log: what was measured is in it to the bit, faults and all, and so are the estimates."""

import pytest

from benchmarks.runner.estimator_run import run_estimator
from benchmarks.runner.execute import carry_out, faulty_run
from benchmarks.runner.replay_log import one_cell, replay_cell
from benchmarks.runner.store import Store
from fusion.cli.main import main
from logs.reader import read_run
from tests.benchmarks.suite_files import write_suite

FAULTS = {
    "drop": 'kind = "drop", topic = "wifi", p = 0.3',
    "delay": 'kind = "delay", topic = "wifi", mean_s = 0.6, jitter_s = 0.3',
    "clock": 'kind = "clock", topic = "gyro", offset_s = 0.3, drift_ppm = 50.0',
    "noise": 'kind = "rssi_noise", std_db = 3.0',
    "nlos": 'kind = "nlos", topic = "wifi", mean = 6.0, p = 0.3',
    "slip": 'kind = "slip", wheel = "left", factor = 1.3',
    "bias": 'kind = "gyro_bias", bias_deg_s = 2.0',
    "kidnap": 'kind = "kidnap", from_s = 3.0, until_s = 6.0',
    "start": 'kind = "bad_start", std_m = 1.0, std_deg = 30.0',
}
HEAD = """
[suite]
name = "again"
seeds = 2
[[runs]]
id = "office"
scenario = "office"
duration_s = 10.0
[[estimators]]
id = "mine"
use = "ekf"
params = { gate_probability = 0.99 }
"""
SUITE = HEAD + "".join(f'[[faults]]\nid = "{name}"\napply = [{{ {table} }}]\n' for name, table in FAULTS.items())


@pytest.fixture
def suite(tmp_path):
    return write_suite(tmp_path, SUITE)


@pytest.mark.parametrize("fault", ["clean", *FAULTS])
def test_log_of_a_cell_gives_the_same_answers_to_the_bit(suite, tmp_path, fault):
    cell = one_cell(suite, Store(tmp_path / "store"), "office", "mine", fault=fault, seed=1)
    digest = replay_cell(cell, tmp_path / "cell.mcap")
    assert digest
    log = read_run(tmp_path / "cell.mcap")
    assert log.measurements == faulty_run(cell).measurements
    assert run_estimator(log, "ekf", {"gate_probability": 0.99}, seed=1).digest == digest


def test_command_compares_with_the_store_and_refuses_ids_with_the_nearest(suite, tmp_path, capsys):
    store = Store(tmp_path / "store")
    words = [
        "bench",
        "replay",
        suite.word,
        "office",
        "mine",
        "--store",
        str(store.folder),
        "-o",
        str(tmp_path / "c.mcap"),
    ]
    assert main(words) == 0
    assert "store" not in capsys.readouterr().err
    cell = one_cell(suite, store, "office", "mine")
    carry_out((cell, store.folder))
    assert main(words) == 0
    assert "the same to the bit" in capsys.readouterr().err
    kept = store.place("estimates", cell.estimate_key) / "result.json"
    kept.write_text(kept.read_text().replace('"digest": "', '"digest": "0'))
    assert main(words) == 5
    assert "is not what it was" in capsys.readouterr().err
    for wrong, hint in ((["--fault", "sleep"], "slip"), (["--seed", "2"], "0 to 1")):
        assert main([*words, *wrong]) == 1
        assert hint in capsys.readouterr().err


def test_log_of_an_estimator_that_crashed_holds_all_that_was_measured(tmp_path, suite):
    broken = write_suite(tmp_path, HEAD.replace("gate_probability = 0.99", "gate_probability = 7.0"))
    cell = one_cell(broken, Store(tmp_path / "store"), "office", "mine")
    assert replay_cell(cell, tmp_path / "cell.mcap") == ""
    assert read_run(tmp_path / "cell.mcap").measurements == faulty_run(cell).measurements
