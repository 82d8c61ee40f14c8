"""An estimator that fails while it runs."""

from fusion import Estimate, WifiScan


class Breaks:
    """Fails at its first scan."""

    summary, tags = "breaks", frozenset()

    def __init__(self, world):
        pass

    def start(self, prior, seed):
        return prior.pose

    def step(self, state, motion, scan):
        if isinstance(scan, WifiScan):
            raise ZeroDivisionError("no such weight")
        return state, ()

    def estimate(self, state, motion, time_ns):
        return Estimate(time_ns, state, None)
