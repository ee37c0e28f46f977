"""The start of the drive: where it is, how it is turned, and what each of these came from.

Level, gyro bias and the accelerometer error along gravity come from the first stop; position and
heading from GPS (:mod:`vehnav.gps_start`) or from the user; what nobody gives stays local.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vehnav.alignment import bias_along_gravity
from vehnav.classic import Corrections, Drive, Outcome, Start, rest_of
from vehnav.earth import geodetic_from_local_enu, normal_gravity
from vehnav.errors import Finding
from vehnav.gps_start import (
    HeadingFit,
    HeadingWindow,
    PositionFix,
    fit_heading,
    heading_window,
    position_from_fixes,
)
from vehnav.logs.log import Gnss
from vehnav.prepare import Samples
from vehnav.rotation import angles_from_c_nb, c_nb_from_angles
from vehnav.units import NS

Array = npt.NDArray[np.float64]
Solve = Callable[[Drive, Start, Corrections], Outcome]


@dataclass(frozen=True)
class Alignment:
    """How the drive starts, and from what.

    Attributes
    ----------
    time_ns : int
        The instant.
    position : (lat rad, lon rad, h m)
    heading, pitch, roll : float
        rad
    position_from, heading_from : str
        ``gps``, ``option``, ``attitude option``, ``gyrocompass`` or ``none``.
    heading_rms : float or None
        m between the turned first stretch and GPS.
    gyro_bias : (3,)
        rad/s, body axes, Earth rate removed.
    rest_force : float or None
        m/s2, size of the specific force at the first stop.
    gravity : float
        m/s2, normal gravity there. The difference is taken out as a bias along gravity; read as a
        scale error it would be rest_force / gravity - 1.
    """

    time_ns: int
    position: tuple[float, float, float]
    heading: float
    pitch: float
    roll: float
    position_from: str
    heading_from: str
    heading_rms: float | None
    gyro_bias: Array
    rest_force: float | None
    gravity: float

    @property
    def local(self) -> bool:
        """Whether the frame is only local: position or heading are not known."""
        return "none" in (self.position_from, self.heading_from)


@dataclass(frozen=True)
class GpsUse:
    """What GPS was used for.

    Attributes
    ----------
    used_for : tuple of str
        ``position``, ``heading``, ``aiding``, ``axes``, ``units``, ``time offset``.
    fixes_used : int
    until_ns : int or None
        Fixes up to here judge nothing.
    window_s, window_path_m : float or None
        The stretch that gave the heading.
    cut : tuple of (int, int) or None
        Where fixes aid all the way: the outages in ns, both ends included. Their fixes judge, the
        others judge nothing. None where ``until_ns`` tells.
    """

    used_for: tuple[str, ...] = ()
    fixes_used: int = 0
    until_ns: int | None = None
    window_s: float | None = None
    window_path_m: float | None = None
    cut: tuple[tuple[int, int], ...] | None = None

    @property
    def aids(self) -> bool:
        """Whether fixes aid all the way, not at the start alone."""
        return self.cut is not None


@dataclass(frozen=True)
class Given:
    """What the user says of the start.

    Attributes
    ----------
    position : (lat rad, lon rad, h m) or None
    heading : float or None
        rad
    attitude : (heading, pitch, roll) or None
        rad
    gps_seconds : float
        s of driving after the first departure that give the heading.
    lever_arm : (right, forward, up) or None
        m from the IMU to the antenna, axes of the vehicle.
    """

    position: tuple[float, float, float] | None = None
    heading: float | None = None
    attitude: tuple[float, float, float] | None = None
    gps_seconds: float = 60.0
    lever_arm: tuple[float, float, float] | None = None


def find_start(
    drive: Drive,
    samples: Samples,
    gnss: Gnss | None,
    given: Given,
    corrections: Corrections,
    solve: Solve,
) -> tuple[Start, Alignment, GpsUse, tuple[float, float], list[Finding]]:
    """Position, level, bias and heading, with what each came from.

    ``gnss`` None: GPS may not be used. ``solve`` is the method in force, for the heading fit.
    Returns the start, how it came about, what GPS was used for, the sigmas of position (m) and
    heading (rad), and findings.
    """
    fix, window, fit = None, None, None
    findings: list[Finding] = []
    begin = int(samples.t_ns[drive.first])
    if gnss is not None and given.position is None:
        end = int(samples.t_ns[drive.stops[0].last]) if drive.stops else begin
        fix, findings = position_from_fixes(gnss, begin, end)
    position = given.position or ((0.0, 0.0, 0.0) if fix is None else fix.position)
    start, rest_force = _level_start(drive, position, given)
    heading, heading_from = _given_heading(given)
    if heading is None and gnss is not None and fix is not None and drive.stops:
        departure = int(samples.t_ns[drive.stops[0].last])
        window = heading_window(gnss, departure, int(samples.t_ns[-1]), seconds=given.gps_seconds)
        if window is not None:
            fit = _fit(drive, start, gnss, window, samples, corrections, solve)
            heading, heading_from = fit.heading, "gps"
        else:
            text = "GPS shows under 20 m of driving after the first stop: the heading is unknown"
            findings.append(Finding("heading-unknown", "warning", text))
    start = start.turned(drive, heading or 0.0)
    if fix is not None and given.lever_arm is not None:
        start = replace(start, position=_before_antenna(start, given.lever_arm, drive))
    alignment = _alignment(samples, drive, start, given, fix, fit, heading_from, rest_force)
    if alignment.local:
        findings.append(_local_finding(alignment))
    sigmas = (fix.sigma if fix else 0.0, fit.sigma if fit else 0.0)
    return start, alignment, _gps_use(fix, window if fit else None), sigmas, findings


def _before_antenna(
    start: Start, arm: tuple[float, float, float], drive: Drive
) -> tuple[float, float, float]:
    """The IMU's place, where ``start`` has that of the antenna."""
    back = -(start.c_nb @ np.asarray(arm))
    lat, lon, height = geodetic_from_local_enu(back, origin=start.position, earth=drive.earth)
    return float(lat), float(lon), float(height)


