"""The CSV layouts that are known: one row each in one table, recognised by the names of the header.

A preset says which column holds which quantity and in which unit. ``named`` is the last one: it
takes any header whose names are in :data:`vehnav.logs.columns.ALIASES`, vehnav's own among them.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

from vehnav.errors import ConfigError
from vehnav.logs.columns import Column, name_and_unit, named_columns


def _nothing() -> Mapping[str, str]:
    return MappingProxyType({})


@dataclass(frozen=True)
class Preset:
    """One layout.

    Attributes
    ----------
    name : str
        What ``--preset`` calls it.
    title : str
        What it is, for people.
    columns : mapping
        Quantity -> header name, compared without regard to case; empty: by
        :data:`~vehnav.logs.columns.ALIASES`.
    detect : tuple of str
        Header names that together belong to no other layout; empty: never detected.
    units : mapping
        Quantity, or beginning of a quantity up to "_" -> unit, where the header does not say.
    axes : str
        Where x, y, z of the sensor usually point; a declaration to be checked, not a fact.
    """

    name: str
    title: str
    columns: Mapping[str, str] = field(default_factory=_nothing)
    detect: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=_nothing)
    axes: str = "FLU"

    def matches(self, names: Sequence[str]) -> bool:
        """Whether the header is this layout's."""
        lower = {name.lower() for name in names}
        return bool(self.detect) and all(name in lower for name in self.detect)

    def place(self, names: Sequence[str]) -> dict[str, Column]:
        """Quantity -> column of those that the header has."""
        if not self.columns:
            return named_columns(names)
        index = {name.lower(): k for k, name in reversed(list(enumerate(names)))}
        placed = {}
        for quantity, header in self.columns.items():
            if header.lower() in index:
                k = index[header.lower()]
                unit = self.units.get(quantity, self.units.get(quantity.split("_")[0]))
                placed[quantity] = Column(k, names[k], unit=unit or name_and_unit(names[k])[1])
        return placed


PRESETS: Final = (
    Preset(
        name="dresden",
        title="Tinkerforge brick with GPS in the same rows (balzer82)",
        columns={
            "time": "millis",
            "fix_time": "time",
            "gyro_x": "rollrate",
            "gyro_y": "pitchrate",
            "gyro_z": "yawrate",
            "accel_x": "ax",
            "accel_y": "ay",
            "accel_z": "az",
            "lat": "latitude",
            "lon": "longitude",
            "height": "altitude",
            "gps_speed": "speed",
            "course": "course",
        },
        detect=("millis", "rollrate", "pitchrate", "yawrate", "ax", "ay", "az"),
        units={"gyro": "deg/s", "accel": "m/s2", "time": "ms", "gps_speed": "km/h"},
    ),
    Preset(name="named", title="any header of known names; vehnav's own"),
)


def choose_preset(names: Sequence[str], wanted: str | None) -> Preset:
    """The layout of a header: the wanted one, else the first that matches, else ``named``.

    Raises
    ------
    ConfigError
        No preset of that name.
    """
    if wanted is not None:
        known = {preset.name: preset for preset in PRESETS}
        if wanted not in known:
            near = difflib.get_close_matches(wanted, known, 1) or list(known)
            raise ConfigError(f"--preset: no preset {wanted!r}; did you mean {' or '.join(near)}?")
        return known[wanted]
    return next((preset for preset in PRESETS if preset.matches(names)), PRESETS[-1])
