"""The live pose: the sensors of a robot through an estimator, as their measurements arrive.

The same loop as a recording and the same fold as a replay. The updates of the estimator go into the log, and a replay
of that log computes the same ones, to the bit. Between measurements the pose is computed at a steady rate, for the
moment at which it is asked for.
"""

from __future__ import annotations

import json
import threading
from collections import Counter
from collections.abc import Generator, Mapping, Sequence
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any, NamedTuple

from fusion import (
    Decision,
    Diagnostic,
    Estimate,
    Estimator,
    FusionError,
    Level,
    LogError,
    Measurement,
    Moment,
    ParameterError,
    Timeline,
    Truth,
    World,
    build,
)
from fusion.values import seconds
from sensors.onboard.driver_lifecycle import Received
from sensors.onboard.guarded_tracker import GuardedTracker
from sensors.onboard.recorder import Answers, Recorder, check_policy
from sensors.onboard.robot_file import RobotFile
from sensors.onboard.sensor_loop import PATIENCE_S, Batch, SensorLoop, check_duration
from sensors.onboard.supervisor import Status

FASTEST_HZ = 1000.0


class Now(NamedTuple):
    """The pose at ``time_ns`` of CLOCK_BOOTTIME, when it was asked for.

    ``estimate`` is None once the estimator ended, for the reason ``error``. ``measurements`` counts those it had taken:
    fold as many of the recorded log and ask for the same time, and the answer is the same. ``fates`` counts those of
    readings since the last `Now`, ``news`` are the errors since then. ``statuses``: of the sensors, with the age of the
    freshest measurement of each. ``warning``: what may have led all estimates astray, "" where nothing is known to.
    """

    time_ns: int
    estimate: Estimate | None
    error: str
    measurements: int
    fates: Mapping[Decision, int]
    statuses: Sequence[Status]
    news: Sequence[str]
    warning: str = ""


class Ended(NamedTuple):
    """Result of a live run. ``digests`` certify the updates of each estimator that did not fail; ``trouble`` is what
    went wrong on the way, "" where all went well.
    """

    paths: tuple[Path, ...]
    statuses: tuple[Status, ...]
    duration_s: float
    digests: Mapping[str, str]
    trouble: str


def live(
    robot: RobotFile,
    estimator: str,
    *,
    options: Mapping[str, object] | None = None,
    seed: int = 0,
    shadows: Sequence[str] = (),
    folder: Path | None = None,
    hz: float = 10.0,
    stop: threading.Event | None = None,
    duration_s: float | None = None,
    degraded: bool = False,
    patience_s: float = PATIENCE_S,
) -> Generator[Now, None, Ended]:
    """Poses by the estimator of that name, ``hz`` a second, until ``stop`` is set or the time is over.

    ``folder``: record everything there too, the estimates among it; a disk that fills up ends the recording alone.
    ``shadows``: more estimators on the same measurements, for the log. Closing the generator lets go of the sensors
    and finishes the log. What the caller does between two poses holds up the loop; after twenty seconds of that a
    gyro's queue drops its oldest.

    Raises `PluginError`, `ParameterError`, `SettingError` or `LogError` at once; where a required sensor does not open
    (unless ``degraded``), `NotFoundError` with the first pose.
    """
    if not 0.0 < hz <= FASTEST_HZ:
        raise ParameterError(f"hz {hz:g}: give a rate above zero, at most {FASTEST_HZ:g}")
    if shadows and folder is None:
        raise ParameterError(f"shadow {shadows[0]!r}: its estimates go into a log alone; name its folder by -o")
    check_duration(duration_s)
    configured = _configured(robot.world, [estimator, *shadows], options or {}, seed)
    loop = SensorLoop(robot)
    if folder is not None:
        check_policy(robot.policy, folder)
    patience = None if degraded else patience_s
    return _run(robot, loop, configured, folder, hz, stop or threading.Event(), duration_s, patience)


class _Configured(NamedTuple):
    """An estimator that is to run, and the configuration it was built with."""

    name: str
    estimator: Estimator[Any]
    options: Mapping[str, object]
    seed: int

    @property
    def record(self) -> dict[str, object]:
        """Configuration by which a replay computes the same."""
        return {"parameters": dict(self.options), "seed": self.seed}


def _configured(
    world: World, names: Sequence[str], options: Mapping[str, object], seed: int
) -> tuple[_Configured, ...]:
    """The first with ``options``, those in its shadow as they come."""
    for name in names:
        if names.count(name) > 1:
            raise ParameterError(f"shadow {name!r}: runs already, and a log cannot hold both; name another")
    given = [options, *({} for _ in names[1:])]
    return tuple(_Configured(name, build(name, world, own), own, seed) for name, own in zip(names, given, strict=True))