def _given_heading(given: Given) -> tuple[float | None, str]:
    if given.heading is not None:
        return given.heading, "option"
    if given.attitude is not None:
        return given.attitude[0], "attitude option"
    return None, "none"


def _level_start(
    drive: Drive, position: tuple[float, float, float], given: Given
) -> tuple[Start, float | None]:
    """Level, gyro bias and accelerometer error along gravity at the first stop, heading 0."""
    if not drive.stops:
        heading, pitch, roll = given.attitude or (0.0, 0.0, 0.0)
        zero = np.zeros(3)
        return Start(position, c_nb_from_angles(heading, pitch, roll), zero, zero), None
    rest = rest_of(drive, drive.stops[0])
    bias = bias_along_gravity(rest, position[0], position[2], earth=drive.earth)
    start = Start(position, rest.c_nb(0.0), np.zeros(3), bias)
    return start.turned(drive, 0.0), float(np.linalg.norm(rest.f))


def _fit(
    drive: Drive,
    start: Start,
    gnss: Gnss,
    window: HeadingWindow,
    samples: Samples,
    corrections: Corrections,
    solve: Solve,
) -> HeadingFit:
    """The heading of the first stretch: with the published method, then with the one in force.

    Only the drive up to the first stop after the window takes part.
    """
    start_ns = int(samples.t_ns[0]) - round(float(samples.t[0]) / NS)
    end = (window.end_ns - start_ns) * NS
    later = [stop.last for stop in drive.stops if stop.start > end]
    n = (later[0] if later else drive.t.size - 1) + 1
    short = replace(
        drive,
        t=drive.t[:n],
        omega=drive.omega[:n],
        f=drive.f[:n],
        increments=drive.increments.part(0, n - 1),
        stops=[stop for stop in drive.stops if stop.last < n],
    )
    published = Corrections(refine=False, causal=True)
    fit = fit_heading(
        short, start, gnss, window, lambda d, s: solve(d, s, published),
        heading=0.0, start_ns=start_ns,
    )  # fmt: skip
    if not corrections.refine or corrections.causal:
        return fit
    return fit_heading(
        short, start, gnss, window, lambda d, s: solve(d, s, corrections),
        heading=fit.heading, start_ns=start_ns,
    )  # fmt: skip


def _alignment(
    samples: Samples,
    drive: Drive,
    start: Start,
    given: Given,
    fix: PositionFix | None,
    fit: HeadingFit | None,
    heading_from: str,
    rest_force: float | None,
) -> Alignment:
    heading, pitch, roll = (float(x) for x in angles_from_c_nb(start.c_nb))
    position_from = "option" if given.position is not None else "gps" if fix else "none"
    return Alignment(
        time_ns=int(samples.t_ns[drive.first]),
        position=start.position,
        heading=heading,
        pitch=pitch,
        roll=roll,
        position_from=position_from,
        heading_from=heading_from,
        heading_rms=None if fit is None else fit.rms,
        gyro_bias=start.gyro_bias,
        rest_force=rest_force,
        gravity=float(normal_gravity(start.position[0], start.position[2], drive.earth)),
    )


def _local_finding(alignment: Alignment) -> Finding:
    unknown = [
        name
        for name, source in (
            ("position", alignment.position_from),
            ("heading", alignment.heading_from),
        )
        if source == "none"
    ]
    return Finding(
        "local-frame",
        "warning",
        f"the start {' and '.join(unknown)} {'is' if len(unknown) == 1 else 'are'} not known: the "
        "frame is only local (position 0, 0 and heading 0 stand for them); --gps-file, or "
        "--start-position and --start-heading",
    )


def _gps_use(fix: PositionFix | None, window: HeadingWindow | None) -> GpsUse:
    if fix is None:
        return GpsUse()
    if window is None:
        return GpsUse(("position",), fix.used, fix.used_until_ns)
    return GpsUse(
        ("position", "heading"),
        fix.used + int(window.index.size),
        max(window.end_ns, fix.used_until_ns),
        window.seconds,
        window.path,
    )
