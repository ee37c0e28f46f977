"""CSV and other tables of numbers become records."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.errors import Finding, LogError
from vehnav.logs.check import clean_gnss, clean_imu, clean_speed
from vehnav.logs.columns import GPS_QUANTITIES, list_names, quantity_and_unit
from vehnav.logs.layout import Layout, choose_clock, lay_out, scale_to_si
from vehnav.logs.log import Array, Gnss, Imu, Log, ReadOptions, Speed, TimeArray
from vehnav.logs.presets import refuse_gravity_free
from vehnav.logs.table import Table
from vehnav.logs.timebase import is_unix

STANDING_SPEED: Final = 0.5
"""m/s below which a receiver may leave its course out."""
VERTICAL_SIGMA_RATIO: Final = 1.5
"""Vertical over horizontal sigma where only the horizontal one is logged (usual GPS geometry)."""


def read_csv(path: str, options: ReadOptions) -> Log:
    """A recording kept as a table: IMU, and GPS or speed where the same rows have them.

    Parameters
    ----------
    path : str
    options : ReadOptions

    Returns
    -------
    Log
        ``imu`` is None where the table holds positions only.

    Raises
    ------
    LogError
        No gyro and accelerometer columns and no positions; the text lists what there is.
    """
    layout = lay_out(path, recording_options(options))
    positions = layout.has("lat", "lon")
    if "accel_x" not in options.columns and (not positions or layout.some_inertial):
        refuse_gravity_free(path, layout.sheet.names, layout.columns)
    if layout.imu is None and (not positions or layout.some_inertial):
        raise LogError(layout.missing_imu())
    if not layout.has("time") and not layout.has("log_time"):
        raise LogError(
            f"{path}: no time column among {list_names(layout.sheet.names)}; "
            "name it with --columns time_s=NAME (or time_ms, time_us, time_ns)"
        )
    table = _table(layout)
    findings: list[Finding] = []
    t_ns = choose_clock(table, layout, options, "imu" if layout.imu else "gps")
    inertial = layout.imu
    imu = _imu(table, layout, options, inertial, t_ns, findings) if inertial else None
    gnss = _gnss(table, layout, t_ns, findings) if positions else None
    speed = _speed(table, layout, t_ns, findings) if layout.has("speed") and imu else None
    return Log(
        path=path,
        imu=imu,
        gnss=gnss,
        speed=speed,
        findings=(*table.findings, *findings),
        unix_clock=is_unix(t_ns),
        integrity=MappingProxyType({"rows": table.rows}),
        damaged=any(finding.code == "bad-rows" for finding in table.findings),
        contents=tuple(_contents(layout, imu, gnss, speed)),
    )


def read_csv_gnss(path: str, options: ReadOptions) -> tuple[Gnss, list[Finding]]:
    """Positions kept as a table.

    Raises
    ------
    LogError
        No latitude and longitude, or no time, or no fix left; the text lists what there is.
    """
    layout = lay_out(path, gps_options(options), only_present=True)
    if layout.has("speed", "course") and not layout.has("gps_speed"):
        columns = {**layout.columns, "gps_speed": layout.columns["speed"]}
        layout = replace(layout, columns=columns)
    for quantity, option in (("lat", "lat_deg"), ("lon", "lon_deg"), ("time", "gps_time_s")):
        if not layout.has(quantity) and not (quantity == "time" and layout.has("log_time")):
            raise LogError(
                f"{path}: no column for {option}; name it with --columns {option}=NAME; "
                f"the file has {list_names(layout.sheet.names)}"
            )
    table = _table(layout)
    findings: list[Finding] = []
    t_ns = choose_clock(table, layout, options, "gps")
    gnss = _gnss(table, layout, t_ns, findings)
    findings = [*table.findings, *findings]
    if gnss is None:
        raise LogError(f"{path}: no usable fix in {table.rows} rows; {findings[-1].text}")
    return gnss, findings


def read_csv_speed(path: str, options: ReadOptions) -> tuple[Speed, list[Finding]]:
    """Forward speed kept as a table.

    Raises
    ------
    LogError
        No speed column, or none of its rows is usable.
    """
    layout = lay_out(path, options, only_present=True)
    if not layout.has("speed") or not (layout.has("time") or layout.has("log_time")):
        raise LogError(
            f"{path}: no columns for time and speed; name them with --columns "
            f"speed_m_s=NAME,time_s=NAME; the file has {list_names(layout.sheet.names)}"
        )
    table = _table(layout)
    findings: list[Finding] = []
    speed = _speed(table, layout, choose_clock(table, layout, options, "imu"), findings)
    if speed is None:
        raise LogError(f"{path}: no usable speed in {table.rows} rows")
    return speed, [*table.findings, *findings]


def recording_options(options: ReadOptions) -> ReadOptions:
    """Options for the recording: without the columns of the GPS and speed kept beside it."""
    beside = GPS_QUANTITIES if options.gps_file else frozenset()
    beside |= {"speed"} if options.speed_file else frozenset()
    columns = {
        key: value
        for key, value in options.columns.items()
        if not key.startswith("gps_time") and quantity_and_unit(key)[0] not in beside
    }
    return replace(options, columns=columns)


def gps_options(options: ReadOptions) -> ReadOptions:
    """Options for a GPS file: ``gps_time...`` names its time column."""
    columns = {
        key.removeprefix("gps_") if key.startswith("gps_time") else key: value
        for key, value in options.columns.items()
    }
    return replace(options, columns=columns)


# ---- records -------------------------------------------------------------------------------


def _table(layout: Layout) -> Table:
    """The rows, every digit of their stamps kept."""
    clocks = [layout.columns[name].index for name in ("time", "log_time") if layout.has(name)]
    return Table(layout.sheet, clocks)


def _vectors(
    table: Table,
    layout: Layout,
    quantities: Iterable[str],
    findings: list[Finding],
    option: str | None = None,
) -> Array:
    """(rows, k): columns in SI."""
    quantities = tuple(quantities)
    values = np.empty((table.rows, len(quantities)))
    for k, quantity in enumerate(quantities):
        factor = scale_to_si(layout, quantity, option, findings)
        values[:, k] = table.numbers(layout.columns[quantity].index)
        if factor != 1.0:
            values[:, k] *= factor
    return values


def _imu(
    table: Table,
    layout: Layout,
    options: ReadOptions,
    names: tuple[tuple[str, ...], tuple[str, ...]],
    t_ns: TimeArray,
    findings: list[Finding],
) -> Imu:
    """The samples; ``names`` are those of :attr:`Layout.imu`."""
    gyro_names, accel_names = names
    rates = gyro_names[0].startswith("gyro")
    gyro = _vectors(table, layout, gyro_names, findings, options.gyro_unit if rates else None)
    accel = _vectors(table, layout, accel_names, findings, options.accel_unit if rates else None)
    source = ", ".join(layout.columns[name].name for name in (*gyro_names, *accel_names))
    findings.extend(layout.assumed_units(gyro_names, options.gyro_unit))
    findings.extend(layout.assumed_units(accel_names, options.accel_unit))
    imu, notes = clean_imu(
        t_ns,
        gyro,
        accel,
        source=source,
        sampling="rates" if rates else "increments",
        where=layout.sheet.path,
    )
    findings.extend(notes)
    letters, declared = layout.axes
    return replace(imu, axes=letters, axes_declared=declared)


def _gnss(table: Table, layout: Layout, t_ns: TimeArray, findings: list[Finding]) -> Gnss | None:
    """Fixes of the table; where rows repeat a fix, its first row."""
    fixes = _new_fixes(table, layout)

    def take(*quantities: str) -> Array | None:
        if not layout.has(*quantities):
            return None
        return _vectors(table, layout, quantities, findings)[fixes]

    lat_lon = _vectors(table, layout, ("lat", "lon"), findings)[fixes]
    height = take("height")
    lat_name, lon_name = layout.columns["lat"].name, layout.columns["lon"].name
    gnss, notes = clean_gnss(
        t_ns[fixes],
        lat_lon[:, 0],
        lat_lon[:, 1],
        np.full(fixes.size, np.nan) if height is None else height[:, 0],
        v_n=_velocity(take),
        sigma_pos=_sigma(take),
        sigma_vel=take("sigma_v_east", "sigma_v_north", "sigma_v_up"),
        status=_status(take),
        source=f"{lat_name}, {lon_name}",
        where=f"{layout.sheet.path}: GPS",
    )
    findings.extend(notes)
    return gnss


def _new_fixes(table: Table, layout: Layout) -> npt.NDArray[np.intp]:
    """Rows that carry a new fix.

    In a table of fixes every row does. In a table of IMU samples the last fix may be repeated, or
    the fields between fixes be empty: a row counts where ``fix_time`` changes, else where the
    position does; empty ones never.
    """
    if layout.imu is None:
        return np.arange(table.rows)
    keys = ["fix_time"] if layout.has("fix_time") else ["lat", "lon", "height"]
    values = [table.numbers(layout.columns[key].index) for key in keys if layout.has(key)]
    filled = np.flatnonzero(np.all(np.isfinite(values), axis=0))
    if filled.size < 0.5 * table.rows and not layout.has("fix_time"):
        return filled  # written once each
    changed = np.zeros(filled.size, np.bool_)
    changed[:1] = True
    for value in values:
        changed[1:] |= np.diff(value[filled]) != 0.0
    return filled[changed]


Take = Callable[..., Array | None]


def _velocity(take: Take) -> Array | None:
    """(m, 3) east, north, up velocity; from speed and course with 0 up; None where not logged."""
    horizontal = take("v_east", "v_north")
    if horizontal is not None:
        up, down = take("v_up"), take("v_down")
        vertical = (
            up if up is not None else np.zeros((len(horizontal), 1)) if down is None else -down
        )
        return np.hstack([horizontal, vertical])
    polar = take("gps_speed", "course")
    if polar is None:
        return None
    speed = np.where(polar[:, 0] < 0.0, np.nan, polar[:, 0])  # apps write -1 for none
    return velocity_from_course(speed, polar[:, 1])


def velocity_from_course(speed: Array, course: Array) -> Array:
    """(m, 3) east, north, up of speed over ground (m/s) and course (rad from north); up is 0.

    A standing receiver has no course: where that is missing and the speed is near 0, so is the
    velocity.
    """
    standing = ~np.isfinite(course) & (speed < STANDING_SPEED)
    angle = np.where(standing, 0.0, course)
    return np.column_stack([speed * np.sin(angle), speed * np.cos(angle), 0.0 * speed])


def _status(take: Take) -> npt.NDArray[np.int64] | None:
    """As ``sensor_msgs/NavSatStatus``; unknown where it is missing."""
    status = take("status")
    if status is None:
        return None
    return np.where(np.isfinite(status[:, 0]), status[:, 0], -2.0).astype(np.int64)


def _sigma(take: Take) -> Array | None:
    full = take("sigma_east", "sigma_north", "sigma_up")
    if full is not None:
        return full
    horizontal, up = take("sigma_horizontal"), take("sigma_up")
    if horizontal is None:
        return None
    up = VERTICAL_SIGMA_RATIO * horizontal if up is None else up
    return np.hstack([horizontal, horizontal, up])


def _speed(table: Table, layout: Layout, t_ns: TimeArray, findings: list[Finding]) -> Speed | None:
    speed, notes = clean_speed(
        t_ns,
        _vectors(table, layout, ("speed",), findings)[:, 0],
        source=layout.columns["speed"].name,
        where=f"{layout.sheet.path}: speed",
    )
    findings.extend(notes)
    return speed


def _contents(
    layout: Layout, imu: Imu | None, gnss: Gnss | None, speed: Speed | None
) -> list[Mapping[str, Any]]:
    """One row per record, for ``vehnav info``."""
    rows: list[Mapping[str, Any]] = []
    for kind, record in (("IMU", imu), ("GPS", gnss), ("speed", speed)):
        if record is not None:
            step = float(np.median(np.diff(record.t_ns))) if record.t_ns.size > 1 else 0.0
            rows.append(
                {
                    "name": record.source,
                    "type": f"{kind} (CSV, {layout.preset.name})",
                    "count": int(record.t_ns.size),
                    "rate_hz": 1e9 / step if step else 0.0,
                }
            )
    return rows
