"""Values of a suite file against the types of the record that takes them, with the field named."""

from __future__ import annotations

import difflib
import math
import re
import types
from collections.abc import Iterable, Mapping
from dataclasses import is_dataclass
from typing import Any, Final, Literal, Union, get_args, get_origin, get_type_hints

from vehnav.errors import ConfigError

_SIZES: Final = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}


def nearest(name: str, names: Iterable[str]) -> str:
    """``; did you mean 'path'?``, or all the names that there are.

    >>> nearest("pth", ["path", "group"])
    "; did you mean 'path'?"
    """
    known = sorted(names)
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"; did you mean {close[0]!r}?" if close else f"; known: {', '.join(known)}"


def check_keys(table: Mapping[str, Any], known: Iterable[str], where: str) -> None:
    """ConfigError for a key that is not known, with the nearest one."""
    known = list(known)
    for key in table:
        if key not in known:
            raise ConfigError(f"{where}: unknown key {key!r}{nearest(key, known)}")


def hints(record: type) -> dict[str, Any]:
    """Field -> type of a dataclass."""
    if not is_dataclass(record):
        raise ValueError(f"{record} is no dataclass")
    return get_type_hints(record)


def value_of(value: Any, hint: Any, where: str) -> Any:
    """The value as the type says, or a ConfigError that begins with ``where``.

    A number may stand for a float, an array for a tuple, and text with commas for a tuple of texts.

    >>> value_of([1, 2, 3], tuple[float, float, float], "mount")
    (1.0, 2.0, 3.0)
    >>> value_of("zupt, nhc", tuple[str, ...] | None, "aid")
    ('zupt', 'nhc')
    """
    found = _fitted(value, hint)
    if found is _NO:
        raise ConfigError(f"{where}: expected {_words(hint)}, not {value!r}")
    return found


_NO: Final = object()


def _fitted(value: Any, hint: Any) -> Any:
    """The value as the type says, or :data:`_NO`."""
    origin = get_origin(hint)
    if origin in (Union, types.UnionType):
        kinds = [kind for kind in get_args(hint) if kind is not type(None)]
        return next((x for x in (_fitted(value, kind) for kind in kinds) if x is not _NO), _NO)
    if origin is Literal:
        return value if value in get_args(hint) else _NO
    if origin is tuple:
        return _tuple(value, get_args(hint))
    if hint is float:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return float(value) if number and math.isfinite(value) else _NO
    if hint is int:
        return value if isinstance(value, int) and not isinstance(value, bool) else _NO
    if hint in (str, bool):
        return value if isinstance(value, hint) else _NO
    if origin is not None and isinstance(value, Mapping):
        good = all(isinstance(item, str) for item in value.values())
        return dict(value) if good else _NO
    return _NO


def _tuple(value: Any, kinds: tuple[Any, ...]) -> Any:
    many = len(kinds) == 2 and kinds[1] is Ellipsis
    if many and isinstance(value, str):
        value = [value] if "=" in value else [part.strip() for part in value.split(",")]
    if not isinstance(value, list | tuple) or (not many and len(value) != len(kinds)):
        return _NO
    wanted = [kinds[0]] * len(value) if many else kinds
    items = [_fitted(item, kind) for item, kind in zip(value, wanted, strict=True)]
    return _NO if any(item is _NO for item in items) else tuple(items)


def _words(hint: Any) -> str:
    """What a type is called in a message."""
    origin = get_origin(hint)
    if origin in (Union, types.UnionType):
        kinds = [kind for kind in get_args(hint) if kind is not type(None)]
        return " or ".join(_words(kind) for kind in kinds)
    if origin is Literal:
        return "one of " + ", ".join(map(str, get_args(hint)))
    if origin is tuple:
        kinds = list(get_args(hint))
        count = "an array of" if kinds[-1] is Ellipsis else f"an array of {len(kinds)}"
        return f"{count} {'numbers' if kinds[0] is float else 'texts'}"
    names = {float: "a number", int: "a whole number", str: "a text", bool: "true or false"}
    return names.get(hint, "a table of texts")


def size_of(value: Any, where: str) -> int:
    """Bytes of ``"2G"``, ``"500M"`` or a number.

    >>> size_of("1.5K", "memory_limit")
    1536
    """
    found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([KMGT]?)i?B?\s*", str(value), re.IGNORECASE)
    if isinstance(value, bool) or found is None or float(found[1]) == 0.0:
        raise ConfigError(f"{where}: expected a size such as 500M or 2G, not {value!r}")
    return round(float(found[1]) * _SIZES[found[2].upper()])


def fraction_of(value: Any, where: str) -> float:
    """The fraction of ``"5%"`` or ``0.05``.

    >>> fraction_of("5%", "max_regression"), fraction_of(0.05, "max_regression")
    (0.05, 0.05)

    A bare number from 1 on is refused: ``5`` means 5 % to most and would allow 500 %.
    """
    found = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*(%?)\s*", str(value))
    if isinstance(value, bool) or found is None:
        raise ConfigError(f"{where}: expected a share such as 5% or 0.05, not {value!r}")
    if not found[2] and float(found[1]) >= 1.0:
        raise ConfigError(
            f"{where}: {value!r} without a percent sign: write {value}% or a share such as 0.05"
        )
    return float(found[1]) / (100.0 if found[2] else 1.0)
