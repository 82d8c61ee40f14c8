"""A robot whose wheels turn in a direction that nothing measures is refused, or warned of while it drives."""

import json
import re
import threading
from dataclasses import replace

import pytest

from fusion import FusionError, MotorCommand, SettingError, WheelTicks
from fusion.cli.main import main
from logs.reader import read_run
from logs.wheel_direction import caution
from sensors.cli import doctor
from sensors.cli.live import record as line
from sensors.onboard.driver_lifecycle import Received, State
from sensors.onboard.live import live
from sensors.onboard.recorder import record
from sensors.onboard.sensor_loop import SensorLoop
from sensors.onboard.supervisor import Status
from tests.sensors.robot_files import robot_text

NO_MOTORS = {"motors": '{ kind = "unplug" }'}
MOTORS_LOST = {"motors": '{ kind = "unplug", from_s = 1.5 }'}
PARTLY = r"single-channel encoders without motor commands for \d\.\d\d m of a wheel's way, first at \d\.\d s: "


@pytest.fixture
def sentence(robot):
    """The sentence about the robot in `room` without its motor commands, everywhere the same."""
    return str(caution(robot().world.robot, {WheelTicks}))


def recorded(robot, folder, duration_s, **options):
    return record(robot, folder, stop=threading.Event(), duration_s=duration_s, **options)


def lived(robot, duration_s, **options):
    """Every pose, and how it ended."""
    poses, given = live(robot, "ekf", duration_s=duration_s, **options), []
    while True:
        try:
            given.append(next(poses))
        except StopIteration as end:
            return given, end.value


def test_a_robot_file_without_motor_commands_is_refused_before_anything_runs(robot, tmp_path, sentence):
    """With a shadow too, and when it may start without what is missing: a sensor that no file names is not missing."""
    one, folder = robot(leave_out=["motors"]), tmp_path / "out"
    for start in (
        lambda: recorded(one, folder, 0.5),
        lambda: recorded(one, folder, 0.5, degraded=True),
        lambda: live(one, "ekf"),
        lambda: live(one, "radio_only", folder=folder, shadows=["dead_reckoning"], degraded=True),
    ):
        with pytest.raises(SettingError) as refused:
            start()
        assert str(refused.value) == sentence
    assert not folder.exists()


def test_a_robot_file_that_needs_no_motor_commands_is_not_refused(robot, tmp_path):
    assert recorded(robot(leave_out=["motors", "encoders"]), tmp_path / "out", 0.2).warning == ""
    sees = robot(leave_out=["motors"])
    sees = replace(sees, world=replace(sees.world, robot=replace(sees.world.robot, encoder="quadrature")))
    assert recorded(sees, tmp_path / "out", 0.2).warning == ""


def test_the_commands_give_it_in_one_sentence(tmp_path, capsys, sentence):
    path = tmp_path / "trolley.toml"
    path.write_text(robot_text(leave_out=["motors"]))
    assert main(["record", str(path), "-o", str(tmp_path / "out")]) == 1
    assert capsys.readouterr().err == f"fusion record: {sentence}\n"
    assert main(["live", str(path), "--estimator", "ekf"]) == 1
    assert capsys.readouterr().err == f"fusion live: {sentence}\n"
    assert main(["doctor", str(path), "-o", str(tmp_path)]) == 1
    what, cure = sentence.split("; ")
    assert f"FIX   {what}\n      ↳ {cure}\n" in capsys.readouterr().out


def test_the_doctor_names_it_once_and_only_where_it_is_so(robot, tmp_path, sentence):
    def found(robot):
        return [str(advice) for advice in doctor.examine(robot, tmp_path) if advice.what.startswith("single-channel")]

    assert found(robot(leave_out=["motors"])) == [sentence]
    assert found(robot()) == []
    assert found(robot(leave_out=["motors", "encoders"])) == []


def test_motor_commands_that_are_there_need_no_word(robot, tmp_path):
    done = recorded(robot(), tmp_path / "out", 1.0)
    assert done.warning == ""
    assert not read_run(done.paths[0]).warnings


@pytest.mark.parametrize(
    ("faults", "required", "degraded"),
    [(NO_MOTORS, True, True), (NO_MOTORS, False, False), (MOTORS_LOST, True, False), (MOTORS_LOST, False, False)],
    ids=["missing, degraded", "missing, optional", "lost", "lost, optional"],
)
def test_a_recording_without_its_motor_commands_warns_and_so_does_its_log(robot, tmp_path, faults, required, degraded):
    warnings = []
    options = {"degraded": degraded, "on_status": lambda _, warning: warnings.append(warning)}
    one = robot(faults=faults, required={"motors": required})
    done = recorded(one, tmp_path / "out", 3.0, **options)
    assert done.trouble == ""
    assert re.match(PARTLY, done.warning)
    assert warnings[-1], "while it runs, not only at its end"
    (warning,) = read_run(done.paths[0]).warnings
    assert "single-channel encoders without motor commands" in warning


def test_a_required_sensor_of_motor_commands_that_is_missing_refuses_the_start(robot, tmp_path):
    with pytest.raises(FusionError, match=r"motors: .*unplugged.*--degraded"):
        recorded(robot(faults=NO_MOTORS), tmp_path / "out", 0.5, patience_s=0.3)


def test_every_pose_after_the_loss_of_the_motor_commands_carries_the_warning(robot, tmp_path):
    poses, ended = lived(robot(faults=MOTORS_LOST), 3.0, folder=tmp_path / "out", shadows=["dead_reckoning"])
    assert line(poses[0])["warning"] is None
    assert line(poses[-1])["warning"] == poses[-1].warning
    first = next(k for k, now in enumerate(poses) if now.warning)
    assert all(now.warning for now in poses[first:])
    assert poses[-1].estimate.valid, "the pose goes on"
    assert "without motor commands for" in ended.trouble
    (warning,) = read_run(ended.paths[0]).warnings
    assert "without motor commands for" in warning


def test_the_commands_warn_once_while_they_run_and_at_the_end(tmp_path, capsys):
    path = tmp_path / "trolley.toml"
    path.write_text(robot_text(faults=MOTORS_LOST))
    assert main(["record", str(path), "-o", str(tmp_path / "out"), "--duration", "3.0", "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["warning"]
    assert err.count("warning: single-channel encoders without motor commands for") == 2
    assert main(["live", str(path), "--estimator", "ekf", "--duration", "3.0"]) == 1
    out, err = capsys.readouterr()
    assert json.loads(out.splitlines()[-1])["warning"].startswith("single-channel encoders without")
    assert err.count("warning: single-channel encoders without motor commands for") == 1
    assert err.splitlines()[-1].startswith("fusion live: single-channel encoders without motor commands for")


def test_a_driver_that_its_device_holds_up_states_no_direction(robot):
    """It reports nothing, for it does not come back; its status shows it."""
    loop = SensorLoop(robot())
    said = [MotorCommand(0, "motors", 0, (0.6,) * 4), *(WheelTicks(k, "encoders", k, (20 * k,) * 4) for k in range(3))]
    loop._supervisor.take = lambda _: [Received(one.time_ns, one) for one in said]
    next(loop.batches(threading.Event()))
    assert loop.warning == ""
    loop.statuses = lambda: [Status("motors", State.STALLED, None, None, 1, 0, 0, "its device holds the driver up")]
    loop._report()
    said = [WheelTicks(k, "encoders", k, (20 * k,) * 4) for k in range(3, 5)]
    next(loop.batches(threading.Event()))
    assert "for 0.41 m of a wheel's way" in loop.warning
