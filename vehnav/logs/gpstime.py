"""GPS time and UTC: weeks, seconds of the week, leap seconds.

GPS time counts SI seconds since 1980-01-06 without leap seconds; Unix time leaves them out.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.logs.log import TimeArray

GPS_EPOCH_UNIX_S: Final = 315_964_800
WEEK_S: Final = 604_800
NS_PER_S: Final = 1_000_000_000

LEAP_DATES: Final = (
    "1981-07-01",
    "1982-07-01",
    "1983-07-01",
    "1985-07-01",
    "1988-01-01",
    "1990-01-01",
    "1991-01-01",
    "1992-07-01",
    "1993-07-01",
    "1994-07-01",
    "1996-01-01",
    "1997-07-01",
    "1999-01-01",
    "2006-01-01",
    "2009-01-01",
    "2012-07-01",
    "2015-07-01",
    "2017-01-01",
)
"""UTC days that began after a leap second since 1980 (IERS Bulletin C)."""

_LEAP_NS = np.array(LEAP_DATES, "datetime64[ns]").astype(np.int64)
# the same instants on the GPS clock read as if it were UTC: later by the seconds inserted so far
_LEAP_GPS_NS = _LEAP_NS + NS_PER_S * np.arange(1, _LEAP_NS.size + 1)


def unix_from_gps(gps_ns: TimeArray) -> TimeArray:
    """Unix ns of GPS time, both counted from 1970: the leap seconds inserted so far come off.

    Parameters
    ----------
    gps_ns : (n,) int64
        A GPS calendar time (as in RTKLIB's GPST) read as if it were UTC, ns.
    """
    leap = np.searchsorted(_LEAP_GPS_NS, gps_ns, side="right")
    return np.asarray(gps_ns - NS_PER_S * leap.astype(np.int64))


def gps_from_week(week: npt.NDArray[np.int64], tow_ns: TimeArray) -> TimeArray:
    """GPS time in ns counted from 1970, of week number and nanoseconds of the week."""
    return np.asarray((GPS_EPOCH_UNIX_S + week * WEEK_S) * NS_PER_S + tow_ns)
