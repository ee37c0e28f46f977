"""NMEA 0183: fixes from GGA, velocity and date from RMC, standard deviations from GST.

Sentences may stand anywhere in a line, as loggers like to write their own stamp before them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import reduce
from operator import xor
from pathlib import Path
from typing import Final

import numpy as np

from vehnav.errors import Finding, LogError
from vehnav.logs.check import clean_gnss
from vehnav.logs.clock import NO_TIME
from vehnav.logs.csv import velocity_from_course
from vehnav.logs.gpstime import NS_PER_S
from vehnav.logs.log import Array, Gnss, ReadOptions, TimeArray
from vehnav.units import DEG

DAY_NS: Final = 86_400 * NS_PER_S
KNOT: Final = 1852.0 / 3600.0
FIELDS: Final = {b"GGA": 11, b"RMC": 9, b"GST": 8}
"""Sentence -> fields that are needed of it."""

_SENTENCE = re.compile(rb"\$([A-Z]{2}(GGA|RMC|GST),([^*$\r\n]*))(?:\*([0-9A-Fa-f]{2}))?")
_ANY = re.compile(r"\$[A-Z]{2}[A-Z]{3},")


@dataclass(frozen=True)
class _Sentences:
    """The sentences of one type: time of day (ns), place in the file, fields."""

    tod_ns: TimeArray
    order: TimeArray
    fields: list[list[bytes]]

    def numbers(self, field: int) -> Array:
        """Column of numbers, NaN where it is empty or broken."""
        return np.array([_number(row[field]) for row in self.fields], np.float64)

    def angle(self, field: int) -> Array:
        """Latitude or longitude in rad of (d)ddmm.mmmm and its letter in the next field."""
        packed = self.numbers(field)
        degrees = np.floor(packed / 100.0)
        negative = np.array([row[field + 1] in (b"S", b"W") for row in self.fields], np.bool_)
        angle = (degrees + (packed - 100.0 * degrees) / 60.0) * DEG
        return np.where(negative, -angle, angle)


def is_nmea(beginning: str) -> bool:
    """Whether the first line of a text holds a sentence."""
    return _ANY.search(beginning.lstrip().partition("\n")[0]) is not None


def read_nmea(path: str, _: ReadOptions | None = None) -> tuple[Gnss, list[Finding]]:
    """Fixes of an NMEA file on the UTC (Unix) clock.

    Height is above the ellipsoid where the receiver tells the geoid separation, else above mean
    sea level. Without any date (no valid RMC) stamps are nanoseconds since the midnight before the
    first fix, with the finding ``no-date``.

    Raises
    ------
    LogError
        No position sentence, or no usable fix.
    """
    findings: list[Finding] = []
    kinds = _sentences(path, findings)
    gga, rmc, gst = kinds[b"GGA"], kinds[b"RMC"], kinds[b"GST"]
    if not gga.fields and not rmc.fields:
        raise LogError(f"{path}: no GGA or RMC sentence with a valid checksum")
    stamps, dated = _stamps(gga, rmc, gst)
    where = gga if gga.fields else rmc
    t_ns = stamps[where.order]
    first = 1 if gga.fields else 2
    gnss, notes = clean_gnss(
        t_ns,
        where.angle(first),
        where.angle(first + 2),
        _height(gga) if gga.fields else np.full(t_ns.size, np.nan),
        v_n=_velocity(rmc, stamps, t_ns),
        sigma_pos=_sigma(gst, stamps, t_ns),
        status=_status(gga, rmc),
        source=Path(path).name,
        where=path,
    )
    findings += notes
    if gnss is None:
        raise LogError(f"{path}: no usable fix in {t_ns.size} sentences; {notes[-1].text}")
    if not dated:
        text = f"{path}: no date in it (no valid RMC); stamps count from a midnight"
        findings.append(Finding("no-date", "warning", text))
    return gnss, findings


def _sentences(path: str, findings: list[Finding]) -> dict[bytes, _Sentences]:
    """Sentences of each type; those with a wrong checksum or too few fields are counted."""
    found: dict[bytes, list[tuple[int, list[bytes]]]] = {kind: [] for kind in FIELDS}
    bad = order = 0
    for body, kind, text, checksum in _SENTENCE.findall(Path(path).read_bytes()):
        fields = text.split(b",")
        wrong = checksum and reduce(xor, body) != int(checksum, 16)
        if wrong or len(fields) < FIELDS[kind]:
            bad += 1
            continue
        found[kind].append((order, fields))
        order += 1
    if bad:
        note = f"{path}: {bad} of {bad + order} sentences dropped for a wrong checksum or length"
        findings.append(Finding("bad-rows", "error", note))
    return {
        kind: _Sentences(
            np.array([_time_of_day(fields[0]) for _, fields in rows], np.int64),
            np.array([k for k, _ in rows], np.int64),
            [fields for _, fields in rows],
        )
        for kind, rows in found.items()
    }


def _number(text: bytes) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan


def _time_of_day(text: bytes) -> int:
    """Nanoseconds of hhmmss.sss; ``NO_TIME`` where it is not one."""
    whole, _, decimals = text.partition(b".")
    if len(whole) != 6 or not whole.isdigit() or (decimals and not decimals.isdigit()):
        return NO_TIME
    seconds = int(whole[:2]) * 3600 + int(whole[2:4]) * 60 + int(whole[4:])
    return seconds * NS_PER_S + int(decimals[:9].ljust(9, b"0") or b"0")


def _stamps(*kinds: _Sentences) -> tuple[TimeArray, bool]:
    """Stamp of every sentence in the order of the file, and whether the date is known.

    Time of day that falls by over half a day is the next day. Dates come from the RMC sentence of
    the same epoch, else from the last one before.
    """
    _, rmc, _ = kinds
    total = sum(len(kind.fields) for kind in kinds)
    tod = np.full(total, NO_TIME, np.int64)
    for kind in kinds:
        tod[kind.order] = kind.tod_ns
    good = np.flatnonzero(tod != NO_TIME)
    step = np.diff(tod[good])
    days = np.zeros(total, np.int64)
    days[good[1:]] = np.cumsum(
        (step < -DAY_NS // 2).astype(np.int64) - (step > DAY_NS // 2).astype(np.int64)
    )
    dates = np.array([_date(row[8]) if row[1] == b"A" else -1 for row in rmc.fields], np.int64)
    known = (dates >= 0) & (rmc.tod_ns != NO_TIME)
    if not known.any():
        return np.where(tod == NO_TIME, NO_TIME, days * DAY_NS + tod), False
    at, dates = rmc.order[known], dates[known]
    after = np.minimum(np.searchsorted(at, np.arange(total)), at.size - 1)
    before = np.maximum(after - 1, 0)
    before = np.where(at[after] == np.arange(total), after, before)
    chosen = np.where((tod[at[after]] == tod) & (tod[at[before]] != tod), after, before)
    days = dates[chosen] + days - days[at[chosen]]
    return np.where(tod == NO_TIME, NO_TIME, days * DAY_NS + tod), True


def _date(text: bytes) -> int:
    """Days since 1970 of ddmmyy (1980 to 2079); -1 where it is not one."""
    if len(text) != 6 or not text.isdigit():
        return -1
    day, month, year = int(text[:2]), int(text[2:4]), int(text[4:])
    try:
        date = np.datetime64(f"{2000 + year if year < 80 else 1900 + year}-{month:02d}-{day:02d}")
    except ValueError:
        return -1
    return int(date.astype(np.int64))


def _height(gga: _Sentences) -> Array:
    """Above the ellipsoid where every fix with a height has a separation, else above the sea."""
    sea, separation = gga.numbers(8), gga.numbers(10)
    full = np.isfinite(separation)
    return sea + separation if np.all(full[np.isfinite(sea)]) else sea


def _status(gga: _Sentences, rmc: _Sentences) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """0 or -1 (no fix) of the sentences that give positions."""
    if gga.fields:
        good = [row[5] not in (b"", b"0") for row in gga.fields]
    else:
        good = [row[1] == b"A" for row in rmc.fields]
    return np.where(good, 0, -1)


def _matched(kind: _Sentences, stamps: TimeArray, t_ns: TimeArray, values: Array) -> Array | None:
    """Rows of ``values`` at the stamps ``t_ns``, NaN where there is none; None without any."""
    own = stamps[kind.order]
    order = np.argsort(own, kind="stable")
    if not order.size:
        return None
    place = np.minimum(np.searchsorted(own[order], t_ns), order.size - 1)
    row = order[place]
    return np.where((own[row] == t_ns)[:, np.newaxis], values[row], np.nan)


def _velocity(rmc: _Sentences, stamps: TimeArray, t_ns: TimeArray) -> Array | None:
    values = velocity_from_course(rmc.numbers(6) * KNOT, rmc.numbers(7) * DEG)
    return _matched(rmc, stamps, t_ns, values)


def _sigma(gst: _Sentences, stamps: TimeArray, t_ns: TimeArray) -> Array | None:
    values = np.column_stack([gst.numbers(6), gst.numbers(5), gst.numbers(7)])
    return _matched(gst, stamps, t_ns, values)
