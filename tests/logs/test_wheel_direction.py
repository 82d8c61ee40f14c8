"""Wheels whose direction no command states are named: in the whole of a run or in a part, for one wheel or for all."""

import argparse
import json

import pytest

from benchmarks.runner.adhoc_suite import bench, remarks
from fusion import Diagnostic, Level, MotorCommand, Odometry, Truth, WheelTicks
from fusion.cli.main import main
from logs.cli.import_ import import_recordings
from logs.reader import read_run
from logs.wheel_direction import LEAST_M, DirectionWatch, caution, caution_of_run
from logs.writer import RunWriter
from sensors.cli.calibration import Findings, calibrate
from tests.worlds import empty_world

SECOND = 1_000_000_000
TICK_M = 0.0102
SENTENCE = (
    "single-channel encoders without motor commands: wheels that turn backwards count as forwards; add a sensor of "
    'motor commands (`motors`, or `simulated_motors`), or set encoder = "quadrature" in the world\'s [robot] if the '
    "encoders see the direction or no wheel ever turns backwards"
)
KINDS = {"bare": {WheelTicks, Truth}, "commanded": {WheelTicks, MotorCommand}, "odometry": {Odometry}}


def world(encoder="single_channel", drive="differential"):
    return empty_world(name="hall", robot={"encoder": encoder, "drive": drive})


ROBOT = world().robot


def ticks(count=21, per_s=10):
    """Both wheels of a robot that drives for as many seconds, with a message each."""
    return [WheelTicks(k * SECOND, "encoders", k, (k * per_s, k * per_s)) for k in range(count)]


def command(time_s, *speeds, seq=0):
    return MotorCommand(round(time_s * SECOND), "motors", seq, speeds or (0.1, 0.1))


def lost(time_s, state="backoff"):
    return Diagnostic(round(time_s * SECOND), "motors", Level.WARN, "motors: the socket is gone", (("state", state),))


def missed(measurements, remarks=()):
    """How far a wheel rolled in an unknown direction [m], and from when [s], as the sentence has it."""
    found = caution_of_run(ROBOT, measurements, remarks)
    if found is None:
        return None
    words = found.what.partition(" for ")[2].split()
    return float(words[0]), float(words[words.index("at") + 1])


@pytest.mark.parametrize(("kinds", "is_missing"), [("bare", True), ("commanded", False), ("odometry", False)])
def test_only_ticks_of_single_channel_encoders_need_commands(kinds, is_missing):
    assert caution(world("quadrature").robot, KINDS[kinds]) is None
    assert (caution(ROBOT, KINDS[kinds]) is not None) is is_missing


def test_a_run_without_commands_has_the_sentence_of_a_robot_file():
    found = caution_of_run(ROBOT, ticks(), ())
    assert found == caution(ROBOT, {WheelTicks})
    assert str(found) == SENTENCE
    assert caution_of_run(world("quadrature").robot, ticks(), ()) is None


def test_a_robot_that_stood_needs_no_commands():
    assert caution_of_run(ROBOT, ticks(per_s=0), ()) is None


def test_a_run_whose_commands_hold_throughout_is_well():
    assert missed([command(0.0), *ticks()]) is None
    assert missed([*ticks(), command(0.0)]) is None, "arrival is no matter: the host puts it in its place"


def test_what_rolls_before_the_first_command_is_named_with_its_length_and_its_time():
    assert missed([*ticks(), command(5.5)]) == (0.51, 1.0)


def test_a_command_to_stand_states_no_direction_and_takes_none_away():
    assert missed([command(0.0, 0.0, 0.0), *ticks()]) == (2.04, 1.0)
    assert missed([command(0.0), command(3.0, 0.0, 0.0), *ticks()]) is None


def test_commands_for_one_wheel_leave_the_other_unknown():
    assert missed([command(0.0, -0.1, 0.0), *ticks()]) == (2.04, 1.0)


def test_a_number_that_is_none_states_no_direction():
    assert missed([command(0.0, float("nan"), 0.1), *ticks()]) == (2.04, 1.0)


