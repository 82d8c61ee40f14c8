"""A crash costs a recording its last second and no more.

A copy of the files at some moment is what a crash at that moment would leave: what a program holds back in its memory
is in neither. So one recording is judged at many moments.
"""

import random
import shutil
import signal
import time
from itertools import pairwise

from fusion import BootClock
from fusion.values import Gyro, seconds
from logs.message_stream import Walk
from logs.messages import CODECS
from logs.reader import read_run
from logs.writer import LOSS_NS
from tests.sensors.virtual_drive import START_NS, virtual_drive

GYRO = CODECS[Gyro].topic
COPIES = 15
BUSY_S = 0.2
"""What a crash may cost beyond the second: the longest time of a batch."""
PAUSE_S = 0.1
"""A gyro reports 50 times a second; where nothing arrived for longer than this, the recorder was kept from running."""


def arrivals_ns(folder):
    """Times of arrival of all gyro messages in the logs of a folder, in order."""
    walks = map(Walk, folder.glob("*.mcap"))
    return sorted(message.log_time for walk in walks for source, message in walk if source.topic == GYRO)


def running_s(from_ns, to_ns, times_ns):
    """The part of a stretch of time in which the recorder was running, by all the arrivals of its recording."""
    beats_ns = [from_ns, *(time_ns for time_ns in times_ns if from_ns < time_ns <= to_ns)]
    return sum(min(seconds(late - early), PAUSE_S) for early, late in pairwise(beats_ns))


def test_at_no_moment_more_than_a_second_is_missing_on_the_disk(robot, tmp_path):
    folder, missing_ns = tmp_path / "out", []
    sizes, last_ns = {}, START_NS

    def look(now_ns):
        nonlocal sizes, last_ns
        if sizes != (sizes := {path: path.stat().st_size for path in folder.iterdir()}):
            last_ns = max(arrivals_ns(folder), default=last_ns)
        missing_ns.append(now_ns - last_ns)

    paths = virtual_drive(robot(record="min_free_mb = 0.0\nsplit_s = 2.5"), folder, 6.0, after_tick=look)
    assert len(paths) == 3
    assert len(missing_ns) >= 500
    assert max(missing_ns) <= LOSS_NS


def test_a_recording_process_keeps_that_pace_in_real_time(start_recording, tmp_path):
    """On a busy machine, too: time counts where the recorder was running, and few copies may wait for a slow disk."""
    moments, copies = random.Random(1), []
    process, began_ns = start_recording(), BootClock().now_ns()
    for number in range(COPIES):
        time.sleep(moments.uniform(0.05, 0.45))
        taken_ns = BootClock().now_ns()
        copied_ns = arrivals_ns(shutil.copytree(tmp_path / "out", tmp_path / str(number)))
        copies.append((taken_ns, copied_ns[-1] if copied_ns else began_ns))
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=30)
    everything_ns = arrivals_ns(tmp_path / "out")
    missing_s = sorted(running_s(last_ns, taken_ns, everything_ns) for taken_ns, last_ns in copies)
    assert missing_s[-1 - COPIES // 5] <= seconds(LOSS_NS) + BUSY_S, missing_s
    assert missing_s[-1] <= 5.0, missing_s


def test_a_killed_recording_can_be_read(start_recording, tmp_path):
    process = start_recording()
    while process.poll() is None and len(arrivals_ns(tmp_path / "out")) < 50:
        time.sleep(0.05)
    process.kill()
    process.communicate()
    (path,) = (tmp_path / "out").glob("*.mcap")
    run = read_run(path)
    assert len(run.measurements) >= 20
    assert any("cut off: at most 1.0 s" in warning for warning in run.warnings), run.warnings
