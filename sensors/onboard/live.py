"""Where the robot is, now: the sensors of a robot through an estimator, as they speak.

The same loop as a recording and the same fold as a replay. What the estimator says to each measurement goes into the
log, and a replay of that log says the same again, to the bit. Between measurements the pose is asked for at a steady
pace, for the moment of asking.
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
from sensors.onboard.guarded_tracker import Lane
from sensors.onboard.recorder import Answers, Recorder, check_policy
from sensors.onboard.robot_file import RobotFile
from sensors.onboard.sensor_loop import PATIENCE_S, Sensing, Turn, check_duration
from sensors.onboard.supervisor import Status

FASTEST_HZ = 1000.0


class Now(NamedTuple):
    """The pose at ``time_ns`` of CLOCK_BOOTTIME, when it was asked for.

    ``estimate`` is None once the estimator ended; ``error`` says why. ``measurements`` is how many it had heard: fold
    as many of the recorded log and ask for the same time, and the answer is the same. ``fates`` counts what became of
    readings since the last `Now`, ``news`` tells what ended since then. ``statuses``: how the sensors do, the age of
    the freshest measurement of each among it. ``warning``: what may have led all estimates astray, "" where nothing is
    known to.
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
    """What came of it. ``digests`` certify what each estimator said that did not fail; ``trouble`` is what went wrong
    on the way, "" where all went well.
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
    """The pose by the estimator of that name ``hz`` times a second, until ``stop`` is set or the time is over.

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
        raise ParameterError(f"shadow {shadows[0]!r}: nobody would hear it; say where to record, with -o FOLDER")
    check_duration(duration_s)
    contestants = _contestants(robot.world, [estimator, *shadows], options or {}, seed)
    sensing = Sensing(robot)
    if folder is not None:
        check_policy(robot.policy, folder)
    patience = None if degraded else patience_s
    return _run(robot, sensing, contestants, folder, hz, stop or threading.Event(), duration_s, patience)


class _Contestant(NamedTuple):
    """An estimator that is to run, and what it was built with."""

    name: str
    estimator: Estimator[Any]
    options: Mapping[str, object]
    seed: int

    @property
    def record(self) -> dict[str, object]:
        """What a replay must be given to say the same."""
        return {"parameters": dict(self.options), "seed": self.seed}


def _contestants(
    world: World, names: Sequence[str], options: Mapping[str, object], seed: int
) -> tuple[_Contestant, ...]:
    """The first with ``options``, those in its shadow as they come."""
    for name in names:
        if names.count(name) > 1:
            raise ParameterError(f"shadow {name!r}: runs already; a log could not tell the two apart, name another")
    given = [options, *({} for _ in names[1:])]
    return tuple(_Contestant(name, build(name, world, own), own, seed) for name, own in zip(names, given, strict=True))


def _run(
    robot: RobotFile,
    sensing: Sensing,
    contestants: Sequence[_Contestant],
    folder: Path | None,
    hz: float,
    stop: threading.Event,
    duration_s: float | None,
    patience_s: float | None,
) -> Generator[Now, None, Ended]:
    with sensing:
        if patience_s is not None:
            sensing.await_open(patience_s, stop)
        prior = robot.start.prior(sensing.began_ns, robot.world)
        timeline = Timeline(robot.world, prior.time_ns)
        lanes = [Lane(one.name, one.estimator, prior, one.seed) for one in contestants]
        about = {"live_lanes": json.dumps({one.name: one.record for one in contestants})}
        with Recorder(robot, folder, prior, about) if folder else nullcontext() as recorder:
            fold = _Fold(sensing, timeline, lanes, recorder)
            try:
                for turn in sensing.turns(stop, duration_s, 1.0 / hz):
                    fold.take(turn)
                    if turn.beat:
                        yield fold.now()
            finally:
                fold.close()
    return fold.ended(seconds(sensing.clock.now_ns() - prior.time_ns))


class _Fold:
    """Every turn through every lane and into the log; the first lane is the one that is asked for the pose. Order and
    motion are found once, for all of them.
    """

    def __init__(self, sensing: Sensing, timeline: Timeline, lanes: Sequence[Lane], recorder: Recorder | None) -> None:
        self._sensing, self._timeline, self._lanes = sensing, timeline, lanes
        self._kept = self._recorder = recorder
        self._measurements = 0
        self._fates: Counter[Decision] = Counter()
        self._troubles: dict[str, str] = {}
        self._news: list[str] = []

    def take(self, turn: Turn) -> None:
        """Fold what came, and write it."""
        answers = [self._hear(one) for one in turn.received]
        if self._recorder:
            self._recorder.take(turn, answers)
        self._notice(turn.now_ns)
        if self._lanes[0].error and not self._recorder:
            self._sensing.end(self._lanes[0].error)

    def now(self) -> Now:
        """The pose for this moment, and what happened since the last."""
        lane, now_ns = self._lanes[0], self._sensing.clock.now_ns()
        time_ns = max(now_ns, self._timeline.time_ns)
        estimate = lane.estimate(self._timeline.held(time_ns), time_ns)
        fates, self._fates = self._fates, Counter()
        news, self._news = self._news, []
        statuses, warning = self._sensing.statuses(), self._sensing.warning
        return Now(now_ns, estimate, lane.error, self._measurements, fates, statuses, news, warning)

    def close(self) -> None:
        """Certify what was said in the log."""
        if self._recorder:
            self._recorder.note({"live_digests": json.dumps(self._digests())})

    def ended(self, duration_s: float) -> Ended:
        """What came of it."""
        troubles = [*self._troubles.values(), *filter(None, [self._sensing.trouble, self._sensing.warning])]
        paths = self._kept.paths if self._kept else ()
        statuses = tuple(self._sensing.statuses())
        return Ended(paths, statuses, duration_s, self._digests(), "; ".join(dict.fromkeys(troubles)))

    def _digests(self) -> dict[str, str]:
        return {lane.name: lane.digest for lane in self._lanes if lane.digest}

    def _hear(self, received: Received) -> Answers:
        said = received.said
        if isinstance(said, Truth | Diagnostic):
            return ()
        self._measurements += 1
        moments = self._moments(said)
        own = self._lanes[0].take(moments)
        self._fates.update(fate.decision for update in own if not update.revised for fate in update.fates)
        others = [(lane.name, update) for lane in self._lanes[1:] for update in lane.take(moments)]
        return [*((self._lanes[0].name, update) for update in own), *others]

    def _moments(self, measurement: Measurement) -> Sequence[Moment]:
        """The run after a measurement; none where the front end cannot take it, which ends every lane."""
        try:
            return self._timeline.push(measurement)
        except FusionError as error:
            for lane in self._lanes:
                lane.end(str(error))
            return ()

    def _notice(self, now_ns: int) -> None:
        """Tell once of every lane that ended, and of the recording."""
        for lane in self._lanes:
            if self._recorder and lane.name in self._recorder.refused:
                lane.end(self._recorder.refused[lane.name])
            if lane.error and lane.name not in self._troubles:
                self._tell(lane.name, lane.error, now_ns)
        if self._recorder and self._recorder.trouble:
            self._tell("", f"the recording ended: {self._recorder.trouble}", now_ns)
            with suppress(LogError):  # what it could not write was told just now
                self._recorder.close()
            self._recorder = None

    def _tell(self, who: str, trouble: str, now_ns: int) -> None:
        self._troubles[who] = trouble
        self._news.append(trouble)
        if self._recorder and who:
            self._recorder.diagnostic(Diagnostic(now_ns, who, Level.ERROR, trouble))
