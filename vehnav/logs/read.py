"""The dispatcher: what a file is, by its first bytes, and which reader takes it.

One row per format in :data:`FORMATS`. What cannot be read is refused by name, with what to do.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from vehnav.errors import Finding, LogError
from vehnav.logs.gpx import is_gpx
from vehnav.logs.log import Gnss, Log, ReadOptions, Speed
from vehnav.logs.nmea import is_nmea
from vehnav.logs.pos import is_pos
from vehnav.logs.timebase import is_unix
from vehnav.units import NS

DAY_NS: Final = 86_400 * 1_000_000_000
DEFAULTS: Final = ReadOptions()
BEGINNING: Final = 4096


@dataclass(frozen=True)
class Format:
    """How a kind of file is recognised, and read or refused.

    Attributes
    ----------
    name : str
    magic : tuple of bytes
        First bytes, any of them.
    suffixes : tuple of str
        Decide where no first bytes do.
    text : callable or None
        Whether the beginning of a text is of this kind.
    log, gnss, speed : str
        ``module:function`` that reads it: ``(path, options) -> Log``,
        ``-> (Gnss, findings)``, ``-> (Speed, findings)``; "": not of this kind.
    refusal : str
        Why it cannot be read, and what to do.
    """

    name: str
    magic: tuple[bytes, ...] = ()
    suffixes: tuple[str, ...] = ()
    text: Callable[[str], bool] | None = None
    log: str = ""
    gnss: str = ""
    speed: str = ""
    refusal: str = ""


CSV_READER: Final = "vehnav.logs.csv:read_csv"
_UNPACK = "compressed as a whole; unpack it first ({command})"

FORMATS: Final = (
    Format(
        "MCAP",
        magic=(b"\x89MCAP0\r\n",),
        suffixes=(".mcap",),
        log="vehnav.logs.mcap:read_mcap",
    ),
    Format(
        "ROS 1 bag",
        magic=(b"#ROSBAG V",),
        log="vehnav.logs.rosbag:read_rosbag",
    ),
    Format(
        "rosbag2 database",
        magic=(b"SQLite format 3\0",),
        log="vehnav.logs.rosbag:read_rosbag",
    ),
    Format("gzip", magic=(b"\x1f\x8b",), refusal=_UNPACK.format(command="gunzip {path}")),
    Format("zstd", magic=(b"\x28\xb5\x2f\xfd",), refusal=_UNPACK.format(command="zstd -d {path}")),
    Format("lz4", magic=(b"\x04\x22\x4d\x18",), refusal=_UNPACK.format(command="lz4 -d {path}")),
    Format("bzip2", magic=(b"BZh",), refusal=_UNPACK.format(command="bunzip2 {path}")),
    Format("xz", magic=(b"\xfd7zXZ\0",), refusal=_UNPACK.format(command="unxz {path}")),
    Format(
        "zip",
        magic=(b"PK\x03\x04",),
        refusal="a zip archive; unpack it and give the file or the folder inside",
    ),
    Format(
        "Git LFS pointer",
        magic=(b"version https://git-lfs",),
        refusal="not the recording but a pointer to it in Git LFS; "
        "fetch the recording with 'git lfs pull' in its repository",
    ),
    Format(
        "Parquet",
        magic=(b"PAR1",),
        refusal="a Parquet table; write it as CSV, e.g. with pandas.read_parquet(...).to_csv(...)",
    ),
    Format("HDF5", magic=(b"\x89HDF\r\n",), refusal="HDF5 or MATLAB 7.3; export it as CSV"),
    Format("MATLAB", magic=(b"MATLAB 5.0",), refusal="a MATLAB file; export it as CSV"),
    Format("RTKLIB solution", suffixes=(".pos",), text=is_pos, gnss="vehnav.logs.pos:read_pos"),
    Format("NMEA", suffixes=(".nmea",), text=is_nmea, gnss="vehnav.logs.nmea:read_nmea"),
    Format("GPX", suffixes=(".gpx",), text=is_gpx, gnss="vehnav.logs.gpx:read_gpx"),
    Format(
        "CSV",
        suffixes=(".csv", ".txt", ".tsv", ".dat"),
        text=lambda _: True,
        log=CSV_READER,
        gnss="vehnav.logs.csv:read_csv_gnss",
        speed="vehnav.logs.csv:read_csv_speed",
    ),
)


FOLDER: Final = Format("folder", log="vehnav.logs.folders:read_folder")


def identify(path: str) -> Format:
    """What kind of file this is; which kind a folder is, :mod:`vehnav.logs.folders` finds.

    Raises
    ------
    LogError
        Missing, unreadable, empty, or nothing that is known.
    """
    place = Path(path)
    if place.is_dir():
        return FOLDER
    try:
        with place.open("rb") as file:
            beginning = file.read(BEGINNING)
    except FileNotFoundError:
        raise LogError(f"{path}: no such file") from None
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error
    if not beginning:
        raise LogError(f"{path}: empty (0 bytes); the recording did not reach the disk")
    for kind in FORMATS:
        if any(beginning.startswith(magic) for magic in kind.magic):
            return kind
    return _by_text(path, beginning)


def _by_text(path: str, beginning: bytes) -> Format:
    """The kind of a file without known first bytes: by its text, else by its suffix."""
    suffix = Path(path).suffix.lower()
    named = next((kind for kind in FORMATS if suffix in kind.suffixes), None)
    text = _as_text(beginning)
    if text is None:
        if named is not None and named.text is None:
            return named  # its first bytes are damaged; its reader may save the rest
        raise LogError(
            f"{path}: neither text nor a known recording (it begins with {beginning[:8].hex(' ')})"
        )
    if named is not None and named.text is None:
        raise LogError(
            f"{path}: named {suffix}, but it is text ({text[:40]!r}...); rename it if it is CSV"
        )
    return next(kind for kind in FORMATS if kind.text is not None and kind.text(text))


def _as_text(beginning: bytes) -> str | None:
    """The beginning as text; None for binary bytes."""
    if beginning[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return beginning.decode("utf-16", errors="replace")
    text = beginning.decode("utf-8-sig", errors="replace")
    strange = sum(not (c.isprintable() or c in "\t\r\n\f") for c in text)
    return None if strange > 0.05 * len(text) else text


def _call(target: str, *arguments: Any) -> Any:
    module, _, function = target.partition(":")
    return getattr(importlib.import_module(module), function)(*arguments)


def _refuse(kind: Format, path: str, wanted: str) -> LogError:
    place = Path(path)
    if kind.refusal:
        reason = kind.refusal.format(path=path, stem=place.stem, folder=place.parent)
        return LogError(f"{path}: {reason}")
    return LogError(f"{path}: {kind.name} holds no {wanted}")


def read_log(path: str, options: ReadOptions = DEFAULTS) -> Log:
    """A recording of any supported kind, with the GPS and speed kept beside it.

    Parameters
    ----------
    path : str
    options : ReadOptions
        ``gps_file`` and ``speed_file`` replace what the recording itself has. Beside a CSV
        without GPS or speed, STEM.gps.csv and STEM.speed.csv are taken, with a finding.

    Returns
    -------
    Log
        ``imu`` is None for a file of positions.

    Raises
    ------
    LogError, FormatError, ConfigError
        What is wrong, where, and what to do.
    """
    path = str(path)
    kind = identify(path)
    if kind.log:
        log: Log = _call(kind.log, path, options)
    elif kind.gnss:
        gnss, findings = _call(kind.gnss, path, options)
        log = Log(path, None, gnss, None, tuple(findings), unix_clock=is_unix(gnss.t_ns))
    else:
        raise _refuse(kind, path, "recording")
    findings = list(log.findings)
    if kind.log == CSV_READER:
        options = _with_siblings(path, log, options, findings)
    if options.gps_file is not None:
        beside, more = read_gnss(options.gps_file, _beside(options))
        log = replace(log, gnss=beside)
        findings += more
    if options.speed_file is not None:
        speed, more = read_speed(options.speed_file, _beside(options))
        log = replace(log, speed=speed)
        findings += more
    log = _dated(log, findings)
    log = _on_one_clock(log, options, findings)
    return replace(log, findings=tuple(findings))


def _with_siblings(
    path: str, log: Log, options: ReadOptions, findings: list[Finding]
) -> ReadOptions:
    """Options with the files that vehnav keeps beside a CSV: STEM.gps.csv and STEM.speed.csv."""
    for field, what, there in (
        ("gps_file", "gps", log.gnss is not None),
        ("speed_file", "speed", log.speed is not None),
    ):
        beside = Path(path).with_suffix(f".{what}.csv")
        if log.imu is None or there or getattr(options, field) is not None or not beside.is_file():
            continue
        findings.append(Finding(f"{what}-beside", "info", f"{path}: {what} taken from {beside}"))
        gps = options.gps_file if what == "speed" else str(beside)
        speed = options.speed_file if what == "gps" else str(beside)
        options = replace(options, gps_file=gps, speed_file=speed)
    return options


def _beside(options: ReadOptions) -> ReadOptions:
    """Options for a file kept beside the recording: nothing that is said of the recording."""
    return replace(options, gps_file=None, speed_file=None, preset=None, imu_topic=None)


def read_gnss(path: str, options: ReadOptions = DEFAULTS) -> tuple[Gnss, list[Finding]]:
    """The fixes of a file: a GPS file of any supported kind, or a recording that has GPS.

    The stamps are as the file has them; ``gps_time_offset`` is :func:`read_log`'s.

    Raises
    ------
    LogError
        No GPS in it.
    """
    path = str(path)
    kind = identify(path)
    if kind.gnss:
        gnss, findings = _call(kind.gnss, path, options)
        return gnss, list(findings)
    if not kind.log:
        raise _refuse(kind, path, "GPS")
    log: Log = _call(kind.log, path, options)
    if log.gnss is None:
        raise LogError(f"{path}: no GPS in it; see 'vehnav info'")
    return log.gnss, list(log.findings)


def read_speed(path: str, options: ReadOptions = DEFAULTS) -> tuple[Speed, list[Finding]]:
    """The forward speed of a file: a table, or a recording that has wheel speed or odometry.

    Raises
    ------
    LogError
        No speed in it.
    """
    path = str(path)
    kind = identify(path)
    if kind.speed:
        speed, findings = _call(kind.speed, path, options)
        return speed, list(findings)
    if not kind.log:
        raise _refuse(kind, path, "speed")
    log: Log = _call(kind.log, path, options)
    if log.speed is None:
        raise LogError(f"{path}: no speed in it; see 'vehnav info'")
    return log.speed, list(log.findings)


def _dated(log: Log, findings: list[Finding]) -> Log:
    """GPS without a date moved by whole days to the recording."""
    undated = any(finding.code == "no-date" for finding in findings)
    if not undated or log.imu is None or log.gnss is None or not log.unix_clock:
        return log
    days = round((int(log.imu.t_ns[0]) - int(log.gnss.t_ns[0])) / DAY_NS)
    return replace(log, gnss=replace(log.gnss, t_ns=log.gnss.t_ns + days * DAY_NS))


def _on_one_clock(log: Log, options: ReadOptions, findings: list[Finding]) -> Log:
    """GPS shifted as asked, and left out with a finding where it shares no time with the IMU."""
    if log.gnss is not None and options.gps_time_offset:
        shift = round(options.gps_time_offset / NS)
        shifted = replace(log.gnss, t_ns=log.gnss.t_ns + shift)
        log = replace(log, gnss=shifted, gps_time_offset=options.gps_time_offset)
    for name, label in (("gnss", "GPS"), ("speed", "speed")):
        record = getattr(log, name)
        if log.imu is None or record is None or not record.t_ns.size:
            continue
        first, last = int(log.imu.t_ns[0]), int(log.imu.t_ns[-1])
        if record.t_ns[0] <= last and record.t_ns[-1] >= first:
            continue
        apart = (int(record.t_ns[0]) - first) * NS
        text = (
            f"{log.path}: {label} {record.source} and IMU share no time ({label} starts "
            f"{apart:+.3f} s from the IMU and lasts {np.ptp(record.t_ns) * NS:.1f} s); not used. "
            "If their clocks differ, see --gps-time-offset"
        )
        findings.append(Finding("clock-offset", "warning", text, first, last))
        log = replace(log, gnss=None) if name == "gnss" else replace(log, speed=None)
    return log
