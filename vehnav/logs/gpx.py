"""GPX: the track points that have a time."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from datetime import datetime
from pathlib import Path
from typing import Final

import numpy as np

from vehnav.errors import Finding, FormatError, LogError
from vehnav.logs.check import clean_gnss
from vehnav.logs.clock import NO_TIME
from vehnav.logs.csv import velocity_from_course
from vehnav.logs.gpstime import NS_PER_S
from vehnav.logs.log import Gnss, ReadOptions
from vehnav.units import DEG

POINTS: Final = ("trkpt", "rtept")
VALUES: Final = ("ele", "speed", "course")
_TIME = re.compile(
    r"(?P<second>\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d)(?:\.(?P<decimals>\d+))?"
    r"(?P<zone>Z|[+-]\d\d:\d\d)?"
)


def is_gpx(beginning: str) -> bool:
    """Whether a text begins like a GPX file."""
    text = beginning.lstrip()
    return text.startswith("<gpx") or (text.startswith("<?xml") and "<gpx" in text)


def read_gpx(path: str, _: ReadOptions | None = None) -> tuple[Gnss, list[Finding]]:
    """Fixes of the tracks of a GPX file, on the UTC (Unix) clock.

    Speed and course become the velocity where points have them (GPX 1.0, or an extension).
    A file that breaks off is read as far as it goes, with a finding.

    Raises
    ------
    FormatError
        Not XML, or with a document type declaration (GPX has none).
    LogError
        No point with a time (a route planned by hand), or no usable fix.
    """
    findings: list[Finding] = []
    rows, times = _points(path, findings)
    if not rows:
        raise LogError(f"{path}: no track point")
    missing = sum(time is None for time in times)
    if missing == len(times):
        raise LogError(f"{path}: track points without time; a recorded track has a time per point")
    if missing:
        text = f"{path}: {missing} of {len(times)} points without time dropped"
        findings.append(Finding("gps-rejected", "warning", text))
    kept = [k for k, time in enumerate(times) if time is not None]
    values = np.array(rows, np.float64)[kept]
    t_ns = np.array([_unix_ns(time) for time in times if time is not None], np.int64)
    has_velocity = np.isfinite(values[:, 3]).any() and np.isfinite(values[:, 4]).any()
    gnss, notes = clean_gnss(
        t_ns,
        values[:, 0] * DEG,
        values[:, 1] * DEG,
        values[:, 2],
        v_n=velocity_from_course(values[:, 3], values[:, 4] * DEG) if has_velocity else None,
        source=Path(path).name,
        where=path,
    )
    findings += notes
    if gnss is None:
        raise LogError(f"{path}: no usable fix in {len(rows)} points; {notes[-1].text}")
    return gnss, findings


def _points(path: str, findings: list[Finding]) -> tuple[list[list[float]], list[str | None]]:
    """[lat, lon, ele, speed, course] (deg, m, m/s; NaN where missing) and time of every point."""
    with Path(path).open("rb") as file:
        if b"<!DOCTYPE" in file.read(4096):
            raise FormatError(f"{path}: a document type declaration does not belong into GPX")
    rows: list[list[float]] = []
    times: list[str | None] = []
    try:
        for _, element in ET.iterparse(path, events=("end",)):
            if _local(element) in POINTS:
                row, time = _point(element)
                rows.append(row)
                times.append(time)
                element.clear()
    except ET.ParseError as error:
        if not rows:
            raise FormatError(f"{path}: not XML: {error}") from error
        text = f"{path}: the file breaks off or is damaged ({error}); {len(rows)} points read"
        findings.append(Finding("bad-rows", "error", text))
    return rows, times


def _local(element: ET.Element) -> str:
    """Tag without its namespace."""
    return element.tag.rpartition("}")[2]


def _point(element: ET.Element) -> tuple[list[float], str | None]:
    texts = {_local(child): child.text for child in element.iter()}
    values = [element.get("lat"), element.get("lon"), *(texts.get(name) for name in VALUES)]
    return [_number(value) for value in values], texts.get("time")


def _number(text: str | None) -> float:
    try:
        return float(text or "nan")
    except ValueError:
        return np.nan


def _unix_ns(text: str) -> int:
    """Unix ns of an XML dateTime, every digit kept; ``NO_TIME`` where it is not one."""
    match = _TIME.fullmatch(text.strip())
    if match is None:
        return NO_TIME
    try:
        moment = datetime.fromisoformat(match["second"] + (match["zone"] or "Z"))
    except ValueError:
        return NO_TIME
    decimals = (match["decimals"] or "0")[:9].ljust(9, "0")
    return int(moment.timestamp()) * NS_PER_S + int(decimals)
