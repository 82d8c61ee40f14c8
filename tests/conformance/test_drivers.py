"""Every installed driver keeps every promise of the contract, on the fake device that it ships."""

import pytest

import fusion
from fusion.conformance.checks import Outcome
from fusion.conformance.driver_promises import DRIVER_PROMISES, driver_verdict
from fusion.plugins import SENSORS


@pytest.mark.parametrize("promise", DRIVER_PROMISES, ids=lambda promise: promise.id)
@pytest.mark.parametrize("name", fusion.names(SENSORS))
def test_a_driver_keeps_its_promises(name, promise):
    verdict = driver_verdict(promise, fusion.load(name, SENSORS))
    assert verdict.outcome is Outcome.KEPT, verdict.detail
