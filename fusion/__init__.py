"""Which filter should run on my robot, and can I trust it?

Everything a user or plug-in author needs is imported from here; estimators and drivers are met by name.
"""

from fusion.certificate import digest
from fusion.errors import (
    ConformanceError,
    FusionError,
    LogError,
    MeasurementError,
    ParameterError,
    PluginError,
    RecordingError,
    SuiteError,
    ViewerError,
    WorldError,
)
from fusion.estimator import Estimator, ParticleEstimator, Particles, Tag, generator
from fusion.geometry import Covariance, Pose, wrap_angle
from fusion.motion import Increment, compose
from fusion.plugins import build, load, names, registered
from fusion.sighting import Sighting, sightings
from fusion.track import Tracker, Update, final, track
from fusion.values import (
    Decision,
    Estimate,
    Fate,
    Gyro,
    Measurement,
    MotorCommand,
    Odometry,
    Prior,
    RangeReading,
    Ranges,
    Reason,
    RssiReading,
    Truth,
    WheelTicks,
    WifiScan,
)
from fusion.world import Anchor, Bounds, OdometryNoise, Robot, World

__version__ = "0.1.0"

__all__ = [
    "Anchor",
    "Bounds",
    "ConformanceError",
    "Covariance",
    "Decision",
    "Estimate",
    "Estimator",
    "Fate",
    "FusionError",
    "Gyro",
    "Increment",
    "LogError",
    "Measurement",
    "MeasurementError",
    "MotorCommand",
    "Odometry",
    "OdometryNoise",
    "ParameterError",
    "ParticleEstimator",
    "Particles",
    "PluginError",
    "Pose",
    "Prior",
    "RangeReading",
    "Ranges",
    "Reason",
    "RecordingError",
    "Robot",
    "RssiReading",
    "Sighting",
    "SuiteError",
    "Tag",
    "Tracker",
    "Truth",
    "Update",
    "ViewerError",
    "WheelTicks",
    "WifiScan",
    "World",
    "WorldError",
    "build",
    "compose",
    "digest",
    "final",
    "generator",
    "load",
    "names",
    "registered",
    "sightings",
    "track",
    "wrap_angle",
]
