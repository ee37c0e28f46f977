"""A trajectory as named columns (``trajectory.csv``, Parquet, JSON), and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.earth import POLAR, position_difference
from vehnav.errors import FormatError
from vehnav.export.decimals import Column, column
from vehnav.rotation import angles_from_c_nb, c_nb_from_angles
from vehnav.strapdown.place import c_nw, c_we_from_geodetic
from vehnav.strapdown.quasi import gyro_heading, quasi_from_geodetic, quasi_heading, wander_along
from vehnav.trajectory import Trajectory
from vehnav.units import NS

Array = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

TIME: Final = "time_s"
DECIMALS: Final = {
    "lat_deg": 10,  # 0.01 mm
    "lon_deg": 10,
    "height_m": 4,
    "v_east_m_s": 5,
    "v_north_m_s": 5,
    "v_up_m_s": 5,
    "heading_deg": 5,
    "pitch_deg": 5,
    "roll_deg": 5,
    "stopped": 0,
    "sigma_east_m": 4,
    "sigma_north_m": 4,
    "sigma_up_m": 4,
    "sigma_heading_deg": 5,
    "eps_deg": 5,
    "qlat_deg": 10,
    "qlon_deg": 10,
    "qheading_deg": 5,
    "gyro_heading_deg": 5,
}
"""Columns of ``trajectory.csv`` after the time, and their decimals."""
QUASI: Final = ("eps_deg", "qlat_deg", "qlon_deg", "qheading_deg", "gyro_heading_deg")
"""Columns that ``--coords`` adds; all but the first follow from the others."""
REQUIRED: Final = ("lat_deg", "lon_deg")


def to_columns(trajectory: Trajectory) -> dict[str, Array]:
    """The quantities of the file by name, in its units, without the time."""
    heading, pitch, roll = angles_from_c_nb(trajectory.c_nb)
    columns = {
        "lat_deg": np.degrees(trajectory.lat),
        "lon_deg": np.degrees(trajectory.lon),
        "height_m": trajectory.height,
        "v_east_m_s": trajectory.v_n[:, 0],
        "v_north_m_s": trajectory.v_n[:, 1],
        "v_up_m_s": trajectory.v_n[:, 2],
        "heading_deg": np.degrees(heading),
        "pitch_deg": np.degrees(pitch),
        "roll_deg": np.degrees(roll),
        "stopped": trajectory.stopped.astype(float),
    }
    if trajectory.sigma_pos is not None:
        for k, name in enumerate(("sigma_east_m", "sigma_north_m", "sigma_up_m")):
            columns[name] = trajectory.sigma_pos[:, k]
    if trajectory.sigma_heading is not None:
        columns["sigma_heading_deg"] = np.degrees(trajectory.sigma_heading)
    if trajectory.wander is not None:
        columns |= quasi_columns(trajectory, trajectory.wander)
    return columns


def quasi_columns(trajectory: Trajectory, wander: Array) -> dict[str, Array]:
    """Wander angle, quasi-coordinates and the headings that stay regular at a pole (paper 003)."""
    lat, lon = trajectory.lat, trajectory.lon
    c_we = c_we_from_geodetic(lat, lon, wander)
    c_wb = np.swapaxes(c_nw(wander), 1, 2) @ trajectory.c_nb
    lat_q, lon_q, _ = quasi_from_geodetic(lat, lon, trajectory.height)
    eps = np.remainder(wander + np.pi, 2.0 * np.pi) - np.pi
    angles = (eps, lat_q, lon_q, quasi_heading(c_we, c_wb), gyro_heading(c_wb))
    return {name: np.degrees(x) for name, x in zip(QUASI, angles, strict=True)}


def fixed_columns(trajectory: Trajectory) -> list[Column]:
    """The file's columns as scaled integers; the time is exact."""
    time = Column(TIME, trajectory.t_ns, 9)
    return [time, *(column(n, x, DECIMALS[n]) for n, x in to_columns(trajectory).items())]


