"""Config files: ``--config FILE`` fills in what was not given, ``--print-config`` shows all.

A config file is TOML with the tables ``[input] [method] [stops] [gps] [output]`` and keys named as
the options with underscores. The command line beats the file, the file beats the default. One file
serves every command: a key that ``run`` knows and this command does not is left alone; a key that
nobody knows is an error with the nearest name.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from vehnav.cli.options import TABLES, TableOption
from vehnav.errors import ConfigError
from vehnav.toml_text import quoted


def table_options(command: click.Command) -> dict[str, TableOption]:
    """The options of a command that a config file can set, by key."""
    return {param.key: param for param in command.params if isinstance(param, TableOption)}


def load_config(ctx: click.Context, path: str) -> dict[str, Any]:
    """Values of a config file for the command of ``ctx``, by parameter name.

    ConfigError, with the file and the field, for what cannot be read, is unknown or has the wrong
    type.
    """
    own = table_options(ctx.command)
    known = {**_options_of_run(ctx), **own}
    switched_off = {name: target for target in known.values() for name in target.off_keys}
    values: dict[str, Any] = {}
    for table, entries in _read_toml(path).items():
        if table not in TABLES:
            raise ConfigError(f"{path}: unknown table [{table}]{_nearest(table, TABLES)}")
        if not isinstance(entries, Mapping):
            raise ConfigError(f"{path}: {table} must be a table: [{table}]")
        for key, value in entries.items():
            where = f"{path}: [{table}] {key}"
            target = known.get(key) or switched_off.get(key)
            if target is None:
                raise ConfigError(f"{where}: unknown key{_nearest(key, known)}")
            if target.table != table:
                raise ConfigError(f"{where}: this key belongs in [{target.table}]")
            converted = _convert(target, value, ctx, where)
            if target.key in own:
                values[str(own[target.key].name)] = converted if key in known else not converted
    return values


def _options_of_run(ctx: click.Context) -> dict[str, TableOption]:
    group = ctx.find_root().command
    run = group.get_command(ctx, "run") if isinstance(group, click.Group) else None
    return table_options(run) if run is not None else {}


def _read_toml(path: str) -> dict[str, Any]:
    import tomllib

    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not a TOML file: {error}") from error


def _nearest(name: str, names: Iterable[str]) -> str:
    import difflib

    close = difflib.get_close_matches(name, list(names), n=1, cutoff=0.5)
    return f"; did you mean {close[0]!r}?" if close else f"; known: {', '.join(sorted(names))}"


def _convert(target: TableOption, value: Any, ctx: click.Context, where: str) -> Any:
    """The value as the option would have it; a boolean is for flags and only for flags."""
    if isinstance(value, bool) != target.is_flag and not (
        isinstance(value, bool) and isinstance(target.type, click.types.BoolParamType)
    ):
        wanted = "true or false" if target.is_flag else f"a {target.type.name}, not a boolean"
        raise ConfigError(f"{where}: expected {wanted}")
    try:
        return target.type_cast_value(ctx, value)
    except click.BadParameter as error:
        raise ConfigError(f"{where}: {error.message}") from error


# ---- what is in force --------------------------------------------------------------------------

_SOURCES = {
    ParameterSource.COMMANDLINE: "command line",
    ParameterSource.ENVIRONMENT: "environment",
    ParameterSource.DEFAULT_MAP: "config file",
}


def config_in_force(ctx: click.Context) -> dict[str, dict[str, Any]]:
    """Table -> key -> value of every option of the command, None where it is not set."""
    tables: dict[str, dict[str, Any]] = {}
    for key, target in table_options(ctx.command).items():
        tables.setdefault(target.table, {})[key] = _plain(ctx.params.get(str(target.name)))
    return {table: tables[table] for table in TABLES if table in tables}


def render_config(ctx: click.Context) -> str:
    """The options in force as a config file that can be read again, with where each came from."""
    options = table_options(ctx.command)
    lines = []
    for table, entries in config_in_force(ctx).items():
        lines.append(f"[{table}]")
        for key, value in entries.items():
            source = ctx.get_parameter_source(str(options[key].name))
            origin = _SOURCES.get(source, "default") if source else "default"
            if value is None:
                lines.append(f"# {key} is not set")
            else:
                lines.append(f"{key} = {_toml(value)}  # {origin}")
        lines.append("")
    return "\n".join(lines).rstrip("\n")


def _plain(value: Any) -> Any:
    """A value that TOML and JSON know."""
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    return str(getattr(value, "text", value))


def _toml(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{quoted(k)} = {_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    return quoted(value) if isinstance(value, str) else json.dumps(value)
