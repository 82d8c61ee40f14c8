"""One estimator among those that run live: whatever it does wrong ends itself and nothing else."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from fusion import Covariance, Estimate, Estimator, Fold, FusionError, Increment, Moment, Pose, Prior, Update
from fusion.certificate import Certificate

Answer = TypeVar("Answer")


class GuardedTracker:
    """An estimator and its certificate so far. ``error`` is why it ended, "" while it goes on."""

    def __init__(self, name: str, estimator: Estimator[Any], prior: Prior, seed: int) -> None:
        self.name = name
        self.error = ""
        self._certificate = Certificate()
        self._fold = self._guarded(lambda: Fold(estimator, prior, seed))

    def take(self, moments: Sequence[Moment]) -> list[Update]:
        """Its updates by one measurement, the measurement's own first; none once it ended."""
        return self._guarded(lambda: self._certified(moments)) or []

    def estimate(self, motion: Increment, time_ns: int) -> Estimate | None:
        """Its belief at ``time_ns``, after the ``motion`` since the last epoch; None once it ended."""
        return self._guarded(lambda: _plain(self._fold.estimate(motion, time_ns)) if self._fold else None)

    def end(self, error: str) -> None:
        """Stop it, for a reason; the first one counts."""
        self.error = self.error or error

    @property
    def digest(self) -> str:
        """The certificate of all its updates, as `fusion.digest`; "" once it ended."""
        return "" if self.error else self._certificate.digest

    def _certified(self, moments: Sequence[Moment]) -> list[Update]:
        updates = [self._fold.take(moment) for moment in moments] if self._fold else []
        for update in updates:
            self._certificate.add(update)
        return updates

    def _guarded(self, act: Callable[[], Answer]) -> Answer | None:
        if self.error:
            return None
        try:
            return act()
        except FusionError as known:
            self.error = str(known)
        except Exception as unknown:  # noqa: BLE001 - a plug-in may fail in any way, and the others go on
            self.error = f"{self.name} failed: {unknown!r}; choose another estimator, or report it to its author"
        return None


def _plain(estimate: Estimate) -> Estimate:
    """The same in plain numbers, whatever arrays it was made with; raises where something in it is no number."""
    claim, lost = estimate.covariance, estimate.p_lost
    return estimate._replace(
        time_ns=int(estimate.time_ns),
        pose=Pose(*map(float, estimate.pose)),
        covariance=None if claim is None else Covariance(*map(float, claim)),
        valid=bool(estimate.valid),
        heading_known=bool(estimate.heading_known),
        p_lost=None if lost is None else float(lost),
    )