def from_columns(t_ns: TimeArray, columns: Mapping[str, Array], *, where: str) -> Trajectory:
    """The trajectory of columns by name; what a minimal file lacks is derived.

    Without velocities they are the differences of the positions; without a heading it is the
    course. FormatError names the file (``where``), row and column of what cannot be used.
    """
    check(t_ns, columns, where=where)
    n = t_ns.size
    zero = np.zeros(n)
    lat, lon = np.radians(columns["lat_deg"]), np.radians(columns["lon_deg"])
    height = columns.get("height_m", zero)
    if {"v_east_m_s", "v_north_m_s"} <= columns.keys():
        v_up = columns.get("v_up_m_s", zero)
        v_n = np.column_stack([columns["v_east_m_s"], columns["v_north_m_s"], v_up])
    else:
        v_n = velocity_of(t_ns, lat, lon, height)
    heading = columns.get("heading_deg")
    angles = (
        course_of(v_n) if heading is None else np.radians(heading),
        np.radians(columns.get("pitch_deg", zero)),
        np.radians(columns.get("roll_deg", zero)),
    )
    sigmas = [columns.get(name) for name in ("sigma_east_m", "sigma_north_m", "sigma_up_m")]
    given = [s for s in sigmas if s is not None]
    sigma_heading = columns.get("sigma_heading_deg")
    wander = columns.get("eps_deg")
    return Trajectory(
        t_ns=t_ns,
        lat=lat,
        lon=lon,
        height=height,
        v_n=v_n,
        c_nb=c_nb_from_angles(*angles),
        stopped=columns.get("stopped", zero) > 0.5,
        sigma_pos=np.column_stack(given) if len(given) == 3 else None,
        sigma_heading=None if sigma_heading is None else np.radians(sigma_heading),
        wander=None if wander is None else np.radians(wander),
    )


def check(t_ns: TimeArray, columns: Mapping[str, Array], *, where: str) -> None:
    """FormatError unless the required columns are there, finite, in range, in order of time."""
    missing = [name for name in REQUIRED if name not in columns]
    if missing:
        raise FormatError(f"{where}: no column {', '.join(missing)}; it is not a trajectory")
    if t_ns.size < 2:
        raise FormatError(f"{where}: {t_ns.size} rows; a trajectory has at least two")
    for name, values in columns.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise FormatError(f"{where}: row {bad[0] + 1}: {name} is missing or not finite")
    back = np.flatnonzero(np.diff(t_ns) <= 0)
    if back.size:
        raise FormatError(
            f"{where}: row {back[0] + 2}: the time {t_ns[back[0] + 1] * NS:.9f} s is not after "
            "the row before; sort it and leave repeated stamps out"
        )
    beyond = np.flatnonzero(np.abs(columns["lat_deg"]) > 90.0)
    if beyond.size:
        value = columns["lat_deg"][beyond[0]]
        raise FormatError(
            f"{where}: row {beyond[0] + 1}: latitude {value} is beyond 90 degrees; "
            "are latitude and longitude swapped?"
        )


def velocity_of(t_ns: TimeArray, lat: Array, lon: Array, height: Array) -> Array:
    """(n, 3) m/s: East-North-Up velocities as differences of positions."""
    step = position_difference(lat[1:], lon[1:], lat[:-1], lon[:-1], height[1:])
    t = (t_ns - t_ns[0]) * NS
    wander = np.zeros(lat.size)  # of axes that do not turn; needed near the poles alone
    if np.any(np.abs(lat) > POLAR):
        wander = wander_along(t, lat, lon)
        step = np.einsum("kji,kj->ki", c_nw(wander[:-1])[:, :2, :2], step)
    plane = np.concatenate([np.zeros((1, 2)), np.cumsum(step, axis=0)])
    slope = np.gradient(np.column_stack([plane, height]), t, axis=0)
    return np.asarray(np.einsum("kij,kj->ki", c_nw(wander), slope) if np.any(wander) else slope)


def course_of(v_n: Array) -> Array:
    """(n,) rad: direction of the velocity, held below 0.5 m/s."""
    moving = np.hypot(v_n[:, 0], v_n[:, 1]) > 0.5
    if not moving.any():
        return np.zeros(v_n.shape[0])
    last = np.maximum.accumulate(np.where(moving, np.arange(moving.size), -1))
    angle = np.arctan2(v_n[:, 0], v_n[:, 1])
    return np.asarray(angle[np.where(last < 0, np.argmax(moving), last)])


def decimate(trajectory: Trajectory, rate_hz: float | None) -> Trajectory:
    """The states nearest after a grid of ``rate_hz``, first and last included; None: all.

    States are chosen, never interpolated: every row of a file was computed.
    """
    if rate_hz is None or trajectory.size < 2:
        return trajectory
    if not rate_hz > 0.0:
        raise ValueError(f"rate {rate_hz} Hz: must be positive")
    t = (trajectory.t_ns - trajectory.t_ns[0]) * NS
    half = 0.25 * float(np.median(np.diff(t)))  # jitter must not skip to the next state
    index = np.searchsorted(t, np.arange(0.0, t[-1] + half, 1.0 / rate_hz) - half)
    return trajectory.rows(np.unique(np.append(index[index < t.size], t.size - 1)))


def document(trajectory: Trajectory, *, unix_clock: bool) -> dict[str, Any]:
    """A trajectory as one JSON document: times in integer nanoseconds, the rest as in the CSV."""
    columns = {
        name: np.round(values, DECIMALS[name]).tolist()
        for name, values in to_columns(trajectory).items()
    }
    return {
        "version": 1,
        "format": "vehnav.trajectory",
        "unix_clock": unix_clock,
        "columns": {"t_ns": trajectory.t_ns.tolist(), **columns},
    }
