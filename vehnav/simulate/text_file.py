"""CSV files of a simulated log: IMU, fixes and speed as ``vehnav`` reads them back, and truth."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vehnav.logs.log import Gnss, Imu, Speed
from vehnav.rotation import angles_from_c_nb
from vehnav.trajectory import Trajectory

Array = npt.NDArray[np.float64]

_ROWS = 4096


def write_columns(path: Path, names: Sequence[str], form: str, columns: Sequence[Any]) -> None:
    """Write a CSV file of equal columns, ``form`` the %-format of a row."""
    lists = [np.asarray(c).tolist() for c in columns]
    rows = len(lists[0])
    with path.open("w", encoding="ascii", newline="\n") as stream:
        stream.write(",".join(names) + "\n")
        for k in range(0, rows, _ROWS):
            block = [c[k : k + _ROWS] for c in lists]
            flat = tuple(itertools.chain.from_iterable(zip(*block, strict=True)))
            stream.write((form + "\n") * len(block[0]) % flat)


def write_imu(path: Path, imu: Imu) -> None:
    """``t_ns`` and six columns, rad/s and m/s2 (gyro, accel) or rad and m/s (dtheta, dvel)."""
    kinds = ("dtheta", "dvel") if imu.sampling == "increments" else ("gyro", "accel")
    names = ["t_ns", *(f"{kind}_{axis}" for kind in kinds for axis in "xyz")]
    form = "%d" + ",%.12g" * 6
    write_columns(path, names, form, [imu.t_ns, *imu.gyro.T, *imu.accel.T])


def write_gnss(path: Path, gnss: Gnss) -> None:
    """Fixes with their standard deviations, and the velocity if there is one."""
    names = ["t_ns", "lat_deg", "lon_deg", "height_m"]
    columns: list[Any] = [gnss.t_ns, np.degrees(gnss.lat), np.degrees(gnss.lon), gnss.height]
    form = "%d,%.9f,%.9f,%.3f"
    for values, title, unit in (
        (gnss.v_n, "v", "m_s"),
        (gnss.sigma_pos, "sigma", "m"),
        (gnss.sigma_vel, "sigma_v", "m_s"),
    ):
        if values is not None:
            names += [f"{title}_{axis}_{unit}" for axis in ("east", "north", "up")]
            columns += list(values.T)
            form += ",%.3f,%.3f,%.3f"
    write_columns(path, names, form, columns)


def write_speed(path: Path, speed: Speed) -> None:
    """Forward speed."""
    write_columns(path, ["t_ns", "speed_m_s"], "%d,%.4f", [speed.t_ns, speed.speed])


def write_truth(path: Path, truth: Trajectory) -> None:
    """The columns of ``trajectory.csv``."""
    names = [
        "time_s",
        "lat_deg",
        "lon_deg",
        "height_m",
        "v_east_m_s",
        "v_north_m_s",
        "v_up_m_s",
        "heading_deg",
        "pitch_deg",
        "roll_deg",
        "stopped",
    ]
    angles = angles_from_c_nb(truth.c_nb)
    columns = [
        truth.t_ns // 1_000_000_000,
        truth.t_ns % 1_000_000_000,
        np.degrees(truth.lat),
        np.degrees(truth.lon),
        truth.height,
        *truth.v_n.T,
        *(np.degrees(a) for a in angles),
        truth.stopped.astype(int),
    ]
    form = "%d.%09d,%.10f,%.10f,%.4f,%.5f,%.5f,%.5f,%.5f,%.5f,%.5f,%d"
    write_columns(path, names, form, columns)
