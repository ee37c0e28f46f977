"""Recordings kept as a folder: which kind it is, and the readers of two of them.

One row per kind in :data:`FOLDERS`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np

from vehnav.errors import Finding, FormatError, LogError
from vehnav.logs.check import clean_gnss, clean_imu
from vehnav.logs.clock import NO_TIME
from vehnav.logs.columns import GROUPS, name_and_unit
from vehnav.logs.log import Array, Gnss, Imu, Log, ReadOptions, TimeArray
from vehnav.logs.phones import is_phyphox, is_sensor_logger
from vehnav.logs.timebase import is_unix
from vehnav.units import DEG

OXTS_COLUMNS: Final = 30
_SIM_GROUPS: Final = tuple(GROUPS[name] for name in ("gyro", "accel", "angle", "speed", "length"))


@dataclass(frozen=True)
class Folder:
    """A kind of folder: how it is recognised, and ``module:function`` (path, options) -> Log."""

    name: str
    matches: Callable[[Path], bool]
    log: str = ""
    refusal: str = ""


def _has(folder: Path, *patterns: str) -> bool:
    return all(any(folder.glob(pattern)) for pattern in patterns)


FOLDERS: Final = (
    Folder("rosbag2 (MCAP)", lambda f: _has(f, "*.mcap"), log="vehnav.logs.mcap:read_mcap"),
    Folder(
        "rosbag2 (SQLite)",
        lambda f: _has(f, "*.db3"),
        log="vehnav.logs.rosbag:read_rosbag",
    ),
    Folder(
        "gnss-ins-sim",
        lambda f: _has(f, "time.csv", "gyro-0.csv", "accel-0.csv"),
        log="vehnav.logs.folders:read_gnss_ins_sim",
    ),
    Folder(
        "KITTI OXTS",
        lambda f: _oxts(f) is not None,
        log="vehnav.logs.folders:read_kitti_oxts",
    ),
    Folder(
        "Sensor Logger",
        lambda f: _has(f, "*.csv") and is_sensor_logger(f),
        log="vehnav.logs.phones:read_sensor_logger",
    ),
    Folder(
        "phyphox",
        lambda f: _has(f, "*.csv") and is_phyphox(f),
        log="vehnav.logs.phones:read_phyphox",
    ),
)


def read_folder(path: str, options: ReadOptions) -> Log:
    """A recording kept as a folder.

    Raises
    ------
    LogError
        None of the known kinds; the text lists what is in it.
    """
    folder = Path(path)
    kind = next((kind for kind in FOLDERS if kind.matches(folder)), None)
    if kind is None:
        inside = sorted(entry.name for entry in folder.iterdir())
        listed = ", ".join(inside[:10]) + (", ..." if len(inside) > 10 else "")
        raise LogError(
            f"{path}: a folder of no known kind ({', '.join(k.name for k in FOLDERS)}); "
            f"give the recording inside it: {listed or 'it is empty'}"
        )
    if kind.refusal:
        raise LogError(f"{path}: {kind.refusal.format(path=path, name=folder.name)}")
    module, _, function = kind.log.partition(":")
    log: Log = getattr(importlib.import_module(module), function)(path, options)
    return log


# ---- gnss-ins-sim ----------------------------------------------------------------------------


def read_gnss_ins_sim(path: str, _: ReadOptions) -> Log:
    """The first run of a gnss-ins-sim folder: a file per quantity, forward-right-down.

    Raises
    ------
    FormatError
        Files of different length, or without the columns that they are named for.
    """
    folder = Path(path)
    t_ns = _nanoseconds(_table(folder / "time.csv", "time"))
    gyro = _table(folder / "gyro-0.csv", "gyro_x", "gyro_y", "gyro_z")
    accel = _table(folder / "accel-0.csv", "accel_x", "accel_y", "accel_z")
    if not len(t_ns) == len(gyro) == len(accel):
        raise FormatError(
            f"{path}: time.csv, gyro-0.csv and accel-0.csv have {len(t_ns)}, {len(gyro)} and "
            f"{len(accel)} rows; the run was not written completely"
        )
    imu, findings = clean_imu(t_ns, gyro, accel, source="gyro-0.csv, accel-0.csv", where=path)
    gnss = None
    if _has(folder, "gps-0.csv", "gps_time.csv"):
        gnss, notes = _simulated_gnss(folder)
        findings += notes
    return _log(path, replace(imu, axes="FRD", axes_declared=True), gnss, findings)


def _simulated_gnss(folder: Path) -> tuple[Gnss | None, list[Finding]]:
    """Fixes of ref_frame 0 (latitude, longitude); none where they are Cartesian."""
    file = folder / "gps-0.csv"
    try:
        fixes = _table(file, "gps_lat", "gps_lon", "gps_alt", "gps_vn", "gps_ve", "gps_vd")
    except FormatError as error:
        return None, [Finding("gps-rejected", "warning", str(error))]
    t_ns = _nanoseconds(_table(folder / "gps_time.csv", "gps_time"))
    if len(t_ns) != len(fixes):
        raise FormatError(f"{file}: {len(fixes)} rows, but gps_time.csv has {len(t_ns)}")
    v_n = fixes[:, [4, 3, 5]] * [1.0, 1.0, -1.0]
    lat, lon, height = fixes[:, :3].T
    return clean_gnss(t_ns, lat, lon, height, v_n=v_n, source=file.name, where=str(file))


def _table(file: Path, *names: str) -> Array:
    """(rows, k): columns of a file in SI and radians, by name and the unit in its brackets."""
    import pandas as pd

    frame = pd.read_csv(file, skipinitialspace=True)
    known = {name_and_unit(str(header))[0]: str(header) for header in frame.columns}
    missing = [name for name in names if name not in known]
    if missing:
        raise FormatError(
            f"{file}: no column {', '.join(missing)} among {', '.join(map(str, frame.columns))}"
        )
    columns = []
    for name in names:
        values = pd.to_numeric(frame[known[name]], errors="coerce").to_numpy(np.float64)
        unit = name_and_unit(known[name])[1] or ""
        columns.append(values * next((g.units[unit] for g in _SIM_GROUPS if unit in g.units), 1.0))
    return np.column_stack(columns)


def _nanoseconds(seconds: Array) -> TimeArray:
    good = np.isfinite(seconds[:, 0])
    return np.where(good, np.rint(np.where(good, seconds[:, 0], 0.0) * 1e9), NO_TIME).astype(
        np.int64
    )


# ---- KITTI OXTS ------------------------------------------------------------------------------


def _oxts(folder: Path) -> Path | None:
    """The folder of the OXTS packets: the drive's ``oxts``, or the folder itself."""
    for place in (folder / "oxts", folder):
        if (place / "timestamps.txt").is_file() and (place / "data").is_dir():
            first = next(place.glob("data/*.txt"), None)
            if first is not None and len(first.read_text().split()) == OXTS_COLUMNS:
                return place
    return None


