"""What the replay certificate covers: every bit of the motion, the fates, and the estimate at every epoch."""

import math
from dataclasses import replace

import pytest

from fusion import Decision, Estimate, Fate, Increment, Odometry, Pose, Reason, Update, digest, final
from fusion.certificate import Certificate
from tests.fusion.streams import (
    CLOSED_S,
    LATE,
    LONG,
    PRIOR,
    SCANS_MS,
    SECOND,
    STREAM,
    Ledger,
    odometry,
    ranges,
    updates_of,
)


class Constant(Ledger):
    """Its fates and estimates depend on nothing but the number of epochs."""

    def estimate(self, state, motion, time_ns):
        return Estimate(time_ns, Pose(float(len(state)), 0.0, 0.0), None)


def changed(stream, index, **values):
    return [replace(m, **values) if i == index else m for i, m in enumerate(stream)]


def by_an_ulp(number):
    return math.nextafter(number, math.inf)


@pytest.mark.parametrize("name", ["distance_m", "turn_rad"])
@pytest.mark.parametrize("estimator", [Constant, Ledger])
def test_certificate_distinguishes_motions_that_differ_in_the_last_bit(estimator, name):
    """An epoch of one increment, for a sum may swallow a bit; to `Constant` nothing else differs."""
    stream = [odometry(1), ranges(SECOND // 10), *STREAM[1:]]
    moved = changed(stream, 0, **{name: by_an_ulp(getattr(stream[0], name))})
    assert digest(updates_of(estimator(), moved)) != digest(updates_of(estimator(), stream))


@pytest.mark.parametrize("place", ["covariance", *Increment._fields])
def test_certificate_covers_every_number_of_the_motion(place):
    (epoch,) = updates_of(Constant(), LONG)[CLOSED_S - 1].epochs
    value = getattr(epoch.motion, place)
    if place == "covariance":
        others = [value._replace(**{axis: by_an_ulp(getattr(value, axis))}) for axis in value._fields]
    else:
        others = [value + 1 if isinstance(value, int) else by_an_ulp(value)]
    estimate = Estimate(0, PRIOR.pose, None)
    for other in others:
        moved = epoch._replace(motion=epoch.motion._replace(**{place: other}))
        one, another = (digest([Update(LONG[CLOSED_S - 1], estimate, (), epochs=(e,))]) for e in (epoch, moved))
        assert one != another


def test_certificate_covers_fates_of_the_screening_and_of_the_estimator():
    """A reading of an anchor that the world does not have changes no estimate."""
    with_unknown = changed(STREAM, STREAM.index(ranges(2 * SECOND, 2000)))
    unknown = replace(ranges(2 * SECOND, 2000), readings=ranges(0, 0, "abcz").readings)
    with_unknown[with_unknown.index(ranges(2 * SECOND, 2000))] = unknown

    class Downweights(Constant):
        def step(self, state, motion, scan):
            after, fates = super().step(state, motion, scan)
            return after, tuple(fate._replace(weight=by_an_ulp(0.5)) for fate in fates)

    class DownweightsLess(Constant):
        def step(self, state, motion, scan):
            after, fates = super().step(state, motion, scan)
            return after, tuple(fate._replace(weight=0.5) for fate in fates)

    digests = {
        digest(updates_of(estimator(), stream))
        for estimator, stream in (
            (Constant, STREAM),
            (Constant, with_unknown),
            (Downweights, STREAM),
            (DownweightsLess, STREAM),
        )
    }
    assert len(digests) == 4


FATE = Fate(0, "uwb", 0, "a", Decision.USED, Reason.OK, 1.0)


@pytest.mark.parametrize(
    "change",
    [
        {"time_ns": 1},
        {"sensor": "uwb2"},
        {"seq": 1},
        {"anchor": "b"},
        {"decision": Decision.REJECTED},
        {"reason": Reason.GATE},
        {"weight": math.nextafter(1.0, 0.0)},
        {"innovation": 0.0},
        {"innovation_variance": 0.0},
        {"nis": 0.0},
    ],
    ids=lambda change: next(iter(change)),
)
def test_certificate_covers_every_field_of_a_fate(change):
    estimate = Estimate(0, PRIOR.pose, None)
    one, other = (digest([Update(ranges(0), estimate, (fate,))]) for fate in (FATE, FATE._replace(**change)))
    assert one != other


@pytest.mark.parametrize(
    "change",
    [
        {"time_ns": 1},
        {"pose": Pose(by_an_ulp(2.0), 1.0, 0.3)},
        {"pose": Pose(2.0, by_an_ulp(1.0), 0.3)},
        {"pose": Pose(2.0, 1.0, by_an_ulp(0.3))},
        {"covariance": None},
        {"covariance": PRIOR.covariance._replace(xy=-0.0)},
        {"covariance": PRIOR.covariance._replace(hh=by_an_ulp(PRIOR.covariance.hh))},
        {"valid": False},
        {"heading_known": False},
        {"p_lost": 0.0},
        {"reset_count": 1},
    ],
    ids=lambda change: next(iter(change)),
)
def test_certificate_covers_the_estimate_at_every_epoch(change):
    estimate = Estimate(0, PRIOR.pose, PRIOR.covariance)
    epochs = next(update.epochs for update in updates_of(Ledger(), STREAM) if update.epochs)
    one, other = (digest([Update(ranges(0), e, (), epochs=epochs)]) for e in (estimate, estimate._replace(**change)))
    assert one != other


def test_certificate_asks_for_an_estimate_at_epochs_and_at_the_end_alone():
    estimator = Ledger()
    digest(updates_of(estimator, STREAM))
    assert estimator.asked == len(SCANS_MS) + 1


def test_certificate_so_far_is_the_digest_of_the_updates_so_far():
    certificate, updates = Certificate(), updates_of(Ledger(), STREAM)
    for count, update in enumerate(updates, start=1):
        certificate.add(update)
        if count % 10 == 0:
            assert certificate.digest == digest(updates[:count])


def test_certificate_distinguishes_an_order_of_arrival_and_the_last_words_do_not():
    in_order, revised = updates_of(Ledger(), STREAM), updates_of(Ledger(), LATE)
    assert digest(in_order) != digest(revised)
    assert digest(final(in_order)) == digest(final(revised))


@pytest.mark.parametrize("stream", [STREAM, [odometry(k) for k in range(1, 41)]], ids=["tail", "no radio"])
def test_certificate_covers_the_motion_after_the_last_epoch(stream):
    far = changed(stream, len(stream) - 1, distance_m=3.0)
    assert isinstance(stream[-1], Odometry)
    one, other = updates_of(Ledger(), stream), updates_of(Ledger(), far)
    assert one[-1].estimate != other[-1].estimate
    assert digest(one) != digest(other)
