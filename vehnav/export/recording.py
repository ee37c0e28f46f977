"""A readable log becomes a clean one: standard messages, SI, known axes; reads back bit for bit.

MCAP: one file, ROS 2 CDR, IMU on forward-left-up. CSV: the IMU on right-forward-up (vehnav's own
axes), fixes and speed beside it as ``STEM.gps.csv`` and ``STEM.speed.csv``. Turning by axis
letters only exchanges and negates numbers, and every number is written with all its digits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.errors import ConfigError, LogError
from vehnav.export.atomic import atomic_path
from vehnav.logs.log import Gnss, Imu, Log, Speed
from vehnav.mounting import gravity_contradiction, sensor_to_body
from vehnav.orientation import USUAL
from vehnav.pipeline import search_stops
from vehnav.rotation import exact_degrees

Array = npt.NDArray[np.float64]

SUFFIXES: Final = (".mcap", ".csv")
EXACT: Final = "%r"
"""The shortest text that reads back as the same float64."""


def on_body_axes(
    imu: Imu,
    *,
    axes: str | None = None,
    accel_axes: str | None = None,
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0),
    path: str = "",
) -> Imu:
    """The samples on right-forward-up.

    Parameters
    ----------
    imu : Imu
    axes, accel_axes : str or None
        Letters; None: those of the format, else FLU, checked against gravity over the log.
    mount : (roll, pitch, yaw), rad
    path : str
        For messages.

    Raises
    ------
    LogError
        Gravity contradicts the axes that the format declares.
    """
    letters = axes or imu.axes or USUAL
    if axes is None:
        contradiction = gravity_contradiction(imu.accel.mean(axis=0), accel_axes or letters)
        if contradiction is not None:
            raise LogError(f"{path}: {contradiction}. Set --axes (the drive does not show them)")
    c_gyro, c_accel = sensor_to_body(letters, accel_axes=accel_axes, mount=mount)
    return replace(imu, gyro=imu.gyro @ c_gyro.T, accel=imu.accel @ c_accel.T, axes="RFU")


def on_established_axes(
    log: Log, imu: Imu, *, mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> tuple[Imu, list[str]]:
    """The samples on right-forward-up, in SI, by the axes and units that the drive shows.

    Only letters and units: the small angles that remain are left in, for turning by them rounds.
    Where the drive does not show the axes, those of the format count (see :func:`on_body_axes`).

    Returns
    -------
    imu : Imu
    notes : list of str
        What was established, for a person.
    """
    try:
        shown = search_stops(log).samples.orientation
    except LogError as error:
        return on_body_axes(imu, mount=mount, path=log.path), [f"axes as declared: {error}"]
    if shown.units is not None and not shown.units.as_read:
        gyro, accel = imu.gyro * shown.units.gyro_scale, imu.accel * shown.units.accel_scale
        sampling = "increments" if shown.units.increments else imu.sampling
        imu = replace(imu, gyro=gyro, accel=accel, sampling=sampling)
    notes = [
        f"{finding.code}: {finding.text}"
        for finding in shown.findings
        if finding.code in ("axes-found", "axes-unverified")
    ]
    if not shown.evidence.certain:
        return on_body_axes(imu, mount=mount, path=log.path), notes
    letters, accel_letters = shown.axes, shown.accel_axes
    turned = on_body_axes(imu, axes=letters, accel_axes=accel_letters, mount=mount, path=log.path)
    return turned, notes


def forward_left_up(imu: Imu) -> Imu:
    """Right-forward-up samples on the axes of ROS."""

    def turned(x: Array) -> Array:
        return np.stack([x[:, 1], -x[:, 0], x[:, 2]], axis=-1)

    return replace(imu, gyro=turned(imu.gyro), accel=turned(imu.accel), axes="FLU")


def write_recording(log: Log, path: str | Path) -> list[Path]:
    """Write a log whose IMU is on right-forward-up; the files, the recording first.

    Parameters
    ----------
    log : Log
        With ``imu.axes`` RFU (see :func:`on_body_axes`).
    path : path
        ``.mcap`` or ``.csv``.

    Raises
    ------
    ConfigError
        Another suffix.
    LogError
        No IMU in the log.
    ValueError
        The IMU is not on right-forward-up.
    """
    target = Path(path)
    if target.suffix.lower() not in SUFFIXES:
        raise ConfigError(f"{path}: a log is written as {' or '.join(SUFFIXES)}")
    if log.imu is None:
        raise LogError(f"{log.path}: no IMU in it: nothing to write as a log")
    if log.imu.axes != "RFU":
        raise ValueError("the IMU must be on right-forward-up axes")
    if target.suffix.lower() == ".mcap":
        return _write_mcap(log, log.imu, target)
    return _write_csv(log, log.imu, target)


def _write_mcap(log: Log, imu: Imu, target: Path) -> list[Path]:
    from vehnav.simulate.mcap_file import gnss_topic, imu_topic, speed_topic, write_mcap

    topics = [imu_topic(forward_left_up(imu))]
    if log.gnss is not None and log.gnss.t_ns.size:
        topics.append(gnss_topic(log.gnss))
    if log.speed is not None and log.speed.t_ns.size:
        topics.append(speed_topic(log.speed))
    with atomic_path(target) as temporary:
        write_mcap(temporary, topics)
    return [target]


def _write_csv(log: Log, imu: Imu, target: Path) -> list[Path]:
    for record, name in ((log.gnss, "gps"), (log.speed, "speed")):
        other = target.with_suffix(f".{name}.csv")
        if (record is None or not record.t_ns.size) and other.exists():
            raise ConfigError(
                f"{other}: stands beside {target.name} and would be read as its {name}, but "
                f"{log.path} has none; move it away or choose another name"
            )
    files = [target]
    kinds = ("dtheta", "dvel") if imu.sampling == "increments" else ("gyro", "accel")
    names = ["t_ns", *(f"{kind}_{axis}" for kind in kinds for axis in "xyz")]
    _write_columns(target, names, imu.t_ns, [*imu.gyro.T, *imu.accel.T])
    if log.gnss is not None and log.gnss.t_ns.size:
        files.append(target.with_suffix(".gps.csv"))
        _write_columns(files[-1], *_gnss_columns(log.gnss))
    if log.speed is not None and log.speed.t_ns.size:
        files.append(target.with_suffix(".speed.csv"))
        _write_columns(files[-1], *_speed_columns(log.speed))
    return files


def _gnss_columns(gnss: Gnss) -> tuple[list[str], npt.NDArray[np.int64], list[Array]]:
    names = ["t_ns", "lat_deg", "lon_deg", "height_m"]
    columns = [exact_degrees(gnss.lat), exact_degrees(gnss.lon), gnss.height]
    for values, title, unit in (
        (gnss.v_n, "v", "m_s"),
        (gnss.sigma_pos, "sigma", "m"),
        (gnss.sigma_vel, "sigma_v", "m_s"),
    ):
        if values is not None:
            names += [f"{title}_{axis}_{unit}" for axis in ("east", "north", "up")]
            columns += list(values.T)
    return names, gnss.t_ns, columns


def _speed_columns(speed: Speed) -> tuple[list[str], npt.NDArray[np.int64], list[Array]]:
    return ["t_ns", "speed_m_s"], speed.t_ns, [speed.speed]


def _write_columns(
    path: Path, names: Sequence[str], t_ns: npt.NDArray[np.int64], columns: Sequence[Any]
) -> None:
    from vehnav.simulate.text_file import write_columns

    form = "%d" + f",{EXACT}" * len(columns)
    with atomic_path(path) as temporary:
        write_columns(temporary, names, form, [t_ns, *columns])


def lost(log: Log, path: str | Path) -> list[str]:
    """What the format of ``path`` cannot hold of this log; said, never dropped silently."""
    gnss = log.gnss
    if Path(path).suffix.lower() == ".mcap" and gnss is not None and gnss.sigma_vel is not None:
        return ["the standard deviations of the GPS velocity (no standard message has them)"]
    return []