def read_kitti_oxts(path: str, _: ReadOptions) -> Log:
    """The OXTS packets of a KITTI raw drive: a file per packet, forward-left-up.

    Columns as in KITTI's dataformat.txt, from 0: latitude, longitude (deg), height, roll, pitch,
    yaw, velocity north, east, then forward, left, up; acceleration x, y, z; 17 to 19 angular rate
    x, y, z; 23, 24 accuracy of position and velocity.

    Raises
    ------
    FormatError
        Packets and stamps of different number.
    """
    place = _oxts(Path(path))
    if place is None:
        raise LogError(f"{path}: no OXTS packets (timestamps.txt and data/*.txt)")
    lines = (place / "timestamps.txt").read_text().split("\n")
    stamps = np.array([line.strip() for line in lines if line.strip()], "datetime64[ns]")
    files = sorted(place.glob("data/*.txt"))
    packets = [file.read_text().split() for file in files]
    good = np.array([len(packet) == OXTS_COLUMNS for packet in packets], np.bool_)
    # lost packets have no file, but a stamp: the file's number tells which
    number = np.array([int(file.stem) if file.stem.isdigit() else -1 for file in files])
    if number.size == 0 or number.min() < 0 or number.max() >= stamps.size:
        raise FormatError(
            f"{path}: {stamps.size} stamps, but packets numbered to {number.max(initial=-1)}"
        )
    findings: list[Finding] = []
    if not good.all() or len(files) < stamps.size:
        text = f"{path}: {stamps.size - int(good.sum())} of {stamps.size} packets missing or short"
        findings.append(Finding("bad-rows", "error", text))
    rows = np.array([packet for packet, ok in zip(packets, good, strict=True) if ok], np.float64)
    t_ns = stamps.astype(np.int64)[number[good]]
    imu, notes = clean_imu(t_ns, rows[:, 17:20], rows[:, 11:14], source="oxts", where=path)
    gnss, more = clean_gnss(
        t_ns,
        rows[:, 0] * DEG,
        rows[:, 1] * DEG,
        rows[:, 2],
        v_n=rows[:, [7, 6, 10]],
        sigma_pos=np.repeat(rows[:, 23:24], 3, axis=1),
        sigma_vel=np.repeat(rows[:, 24:25], 3, axis=1),
        source="oxts",
        where=path,
    )
    return _log(path, replace(imu, axes_declared=True), gnss, [*findings, *notes, *more])


def _log(path: str, imu: Imu, gnss: Gnss | None, findings: list[Finding]) -> Log:
    contents = tuple(
        {
            "name": record.source,
            "type": kind,
            "count": int(record.t_ns.size),
            "rate_hz": 1e9 / float(np.median(np.diff(record.t_ns)))
            if record.t_ns.size > 1
            else 0.0,
        }
        for kind, record in (("IMU", imu), ("GPS", gnss))
        if record is not None
    )
    return Log(
        path=path,
        imu=imu,
        gnss=gnss,
        findings=tuple(findings),
        unix_clock=is_unix(imu.t_ns),
        integrity=MappingProxyType({"rows": int(imu.t_ns.size)}),
        damaged=any(finding.code == "bad-rows" for finding in findings),
        contents=contents,
    )
