"""The reference runs of the metrics: figures for them were worked out independently."""

import numpy as np
import pytest

from benchmarks.metrics.matching import Answers
from logs.truth import Instants, wrap_angles


def _answers_of(x, y, heading, covariance=None, valid=None):
    n = len(x)
    claimed = np.full((n, 6), np.nan) if covariance is None else _as_columns(covariance, n)
    known = np.ones(n, dtype=bool) if valid is None else np.asarray(valid)
    return Answers(known, np.array(x, float), np.array(y, float), heading, claimed, np.zeros(n), np.full(n, np.nan))


def _as_columns(covariance, n):
    rows, columns = np.triu_indices(3)
    return np.broadcast_to(covariance, (n, 3, 3))[:, rows, columns]


def _instants_of(time_s, x, y, heading):
    return Instants(np.rint(np.asarray(time_s) * 1e9).astype(np.int64), x, y, heading)


@pytest.fixture(scope="session")
def answers_of():
    """Answers from x, y, heading (n,), one covariance (3, 3) or many, and where they are valid."""
    return _answers_of


@pytest.fixture(scope="session")
def as_columns():
    """Covariances (3, 3) or (n, 3, 3), and n, as answers have them, (n, 6)."""
    return _as_columns


@pytest.fixture(scope="session")
def instants_of():
    """Instants from time [s], x, y, heading (n,)."""
    return _instants_of


@pytest.fixture(scope="session")
def write_tum():
    """Writes a TUM file of time, x, y, heading (n,), nine decimals."""
    return _write_tum


@pytest.fixture
def oracle_a():
    """A figure of eight at 10 Hz for 100 s, with a bias and sines for errors: no random numbers."""
    t = 0.1 * np.arange(1000)
    x, y = 5.0 * np.sin(0.1 * t), 2.5 * np.sin(0.2 * t)
    heading = np.arctan2(0.5 * np.cos(0.2 * t), 0.5 * np.cos(0.1 * t))
    estimate = (
        x + 0.30 + 0.05 * np.sin(1.7 * t),
        y - 0.10 + 0.05 * np.cos(2.3 * t),
        wrap_angles(heading + 0.02 * np.sin(0.9 * t)),
    )
    return _instants_of(t, x, y, heading), _answers_of(*estimate, np.diag([0.04, 0.01, 0.0001]))


@pytest.fixture
def oracle_c():
    """A straight corridor of 50 m; the estimate is turned by 8 degrees, moved by 1.5 m, and noisy by 2 cm."""
    n, yaw = 2000, np.radians(8.0)
    x, y = np.linspace(0.0, 50.0, n), np.zeros(n)
    r = np.random.default_rng(0)
    noise_x, noise_y = r.normal(0, 0.02, n), r.normal(0, 0.02, n)
    if noise_x[:2].tolist() != [0.002514604421867866, -0.0026420972658260378]:
        pytest.skip("this numpy draws other numbers than the one the reference was made with")
    estimate = np.cos(yaw) * x - np.sin(yaw) * y + 1.5 + noise_x, np.sin(yaw) * x + np.cos(yaw) * y + noise_y
    return _instants_of(0.1 * np.arange(n), x, y, np.zeros(n)), _answers_of(*estimate, np.full(n, yaw))


@pytest.fixture
def oracle_d(tmp_path):
    """Truth and estimate at 100 Hz as TUM files: 10 000 poses whose stamps differ by up to 2 ms."""
    n, r = 10_000, np.random.default_rng(2)
    t = 1.7e9 + 0.01 * np.arange(n)
    yaw = np.cumsum(r.normal(0, 0.002, n))
    if yaw[:2].tolist() != [0.00037810676358706615, -0.0006673901193744287]:
        pytest.skip("this numpy draws other numbers than the one the reference was made with")
    x, y = np.cumsum(0.005 * np.cos(yaw)), np.cumsum(0.005 * np.sin(yaw))
    said_t = t + r.uniform(-0.002, 0.002, n)
    said_x, said_y = x + r.normal(0, 0.05, n) + 0.3, y + r.normal(0, 0.05, n) - 0.1
    said_yaw = yaw + r.normal(0, 0.01, n)
    truth, estimate = tmp_path / "truth.tum", tmp_path / "estimate.tum"
    _write_tum(truth, t, x, y, yaw)
    _write_tum(estimate, said_t, said_x, said_y, said_yaw)
    return truth, estimate


def _write_tum(path, t, x, y, yaw):
    none = np.zeros(len(t))
    rows = np.column_stack([t, x, y, none, none, none, np.sin(yaw / 2), np.cos(yaw / 2)])
    np.savetxt(path, rows, fmt="%.9f")
