"""One estimator folded over the epochs of a run: its states are kept as long as late data may ask for them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from fusion.epochs import Epoch
from fusion.errors import FusionError, PluginError
from fusion.estimator import Estimator, ParticleEstimator, Particles
from fusion.motion import Increment
from fusion.timeline import Moment
from fusion.values import Estimate, Fate, Measurement, Prior


class Update:
    """An estimator after one measurement: what became of its readings, and the belief then.

    ``estimate`` is computed when it is first asked for; give a function for that, or the estimate itself. ``epochs``
    are those that the measurement closed. ``revised``: it was folded before, and a late one changed the result.
    """

    __slots__ = ("_estimate", "epochs", "fates", "measurement", "revised")

    def __init__(
        self,
        measurement: Measurement,
        estimate: Estimate | Callable[[], Estimate],
        fates: tuple[Fate, ...],
        epochs: tuple[Epoch, ...] = (),
        revised: bool = False,
    ) -> None:
        self.measurement = measurement
        self._estimate = estimate
        self.fates = fates
        self.epochs = epochs
        self.revised = revised

    @property
    def estimate(self) -> Estimate:
        """The belief after the measurement. Raises `PluginError` where the estimator fails."""
        if not isinstance(self._estimate, Estimate):
            self._estimate = self._estimate()
        return self._estimate


def asked(estimator: Estimator[Any], state: Any, motion: Increment, time_ns: int) -> Estimate:  # noqa: ANN401
    """The estimate of a state at ``time_ns``; raises `PluginError` where the estimator fails."""
    try:
        return estimator.estimate(state, motion, time_ns)
    except FusionError:
        raise
    except Exception as error:
        raise _failed(estimator, f"when asked for its estimate at {time_ns} ns", error) from error


def _asked_at(estimator: Estimator[Any], state: Any, moment: Moment) -> Estimate:  # noqa: ANN401
    return asked(estimator, state, moment.motion, moment.time_ns)


def _started(estimator: Estimator[Any], prior: Prior, seed: int) -> Any:  # noqa: ANN401 - a state is opaque
    try:
        return estimator.start(prior, seed)
    except FusionError:
        raise
    except Exception as error:
        raise _failed(estimator, "at its start", error) from error


def _failed(estimator: Estimator[Any], when: str, error: Exception) -> PluginError:
    return PluginError(
        f"{type(estimator).__name__} failed {when}: {error!r}; leave it out with --estimators, or report it to its "
        "author"
    )


class Fold:
    """The states of one estimator over the epochs of one run. Not thread-safe.

    Raises `PluginError` where the estimator fails at its start.
    """

    def __init__(self, estimator: Estimator[Any], prior: Prior, seed: int = 0) -> None:
        self._estimator = estimator
        self._settled = 0
        self._states: deque[Any] = deque([_started(estimator, prior, seed)])
        """``_states[i]`` is the state after ``_settled + i`` epochs."""

    def take(self, moment: Moment) -> Update:
        """Step through the epochs of a moment. Raises `PluginError` where the estimator fails."""
        states = self._states
        while self._settled + len(states) - 1 > moment.first:
            states.pop()
        fates = moment.fates
        for epoch in moment.epochs:
            state, more = self._stepped(states[-1], epoch)
            states.append(state)
            fates += more
        while self._settled < moment.settled:
            states.popleft()
            self._settled += 1
        ask = partial(_asked_at, self._estimator, states[-1], moment)
        return Update(moment.measurement, ask, fates, moment.epochs, moment.revised)

    def estimate(self, motion: Increment, time_ns: int) -> Estimate:
        """The belief at ``time_ns``, after the ``motion`` since the last epoch."""
        return asked(self._estimator, self._states[-1], motion, time_ns)

    def particles(self) -> Particles | None:
        """The belief at the last epoch as weighted points; None of an estimator that does not offer them."""
        if not isinstance(self._estimator, ParticleEstimator):
            return None
        try:
            return self._estimator.particles(self._states[-1])
        except FusionError:
            raise
        except Exception as error:
            raise _failed(self._estimator, "when asked for its particles", error) from error

    def _stepped(self, state: Any, epoch: Epoch) -> tuple[Any, tuple[Fate, ...]]:  # noqa: ANN401
        try:
            after, fates = self._estimator.step(state, epoch.motion, epoch.scan)
        except FusionError:
            raise
        except Exception as error:
            scan = "motion alone" if epoch.scan is None else f"{type(epoch.scan).__name__} of {epoch.scan.sensor!r}"
            raise _failed(self._estimator, f"on {scan} at {epoch.time_ns} ns", error) from error
        return after, fates
