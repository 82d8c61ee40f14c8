"""Estimators and drivers by name, ours found exactly as strangers': by Python entry points, brought in when asked for.

A plug-in distribution declares, for instance,

    [project.entry-points."fusion.estimators"]
    my_filter = "my_package.my_module:MyFilter"

`build` makes an estimator and refuses parameters it does not have. `registered` adds one for the length of a test.
A plug-in whose package is missing is not installed: `available` leaves it out, `load` refuses it with the remedy.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from fusion.errors import FusionError, NotInstalledError, ParameterError, PluginError, did_you_mean
from fusion.estimator import Estimator

if TYPE_CHECKING:
    import inspect
    from importlib.metadata import EntryPoint

    from fusion.world import World

DISTRIBUTION = "fusion-localization"
ESTIMATORS = "fusion.estimators"
SENSORS = "fusion.sensors"

_in_process: dict[str, type[Any]] = {}


def _entry_points(group: str) -> dict[str, list[EntryPoint]]:
    from importlib.metadata import entry_points

    found: dict[str, list[EntryPoint]] = {}
    for entry in entry_points(group=group):
        if entry not in found.setdefault(entry.name, []):
            found[entry.name].append(entry)
    return found


def names(group: str = ESTIMATORS) -> tuple[str, ...]:
    """All names declared in ``group``, sorted, those whose package is missing among them; nothing is imported."""
    extra = _in_process if group == ESTIMATORS else ()
    return tuple(sorted({*_entry_points(group), *extra}))


def built_in_names() -> tuple[str, ...]:
    """The estimators of this distribution, sorted; nothing is imported."""
    found = _entry_points(ESTIMATORS)
    return tuple(sorted(name for name in found if any(_owner(claim) == DISTRIBUTION for claim in found[name])))


def available() -> tuple[str, ...]:
    """The names of the estimators that can be brought in here, sorted; each is imported to find out."""
    absent = _unavailable()
    return tuple(name for name in names() if name not in absent)


def left_out() -> list[str]:
    """Why `available` leaves out the other estimators, as `in_sentences`."""
    return in_sentences(_unavailable().values())


def _unavailable() -> dict[str, PluginError]:
    found = {}
    for name in names():
        try:
            load(name)
        except PluginError as error:
            found[name] = error
    return found


def in_sentences(errors: Iterable[PluginError]) -> list[str]:
    """Which plug-ins are not available and why, one sentence for all that lack the same package."""
    lacking: dict[str, list[str]] = {}
    broken = []
    for error in errors:
        if isinstance(error, NotInstalledError):
            lacking.setdefault(error.cause, []).append(error.name)
        else:
            broken.append(str(error))
    return [*(str(NotInstalledError(", ".join(own), cause)) for cause, own in lacking.items()), *broken]


def load(name: str, group: str = ESTIMATORS) -> Any:  # noqa: ANN401 - whatever the entry point names
    """What the entry point ``name`` of ``group`` stands for; raises `PluginError` that says how to get it, and
    `NotInstalledError` where that is to install a package.
    """
    if group == ESTIMATORS and name in _in_process:
        return _in_process[name]
    claims = _entry_points(group).get(name, [])
    if not claims:
        kind = group.removeprefix("fusion.").removesuffix("s")
        raise PluginError(f"no {kind} named {name!r} is installed; {did_you_mean(name, names(group))}")
    if len(claims) > 1:
        owners = ", ".join(f"{claim.value} of {_owner(claim)}" for claim in claims)
        raise PluginError(f"{name!r} is claimed twice ({owners}); uninstall one of them")
    return _import(claims[0])


def _owner(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist is not None else "an unnamed distribution"


def _import(entry: EntryPoint) -> Any:  # noqa: ANN401
    """The one place where strangers' code is imported, so it may fail in any way."""
    try:
        return entry.load()
    except ImportError as error:
        if isinstance(error, ModuleNotFoundError) and error.name is not None and "." not in error.name:
            # Of a package that is there but lacks a module, the name would have a dot: that is a fault of the plug-in.
            raise NotInstalledError(entry.name, _missing(entry, error.name)) from error
        package = entry.module.partition(".")[0]
        if "is not a package" in str(error):
            remedy = f"a file {package}.py beside your script hides the package; rename it"
        else:
            remedy = f"install what it needs (of {_owner(entry)}), or uninstall that"
        raise PluginError(f"{entry.name!r} ({entry.value}) cannot be imported: {error}; {remedy}") from error
    except Exception as error:
        raise PluginError(f"{entry.name!r} ({entry.value}) failed while being imported: {error!r}") from error


def _missing(entry: EntryPoint, package: str) -> str:
    """That ``package`` is missing, and the remedy: the smallest extra of the plug-in's distribution that brings it."""
    requires = (entry.dist.requires or []) if entry.dist is not None else []
    matches = (re.match(r"([\w.-]+).*;.*\bextra\s*==\s*['\"]([\w.-]+)['\"]", line) for line in requires)
    extras = [(match[1], match[2]) for match in matches if match is not None]
    size = Counter(extra for _, extra in extras)
    bringing = [extra for needed, extra in extras if needed.lower().replace("-", "_") == package.lower()]
    if bringing:
        remedy = f"pip install '{_owner(entry)}[{min(bringing, key=size.__getitem__)}]'"
    else:
        remedy = f"install what {_owner(entry)} needs, or uninstall that"
    return f"not installed, the package {package} is missing; {remedy}"


def parameters(estimator: type[Any]) -> dict[str, inspect.Parameter]:
    """The parameters an estimator class takes beside the world, by name."""
    import inspect

    return dict(list(inspect.signature(estimator, eval_str=True).parameters.items())[1:])


def build(name: str, world: World, options: Mapping[str, object] | None = None) -> Estimator[Any]:
    """The estimator ``name`` for ``world``; raises `ParameterError` for an option it does not have."""
    made = load(name)
    known = parameters(made)
    checked = {key: _checked(name, key, value, known) for key, value in (options or {}).items()}
    try:
        estimator = made(world, **checked)
    except FusionError:
        raise
    except Exception as error:
        raise PluginError(f"{name!r} could not be built for world {world.name!r}: {error!r}") from error
    if not isinstance(estimator, Estimator):
        raise PluginError(f"{name!r} is no estimator: it needs summary, tags, start, step and estimate")
    return estimator


def _checked(name: str, key: str, value: object, known: Mapping[str, inspect.Parameter]) -> object:
    if key not in known:
        raise ParameterError(f"{name} has no parameter {key!r}; {did_you_mean(key, known)}")
    kind = known[key].annotation
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if isinstance(kind, type) and (not isinstance(value, kind) or (kind is not bool and isinstance(value, bool))):
        raise ParameterError(f"{name}: {key} takes a {kind.__name__}, got {value!r}")
    return value


@contextmanager
def registered(name: str, estimator: type[Any]) -> Iterator[None]:
    """``estimator`` known as ``name`` within a ``with`` block, without installing it."""
    if name in names():
        raise PluginError(f"{name!r} is taken; choose another name")
    _in_process[name] = estimator
    try:
        yield
    finally:
        del _in_process[name]
