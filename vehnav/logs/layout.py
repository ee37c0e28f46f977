"""Where the quantities of a table stand: preset, declared columns, units and the clock that counts.

Three places say which column is what, the later ones win: the preset that the header belongs to
(:mod:`vehnav.logs.presets`), ``--columns``, and for units ``--gyro-unit`` and ``--accel-unit``.
Without a declared unit SI is taken, and degrees for latitude and longitude.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from vehnav.errors import ConfigError, Finding
from vehnav.logs.clock import NO_TIME
from vehnav.logs.columns import (
    GROUPS,
    QUANTITIES,
    Column,
    declared_columns,
    list_names,
)
from vehnav.logs.log import ReadOptions, TimeArray
from vehnav.logs.presets import Preset, choose_preset
from vehnav.logs.table import Sheet, Table, sniff
from vehnav.logs.timebase import stamps

AXES: Final = ("x", "y", "z")
HEADER_CLOCK_TOLERANCE: Final = 0.005
"""Rates of sample and recorder stamps agree within this share, or the recorder's are taken."""
HEADER_CLOCK_OFFSET_S: Final = 60.0
"""Stamps further than this from the recorder's are of another clock."""


@dataclass(frozen=True)
class Layout:
    """Which column of a sheet holds which quantity."""

    sheet: Sheet
    preset: Preset
    columns: Mapping[str, Column]

    def has(self, *quantities: str) -> bool:
        """Whether all of them are there."""
        return all(quantity in self.columns for quantity in quantities)

    @property
    def imu(self) -> tuple[tuple[str, ...], tuple[str, ...]] | None:
        """Names of the six inertial quantities (rates, else increments), or None."""
        for gyro, accel in (("gyro", "accel"), ("dtheta", "dvel")):
            names = tuple(f"{gyro}_{a}" for a in AXES), tuple(f"{accel}_{a}" for a in AXES)
            if self.has(*names[0], *names[1]):
                return names
        return None

    @property
    def axes(self) -> tuple[str, bool]:
        """Axis letters and whether they are declared: by ``# axes: XYZ``, or a preset's fixed ones.

        vehnav's own table, recognised by its names, is right-forward-up by habit: others use such
        names too. Letters "": nothing says anything.
        """
        for line in self.sheet.preamble:
            declared = re.search(r"\baxes\s*[:=]\s*([FBLRUD]{3})\b", line)
            if declared:
                return declared[1], True
        lower = {name.lower() for name in self.sheet.names}
        for kinds in (("gyro", "accel"), ("dtheta", "dvel")):
            own = {f"{kind}_{axis}" for kind in kinds for axis in AXES}
            if own <= lower and lower & {"t_ns", "time_s"}:
                return "RFU", False
        return self.preset.axes, self.preset.axes_fixed

    @property
    def some_inertial(self) -> bool:
        """Whether there is any gyro or accelerometer column."""
        inertial = ("gyro_", "accel_", "dtheta_", "dvel_")
        return any(name.startswith(inertial) for name in self.columns)

    def assumed_units(self, quantities: tuple[str, ...], option: str | None) -> list[Finding]:
        """A finding where neither option, header, preset nor vehnav's own names give the unit."""
        open_ones = [
            self.columns[quantity].name
            for quantity in quantities
            if option is None
            and self.columns[quantity].unit is None
            and self.columns[quantity].name.lower() != quantity
        ]
        if not open_ones:
            return []
        unit = GROUPS[QUANTITIES[quantities[0]]].default
        text = f"{self.sheet.path}: columns {', '.join(open_ones)} declare no unit; read as {unit}"
        return [Finding("unit-assumed", "info", text)]

    def missing_imu(self) -> str:
        """What to tell somebody whose file has not all six inertial columns."""
        names = [f"{name}_{axis}" for name in ("gyro", "accel") for axis in AXES]
        missing = [name for name in names if name not in self.columns]
        return (
            f"{self.sheet.path}: no column for {', '.join(missing)}; name them with "
            f"--columns {','.join(f'{name}=NAME' for name in missing)} (and --gyro-unit, "
            f"--accel-unit); the file has {list_names(self.sheet.names)}. "
            "Where an app keeps each sensor in a file of its own, give the folder"
        )


