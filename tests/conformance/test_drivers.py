"""Every installed driver keeps every promise of the contract, on the fake device that it ships."""

import pytest

import fusion
from fusion.conformance.checks import Check, Outcome, verdict
from fusion.conformance.driver_promises import DRIVER_PROMISES
from fusion.plugins import SENSORS


@pytest.mark.parametrize("promise", DRIVER_PROMISES, ids=lambda promise: promise.id)
@pytest.mark.parametrize("name", fusion.names(SENSORS))
def test_a_driver_keeps_its_promises(name, promise):
    kept = verdict(Check(promise, fusion.load(name, SENSORS)))
    assert kept.outcome is Outcome.KEPT, kept.detail