def _run(
    robot: RobotFile,
    loop: SensorLoop,
    configured: Sequence[_Configured],
    folder: Path | None,
    hz: float,
    stop: threading.Event,
    duration_s: float | None,
    patience_s: float | None,
) -> Generator[Now, None, Ended]:
    with loop:
        if patience_s is not None:
            loop.await_open(patience_s, stop)
        prior = robot.start.prior(loop.began_ns, robot.world)
        timeline = Timeline(robot.world, prior.time_ns)
        trackers = [GuardedTracker(one.name, one.estimator, prior, one.seed) for one in configured]
        about = {"live_lanes": json.dumps({one.name: one.record for one in configured})}
        with Recorder(robot, folder, prior, about) if folder else nullcontext() as recorder:
            fold = _Fold(loop, timeline, trackers, recorder)
            try:
                for batch in loop.batches(stop, duration_s, 1.0 / hz):
                    fold.take(batch)
                    if batch.tick:
                        yield fold.now()
            finally:
                fold.close()
    return fold.ended(seconds(loop.clock.now_ns() - prior.time_ns))


class _Fold:
    """Every batch through every tracker and into the log; the first tracker gives the pose, the others are its shadows.
    Order and motion are computed once, for all of them.
    """

    def __init__(
        self, loop: SensorLoop, timeline: Timeline, trackers: Sequence[GuardedTracker], recorder: Recorder | None
    ) -> None:
        self._loop, self._timeline, self._trackers = loop, timeline, trackers
        self._kept = self._recorder = recorder
        self._measurements = 0
        self._fates: Counter[Decision] = Counter()
        self._troubles: dict[str, str] = {}
        self._news: list[str] = []

    def take(self, batch: Batch) -> None:
        """Fold a batch, and write it."""
        answers = [self._update(one) for one in batch.received]
        if self._recorder:
            self._recorder.take(batch, answers)
        self._report_ends(batch.now_ns)
        if self._trackers[0].error and not self._recorder:
            self._loop.end(self._trackers[0].error)

    def now(self) -> Now:
        """The pose for this moment, and what happened since the last."""
        tracker, now_ns = self._trackers[0], self._loop.clock.now_ns()
        time_ns = max(now_ns, self._timeline.time_ns)
        estimate = tracker.estimate(self._timeline.held(time_ns), time_ns)
        fates, self._fates = self._fates, Counter()
        news, self._news = self._news, []
        statuses, warning = self._loop.statuses(), self._loop.warning
        return Now(now_ns, estimate, tracker.error, self._measurements, fates, statuses, news, warning)

    def close(self) -> None:
        """Certify the updates in the log."""
        if self._recorder:
            self._recorder.note({"live_digests": json.dumps(self._digests())})

    def ended(self, duration_s: float) -> Ended:
        """Result of the run."""
        troubles = [*self._troubles.values(), *filter(None, [self._loop.trouble, self._loop.warning])]
        paths = self._kept.paths if self._kept else ()
        statuses = tuple(self._loop.statuses())
        return Ended(paths, statuses, duration_s, self._digests(), "; ".join(dict.fromkeys(troubles)))

    def _digests(self) -> dict[str, str]:
        return {tracker.name: tracker.digest for tracker in self._trackers if tracker.digest}

    def _update(self, received: Received) -> Answers:
        output = received.output
        if isinstance(output, Truth | Diagnostic):
            return ()
        self._measurements += 1
        moments = self._moments(output)
        own = self._trackers[0].take(moments)
        self._fates.update(fate.decision for update in own if not update.revised for fate in update.fates)
        others = [(tracker.name, update) for tracker in self._trackers[1:] for update in tracker.take(moments)]
        return [*((self._trackers[0].name, update) for update in own), *others]

    def _moments(self, measurement: Measurement) -> Sequence[Moment]:
        """The run after a measurement; none where the front end cannot take it, which ends every tracker."""
        try:
            return self._timeline.push(measurement)
        except FusionError as error:
            for tracker in self._trackers:
                tracker.end(str(error))
            return ()

    def _report_ends(self, now_ns: int) -> None:
        """Report once that a tracker ended, or the recording."""
        for tracker in self._trackers:
            if self._recorder and tracker.name in self._recorder.refused:
                tracker.end(self._recorder.refused[tracker.name])
            if tracker.error and tracker.name not in self._troubles:
                self._report(tracker.name, tracker.error, now_ns)
        if self._recorder and self._recorder.trouble:
            self._report("", f"the recording ended: {self._recorder.trouble}", now_ns)
            with suppress(LogError):  # what it could not write was reported just now
                self._recorder.close()
            self._recorder = None

    def _report(self, name: str, trouble: str, now_ns: int) -> None:
        self._troubles[name] = trouble
        self._news.append(trouble)
        if self._recorder and name:
            self._recorder.write_diagnostic(Diagnostic(now_ns, name, Level.ERROR, trouble))
