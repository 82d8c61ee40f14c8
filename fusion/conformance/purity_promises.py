"""Promises of purity: the answer depends on the input alone, and asking changes nothing."""

from __future__ import annotations

import pickle
from typing import Any

from fusion.conformance.folds import NOISY, SEED, require_same, states_of, stepped, updates_of
from fusion.conformance.promise import Promise, promise, require
from fusion.estimator import Tag
from fusion.fold import Update
from fusion.tracker import Tracker
from fusion.values import NANOSECONDS, seconds

PROMISES: list[Promise] = []


@promise(PROMISES, "same-bytes", "Same input, same bytes: without that a replay proves nothing.")
def _same_bytes(made: type[Any]) -> None:
    require_same(updates_of(made, NOISY), updates_of(made, NOISY), "two runs over the same measurements differ")


@promise(
    PROMISES,
    "no-hidden-dice",
    "Chance is declared: without the tag another seed changes nothing.",
    unless=[Tag.STOCHASTIC],
)
def _no_hidden_dice(made: type[Any]) -> None:
    require_same(updates_of(made, NOISY), updates_of(made, NOISY, seed=SEED + 1), "another seed gives another answer")


@promise(PROMISES, "step-is-pure", "One state stepped twice gives one answer: the host goes back to old states.")
def _step_is_pure(made: type[Any]) -> None:
    for estimator, state, epoch in states_of(made, NOISY):
        once, again = (stepped(estimator, state, epoch) for _ in range(2))
        require_same([once], [again], "the same state stepped twice gives two answers")


@promise(PROMISES, "state-is-kept", "A step leaves the state it was given as it was: old states are the host's memory.")
def _state_is_kept(made: type[Any]) -> None:
    for estimator, state, epoch in states_of(made, NOISY):
        before = pickle.dumps(state)
        stepped(estimator, state, epoch)
        require(
            pickle.dumps(state) == before,
            f"step or estimate wrote into the state it was given, at {seconds(epoch.time_ns)} s",
        )


@promise(PROMISES, "estimate-is-pure", "Asking changes nothing: a display may ask as often as it likes.")
def _estimate_is_pure(made: type[Any]) -> None:
    world = NOISY.world()
    tracker = Tracker(made(world), world, NOISY.prior(), seed=SEED)
    asked: list[Update] = []
    for measurement in NOISY.measurements():
        asked += tracker.push(measurement)
        tracker.estimate(measurement.time_ns + NANOSECONDS)
    require_same(updates_of(made, NOISY), asked, "asking for estimates in between changed the answer")


@promise(PROMISES, "state-pickles", "A state survives being stored: warm starts and other processes need it.")
def _state_pickles(made: type[Any]) -> None:
    for estimator, state, epoch in states_of(made, NOISY):
        stored = pickle.loads(pickle.dumps(state))  # noqa: S301 - our own bytes, a moment old
        once, again = (stepped(estimator, given, epoch) for given in (state, stored))
        require_same([once], [again], "a state that was pickled and brought back goes on differently")
