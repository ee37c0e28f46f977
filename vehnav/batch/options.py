"""Options of ``vehnav run`` in a suite: their names, their types, and the records they make."""

from __future__ import annotations

import functools
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from vehnav.batch.fields import check_keys, hints, value_of
from vehnav.batch.places import expanded, is_url
from vehnav.config import Config
from vehnav.errors import ConfigError
from vehnav.logs.log import ReadOptions

TABLES: Final = ("input", "method", "stops", "gps", "output")
"""Of a config file of ``vehnav run``."""
FILES: Final = ("gps_file", "speed_file", "sensor")
"""Options that may name a file."""


@functools.cache
def run_options() -> dict[str, Any]:
    """Option -> type; one result for each log, so there is no ``split``."""
    found = {**hints(ReadOptions), **hints(Config)}
    del found["split"]
    return {**found, "gps_time_offset": float | str}


def check_options(
    table: Mapping[str, Any], where: str, folder: Path, *, leave: Sequence[str] = ()
) -> dict[str, Any]:
    """The options of a table in their types, files relative to ``folder``.

    Raises
    ------
    ConfigError
        With ``where`` and the field: wrong kind, or values that do not fit together.
    """
    types = run_options()
    options = {
        key: value_of(value, types[key], f"{where} {key}")
        for key, value in table.items()
        if key not in leave
    }
    if isinstance(options.get("gps_time_offset"), str) and options["gps_time_offset"] != "auto":
        raise ConfigError(f"{where} gps_time_offset: expected a number or 'auto'")
    for key in FILES:
        name = options.get(key)
        if name is not None and (key != "sensor" or name.lower().endswith(".toml")):
            name = expanded(name)
            options[key] = name if is_url(name) else str(folder / name)
    try:
        records(options)
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from error
    return options


def config_options(path: Path, where: str) -> dict[str, Any]:
    """The options that a config file of ``vehnav run`` sets, without its ``[output]``."""
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{where} file: {path}: not a readable config file: {error}") from error
    where = f"{where} file: {path}"
    check_keys(content, TABLES, where)
    merged: dict[str, Any] = {}
    for name, table in content.items():
        if not isinstance(table, Mapping):
            raise ConfigError(f"{where}: {name} must be a table: [{name}]")
        if name != "output":
            keys = {key: key.removeprefix("no_") for key in table}  # no_levelling = true
            check_keys({keys[key]: None for key in table}, run_options(), f"{where}: [{name}]")
            merged.update({keys[k]: v if keys[k] == k else not v for k, v in table.items()})
    return check_options(merged, where, path.parent)


def records(options: Mapping[str, Any]) -> tuple[ReadOptions, Config, bool]:
    """What a run is told, and whether the delay of the GPS is to be found.

    ConfigError for values that do not fit together.
    """
    options = {key: tuple(x) if isinstance(x, list) else x for key, x in options.items()}  # JSON
    reading, running = hints(ReadOptions), hints(Config)
    read = {key: value for key, value in options.items() if key in reading}
    auto = read.get("gps_time_offset") == "auto"
    if auto:
        read["gps_time_offset"] = 0.0
    config = Config(**{key: value for key, value in options.items() if key in running})
    return ReadOptions(**read), config, auto
