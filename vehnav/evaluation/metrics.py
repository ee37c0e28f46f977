"""A metric is named by its dotted path everywhere: ``errors.horizontal_m.max``."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from typing import Any

from vehnav.errors import ConfigError


def metric_names(tree: Mapping[str, Any], prefix: str = "") -> Iterator[str]:
    """The dotted paths of everything in ``tree`` that is a number or undefined."""
    for key, value in tree.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            yield from metric_names(value, f"{name}.")
        elif value is None or (isinstance(value, int | float) and not isinstance(value, bool)):
            yield name


def metric(tree: Mapping[str, Any], name: str) -> float | None:
    """The number at a dotted path; None where it is undefined (or the whole branch is).

    ConfigError for a path that leads nowhere, with the nearest name.

    >>> metric({"errors": {"up_m": None, "cep50_m": 1.5}}, "errors.cep50_m")
    1.5
    >>> metric({"errors": {"up_m": None}}, "errors.up_m.max") is None
    True
    """
    value: Any = tree
    for key in name.split("."):
        if value is None:
            return None
        if not isinstance(value, Mapping) or key not in value:
            close = difflib.get_close_matches(name, list(metric_names(tree)), n=1, cutoff=0.0)
            hint = f"; did you mean {close[0]!r}?" if close else ""
            raise ConfigError(f"no metric {name!r}{hint}")
        value = value[key]
    if value is None or (isinstance(value, int | float) and not isinstance(value, bool)):
        return None if value is None else float(value)
    raise ConfigError(f"{name!r} is not a number but a group: {', '.join(map(str, value))}")
