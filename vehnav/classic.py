"""Dead reckoning with stops (paper 002): level, gyro bias and heading once, at the start; then
Poisson integration with levelling and velocity reset at every stop; and the gyro bias that every
stop shows. What the same stops give offline is in :mod:`vehnav.offline`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from vehnav.alignment import Rest, gyro_bias, mean_over_rest, track_random_walk
from vehnav.earth import Ellipsoid
from vehnav.errors import Finding
from vehnav.legs import LegNoise
from vehnav.rest import white_noise
from vehnav.rotation import angles_from_c_nb, c_nb_from_angles
from vehnav.stops import MARGIN_WARNING, Stop, stop_numbers
from vehnav.strapdown.eci import mechanize_eci
from vehnav.strapdown.enu import Solution, StopControl, mechanize_enu
from vehnav.strapdown.increments import Increments
from vehnav.strapdown.wander import Azimuth, c_we_from_geodetic, mechanize_wander

Array = npt.NDArray[np.float64]

GUARD = 0.3
"""s before the end of a stop at which levelling ends: 0.5 s of levelling under way cost 38 m a
minute later (spec A 4.3)."""
FAST_STOP = 3.0
"""m/s before the reset above which a stop is reported (spec C 1)."""
MEAN_OFFSET = 0.5
"""s in the gain 1/(t + 0.5 s): the running mean since levelling began (spec A 4.3, spec C 3)."""


def _in_wander_axes(
    increments: Increments,
    *,
    position: tuple[float, float, float],
    v_n: tuple[float, float, float] = (0.0, 0.0, 0.0),
    c_nb: Array,
    azimuth: Azimuth,
    **options: Any,
) -> Solution:
    """As :func:`mechanize_enu`, in axes free in azimuth that start as East-North-Up."""
    c_we, height = c_we_from_geodetic(*position[:2]), position[2]
    solution = mechanize_wander(
        increments, c_we=c_we, height=height, v_w=v_n, c_wb=c_nb, azimuth=azimuth, **options
    )
    return solution.enu()


MECHANIZATIONS: Final[dict[str, Callable[..., Solution]]] = {
    "enu": mechanize_enu,
    "eci": mechanize_eci,
    "wander": partial(_in_wander_axes, azimuth="relative"),
    "wander absolute": partial(_in_wander_axes, azimuth="absolute"),
}
"""Frame -> function with the arguments of :func:`vehnav.strapdown.enu.mechanize_enu`."""


@dataclass(frozen=True)
class Drive:
    """What the stop methods work on.

    Attributes
    ----------
    t : (n,)
        s since the start of the log.
    omega, f : (n, 3)
        Angular rate and specific force in body axes; rates, also where the log has increments.
    increments : Increments
        Over the n-1 steps.
    stops : list of Stop
    earth : Ellipsoid
    vertical : str
        ``clamp`` or ``free``.
    frame : str
        Of the mechanization: a key of :data:`MECHANIZATIONS`.
    levelling_rate : float or None
        k g, 1/s; None: the running mean.
    """

    t: Array
    omega: Array
    f: Array
    increments: Increments
    stops: list[Stop]
    earth: Ellipsoid
    vertical: Literal["clamp", "free"] = "clamp"
    frame: str = "enu"
    levelling_rate: float | None = None

    @property
    def first(self) -> int:
        """Index of the instant where the solution starts."""
        return self.stops[0].first if self.stops else 0


@dataclass(frozen=True)
class Start:
    """Where and how the drive starts, at ``Drive.first``.

    Attributes
    ----------
    position : (lat rad, lon rad, h m)
    c_nb : (3, 3)
    gyro_bias : (3,)
        rad/s, body axes.
    accel_bias : (3,)
        m/s2, body axes, along gravity at the first stop.
    v_n : (east, north, up)
        m/s, zero at a stop.
    """

    position: tuple[float, float, float]
    c_nb: Array
    gyro_bias: Array
    accel_bias: Array
    v_n: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def turned(self, drive: Drive, heading: float) -> Start:
        """With another heading, rad; the gyro bias at the first stop follows (Earth rate)."""
        _, pitch, roll = (float(x) for x in angles_from_c_nb(self.c_nb))
        c_nb = c_nb_from_angles(heading, pitch, roll)
        if not drive.stops:
            return replace(self, c_nb=c_nb)
        rest = rest_of(drive, drive.stops[0])
        bias = gyro_bias(rest, c_nb, self.position[0], earth=drive.earth)
        return replace(self, c_nb=c_nb, gyro_bias=bias)


@dataclass(frozen=True)
class Corrections:
    """Which procedures are on.

    Attributes
    ----------
    levelling, reset : bool
        Procedures 1 and 2 of paper 002.
    refine : bool
        The gyro bias of every stop, and the distribution over the legs.
    causal : bool
        Only what was known at the time: the bias of stops so far, no distribution, nothing before
        the first stop.
    """

    levelling: bool = True
    reset: bool = True
    refine: bool = True
    causal: bool = False


@dataclass(frozen=True)
class StopRecord:
    """What a stop showed and what was done.

    Attributes
    ----------
    speed_before_reset : float
        m/s, horizontal, of the dead-reckoned velocity on its first instant.
    tilt_corrected : float
        rad, that levelling turned the platform.
    gyro_bias : (3,)
        rad/s, seen in this stop alone.
    """

    speed_before_reset: float
    tilt_corrected: float
    gyro_bias: Array


@dataclass(frozen=True)
class Outcome:
    """A solution over the instants ``first`` ... of the drive.

    Attributes
    ----------
    first : int
        Index of the first instant that has a solution.
    position, v_n, c_nb : (m, 3), (m, 3), (m, 3, 3)
        lat rad, lon rad, h m; m/s; body to ENU.
    records : list of StopRecord
    sigma_pos : (m, 3) or None
        East, north, up, m (up is nan where the height is clamped).
    sigma_heading : (m,) or None
        rad
    accel_bias : (3,) or None
        m/s2, body, beyond the one of the start; where the legs show it.
    """

    first: int
    position: Array
    v_n: Array
    c_nb: Array
    records: list[StopRecord]
    sigma_pos: Array | None = None
    sigma_heading: Array | None = None
    accel_bias: Array | None = None


def rest_of(drive: Drive, stop: Stop) -> Rest:
    """Means over the part of a stop where levelling may work."""
    inside = (drive.t >= stop.settled) & (drive.t <= stop.end - GUARD)
    where = np.flatnonzero(inside)
    if where.size < 2:
        return mean_over_rest(drive.omega, drive.f, stop.first, stop.last)
    return mean_over_rest(drive.omega, drive.f, int(where[0]), int(where[-1]))


def levelling_gain(t: Array, stops: list[Stop], rate: float | None) -> Array:
    """(n-1,) gain of procedure 1 over each step, 1/s: from when every stop is settled to GUARD
    before its end; ``rate``, or 1/(time since then + 0.5 s).
    """
    gain = np.zeros(t.size - 1)
    for stop in stops:
        begin = stop.settled
        steps = np.flatnonzero((t[:-1] >= begin) & (t[1:] <= stop.end - GUARD))
        gain[steps] = rate if rate is not None else 1.0 / (t[steps] - begin + MEAN_OFFSET)
    return gain


def stop_control(drive: Drive, *, levelling: bool, reset: bool) -> StopControl:
    """The two procedures at the stops of a drive, over all its instants."""
    gain = levelling_gain(drive.t, drive.stops, drive.levelling_rate)
    numbers = stop_numbers(drive.t.size, drive.stops)
    return StopControl(numbers, gain if levelling else 0.0 * gain, reset, len(drive.stops))


def dead_reckon(
    drive: Drive,
    start: Start,
    *,
    levelling: bool,
    reset: bool,
    bias: Array | None = None,
    accel_bias: Array | None = None,
) -> Solution:
    """Integrate forward from the start with the procedures that are on.

    ``bias`` (n-1, 3) rad/s per step of the whole drive, else the one of the start; ``accel_bias``
    (3,) m/s2, beyond the one of the start.
    """
    last = drive.t.size - 1
    per_step = np.broadcast_to(start.gyro_bias if bias is None else bias, (last, 3))
    extra = np.zeros(3) if accel_bias is None else accel_bias
    increments = drive.increments.corrected(per_step, start.accel_bias + extra)
    control = stop_control(drive, levelling=levelling, reset=reset)
    return mechanize(
        drive,
        increments.part(drive.first, last),
        position=start.position,
        v_n=start.v_n,
        c_nb=start.c_nb,
        control=control.part(drive.first, last),
    )


def mechanize(drive: Drive, increments: Increments, **start: Any) -> Solution:
    """Integrate in the frame of the drive; ``start`` as of the mechanizations."""
    return MECHANIZATIONS[drive.frame](
        increments, vertical=drive.vertical, earth=drive.earth, **start
    )


# ---- gyro bias from the stops ------------------------------------------------------------------


def biases_at_stops(drive: Drive, solution: Solution, start: Start) -> Array:
    """(stops, 3) rad/s: mean rate of each stop less the Earth rate in its attitude (spec C 3)."""
    out = np.zeros((len(drive.stops), 3))
    for k, stop in enumerate(drive.stops):
        rest = rest_of(drive, stop)
        heading, _, _ = angles_from_c_nb(solution.c_nb[stop.last - drive.first])
        out[k] = gyro_bias(rest, rest.c_nb(float(heading)), start.position[0], earth=drive.earth)
    return out


def bias_per_step(drive: Drive, seen: Array, noise: LegNoise, *, smooth: bool) -> Array:
    """(n-1, 3) rad/s: gyro bias over every step, each stop weighed by its noise.

    Offline it is interpolated between the stops; causally it is held until the next one ends.
    """
    duration = np.array([stop.end - GUARD - stop.settled for stop in drive.stops])
    middle = np.array([0.5 * (stop.start + stop.end) for stop in drive.stops])
    variance = noise.gyro_white**2 / np.maximum(duration, 1.0)
    track, _ = track_random_walk(middle, seen, variance, noise.gyro_bias_walk, smooth=smooth)
    at = 0.5 * (drive.t[1:] + drive.t[:-1])
    if smooth:
        return np.stack([np.interp(at, middle, track[:, k]) for k in range(3)], axis=1)
    ends = np.array([stop.end for stop in drive.stops])
    return np.asarray(track[np.maximum(np.searchsorted(ends, at, side="right") - 1, 0)])


def stop_records(solution: Solution, seen: Array) -> list[StopRecord]:
    """What every stop showed, from the solution and the biases ``seen`` (stops, 3), rad/s."""
    return [
        StopRecord(float(np.hypot(v[0], v[1])), float(np.hypot(*tilt)), bias)
        for v, tilt, bias in zip(
            solution.v_before_reset, solution.tilt_correction, seen, strict=True
        )
    ]


def noise_from_rest(
    drive: Drive, *, motion_factor: float = 4.0, accel_bias: float = 0.02, level: float = 0.0017
) -> LegNoise:
    """Noise figures from the log's own rest.

    ``motion_factor``: effective white noise while driving over that at rest (rectified vibration,
    scale factor errors), set so that 95 % of the real errors lie inside the expected circle; the
    bias walk is a twentieth of the white noise per sqrt(s), the ratio of MEMS and tactical grades
    alike (spec C 4: 0.02 and 9e-4, 0.002 and 9e-5 deg/s). ``accel_bias``: m/s2. ``level``: rad,
    0.1 deg of road and suspension between two stops.
    """
    spans = [(stop.first, stop.last) for stop in drive.stops]
    gyro = white_noise(drive.t, drive.omega, spans)
    accel = white_noise(drive.t, drive.f, spans)
    gyro_white = float(np.sqrt(np.mean(gyro**2))) if np.all(np.isfinite(gyro)) else 2e-4
    accel_white = float(np.sqrt(np.mean(accel**2))) if np.all(np.isfinite(accel)) else 5e-3
    return LegNoise(
        gyro_white=motion_factor * max(gyro_white, 1e-6),
        accel_white=motion_factor * max(accel_white, 1e-4),
        gyro_bias_walk=max(gyro_white, 1e-6) / 20.0,
        accel_bias=accel_bias,
        level=level,
        gravity=9.81,
    )


def noise_of_sensor(
    noise: LegNoise, *, gyro_noise: float, gyro_walk: float, accel_noise: float, accel_bias: float
) -> LegNoise:
    """Figures from the log's rest, with those of a known sensor where they say more.

    ``gyro_noise`` rad/sqrt(s), ``gyro_walk`` rad/s/sqrt(s), ``accel_noise`` m/s/sqrt(s),
    ``accel_bias`` m/s2. The noise is never taken below what the rest shows: vibration is no part
    of a data sheet.
    """
    return replace(
        noise,
        gyro_white=max(noise.gyro_white, gyro_noise),
        accel_white=max(noise.accel_white, accel_noise),
        gyro_bias_walk=gyro_walk or noise.gyro_bias_walk,
        accel_bias=accel_bias or noise.accel_bias,
    )


def stop_findings(
    stops: list[Stop], records: list[StopRecord], t_ns: npt.NDArray[np.int64]
) -> list[Finding]:
    """Stops that barely passed, and those that the solution reached too fast: one line a kind."""
    near = [k for k, stop in enumerate(stops) if stop.margin > MARGIN_WARNING]
    fast = [k for k, record in enumerate(records) if record.speed_before_reset > FAST_STOP]
    findings = []
    if near:
        worst = max(near, key=lambda k: stops[k].margin)
        text = (
            f"{_numbers(near)} near the threshold: the margin of stop {worst + 1} is "
            f"{stops[worst].margin:.2f} of 1"
        )
        findings.append(Finding("stop-margin", "warning", text, *_span(stops, near, t_ns)))
    if fast:
        worst = max(fast, key=lambda k: records[k].speed_before_reset)
        text = (
            f"{_numbers(fast)} reached with a dead-reckoned speed of over {FAST_STOP:g} m/s "
            f"({records[worst].speed_before_reset:.1f} m/s at stop {worst + 1}): the errors of the "
            "leg before are that large, or it is no stop"
        )
        findings.append(Finding("stop-speed", "warning", text, *_span(stops, fast, t_ns)))
    return findings


def _numbers(indices: list[int]) -> str:
    listed = ", ".join(str(k + 1) for k in indices[:8]) + (", ..." if len(indices) > 8 else "")
    return f"stop {listed} was" if len(indices) == 1 else f"stops {listed} were"


def _span(stops: list[Stop], indices: list[int], t_ns: npt.NDArray[np.int64]) -> tuple[int, int]:
    return int(t_ns[stops[indices[0]].first]), int(t_ns[stops[indices[-1]].last])
