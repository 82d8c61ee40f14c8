"""A review of a recording tells what became of its devices."""

from benchmarks.review.raw_sensors import worth_a_line
from fusion import Level, Remark
from logs.run import Run


def remark(text, level=Level.WARN):
    return Remark(1, "gyro", level, text)


def test_openings_and_complaints_are_told_and_routine_is_not():
    told = [remark("opened", Level.OK), remark("gone"), remark("broken", Level.ERROR)]
    routine = [remark("status"), remark("status", Level.OK), remark("state of the chip", Level.OK)]
    run = Run(None, "r", None, None, {}, (), None, (), {}, remarks=tuple(told + routine))
    assert worth_a_line(run) == told
