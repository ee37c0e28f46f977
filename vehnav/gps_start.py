"""What the start takes from GPS: a position and a heading, and which fixes that used up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.alignment import heading_from_tracks
from vehnav.classic import Drive, Outcome, Start
from vehnav.earth import position_difference
from vehnav.errors import Finding
from vehnav.evaluation.reference import path_distance
from vehnav.logs.log import Gnss
from vehnav.units import NS

Array = npt.NDArray[np.float64]

NEAR: Final = 10.0
"""s: a fix this near to the first stop gives the position if none lies in it."""
ENOUGH_PATH: Final = 50.0
"""m of GPS path that the heading window must hold (cli.md)."""
TOO_SHORT_PATH: Final = 20.0
"""m below which the heading stays unknown (cli.md)."""
GROW: Final = 5.0
"""s by which the window grows."""
DEFAULT_SIGMA: Final = 2.0
"""m, of a plain receiver that logs no covariance, per axis."""
MIN_HEADING_SIGMA: Final = np.radians(0.5)
"""rad: multipath and antenna offset leave this even on a good fit."""


@dataclass(frozen=True)
class PositionFix:
    """The position of the start.

    Attributes
    ----------
    position : (lat rad, lon rad, h m)
    sigma : float
        m per axis.
    used : int
        Fixes that it is the median of.
    used_until_ns : int
        Stamp of the last of them.
    """

    position: tuple[float, float, float]
    sigma: float
    used: int
    used_until_ns: int


@dataclass(frozen=True)
class HeadingWindow:
    """The stretch whose GPS track gives the heading.

    Attributes
    ----------
    index : (m,) int64
        Fixes in it.
    end_ns : int
        Fixes up to here judge nothing.
    path : float
        m, driven in it by GPS.
    seconds : float
        Length after the departure.
    """

    index: npt.NDArray[np.int64]
    end_ns: int
    path: float
    seconds: float


@dataclass(frozen=True)
class HeadingFit:
    """A heading by least squares.

    Attributes
    ----------
    heading : float
        rad at the first instant of the solution.
    rms : float
        m between the turned track and GPS.
    sigma : float
        rad
    """

    heading: float
    rms: float
    sigma: float


def position_from_fixes(
    gnss: Gnss, start_ns: int, end_ns: int
) -> tuple[PositionFix | None, list[Finding]]:
    """Median of the fixes in the first stop; the nearest one where it has none; None if too far."""
    inside = np.flatnonzero((gnss.t_ns >= start_ns) & (gnss.t_ns <= end_ns))
    findings: list[Finding] = []
    if inside.size == 0:
        away = np.maximum(start_ns - gnss.t_ns, gnss.t_ns - end_ns)
        nearest = int(np.argmin(away))
        if away[nearest] * NS > NEAR:
            text = (
                f"no GPS fix within {NEAR:g} s of the first stop (the nearest is "
                f"{away[nearest] * NS:.1f} s away): the start is not known, the frame is local"
            )
            return None, [Finding("no-gps-start", "warning", text, start_ns, end_ns)]
        inside = np.array([nearest])
        text = f"no GPS fix in the first stop: the one {away[nearest] * NS:.1f} s away was taken"
        findings.append(Finding("gps-start-nearest", "warning", text, start_ns, end_ns))
    lat, lon, height = (float(np.median(x[inside])) for x in (gnss.lat, gnss.lon, gnss.height))
    if gnss.sigma_pos is None:
        sigma = DEFAULT_SIGMA
    else:
        sigma = float(np.sqrt(np.mean(gnss.sigma_pos[inside, :2] ** 2)))
    last = int(gnss.t_ns[inside[-1]])
    return PositionFix((lat, lon, height), sigma, int(inside.size), last), findings


def heading_window(
    gnss: Gnss, departure_ns: int, last_ns: int, *, seconds: float
) -> HeadingWindow | None:
    """The first ``seconds`` after the departure and at least 50 m of GPS path; else it grows.

    None where less than 20 m are driven by ``last_ns``, the end of the trajectory.
    """
    path = path_distance(gnss)
    t = (gnss.t_ns - departure_ns) * NS
    end = (last_ns - departure_ns) * NS
    while True:
        index = np.flatnonzero((t > 0.0) & (t <= min(seconds, end)))
        driven = float(path[index[-1]] - path[index[0]]) if index.size > 1 else 0.0
        if driven >= ENOUGH_PATH or seconds >= end:
            break
        seconds += GROW
    if index.size < 3 or driven < TOO_SHORT_PATH:
        return None
    until = departure_ns + round(min(seconds, end) / NS)
    return HeadingWindow(index, until, driven, min(seconds, end))


def fit_heading(
    drive: Drive,
    start: Start,
    gnss: Gnss,
    window: HeadingWindow,
    solve: Callable[[Drive, Start], Outcome],
    *,
    heading: float,
    start_ns: int,
) -> HeadingFit:
    """Turn the track of ``solve`` over the window onto GPS; repeat, for the gyro bias follows.

    ``start_ns``: the stamp where the seconds of the drive count from.
    """
    t_fix = (gnss.t_ns[window.index] - start_ns) * NS
    lat, lon, height = start.position
    track = position_difference(
        gnss.lat[window.index], gnss.lon[window.index], lat, lon, height, earth=drive.earth
    )
    rms = 0.0
    for _ in range(2):
        outcome = solve(drive, start.turned(drive, heading))
        t = drive.t[outcome.first : outcome.first + outcome.position.shape[0]]
        own = position_difference(
            outcome.position[:, 0], outcome.position[:, 1], lat, lon, height, earth=drive.earth
        )
        at_fixes = np.stack([np.interp(t_fix, t, own[:, k]) for k in (0, 1)], axis=1)
        turn, rms = heading_from_tracks(at_fixes, track)
        heading += turn
    lever = float(np.sqrt(np.mean(np.sum(track**2, axis=1))))
    sigma = float(np.hypot(MIN_HEADING_SIGMA, rms / max(lever, 1.0)))
    return HeadingFit(float(np.remainder(heading, 2.0 * np.pi)), rms, sigma)
