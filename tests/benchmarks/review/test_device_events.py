"""A review of a recording tells what became of its devices."""

from benchmarks.review.raw_sensors import worth_a_line
from fusion import Diagnostic, Level
from logs.run import Run


def diagnostic(text, level=Level.WARN):
    return Diagnostic(1, "gyro", level, text)


def test_openings_and_complaints_are_told_and_routine_is_not():
    told = [diagnostic("opened", Level.OK), diagnostic("gone"), diagnostic("broken", Level.ERROR)]
    routine = [diagnostic("status"), diagnostic("status", Level.OK), diagnostic("state of the chip", Level.OK)]
    run = Run(None, "r", None, None, {}, (), None, (), {}, diagnostics=tuple(told + routine))
    assert worth_a_line(run) == told
