"""Plug-ins by name, ours found exactly as strangers': by Python entry points, each imported when it is asked for.

A plug-in distribution declares, for instance,

    [project.entry-points."fusion.estimators"]
    my_filter = "my_package.my_module:MyFilter"

The groups are the constants below; `docs/plugin.md` shows one of each. `load` refuses what cannot be imported, what
lacks the parts of its group, and a name that two distributions claim; a plug-in whose package is missing is not
installed. `build` makes an estimator and refuses parameters it does not have. `registered` adds one for the length of
a test.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from contextlib import contextmanager
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from fusion.errors import FusionError, NotInstalledError, ParameterError, PluginError, did_you_mean
from fusion.estimator import Estimator

if TYPE_CHECKING:
    import inspect
    from importlib.metadata import EntryPoint

    from fusion.world import World

DISTRIBUTION = "fusion-localization"
ESTIMATORS = "fusion.estimators"
SENSORS = "fusion.sensors"
IMPORTERS = "fusion.importers"
FAULTS = "fusion.faults"
METRICS = "fusion.metrics"
VERBS = "fusion.verbs"


class Shape(NamedTuple):
    """The parts of every plug-in of a group, as far as they can be seen without running it."""

    parts: Mapping[str, type] = MappingProxyType({})
    """Attributes and their types."""
    called_with: Mapping[str, int] = MappingProxyType({})
    """Number of arguments that a part takes by position, ``self`` of a method among them."""
    built_with: int = 0
    """Number that the plug-in itself takes by position, before its settings; 0: it is not called."""
    named_by: str | None = None
    """The part that must be the name of the entry point."""


SHAPES: Mapping[str, Shape] = {
    ESTIMATORS: Shape({"summary": str, "tags": Set, "start": object, "step": object, "estimate": object}, built_with=1),
    SENSORS: Shape({"summary": str, "discover": object, "open": object, "poll": object, "close": object}, built_with=2),
    IMPORTERS: Shape(built_with=1),
    FAULTS: Shape(
        {"kind": str, "apply": object, "place": object, "lasts": object, "__dataclass_fields__": object},
        {"apply": 3},
        named_by="kind",
    ),
    METRICS: Shape({"METRICS": Sequence, "metrics": object}, {"metrics": 1}),
    VERBS: Shape({"configure": object, "run": object}, {"configure": 1, "run": 1}),
}

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


class Origin(NamedTuple):
    """A distribution that declares a plug-in, and its own one-line summary."""

    distribution: str
    summary: str

    def __str__(self) -> str:
        """The summary, if there is one, and the distribution."""
        return f"{self.summary} ({self.distribution})".strip()


def origins(name: str, group: str) -> list[Origin]:
    """The distributions that declare ``name`` in ``group``; nothing is imported."""
    found = _entry_points(group).get(name, [])
    return [
        Origin(_owner(claim), "" if claim.dist is None else claim.dist.metadata["Summary"] or "") for claim in found
    ]


def built_in_names(group: str = ESTIMATORS) -> tuple[str, ...]:
    """The names of this distribution in ``group``, sorted; nothing is imported."""
    found = _entry_points(group)
    return tuple(sorted(name for name in found if any(_owner(claim) == DISTRIBUTION for claim in found[name])))


def available() -> tuple[str, ...]:
    """The names of the estimators that can be brought in here, sorted; each is imported to find out."""
    absent = _unavailable()
    return tuple(name for name in names() if name not in absent)


def left_out() -> list[str]:
    """The reasons why `available` leaves out the other estimators, as `in_sentences`."""
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
    """The object that the entry point ``name`` of ``group`` names; raises `PluginError` with the remedy, and
    `NotInstalledError` where that is to install a package.
    """
    if group == ESTIMATORS and name in _in_process:
        return _in_process[name]
    claims = _entry_points(group).get(name, [])
    if not claims:
        raise PluginError(f"no {_kind(group)} named {name!r} is installed; {_remedy(name, group)}")
    if len(claims) > 1:
        raise PluginError(f"{name!r} is claimed twice ({', '.join(map(_origin, claims))}); uninstall one of them")
    made = _import(claims[0])
    if flaw := _flaw(made, name, SHAPES[group]):
        article = "an" if _kind(group)[0] in "aeiou" else "a"
        raise PluginError(
            f"{name!r} ({_origin(claims[0])}) is not {article} {_kind(group)}: {flaw}; correct it, or uninstall that"
        )
    return made


def _kind(group: str) -> str:
    return group.removeprefix("fusion.").removesuffix("s")


def _remedy(name: str, group: str) -> str:
    if group != VERBS and not built_in_names(group):
        return f"{DISTRIBUTION} was installed before it declared any; install it anew (`make` does, in a checkout)"
    return did_you_mean(name, names(group))


def _flaw(made: Any, name: str, shape: Shape) -> str | None:  # noqa: ANN401 - whatever the entry point names
    """The first reason why ``made`` is no plug-in of that shape; None where there is none."""
    if lacking := [part for part in shape.parts if not hasattr(made, part)]:
        return f"it lacks {', '.join(lacking)}"
    for part, kind in shape.parts.items():
        if not isinstance(own := getattr(made, part), kind):
            return f"its {part} is {own!r}, no {kind.__name__}"
    for part, count in shape.called_with.items():
        if not _takes(getattr(made, part), count, settings=False):
            return f"its {part} does not take {count} argument{'s' if count > 1 else ''} by position"
    if shape.built_with and not _takes(made, shape.built_with, settings=True):
        return f"it cannot be called with {shape.built_with} argument{'s' if shape.built_with > 1 else ''} by position"
    if shape.named_by and (own := getattr(made, shape.named_by)) != name:
        return f"its {shape.named_by} is {own!r}"
    return None


def _takes(called: Any, count: int, *, settings: bool) -> bool:  # noqa: ANN401 - whatever the entry point names
    """Whether it can be called with ``count`` arguments by position, and nothing else unless it has ``settings``."""
    import inspect

    try:
        signature = inspect.signature(called)
        (signature.bind_partial if settings else signature.bind)(*[None] * count)
    except (TypeError, ValueError):  # the latter for a callable of C without a signature
        return False
    return True


def _origin(entry: EntryPoint) -> str:
    return f"{entry.value} of {_owner(entry)}"


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
            remedy = "install what it needs, or uninstall that"
        raise PluginError(f"{entry.name!r} ({_origin(entry)}) cannot be imported: {error}; {remedy}") from error
    except (Exception, SystemExit) as error:
        raise PluginError(
            f"{entry.name!r} ({_origin(entry)}) failed while being imported: {error!r}; correct it, or uninstall that"
        ) from error


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


def parameters(made: Callable[..., Any]) -> dict[str, inspect.Parameter]:
    """The parameters that an estimator takes beside the world, or an importer beside the folder, by name; raises
    `PluginError` for annotations that mean nothing.
    """
    import inspect

    try:
        return dict(list(inspect.signature(made, eval_str=True).parameters.items())[1:])
    except Exception as error:
        raise PluginError(f"the annotations of {made!r} cannot be read: {error!r}; correct them") from error


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
