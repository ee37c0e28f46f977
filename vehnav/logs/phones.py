"""Folders of phone apps that keep each sensor in a file of its own: Sensor Logger, phyphox."""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np

from vehnav.errors import Finding, LogError, VehnavError
from vehnav.logs.check import clean_imu
from vehnav.logs.clock import NO_TIME
from vehnav.logs.columns import Column
from vehnav.logs.csv import read_csv_gnss
from vehnav.logs.layout import Layout, lay_out, scale_to_si
from vehnav.logs.log import Gnss, Log, ReadOptions, TimeArray
from vehnav.logs.presets import refuse_gravity_free
from vehnav.logs.streams import Stream, join
from vehnav.logs.table import Table, sniff
from vehnav.logs.timebase import is_unix, stamps
from vehnav.units import STANDARD_GRAVITY

AXES: Final = ("x", "y", "z")
PHONE_AXES: Final = "RFU"
"""Android and, once its signs are turned, iOS: right, up along the screen, out of the screen."""


def find(folder: Path, *names: str) -> Path | None:
    """The first of these files that the folder has, whatever the case of its name."""
    there = {path.name.lower(): path for path in folder.iterdir()}
    return next((there[name.lower()] for name in names if name.lower() in there), None)


# ---- Sensor Logger ---------------------------------------------------------------------------

_GYRO = ("Gyroscope.csv", "GyroscopeUncalibrated.csv")
_LOCATION = ("Location.csv", "LocationGps.csv")


def is_sensor_logger(folder: Path) -> bool:
    """Whether the folder is a recording of Sensor Logger."""
    gyro = find(folder, *_GYRO)
    return gyro is not None and "seconds_elapsed" in sniff(str(gyro)).names


def read_sensor_logger(path: str, options: ReadOptions) -> Log:
    """A recording of Sensor Logger (Android and iOS).

    The accelerometer with gravity is TotalAcceleration (Android), else Accelerometer plus Gravity
    (iOS), else AccelerometerUncalibrated. iOS has the opposite sign, and g in the uncalibrated
    one, unless the recording was standardised; Metadata.csv tells.

    Raises
    ------
    LogError
        No gyroscope, or only acceleration without gravity.
    """
    folder = Path(path)
    findings: list[Finding] = []
    gyro_file = find(folder, *_GYRO)
    if gyro_file is None:
        raise LogError(f"{path}: no Gyroscope.csv; switch the gyroscope on in Sensor Logger")
    gyro = _xyz(gyro_file, findings)
    accel = _sensor_logger_force(folder, findings)
    if _is_apple(folder):
        accel = replace(accel, values=-accel.values)
    gnss = _location(find(folder, *_LOCATION), options, findings)
    return _log(path, gyro, accel, gnss, findings, unix=True)


def _xyz(file: Path, findings: list[Finding]) -> Stream:
    """Stamps and columns x, y, z of one sensor's file."""
    table = Table(sniff(str(file)))
    names = [name.lower() for name in table.sheet.names]
    missing = [name for name in ("time", *AXES) if name not in names]
    if missing:
        raise LogError(f"{file}: no column {', '.join(missing)} among {', '.join(names)}")
    time = names.index("time")
    t_ns = stamps(table, Column(time, "time", unit="ns"), kind="imu")
    values = np.column_stack([table.numbers(names.index(axis)) for axis in AXES])
    findings.extend(table.findings)
    return Stream(t_ns, values, file.name)


def _sensor_logger_force(folder: Path, findings: list[Finding]) -> Stream:
    total = find(folder, "TotalAcceleration.csv")
    if total is not None:
        return _xyz(total, findings)
    free, gravity = find(folder, "Accelerometer.csv"), find(folder, "Gravity.csv")
    if free is not None and gravity is not None:
        moved, g = _xyz(free, findings), _xyz(gravity, findings)
        t_ns, a, b = join(moved, g, str(folder), findings)
        return Stream(t_ns, a + b, f"{free.name} + {gravity.name}")
    raw = find(folder, "AccelerometerUncalibrated.csv")
    if raw is None:
        raise LogError(
            f"{folder}: Accelerometer.csv is acceleration without gravity; dead reckoning needs "
            "gravity too: record TotalAcceleration (Android) or Gravity (iOS) beside it"
        )
    stream = _xyz(raw, findings)
    size = float(np.nanmedian(np.linalg.norm(stream.values, axis=1)))
    if 0.5 < size < 2.0:  # 1 g in g; in m/s2 it is 9.8
        text = f"{raw}: median {size:.3f}, so its unit is g (iOS, not standardised)"
        findings.append(Finding("unit-inferred", "info", text))
        stream = replace(stream, values=stream.values * STANDARD_GRAVITY)
    return stream


def _is_apple(folder: Path) -> bool:
    """Whether signs are Apple's: an iOS device, and not standardised by the app."""
    file = find(folder, "Metadata.csv")
    if file is None:
        return False
    with file.open(newline="", encoding="utf-8", errors="replace") as stream:
        row = next(csv.DictReader(stream), {})
    values = {str(key).lower(): str(value).strip().lower() for key, value in row.items()}
    return values.get("platform") == "ios" and values.get("standardisation") != "true"


def _location(file: Path | None, options: ReadOptions, findings: list[Finding]) -> Gnss | None:
    if file is None:
        return None
    try:
        gnss, notes = read_csv_gnss(str(file), replace(options, columns={}, preset=None))
    except LogError as error:  # the receiver may have had no fix at all
        findings.append(Finding("gps-rejected", "warning", str(error)))
        return None
    findings.extend(notes)
    return gnss


