"""Streams of measurements, a world that counts, and an estimator that keeps a ledger of what the host gives it."""

import math
from collections import Counter
from dataclasses import fields, replace
from functools import reduce

import numpy as np
from hypothesis import strategies as st

from fusion import (
    Covariance,
    Decision,
    Estimate,
    Fate,
    Gyro,
    Increment,
    Odometry,
    OdometryNoise,
    Pose,
    Prior,
    RangeReading,
    Ranges,
    Reason,
    RssiReading,
    WifiScan,
    World,
    final,
)
from fusion.epochs import LONGEST
from fusion.timeline import Timeline, order
from fusion.tracker import Tracker

SECOND = 1_000_000_000
MILLISECOND = 1_000_000
NOISE = OdometryNoise()
ANCHORS = [
    {"id": "a", "position_m": [0, 0, 2]},
    {"id": "b", "position_m": [8, 0, 2]},
    {"id": "c", "position_m": [1, 6, 2]},
]
WORLD = World.from_table({"anchors": ANCHORS})
PRIOR = Prior(0, Pose(2.0, 1.0, 0.3), Covariance.from_std(0.1, 0.1, 0.1))


def world(**extra):
    return World.from_table({"anchors": ANCHORS, **extra})


def prior(**known):
    return replace(PRIOR, **known)


