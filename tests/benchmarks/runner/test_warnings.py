"""What is wrong with a run of a suite stands where its numbers do: after `bench run`, and in the report."""

import pytest

from fusion import Truth, WheelTicks, World
from fusion.cli.main import main
from logs.writer import RunWriter

SECOND = 1_000_000_000
SUITE = """
[suite]
name = "small"
[[runs]]
id = "blind"
mcap = "run.mcap"
[[estimators]]
id = "wheels"
use = "dead_reckoning"
[[faults]]
id = "silence"
apply = [{ kind = "drop", topic = "odom", windows = [[4.0, 5.0]] }]
"""


@pytest.fixture
def folder(tmp_path):
    """A suite of one run, whose single-channel encoders come without motor commands."""
    bounds = {"x_min": 0, "x_max": 9, "y_min": 0, "y_max": 9}
    world = World.from_table({"name": "hall", "bounds": bounds, "robot": {"encoder": "single_channel"}})
    with RunWriter(tmp_path / "run.mcap", world, name="run") as writer:
        for k in range(12):
            writer.write(WheelTicks(k * SECOND, "encoders", k, (10 * k,) * 4))
            writer.write_truth(Truth(k * SECOND, 0.1 * k, 0.0, 0.0))
    (tmp_path / "suite.toml").write_text(SUITE, encoding="utf-8")
    return tmp_path


def test_each_warning_stands_once_after_the_run_and_from_the_store(folder, capsys):
    words = [str(folder / "suite.toml"), "--store", str(folder / "store")]
    for _ in range(2):
        assert main(["bench", "run", *words, "-j", "1"]) == 0
        (line,) = [line for line in capsys.readouterr().err.splitlines() if "single-channel" in line]
        assert line.startswith(f"fusion bench run: blind: {folder / 'run.mcap'}: single-channel encoders without motor")
    assert main(["bench", "report", *words, "--markdown", str(folder / "page.md")]) == 0
    page = (folder / "page.md").read_text(encoding="utf-8")
    assert page.count(f"**Warning**: `blind: {folder / 'run.mcap'}: single-channel encoders without motor") == 1
