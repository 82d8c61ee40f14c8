"""Tables of names and values into frozen dataclasses, refusing what was not asked for.

Used for world, scenario and suite files. Unknown keys are answered with their nearest match, numbers must be finite,
and every message names the place (``anchors[2].radio``).
"""

from __future__ import annotations

import dataclasses
import math
import sys
import types
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from fusion.errors import WorldError, did_you_mean

Record = TypeVar("Record")


def read_record(record: type[Record], table: object, where: str) -> Record:
    """``table`` as an instance of the dataclass ``record``; raises `WorldError` naming ``where``."""
    if not isinstance(table, Mapping):
        raise WorldError(f"{where}: expected a table of names and values, got {table!r}")
    fields = {field.name: field for field in dataclasses.fields(record)}  # type: ignore[arg-type]
    check_keys(table, fields, where)
    types_by_name = get_type_hints(record)
    missing = [name for name, field in fields.items() if _is_required(field) and name not in table]
    if missing:
        raise WorldError(f"{where}: {', '.join(missing)} is missing; add it")
    return record(**{name: read_value(types_by_name[name], value, f"{where}.{name}") for name, value in table.items()})


def check_keys(table: Mapping[str, object], known: Mapping[str, object], where: str) -> None:
    """Refuse the first key of ``table`` that is not ``known``, with a hint."""
    for key in table:
        if key not in known:
            raise WorldError(f"{where}: unknown key {key!r}; {did_you_mean(key, known)}")


def _is_required(field: dataclasses.Field[Any]) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def read_value(kind: Any, value: object, where: str) -> Any:  # noqa: ANN401 - a value of whatever type is asked for
    """``value`` as ``kind``: a number, string, bool, tuple, table or nested dataclass; ``object`` takes anything."""
    if kind is object:
        return value
    if isinstance(kind, types.UnionType):
        kinds = [option for option in get_args(kind) if option is not types.NoneType]
        return None if value is None else read_value(kinds[0], value, where)
    if get_origin(kind) is tuple:
        return _read_tuple(get_args(kind), value, where)
    if get_origin(kind) is Sequence:
        return _read_tuple((*get_args(kind), ...), value, where)
    if get_origin(kind) is Mapping:
        return _read_table(get_args(kind)[1], value, where)
    if dataclasses.is_dataclass(kind):
        return read_record(kind, value, where)  # type: ignore[arg-type]
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value) if abs(value) < sys.float_info.max else math.inf
    if not isinstance(value, kind) or (kind is not bool and isinstance(value, bool)):
        raise WorldError(f"{where}: expected {kind.__name__}, got {value!r}")
    if kind is float and not math.isfinite(value):
        raise WorldError(f"{where}: {value!r} is not a finite number; give one")
    return value


def _read_tuple(kinds: tuple[Any, ...], value: object, where: str) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise WorldError(f"{where}: expected a list, got {value!r}")
    if len(kinds) == 2 and kinds[1] is Ellipsis:
        kinds = (kinds[0],) * len(value)
    if len(kinds) != len(value):
        raise WorldError(f"{where}: expected {len(kinds)} values, got {len(value)}")
    return tuple(
        read_value(kind, item, f"{where}[{i}]") for i, (kind, item) in enumerate(zip(kinds, value, strict=True))
    )


def _read_table(kind: Any, value: object, where: str) -> dict[str, Any]:  # noqa: ANN401
    if not isinstance(value, Mapping):
        raise WorldError(f"{where}: expected a table of names and values, got {value!r}")
    return {str(key): read_value(kind, item, f"{where}.{key}") for key, item in value.items()}


def require_positive(record: object, keys: tuple[str, ...], where: str) -> None:
    """Raises `WorldError` for the first of these numbers of ``record`` that is neither None nor greater than zero."""
    for key in keys:
        value = getattr(record, key)
        if value is not None and value <= 0:
            raise WorldError(f"{where}.{key}: {value} must be greater than zero")
