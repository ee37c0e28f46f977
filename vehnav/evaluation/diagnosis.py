"""Inputs that cannot be compared, named for what they are: clocks and places that do not fit."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.earth import position_difference
from vehnav.errors import Finding, LogError
from vehnav.evaluation.reference import mean_motion, seconds, tracks
from vehnav.logs.log import Gnss
from vehnav.trajectory import Trajectory
from vehnav.units import NS

Array = npt.NDArray[np.float64]

WEEK: Final = 604_800.0
GPS_EPOCH: Final = 315_964_800.0
"""Unix seconds of 1980-01-06, where GPS time starts."""
LEAP_SECONDS: Final = 18.0
"""GPS time minus UTC, s, since 2017."""
ELSEWHERE: Final = 5_000.0
"""m: two tracks of one drive come closer than this somewhere; drift does not matter, for both
start at the same place."""
SCAN: Final = 60.0
"""s: how far apart the clocks may be for the speed profiles to be laid over each other."""
NAMED_SHIFT: Final = 5.0
"""s: a shift of the speed profiles below this is a delay (see ``--gps-time-offset auto``)."""


def _span(t_ns: npt.NDArray[np.int64]) -> tuple[float, float]:
    return float(t_ns[0]) * NS, float(t_ns[-1]) * NS


def _explain_shift(trajectory: Trajectory, gnss: Gnss) -> str:
    """Why two clocks have no second in common, if a known shift brings them together."""
    (a0, a1), (b0, b1) = _span(trajectory.t_ns), _span(gnss.t_ns)
    shift = a0 - b0

    def fits(s: float) -> bool:
        return b0 + s < a1 and b1 + s > a0

    if a0 < 1e8 <= b0 or b0 < 1e8 <= a0:
        side = "the trajectory" if a0 < 1e8 else "the GPS"
        week = " or from the start of the GPS week" if min(a0, b0) < WEEK else ""
        return f"{side} counts seconds from the start of a recording{week}, the other Unix time"
    for epoch, name in ((GPS_EPOCH, "GPS"), (-GPS_EPOCH, "trajectory")):
        if fits(epoch - LEAP_SECONDS) or fits(epoch):
            return f"the {name} counts from the GPS epoch of 1980, the other is Unix time"
    for unit, name, most in ((WEEK, "week", 2400), (86_400.0, "day", 31), (3_600.0, "hour", 14)):
        count = round(shift / unit)
        for extra in (0.0, LEAP_SECONDS, -LEAP_SECONDS):
            if 0 < abs(count) <= most and fits(count * unit + extra):
                s = "s" if abs(count) != 1 else ""
                return f"the GPS is {-count} {name}{s} off: --gps-time-offset {count * unit:.0f}"
    return "are they of the same drive?"


def check_overlap(trajectory: Trajectory, gnss: Gnss) -> None:
    """LogError if trajectory and GPS have no second in common, with the likely reason."""
    (a0, a1), (b0, b1) = _span(trajectory.t_ns), _span(gnss.t_ns)
    if b0 <= a1 and b1 >= a0:
        return
    raise LogError(
        f"the trajectory ({a0:.3f} to {a1:.3f} s) and the GPS ({b0:.3f} to {b1:.3f} s) do not "
        f"overlap in time; {_explain_shift(trajectory, gnss)}"
    )


def _closest(lat: Array, lon: Array, lat_ref: Array, lon_ref: Array) -> float:
    """The smallest horizontal distance between the two tracks at equal times, m."""
    with np.errstate(invalid="ignore"):
        d = position_difference(lat, lon, lat_ref, lon_ref)
    return float(np.min(np.hypot(d[:, 0], d[:, 1])))


def check_place(lat: Array, lon: Array, gnss: Gnss) -> None:
    """LogError if the tracks are never closer than 5 km, with the likely reason.

    ``lat``, ``lon`` (m,), rad: the trajectory at the fixes of ``gnss``.
    """
    apart = _closest(lat, lon, gnss.lat, gnss.lon)
    if apart < ELSEWHERE:
        return
    reason = "are they of the same drive? --align yaw+translation compares the shapes alone"
    if _closest(lat, lon, gnss.lon, gnss.lat) < ELSEWHERE:
        reason = "latitude and longitude are swapped in one of them"
    elif _closest(lat, lon, gnss.lat, -gnss.lon) < ELSEWHERE:
        reason = "the sign of the longitude is lost in one of them (west is negative)"
    elif _closest(lat, lon, -gnss.lat, gnss.lon) < ELSEWHERE:
        reason = "the sign of the latitude is lost in one of them (south is negative)"
    elif float(np.max(np.abs(lat))) < 0.01 and float(np.max(np.abs(lon))) < 0.01:
        reason = "the trajectory is local (starts at 0, 0): --align yaw+translation compares it"
    raise LogError(
        f"trajectory and GPS are at least {apart / 1000.0:.1f} km apart at all times; {reason}"
    )


def speed_shift(trajectory: Trajectory, gnss: Gnss) -> float | None:
    """Seconds (5 or more) to add to the stamps of the GPS so that the speeds agree, or None.

    A coarse scan of +-60 s in half seconds by the mean absolute difference of the speeds. None
    where a delay under 5 s explains them, or they cannot tell: too little variation, too little
    overlap, or a minimum that does not halve the difference of the (nearly) unshifted ones.
    """
    t = seconds(gnss)
    if gnss.v_n is not None:
        velocity = gnss.v_n[:, :2]
    else:
        velocity = mean_motion(t, tracks(gnss), 1.5)
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    keep = np.unique(np.searchsorted(t, np.arange(0.0, t[-1] + 1e-9, 1.0)))  # 1 Hz is enough
    t, speed = t[keep], speed[keep]
    own_t = (trajectory.t_ns - gnss.t_ns[0]) * NS
    own = np.hypot(trajectory.v_n[:, 0], trajectory.v_n[:, 1])
    if t.size < 30 or float(np.std(speed)) < 1.0:
        return None
    shifts = np.arange(-SCAN, SCAN + 0.25, 0.5)
    at = t[None, :] + shifts[:, None]
    inside = (at >= own_t[0]) & (at <= own_t[-1])
    miss = np.where(inside, np.abs(np.interp(at, own_t, own) - speed), 0.0)
    count = inside.sum(axis=1)
    cost = np.where(count >= 0.5 * t.size, miss.sum(axis=1) / np.maximum(count, 1), np.inf)
    best = int(np.argmin(cost))
    unshifted = np.min(cost[np.abs(shifts) < NAMED_SHIFT])
    if abs(shifts[best]) < NAMED_SHIFT or not cost[best] < 0.5 * unshifted:
        return None
    return float(shifts[best])


def clock_findings(trajectory: Trajectory, gnss: Gnss) -> tuple[Finding, ...]:
    """A finding where the speed profiles say that the clocks are seconds apart."""
    shift = speed_shift(trajectory, gnss)
    if shift is None:
        return ()
    leap = abs(abs(shift) - LEAP_SECONDS) <= 1.5
    name = "; 18 s is GPS time against UTC (leap seconds)" if leap else ""
    text = (
        f"the speed profiles agree best with the GPS shifted by {shift:+.1f} s{name}; "
        f"--gps-time-offset {shift:+.1f}"
    )
    return (Finding("leap-seconds" if leap else "clock-offset", "warning", text),)