@pytest.mark.parametrize("state", ["backoff", "failed", "stalled", "opening"])
def test_a_sensor_of_commands_that_is_lost_takes_the_direction_with_it_until_the_next_command(state):
    commands = [command(0.0), command(9.5, seq=1)]
    assert missed([*commands, *ticks()], [lost(4.5, state)]) == (0.51, 5.0)
    assert missed([*commands, *ticks()], [lost(9.5, state)]) is None, "the command that comes with its return holds"
    assert missed([*commands, *ticks()], [lost(4.5, "running")]) is None
    other = lost(4.5, state)._replace(sensor="wifi")
    assert missed([*commands, *ticks()], [other]) is None


def test_a_few_ticks_before_the_sensors_have_all_begun_are_no_matter():
    few = int(LEAST_M / TICK_M)
    assert missed([*ticks(2, few), command(1.5)]) is None
    assert missed([*ticks(2, few + 1), command(1.5)]) == (round((few + 1) * TICK_M, 2), 1.0)


def test_a_watch_that_saw_nothing_warns_of_nothing():
    assert DirectionWatch(ROBOT).caution is None
    assert DirectionWatch(world(drive="none").robot).caution is None


@pytest.fixture
def log(tmp_path):
    """Writes a log of measurements and remarks; answers its path."""

    def write(*outputs, about=None, encoder="single_channel"):
        with RunWriter(tmp_path / "run.mcap", world(encoder), name="run", metadata=about or {}) as writer:
            for one in outputs:
                if isinstance(one, Diagnostic):
                    writer.write_diagnostic(one)
                else:
                    writer.write(one)
            for k in range(21):
                writer.write_truth(Truth(k * SECOND, 0.1 * k, 0.0, 0.0))
        return tmp_path / "run.mcap"

    return write


def test_a_log_warns_wherever_it_is_read(log, capsys):
    path = log(*ticks())
    (warning,) = read_run(path).warnings
    assert warning == f"{path}: {SENTENCE}"
    assert main(["info", str(path)]) == 0
    assert f"warning: {warning}\n" in capsys.readouterr().out
    assert main(["info", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["warnings"] == [warning]
    assert main(["bench", str(path), "--estimators", "dead_reckoning", "--workers", "1"]) == 0
    assert f"fusion bench: run: {warning}\n" in capsys.readouterr().err
    assert main(["replay", str(path), "--estimator", "dead_reckoning", "-o", str(path.with_name("out.mcap"))]) == 0
    assert f"fusion replay: {warning}\n" in capsys.readouterr().err


def test_a_calibration_from_such_a_log_warns_before_its_numbers(log, capsys):
    path = log(*ticks())
    arguments = argparse.Namespace(runs=[path], world=None, output=None, json=None, png=None)
    calibrate(arguments, lambda _: Findings("odometry", "none", 0, 0.0, (), ["fit"], None, None, None, {}))
    assert capsys.readouterr().err == f"fusion calibrate odometry: {path}: {SENTENCE}\nfusion calibrate odometry: fit\n"


def test_a_log_that_needs_no_commands_warns_of_nothing(log):
    path = log(*ticks(), encoder="quadrature")
    assert read_run(path).warnings == ()
    assert not remarks(bench([path], estimators=["dead_reckoning"], workers=1))


def test_a_log_whose_commands_were_lost_for_a_while_shows_for_how_long(log):
    path = log(command(0.0), *ticks(), lost(4.5), command(9.5, seq=1))
    (warning,) = read_run(path).warnings
    assert "without motor commands for 0.51 m of a wheel's way, first at 5.0 s: wheels" in warning


def test_a_later_part_of_a_recording_is_to_be_joined(log):
    """The command that stands came in an earlier part."""
    path = log(*ticks(), about={"split": "2"})
    (warning,) = read_run(path).warnings
    assert warning.endswith("count as forwards; join the parts of the recording (`fusion join`)")
    assert SENTENCE in read_run(log(*ticks(), about={"split": "0"})).warnings[0]


def test_a_bundle_of_ticks_warns_when_it_is_imported(tmp_path, capsys):
    folder = tmp_path / "walk"
    folder.mkdir()
    (folder / "world.toml").write_text(
        'bounds = {x_min = 0, x_max = 1, y_min = 0, y_max = 1}\nrobot.encoder = "single_channel"'
    )
    (folder / "ticks.csv").write_text("time_s,fl,fr,rl,rr\n1,0,0,0,0\n2,99,99,99,99\n")
    import_recordings("csv", folder, tmp_path / "out.mcap")
    assert capsys.readouterr().err == f"warning: {folder}: {SENTENCE}\n"
