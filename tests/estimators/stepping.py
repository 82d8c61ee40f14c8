"""One estimator stepped by hand, its state in sight; and a fold over radio, from a start that is roughly known."""

from fusion import Covariance, Increment, Odometry, OdometryNoise, Prior, track
from tests.worlds import START

NOISE = OdometryNoise()


class Stepped:
    """An estimator with its state, and the motion since its last scan; nothing is held, and no stretch is closed."""

    def __init__(self, estimator, prior, noise=NOISE):
        self.estimator, self.noise = estimator, noise
        self.state = estimator.start(prior, 0)
        self.motion = Increment(time_ns=prior.time_ns)

    def feed(self, *measurements):
        """Odometry extends the motion, a scan is stepped with it; answers the Fates of the last."""
        fates = ()
        for measurement in measurements:
            fates = ()
            if isinstance(measurement, Odometry):
                self.motion = self.motion.extend(measurement, self.noise)
            else:
                fates = self._step(measurement, measurement.time_ns)
        return fates

    def close(self):
        """Close the motion so far, without a scan; answers the Fates of that."""
        return self._step(None, self.motion.time_ns)

    def estimate(self, time_ns):
        return self.estimator.estimate(self.state, self.motion, time_ns)

    def _step(self, scan, time_ns):
        self.state, fates = self.estimator.step(self.state, self.motion, scan)
        self.motion = Increment(time_ns=time_ns)
        return fates


def prior(pose=START, **known):
    return Prior(0, pose, Covariance.from_std(0.3, 0.3, 0.2), **known)


def radio_updates(estimator, place, measurements, start, seed=0):
    """The updates by scans."""
    return [update for update in track(estimator, place, measurements, start, seed=seed) if update.fates]
