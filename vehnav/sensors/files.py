"""Sensor files: TOML, table ``[sensor]``, the units of :data:`vehnav.sensors.FIELDS`."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vehnav.errors import ConfigError
from vehnav.sensors.catalogue import CATALOGUE
from vehnav.sensors.grade import FIELDS, Sensor, assemble
from vehnav.toml_text import on_one_line, quoted


def load_sensor(name_or_path: str | Path) -> Sensor:
    """A grade of the catalogue by name, or a sensor file (TOML, table ``[sensor]``).

    A file may start from a grade: ``base = "hg1700"``. ConfigError when the name is unknown, the
    file cannot be read, a key is unknown, or a value is not a number of at least zero.

    >>> from vehnav.units import DEG_PER_HOUR
    >>> round(load_sensor("hg1700").gyro.bias / DEG_PER_HOUR, 9)
    1.0
    """
    text = str(name_or_path)
    if text.lower() in CATALOGUE:
        return CATALOGUE[text.lower()]
    path = Path(name_or_path)
    if path.suffix.lower() != ".toml":
        raise ConfigError(
            f"sensor {text!r} is not in the catalogue{_nearest(text.lower(), CATALOGUE)}; "
            f"choose one of {', '.join(CATALOGUE)}, or give a .toml file"
        )
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such sensor file") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"{path}: not a readable TOML file: {error}") from error
    return _from_document(document, path)


def _nearest(word: str, known: Mapping[str, Any]) -> str:
    close = difflib.get_close_matches(word, known, n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def _from_document(document: Mapping[str, Any], path: Path) -> Sensor:
    table = document.get("sensor")
    if not isinstance(table, dict):
        raise ConfigError(f"{path}: no table [sensor]")
    base = CATALOGUE["ideal"]
    if "base" in table:
        base = CATALOGUE.get(str(table["base"]).lower(), base)
        if base.name != str(table["base"]).lower():
            raise ConfigError(f"{path}: base = {table['base']!r} is not in the catalogue")
    sources = table.get("sources", {})
    figures: dict[str, tuple[float, str]] = {}
    for key, value in table.items():
        if key in ("name", "base", "sources"):
            continue
        if key not in FIELDS:
            raise ConfigError(f"{path}: unknown key {key!r} in [sensor]{_nearest(key, FIELDS)}")
        if isinstance(value, bool) or not isinstance(value, int | float) or not value >= 0.0:
            raise ConfigError(f"{path}: {key} must be a number >= 0 ({FIELDS[key].unit})")
        figures[key] = (float(value), str(sources.get(key, path.name)))
    return assemble(base, str(table.get("name", path.stem)), figures)


def sensor_toml(sensor: Sensor) -> str:
    """The sensor as the text of a TOML file that :func:`load_sensor` reads back."""
    lines = ["[sensor]", f"name = {quoted(sensor.name)}"]
    default = Sensor("")
    for key, place in FIELDS.items():
        value, plain = (
            getattr(s if place.part == "sensor" else getattr(s, place.part), place.attribute)
            for s in (sensor, default)
        )
        if value is not None and value != plain:
            comment = (
                f"{place.unit}; {sensor.sources[key]}" if key in sensor.sources else place.unit
            )
            lines.append(f"{key} = {value / place.factor:.9g}  # {on_one_line(comment)}")
    return "\n".join(lines) + "\n"
