"""The metric of a bar: its dotted path against the schema of ``report.json``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vehnav.batch.fields import nearest
from vehnav.batch.finding_codes import CODES
from vehnav.errors import ConfigError
from vehnav.report.schema import schema


def check_metric(metric: str, where: str) -> None:
    """ConfigError, with the nearest name, for a path that no report can have.

    A step is refused only where the schema names all that there is (``additionalProperties``
    false), and a ``findings.CODE`` whose code no finding has; what is below a list is taken as it
    is.

    >>> check_metric("errors.horizontal_m.max", "bar")
    >>> check_metric("errors.horizontal_m.maxx", "bar")
    Traceback (most recent call last):
    ...
    vehnav.errors.ConfigError: bar: no figure 'errors.horizontal_m.maxx'; did you mean 'max'?
    """
    first, _, code = metric.partition(".")
    if first == "findings":
        if code not in CODES:
            raise ConfigError(f"{where}: no finding has the code {code!r}{nearest(code, CODES)}")
        return
    steps = metric.split(".")
    node = schema()
    for step in steps:
        named = node.get("properties", {})
        others = node.get("additionalProperties", True)
        if step not in named and others is False:
            raise ConfigError(f"{where}: no figure {metric!r}{nearest(step, named)}")
        node = _resolved(named.get(step, others))


def _resolved(node: Any) -> dict[str, Any]:
    """The part of the schema that a node stands for: references followed, null left out."""
    if not isinstance(node, Mapping):
        return {}
    if "$ref" in node:
        return _resolved(schema()["$defs"][node["$ref"].rpartition("/")[2]])
    for choice in node.get("anyOf", ()):
        if choice.get("type") != "null":
            return _resolved(choice)
    return dict(node)