def lay_out(path: str, options: ReadOptions, *, only_present: bool = False) -> Layout:
    """The layout of a file; nothing but its beginning is read.

    Raises
    ------
    FormatError, LogError, ConfigError
        Not a table; a declared column that is not there; an unknown quantity or preset.
    """
    sheet = sniff(path)
    preset = choose_preset(sheet, options.preset)
    declared = declared_columns(options, sheet.names, path, only_present=only_present)
    return Layout(sheet, preset, MappingProxyType({**preset.place(sheet.names), **declared}))


def scale_to_si(
    layout: Layout, quantity: str, option: str | None, findings: list[Finding]
) -> float:
    """What a column is multiplied with to be SI; the unit by option, name or preset, else SI."""
    column, group = layout.columns[quantity], GROUPS[QUANTITIES[quantity]]
    path = layout.sheet.path
    for unit in (option, column.unit):
        if unit is not None and unit not in group.units:
            raise ConfigError(
                f"{path}: {unit!r} is not a unit of {quantity} (column {column.name!r}); "
                f"known are {', '.join(group.units)}"
            )
    if option is not None and column.unit not in (None, option):
        text = f"{path}: column {column.name!r} says {column.unit}; read in {option} as declared"
        findings.append(Finding("unit-contradiction", "warning", text))
    return column.sign * group.units[option or column.unit or group.default]


def choose_clock(table: Table, layout: Layout, options: ReadOptions, kind: str) -> TimeArray:
    """Stamps of the rows: the sample's own where they are sound, else the recorder's."""
    names = [name for name in ("time", "log_time") if layout.has(name)]
    if len(names) == 2 and options.time is not None:
        names = names[:1] if options.time == "header" else names[1:]
    clocks = [stamps(table, layout.columns[name], kind=kind) for name in names]
    if names[0] == "time" and layout.has("time_part"):
        part = table.integers(layout.columns["time_part"].index)
        if part is not None:
            whole = (clocks[0] != NO_TIME) & (part != NO_TIME)
            clocks[0] = np.where(whole, clocks[0] + np.where(whole, part, 0), NO_TIME)
    if len(clocks) == 1:
        return clocks[0]
    header, log = clocks
    trouble = _clock_trouble(header, log)
    chosen = "log_time" if trouble else "time"
    text = f"{layout.sheet.path}: stamps from column {layout.columns[chosen].name!r}"
    if trouble:
        text += f", because column {layout.columns['time'].name!r} {trouble}"
    table.findings.append(Finding("clock-choice", "info", text))
    return log if trouble else header


def _clock_trouble(header: TimeArray, log: TimeArray) -> str | None:
    """Why the sample's stamps cannot be used beside the recorder's; None where they can."""
    good = (header != NO_TIME) & (log != NO_TIME)
    if good.sum() < 2 or good.sum() < 0.9 * (log != NO_TIME).sum():
        return "is mostly empty"
    header, log = header[good], log[good]
    offset = float(np.median(log - header)) * 1e-9
    if abs(offset) > HEADER_CLOCK_OFFSET_S:
        return f"is {offset:.6g} s from the recorder's clock"
    back = int(np.sum(header[1:] < header[:-1]))
    if back > np.sum(log[1:] < log[:-1]):
        return f"runs backward {back} times"
    spans = float(header[-1] - header[0]), float(log[-1] - log[0])
    if abs(spans[0] - spans[1]) > HEADER_CLOCK_TOLERANCE * abs(spans[1]) + 2e9:
        return "does not run at the rate of the recorder's clock"
    return None