def drive(seconds=20, seed=1):
    """A gentle curve with odometry at 10 Hz and a scan of all anchors at 2 Hz."""
    random = np.random.default_rng(seed)
    pose, measurements = Pose(2.0, 1.0, 0.3), []
    for k in range(1, seconds * 10 + 1):
        t = k * SECOND // 10
        pose = pose.compose(Pose(0.03, 0.0, 0.02))
        measurements.append(Odometry(t, "wheels", k, t - SECOND // 10, 0.03, 0.02))
        if k % 5 == 0:
            far = {a["id"]: math.dist((pose.x, pose.y, 0.0), a["position_m"]) for a in ANCHORS}
            readings = tuple(RangeReading(n, d + random.normal(0, 0.1)) for n, d in far.items())
            measurements.append(Ranges(t, "uwb", k, readings))
    return measurements, pose


def odometry(k, distance_m=0.05, turn_rad=0.02, period_ns=SECOND // 10):
    """Number ``k``, from 1 on, of a steady stream."""
    return Odometry(k * period_ns, "wheels", k, (k - 1) * period_ns, distance_m, turn_rad)


def ranges(time_ns, seq=0, anchors="abc"):
    return Ranges(time_ns, "uwb", seq, tuple(RangeReading(anchor, 3.0 + 0.1 * (seq % 7)) for anchor in anchors))


SCANS_MS = (1050, 2000, 3333)
STREAM = sorted(
    [*(odometry(k) for k in range(1, 41)), *(ranges(ms * MILLISECOND, ms) for ms in SCANS_MS)],
    key=order,
)
"""Four seconds of odometry at 10 Hz, and three scans."""
LATE_SCAN = ranges(2 * SECOND, 2000)
LATE = [m for m in STREAM if m != LATE_SCAN]
LATE.insert(LATE.index(ranges(3333 * MILLISECOND, 3333)) + 1, LATE_SCAN)
"""The same, the second scan after the third."""
CLOSED_S = math.ceil(LONGEST.duration_s)
LONG = [odometry(k, 0.1, 0.01, SECOND) for k in range(1, 2 * CLOSED_S + 5)]
"""Two stretches that are closed, and the beginning of a third."""


@st.composite
def steps(draw, min_size=1, max_size=25):
    """Odometry without a gap, some of it unmeasured."""
    numbers = st.tuples(st.integers(1, 900), st.floats(-0.5, 0.5), st.floats(-2.0, 2.0), st.booleans())
    found, time_ns = [], 0
    for k, (period_ms, distance_m, turn_rad, measured) in enumerate(
        draw(st.lists(numbers, min_size=min_size, max_size=max_size))
    ):
        from_ns, time_ns = time_ns, time_ns + period_ms * MILLISECOND
        found.append(Odometry(time_ns, "wheels", k, from_ns, distance_m, turn_rad, measured))
    return found


@st.composite
def streams(draw):
    """Odometry, ranges, Wi-Fi and gyro of some seconds, in order."""
    motion = draw(steps(min_size=3))
    times_ns = st.integers(1, motion[-1].time_ns)
    found = list(motion)
    for k, time_ns in enumerate(draw(st.lists(times_ns, max_size=6))):
        found.append(ranges(time_ns, k, "abc"[: 1 + k % 3]))
    for k, time_ns in enumerate(draw(st.lists(times_ns, max_size=4))):
        found.append(WifiScan(time_ns, "wifi", k, (RssiReading("b", -50.0 - k), RssiReading("nowhere", -60.0))))
    for k, time_ns in enumerate(draw(st.lists(times_ns, max_size=4))):
        found.append(Gyro(time_ns, "gyro", k, 0.1 * k))
    return sorted(found, key=order)


@st.composite
def late_streams(draw):
    """A stream in order, and the same as it arrives, each measurement up to 1.9 s late."""
    stream = draw(streams())
    delays_ms = draw(st.lists(st.integers(0, 1900), min_size=len(stream), max_size=len(stream)))
    arrivals = [one.time_ns + delay * MILLISECOND for one, delay in zip(stream, delays_ms, strict=True)]
    return stream, [stream[i] for i in sorted(range(len(stream)), key=arrivals.__getitem__)]


def moments_of(measurements, world=WORLD, **options):
    timeline = Timeline(world, PRIOR.time_ns, **options)
    return [moment for measurement in measurements for moment in timeline.push(measurement)]


def epochs_of(moments):
    """The epochs of the run as they stand after all ``moments``."""
    run = []
    for moment in moments:
        assert moment.first <= len(run)
        run[moment.first :] = moment.epochs
    return run


def joined(epochs):
    """All the motion of some epochs as one increment."""
    return reduce(Increment.then, (epoch.motion for epoch in epochs), Increment())


def integrated(odometries, time_ns=0):
    motion = Increment(time_ns=time_ns)
    for step in odometries:
        motion = motion.extend(step, NOISE)
    return motion


def numbers(motion):
    """Everything in an increment, flat."""
    x, y, heading, covariance, *rest = motion
    return [x, y, heading, *covariance, *rest]


def updates_of(estimator, measurements, world=WORLD, seed=0):
    tracker = Tracker(estimator, world, PRIOR, seed=seed)
    return [update for measurement in measurements for update in tracker.push(measurement)]


def last_words(updates):
    return [(update.measurement, update.fates, update.estimate) for update in final(updates)]


class CountingWorld(World):
    """A world that counts how often it is asked for an anchor: once for each reading that is screened."""

    def __init__(self, world):
        for field in fields(World):
            object.__setattr__(self, field.name, getattr(world, field.name))
        object.__setattr__(self, "asked", Counter())

    def anchor(self, anchor_id):
        self.asked[anchor_id] += 1
        return super().anchor(anchor_id)


class Ledger:
    """Its state is every epoch that it was given: whatever the host does otherwise shows in it."""

    summary, tags = "keeps a ledger", frozenset()

    def __init__(self):
        self.stepped = self.asked = 0

    def start(self, prior, seed):
        return ()

    def step(self, state, motion, scan):
        self.stepped += 1
        readings = () if scan is None else scan.readings
        who = () if scan is None else (scan.time_ns, scan.sensor, scan.seq)
        return (*state, (motion, scan)), tuple(Fate(*who, r.anchor, Decision.USED, Reason.OK, 1.0) for r in readings)

    def estimate(self, state, motion, time_ns):
        self.asked += 1
        whole = reduce(Increment.then, (moved for moved, _ in state), Increment()).then(motion)
        return Estimate(time_ns, PRIOR.pose.compose(whole.pose), whole.covariance)

    def particles(self, state):
        """The state itself, for tests to look at."""
        return state


class Steps(list):
    """Steps of motion that an odometer hands over, as increments."""

    def __call__(self, from_ns, time_ns, distance_m, turn_rad, measured):
        self.append(Odometry(time_ns, "step", len(self), from_ns, distance_m, turn_rad, measured))


def stepped(odometer, *measurements):
    """The steps of several measurements."""
    steps = Steps()
    for measurement in measurements:
        odometer.advance(measurement, steps)
    return steps
