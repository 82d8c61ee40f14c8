"""Repaired files are whole, other readers open them, and the broken file is never touched."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from fusion import LogError
from fusion.cli.main import main
from logs.cli.repair import repair
from logs.reader import read_run
from logs.salvage.records import MAGIC
from tests.logs.salvage.broken_logs import flipped, indexed, own_log, seen, write_mcap


def test_repaired_file_is_whole_and_remembers_what_it_lost(tmp_path):
    path = own_log(tmp_path / "run.mcap", 1000)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    first = repair(path, tmp_path / "good.mcap")
    second = repair(tmp_path / "good.mcap", tmp_path / "again.mcap")
    assert not second.damage.is_lossy
    assert (tmp_path / "again.mcap").read_bytes() == (tmp_path / "good.mcap").read_bytes()
    (warning,) = read_run(tmp_path / "good.mcap").warnings
    assert str(first.damage) in warning


def test_reading_in_place_and_reading_the_repaired_file_are_the_same_in_the_same_words(tmp_path):
    path = own_log(tmp_path / "run.mcap", 1000)
    whole = path.read_bytes()
    start = indexed(path).chunk_indexes[4].chunk_start_offset
    holed = whole[: start + 90] + bytes(8) + whole[start + 98 :]
    for bad in (whole[:-1], whole[: len(whole) // 2], holed, holed[:-20], whole[:7000] + bytes(99)):
        path.write_bytes(bad)
        repaired = repair(path, tmp_path / "good.mcap", force=True)
        in_place = read_run(path)
        assert in_place.measurements == read_run(tmp_path / "good.mcap").measurements
        assert len(in_place.measurements) == repaired.messages
        assert str(repaired.damage) in in_place.warnings[0]
        assert f"fusion repair {path}" in in_place.warnings[0]


RECORDER = """
import os, random, sys
from pathlib import Path
from fusion import Gyro, World
from logs.writer import RunWriter
world = World.from_table({"name": "here", "bounds": {"x_min": 0, "x_max": 1, "y_min": 0, "y_max": 1}})
log = RunWriter(Path(sys.argv[1]), world, name="killed")
noise = random.Random(0)
for number in range(10**9):
    log.write(Gyro(number * 10_000_000, "g", number, noise.random()))
    os.write(1, b"%d\\n" % number)
"""


@pytest.mark.parametrize("moment", [1, 99, 731, 4242, 9999])
def test_killed_recorder_loses_no_more_than_is_stated(tmp_path, moment):
    path, good = tmp_path / "run.mcap", tmp_path / "good.mcap"
    with subprocess.Popen([sys.executable, "-c", RECORDER, str(path)], stdout=subprocess.PIPE) as recorder:
        for _ in range(moment):
            recorder.stdout.readline()
        recorder.kill()
        lines = recorder.stdout.read().splitlines()
    written = int(lines[-1]) if lines else moment - 1
    repaired = repair(path, good)
    kept = read_run(good).measurements
    assert [measurement.seq for measurement in kept] == list(range(len(kept)))
    assert len(kept) == repaired.messages
    assert (written - kept[-1].seq) / 100 <= repaired.damage.seconds_lost == 1.0
    assert "at most 1.0 s lost" in str(repaired.damage)


def test_rosbags_and_rerun_open_what_was_repaired(tmp_path):
    from rosbags.highlevel import AnyReader

    path, good = write_mcap(tmp_path / "run.mcap"), tmp_path / "good.mcap"
    path.write_bytes(flipped(path.read_bytes(), 8 * (indexed(path).chunk_indexes[2].chunk_start_offset + 60))[:-50])
    repair(path, good)
    with AnyReader([good]) as reader:
        texts = [reader.deserialize(data, to.msgtype).data for to, _, data in reader.messages()]
    assert texts == [f"{number:06d}" for number in (*range(8), *range(12, 20))]
    rerun = Path(sys.executable).with_name("rerun")
    checked = subprocess.run([rerun, "mcap", "check", "--full", good], capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stderr
    assert subprocess.run([rerun, "mcap", "check", path], capture_output=True, check=False).returncode != 0


def test_command_prints_what_was_kept_and_lost_in_words_and_as_json(tmp_path, capsys):
    path, good = own_log(tmp_path / "run.mcap", 1000), tmp_path / "good.mcap"
    path.write_bytes(path.read_bytes()[:20000])
    assert main(["repair", str(path), "-o", str(good)]) == 3
    text = capsys.readouterr().out
    assert main(["repair", str(path), "-o", str(good), "--force", "--json"]) == 3
    about = json.loads(capsys.readouterr().out)
    assert f"{about['messages_kept']} messages kept" in text
    assert about["damage"] in text
    assert (about["lossy"], about["seconds_lost_at_most"]) == (True, 1.0)
    assert about["messages_kept"] == len(read_run(good).measurements)


def test_pipe_is_refused(tmp_path):
    command = [sys.executable, "-m", "fusion.cli.main", "info", "/dev/stdin"]
    content = write_mcap(tmp_path / "run.mcap").read_bytes()
    done = subprocess.run(command, input=content, capture_output=True, check=False)
    assert (done.returncode, done.stderr.count(b"\n")) == (1, 1)
    assert b"give a file" in done.stderr


@pytest.mark.parametrize("content", [b"", MAGIC[:7], b"hello, this is no MCAP"])
def test_what_is_no_mcap_file_is_refused(tmp_path, content, capsys):
    (tmp_path / "run.mcap").write_bytes(content)
    assert main(["repair", str(tmp_path / "run.mcap"), "-o", str(tmp_path / "good.mcap")]) == 1
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert os.listdir(tmp_path) == ["run.mcap"]


def test_broken_file_is_never_written_to_and_another_only_if_asked(tmp_path):
    path = write_mcap(tmp_path / "run.mcap", finished=False)
    before = path.read_bytes()
    (tmp_path / "link.mcap").symlink_to(path)
    for good in (path, tmp_path / "link.mcap"):
        with pytest.raises(LogError, match="never touched"):
            repair(path, good, force=True)
    other = tmp_path / "other.mcap"
    other.write_text("mine")
    with pytest.raises(LogError, match="exists already"):
        repair(path, other)
    assert (path.read_bytes(), other.read_text()) == (before, "mine")
    with pytest.raises(LogError, match="exists already"):
        repair(path, tmp_path, force=True)
    for nowhere in (tmp_path / "nowhere" / "good.mcap", path / "good.mcap"):
        with pytest.raises(LogError, match="choose another place"):
            repair(path, nowhere)
    assert main(["repair", str(path), "-o", str(other), "--force"]) == 3
    assert seen(other) == list(range(20))


def test_without_an_output_the_usage_is_wrong(tmp_path):
    with pytest.raises(SystemExit) as stopped:
        main(["repair", str(tmp_path / "run.mcap")])
    assert stopped.value.code == 2


FULL = """
import resource, signal, sys
from fusion.cli.main import main
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (700, 700))
sys.exit(main(["repair", sys.argv[1], "-o", sys.argv[2], "--force"]))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="needs a limit on the size of files")
def test_disk_that_fills_leaves_no_half_written_file(tmp_path):
    path, good = write_mcap(tmp_path / "run.mcap", finished=False), tmp_path / "good.mcap"
    good.write_text("what was there before")
    done = subprocess.run([sys.executable, "-c", FULL, path, good], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "free some space" in done.stderr
    assert good.read_text() == "what was there before"
    assert sorted(os.listdir(tmp_path)) == ["good.mcap", "run.mcap"]
