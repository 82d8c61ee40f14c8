"""Results of Moro & Mehrpouyan (VTC-Fall 2019, arXiv 1911.03754, sections II and IV): every number, in SI units.

Their raw data were never published. Section IV has 80 cm where Table I has 81.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

ODOMETRY, WIFI, PROPOSED = "dead_reckoning", "radio_only", "dynamic_weight"
"""The three curves of the paper's result figures, by the names of the estimators that draw them here."""
EKF = "ekf"
"""The filter to beat."""
BISWAS_VELOSO = "Biswas & Veloso 2010"


class Environment(NamedTuple):
    """One of the paper's experiments. The maxima are of the absolute error over the trial points [m]."""

    title: str
    short: str
    scenario: str
    path_loss_exponent: float
    trial_points: int
    odometry_max_m: float
    wifi_max_m: float
    proposed_max_m: float

    @property
    def maxima_m(self) -> dict[str, float]:
        """The published maxima by estimator."""
        return {ODOMETRY: self.odometry_max_m, WIFI: self.wifi_max_m, PROPOSED: self.proposed_max_m}

    def place(self, scenarios: Path | None) -> str | Path:
        """The argument of `load_scenario`: the built-in scenario, or the one in a folder of one's own."""
        return self.scenario if scenarios is None else scenarios / f"{self.scenario}.toml"


ENVIRONMENTS = (
    Environment("office", "office", "paper_office", 2.27, 7, 0.24, 0.82, 0.05),
    Environment("Micron Engineering Center", "MEC", "paper_mec", 2.13, 12, 1.68, 0.86, 0.53),
    Environment("Taco Bell Arena", "arena", "paper_arena", 1.71, 18, 1.75, 4.52, 0.80),
)


class ErrorRow(NamedTuple):
    """A row of Table I [m]."""

    mean_m: float
    min_m: float
    max_m: float


TABLE_1 = {PROPOSED: ErrorRow(0.30, 0.04, 0.81), BISWAS_VELOSO: ErrorRow(0.70, 0.20, 1.60)}
