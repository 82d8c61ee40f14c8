"""Families of metrics, ours and those of other distributions: by the entry points of ``fusion.metrics``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from types import ModuleType
from typing import NamedTuple, Protocol

from benchmarks.metrics.errors import Errors
from benchmarks.metrics.metric import UNITS, Metric
from fusion import PluginError, load, names, plugins
from fusion.errors import did_you_mean


class Family(Protocol):
    """Metrics that one function computes from the errors of a run; mostly a module."""

    METRICS: Sequence[Metric]
    """A row for each."""

    def metrics(self, measured: Errors) -> Mapping[str, float]:
        """The metrics by id, in their SI units: NaN where nothing can be stated. An estimator that never answers is
        scored too.
        """


class Families(NamedTuple):
    """The families that can be used by the names of their entry points, and one sentence for each that cannot."""

    usable: dict[str, Family]
    refused: list[str]

    @property
    def rows(self) -> dict[str, Metric]:
        """The rows of all of them, by id."""
        return {metric.id: metric for family in self.usable.values() for metric in family.METRICS}


@cache
def families() -> Families:
    """The families that are installed, imported once per process; ours come first, so that no id of theirs is taken."""
    found = Families({}, [])
    for name in sorted(names(plugins.METRICS), key=_is_foreign):
        try:
            family = load(name, plugins.METRICS)
            _check(name, family, found.rows)
        except PluginError as error:
            if not _is_foreign(name):
                raise
            found.refused.append(f"metrics are left out: {error}")
        else:
            found.usable[name] = family
    return found


def modules() -> dict[str, str]:
    """The module of each family of another distribution, by name: stored scores depend on its code."""
    return {name: _module(family) for name, family in families().usable.items() if _is_foreign(name)}


def all_metrics(measured: Errors) -> dict[str, float]:
    """The metrics of all families by id; raises `PluginError` for a family that fails, with the remedy."""
    return {
        metric: value for name, family in families().usable.items() for metric, value in _values(name, family, measured)
    }


def _values(name: str, family: Family, measured: Errors) -> list[tuple[str, float]]:
    try:
        values = [(metric, float(value)) for metric, value in family.metrics(measured).items()]
    except Exception as error:
        if not _is_foreign(name):
            raise
        raise PluginError(f"the metrics {name!r} of {_module(family)} failed: {error!r}; {_REMEDY}") from error
    if unknown := dict(values).keys() - {metric.id for metric in family.METRICS}:
        raise PluginError(f"the metrics {name!r} answered {', '.join(sorted(unknown))}, which has no row; {_REMEDY}")
    return values


_REMEDY = "correct them, or uninstall that"


def _check(name: str, family: Family, taken: Mapping[str, Metric]) -> None:
    origin = f"the metrics {name!r} of {_module(family)}"
    for row in family.METRICS:
        if not isinstance(row, Metric):
            raise PluginError(
                f"{origin}: METRICS holds {row!r}, which is no benchmarks.metrics.metric.Metric; {_REMEDY}"
            )
        if row.id in taken:
            raise PluginError(f"{origin}: another family has the id {row.id} already; {_REMEDY}")
        if row.si_unit not in UNITS:
            raise PluginError(f"{origin}: {row.id} has the unit {row.si_unit!r}; {did_you_mean(row.si_unit, UNITS)}")


def _is_foreign(name: str) -> bool:
    return name not in plugins.built_in_names(plugins.METRICS)


def _module(family: Family) -> str:
    return str(family.__name__ if isinstance(family, ModuleType) else type(family).__module__)
