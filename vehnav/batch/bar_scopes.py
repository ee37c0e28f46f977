"""Whom the bars of a suite are for: a bar that is for nothing would pass for ever."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from vehnav.batch.fields import nearest
from vehnav.errors import ConfigError

if TYPE_CHECKING:
    from vehnav.batch.suite import Bar, ConfigSpec, LogSpec


def check_scopes(
    bars: Iterable[Bar], matrix: Sequence[tuple[LogSpec, ConfigSpec]], where: str
) -> None:
    """ConfigError for a bar that is for no log and configuration of the suite."""
    pairs = [(log.group, log.name, config.name) for log, config in matrix]
    for bar in bars:
        if not any(bar.applies(*pair) for pair in pairs):
            raise ConfigError(f"{where}: [[bar]] {bar.metric}: {_what_is_not(bar, pairs)}")


def _what_is_not(bar: Bar, pairs: Sequence[tuple[str, str, str]]) -> str:
    """The first name that nothing has, with the nearest; else that they do not meet."""
    named = []
    for k, (key, name) in enumerate(
        (("group", bar.group), ("log", bar.log), ("config", bar.config))
    ):
        known = {pair[k] for pair in pairs} - {""}
        if name is not None and name not in known:
            return f"there is no {key} {name!r}{nearest(name, known) if known else ''}"
        if name is not None:
            named.append(f"{key} {name!r}")
    return f"{' and '.join(named)} never meet"