# ---- phyphox ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Parts:
    """The files of a phyphox export by what they hold."""

    gyro: Layout | None
    accel: Layout | None
    location: Path | None
    free: Layout | None


def is_phyphox(folder: Path) -> bool:
    """Whether the folder is an export of phyphox: a table per sensor, time in its first column."""
    parts = _parts(folder)
    return parts.gyro is not None and parts.gyro.sheet.names[0].lower().startswith("time (s")


def _parts(folder: Path) -> _Parts:
    found: dict[str, Layout] = {}
    for file in sorted(folder.glob("*.csv")):
        try:
            layout = lay_out(str(file), ReadOptions())
        except VehnavError:
            continue
        free = any(name.lower().startswith("linear acc") for name in layout.sheet.names)
        for kind, names in (("gyro", "gyro_?"), ("accel", "accel_?")):
            if layout.has(*(names.replace("?", axis) for axis in AXES)) and not free:
                found.setdefault(kind, layout)
        if free:
            found.setdefault("free", layout)
        if layout.has("lat", "lon"):
            found.setdefault("location", layout)
    location = found.get("location")
    return _Parts(
        found.get("gyro"),
        found.get("accel"),
        Path(location.sheet.path) if location else None,
        found.get("free"),
    )


def read_phyphox(path: str, options: ReadOptions) -> Log:
    """An export of phyphox, on the Unix clock where it has meta/time.csv.

    Raises
    ------
    LogError
        No gyroscope, no acceleration, or only acceleration without gravity.
    """
    folder = Path(path)
    parts = _parts(folder)
    if parts.accel is None and parts.free is not None:
        refuse_gravity_free(path, parts.free.sheet.names, {})
    if parts.gyro is None or parts.accel is None:
        raise LogError(f"{path}: phyphox kept no gyroscope or no accelerometer (with g) here")
    findings: list[Finding] = []
    gyro = _named(parts.gyro, "gyro", findings)
    accel = _named(parts.accel, "accel", findings)
    gnss = _location(parts.location, options, findings)
    starts = _phyphox_starts(folder / "meta" / "time.csv")
    if starts is not None:
        gyro = replace(gyro, t_ns=_unix(gyro.t_ns, *starts))
        accel = replace(accel, t_ns=_unix(accel.t_ns, *starts))
        if gnss is not None:
            gnss = replace(gnss, t_ns=_unix(gnss.t_ns, *starts))
    return _log(path, gyro, accel, gnss, findings, unix=starts is not None)


def _named(layout: Layout, kind: str, findings: list[Finding]) -> Stream:
    table = Table(layout.sheet)
    t_ns = stamps(table, layout.columns["time"], kind="imu")
    columns = [
        table.numbers(layout.columns[f"{kind}_{axis}"].index)
        * scale_to_si(layout, f"{kind}_{axis}", None, findings)
        for axis in AXES
    ]
    findings.extend(table.findings)
    return Stream(t_ns, np.column_stack(columns), Path(layout.sheet.path).name)


def _phyphox_starts(file: Path) -> tuple[TimeArray, TimeArray] | None:
    """Experiment and Unix ns of every start; the experiment's time stands in between."""
    if not file.is_file():
        return None
    text = file.read_text(encoding="utf-8", errors="replace")
    delimiter = text.partition("\n")[0].removeprefix('"event"')[:1] or ","
    decimal = "." if delimiter == "," else ","
    experiment, unix = [], []
    for row in csv.reader(text.splitlines()[1:], delimiter=delimiter):
        if len(row) >= 3 and row[0] == "START":
            since, system = (float(field.replace(decimal, ".")) for field in row[1:3])
            experiment.append(round(since * 1e9))
            unix.append(round(system * 1e3) * 1_000_000)  # milliseconds are all there is
    if not unix:
        return None
    return np.array(experiment, np.int64), np.array(unix, np.int64)


def _unix(t_ns: TimeArray, experiment: TimeArray, unix: TimeArray) -> TimeArray:
    start = np.maximum(np.searchsorted(experiment, t_ns, side="right") - 1, 0)
    return np.where(t_ns == NO_TIME, NO_TIME, unix[start] + (t_ns - experiment[start]))


# ---- both ------------------------------------------------------------------------------------


def _log(
    path: str,
    gyro: Stream,
    accel: Stream,
    gnss: Gnss | None,
    findings: list[Finding],
    *,
    unix: bool,
) -> Log:
    t_ns, rates, force = join(gyro, accel, path, findings)
    source = f"{gyro.source}, {accel.source}"
    imu, notes = clean_imu(t_ns, rates, force, source=source, where=path)
    contents = tuple(
        {
            "name": part.source,
            "type": "CSV",
            "count": int(part.t_ns.size),
            "rate_hz": _rate(part.t_ns),
        }
        for part in (gyro, accel, gnss)
        if part is not None
    )
    return Log(
        path=path,
        imu=replace(imu, axes=PHONE_AXES),
        gnss=gnss,
        findings=(*findings, *notes),
        unix_clock=unix and is_unix(imu.t_ns),
        integrity=MappingProxyType({"rows": int(gyro.t_ns.size)}),
        damaged=any(finding.code == "bad-rows" for finding in findings),
        contents=contents,
    )


def _rate(t_ns: TimeArray) -> float:
    steps = np.diff(np.sort(t_ns[t_ns != NO_TIME]))
    return 1e9 / float(np.median(steps)) if steps.size and np.median(steps) > 0 else 0.0
