"""RTKLIB solution files (.pos): fixes with quality, standard deviations and velocity.

The line that names the columns (``%  GPST  latitude(deg) ...``) says the clock (GPST, UTC or JST),
the kind of position and the separator.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from vehnav.earth import c_en, geodetic_from_ecef
from vehnav.errors import Finding, FormatError, LogError
from vehnav.logs.check import clean_gnss
from vehnav.logs.clock import NO_TIME
from vehnav.logs.gpstime import NS_PER_S, gps_from_week, unix_from_gps
from vehnav.logs.log import Array, Gnss, ReadOptions, TimeArray
from vehnav.logs.timebase import datetime_ns
from vehnav.units import DEG

if TYPE_CHECKING:
    import pandas as pd

JST_NS: Final = 9 * 3600 * NS_PER_S
HEADER_BYTES: Final = 1 << 16

_COLUMNS = re.compile(
    r"^%\s*(?P<clock>GPST|UTC|JST)\s*"
    r"(?P<sep>\W?)\s*(?P<rest>(?:latitude|x-ecef|e-baseline).*)$",
    re.MULTILINE,
)


@dataclass(frozen=True)
class _Form:
    """A kind of position: its columns, and those of the sigmas in the same axes."""

    position: tuple[str, ...]
    sigma: tuple[str, str, str]
    velocity: tuple[str, str, str]
    ecef: bool = False

    @property
    def sigma_velocity(self) -> tuple[str, str, str]:
        a, b, c = (name.removesuffix("(m/s)") for name in self.velocity)
        return f"sd{a}", f"sd{b}", f"sd{c}"


_DMS = tuple(f"{angle}_{part}" for angle in ("lat", "lon") for part in "dms")
_NED: Final = (("sdn(m)", "sde(m)", "sdu(m)"), ("vn(m/s)", "ve(m/s)", "vu(m/s)"))
_FORMS = {
    "latitude(deg)": _Form(("latitude(deg)", "longitude(deg)", "height(m)"), *_NED),
    "latitude(d'\")": _Form((*_DMS, "height(m)"), *_NED),
    "x-ecef(m)": _Form(
        ("x-ecef(m)", "y-ecef(m)", "z-ecef(m)"),
        ("sdx(m)", "sdy(m)", "sdz(m)"),
        ("vx(m/s)", "vy(m/s)", "vz(m/s)"),
        ecef=True,
    ),
}


def is_pos(beginning: str) -> bool:
    """Whether a text begins like a solution file."""
    return beginning.startswith(("%", "+")) and _COLUMNS.search(beginning) is not None


def read_pos(path: str, _: ReadOptions | None = None) -> tuple[Gnss, list[Finding]]:
    """Fixes of a solution file on the UTC (Unix) clock; GPST minus the leap seconds of its date.

    Returns
    -------
    Gnss
        Height as written (ellipsoidal unless RTKLIB was told otherwise).
    list of Finding

    Raises
    ------
    FormatError
        No line that names the columns, or no rows.
    LogError
        Positions relative to a base, or no usable fix.
    """
    with Path(path).open("rb") as file:
        beginning = file.read(HEADER_BYTES).decode("latin-1")
    header = _COLUMNS.search(beginning)
    if header is None:
        raise FormatError(f"{path}: no line '%  GPST  latitude(deg) ...' that names the columns")
    form = _FORMS.get(header["rest"].replace(",", " ").split()[0])
    if form is None:
        raise LogError(
            f"{path}: positions relative to a base station; "
            "write the solution with out-solformat=llh or xyz"
        )
    frame = _parse(path, header, beginning)
    t_ns = _times(frame, header["clock"])
    numbers = {name: _numbers(frame[name]) for name in frame.columns if name[:4] != "time"}
    lost = [name for name in form.position if name not in numbers]
    if lost:
        raise FormatError(f"{path}: the header names no column {', '.join(lost)}")
    lat, lon, height, c_en_rows = _position(numbers, form)
    gnss, findings = clean_gnss(
        t_ns,
        lat,
        lon,
        height,
        v_n=_velocity(numbers, form, c_en_rows),
        sigma_pos=_sigma(numbers, form.sigma, c_en_rows),
        sigma_vel=_sigma(numbers, form.sigma_velocity, c_en_rows),
        status=np.where(numbers["Q"] > 0.0, 0, -1) if "Q" in numbers else None,
        source=Path(path).name,
        where=path,
    )
    if gnss is None:
        raise LogError(f"{path}: no usable fix in {t_ns.size} rows; {findings[-1].text}")
    return gnss, findings


def _parse(path: str, header: re.Match[str], beginning: str) -> pd.DataFrame:
    """All rows; the time stands in ``time_0`` and ``time_1``, or in ``time_0`` alone."""
    import pandas as pd

    separator = header["sep"].strip()
    names = header["rest"].split(separator or None)
    names = [name.strip() for name in names]
    if names[0] == "latitude(d'\")":
        names = [*_DMS, *names[2:]]
    row = re.search(r"^[^%+\s].*$", beginning, re.MULTILINE)
    if row is None:
        raise FormatError(f"{path}: a header, but no rows")
    one_field = bool(separator) and "/" in row[0].split(separator)[0]
    times = ["time_0"] if one_field else ["time_0", "time_1"]
    try:
        return pd.read_csv(
            path,
            sep=re.escape(separator) if separator else r"\s+",
            names=[*times, *names],
            usecols=range(len(times) + len(names)),
            comment="%",
            dtype=dict.fromkeys(times, str),
            encoding="latin-1",
            engine="c",
            quoting=csv.QUOTE_NONE,
            index_col=False,
            skipinitialspace=True,
        )
    except ValueError as error:  # pandas derives its parser errors from it
        raise FormatError(f"{path}: rows do not have the columns of the header: {error}") from error


def _numbers(column: pd.Series[Any]) -> Array:
    import pandas as pd

    return np.asarray(pd.to_numeric(column, errors="coerce"), np.float64)


def _times(frame: pd.DataFrame, clock: str) -> TimeArray:
    """Unix ns of calendar times or of GPS weeks and seconds; ``NO_TIME`` where not readable."""
    import pandas as pd

    first = frame["time_0"].str.strip()
    if "/" in str(first.iloc[0]):
        if "time_1" in frame:
            first = first + " " + frame["time_1"].str.strip()
        calendar = pd.to_datetime(first, format="%Y/%m/%d %H:%M:%S.%f", errors="coerce")
        if calendar.isna().any():  # without decimals
            plain = pd.to_datetime(first, format="%Y/%m/%d %H:%M:%S", errors="coerce")
            calendar = calendar.fillna(plain)
        t_ns = datetime_ns(calendar)
    else:
        week, tow = _numbers(first), _numbers(frame["time_1"])
        good = np.isfinite(week) & np.isfinite(tow) & (np.abs(week) < 1e4)
        week, tow = np.where(good, week, 0.0), np.where(good, tow, 0.0)
        tow_ns = np.rint(tow * 1e9).astype(np.int64)
        t_ns = np.where(good, gps_from_week(week.astype(np.int64), tow_ns), NO_TIME)
    good = t_ns != NO_TIME
    if clock == "GPST":
        return np.where(good, unix_from_gps(t_ns), NO_TIME)
    return np.where(good, t_ns - JST_NS, NO_TIME) if clock == "JST" else t_ns


def _position(numbers: dict[str, Array], form: _Form) -> tuple[Array, Array, Array, Array | None]:
    """Latitude, longitude (rad), height, and for ECEF rows C_en (m, 3, 3) to turn the rest."""
    values = [numbers[name] for name in form.position]
    if form.ecef:
        r_e = np.column_stack(values)
        r_e[~np.isfinite(r_e).all(axis=1) | ~r_e.any(axis=1)] = np.nan
        lat, lon, height = geodetic_from_ecef(r_e)
        return lat, lon, height, c_en(lat, lon)
    if len(values) == 7:
        lat, lon = (
            np.copysign(np.abs(d) + m / 60.0 + s / 3600.0, d)
            for d, m, s in (values[:3], values[3:6])
        )
        return lat * DEG, lon * DEG, values[6], None
    return values[0] * DEG, values[1] * DEG, values[2], None


def _velocity(numbers: dict[str, Array], form: _Form, c_en_rows: Array | None) -> Array | None:
    """(m, 3) east, north, up."""
    if not all(name in numbers for name in form.velocity):
        return None
    a, b, c = (numbers[name] for name in form.velocity)
    if c_en_rows is None:
        return np.column_stack([b, a, c])
    return np.asarray(np.einsum("kji,kj->ki", c_en_rows, np.column_stack([a, b, c])))


def _sigma(
    numbers: dict[str, Array], names: tuple[str, str, str], c_en_rows: Array | None
) -> Array | None:
    """(m, 3) east, north, up; off-diagonal columns hold signed roots of covariances."""
    if not all(name in numbers for name in names):
        return None
    a, b, c = (numbers[name] for name in names)
    if c_en_rows is None:
        return np.column_stack([b, a, c])
    unit = names[0].partition("(")[1] + names[0].partition("(")[2]
    stem = names[0].removesuffix(unit).removesuffix("x")
    zero = np.zeros_like(a)
    xy, yz, zx = (numbers.get(f"{stem}{pair}{unit}", zero) for pair in ("xy", "yz", "zx"))
    xy, yz, zx = (np.copysign(root**2, root) for root in (xy, yz, zx))
    covariance = np.stack([a * a, xy, zx, xy, b * b, yz, zx, yz, c * c], axis=-1).reshape(-1, 3, 3)
    variance = np.einsum("kji,kjl,kli->ki", c_en_rows, covariance, c_en_rows)
    return np.sqrt(np.where(variance > 0.0, variance, np.nan))
