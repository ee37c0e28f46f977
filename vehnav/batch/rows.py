"""The rows of ``results.json`` or a baseline, edited or merged by hand: what is wrong where."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

T = TypeVar("T")


def rows_of(content: Mapping[str, Any], build: Callable[[Mapping[str, Any]], T]) -> list[T]:
    """What ``build`` makes of each row of ``results``; ValueError that names the row.

    >>> rows_of({"results": [{"log": "a", "config": "c"}]}, lambda row: row["status"])
    Traceback (most recent call last):
    ...
    ValueError: row 1 (a/c): no field 'status'
    """
    rows = content["results"]
    if not isinstance(rows, list):
        raise ValueError(f"field 'results': expected rows, not {_shown(rows)}")
    out = []
    for k, row in enumerate(rows, 1):
        if not isinstance(row, Mapping):
            raise ValueError(f"row {k}: expected an object, not {_shown(row)}")
        named = f"row {k} ({row.get('log', '?')}/{row.get('config', '?')})"
        try:
            out.append(build(row))
        except KeyError as error:
            raise ValueError(f"{named}: no field {error}") from error
        except (TypeError, ValueError) as error:
            raise ValueError(f"{named}: {error}") from error
    return out


def one_of(row: Mapping[str, Any], field: str, names: tuple[str, ...]) -> Any:
    """The field, which is one of the names; KeyError or ValueError."""
    value = row[field]
    if value not in names:
        known = ", ".join(names)
        raise ValueError(f"field {field!r}: expected one of {known}, not {_shown(value)}")
    return value


def figures_of(row: Mapping[str, Any], field: str) -> dict[str, float | None]:
    """The field, an object of numbers and nulls; KeyError or ValueError."""
    value = row[field]
    if not isinstance(value, Mapping):
        raise ValueError(f"field {field!r}: expected an object of figures, not {_shown(value)}")
    return {str(name): number_of(x, f"{field}: {name}") for name, x in value.items()}


def number_of(value: Any, field: str) -> float | None:
    """A number or null; ValueError."""
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"field {field!r}: expected a number, not {_shown(value)}")
    return float(value)


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
