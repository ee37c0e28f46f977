"""Where the filter starts: standing or rolling, from fixes or from what is given.

Standing at the start: level and gyro bias from the stop. Rolling: level from the specific force
less the acceleration that the fixes show; gyro bias from the first stop that comes, if any does.
The heading is the course of the fixes less the turning that the gyro shows since the start.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.aiding.fixes import Fixes
from vehnav.classic import Drive, rest_of
from vehnav.earth import geodetic_from_local_enu, normal_gravity
from vehnav.rest import TimeIntegral
from vehnav.rotation import c_nb_from_angles
from vehnav.units import DEG

Array = npt.NDArray[np.float64]
Place = tuple[float, float, float]

AT_ONCE: Final = 2.0
"""s: a stop that begins within this of the first sample is a standing start."""
COURSE_SPEED: Final = 2.0
"""m/s above which the course of a fix counts."""
COURSE_SPAN: Final = 20.0
"""s of such fixes that give the heading: a gyro of 0.1 deg/s is off by 2 deg then."""
FORWARD_SPEED: Final = 6.0
"""m/s at which nothing reverses: a course so fast is the heading, a slower one perhaps its back."""
FORWARD_WAIT: Final = 60.0
"""s after the first course in which a fast one is worth more."""
REVERSE_SPAN: Final = 10.0
"""s after a departure in which the accelerometer tells forward from backward: a slope of 0.5 deg
is 1 m/s then."""
REACH: Final = 30.0
"""m/s that a vehicle gets away while nothing shows where it is."""
LEAST_HEADING: Final = 2.0 * DEG
"""rad: sigma of the best fit of the course."""
UNKNOWN_HEADING: Final = 60.0 * DEG
"""rad: sigma where nothing tells the heading; the filter may find it, or not."""
COMPASS_SIGMA: Final = 20.0 * DEG
"""rad: the Earth rate gives the heading where the gyro's bias leaves less than this open."""
COMPASS_FACTOR: Final = 3.0
"""On that sigma at the start: the zero-rate updates, which see the same rate, bring it down."""
UNKNOWN_SPEED: Final = 10.0
"""m/s: sigma of the velocity of a rolling start without fixes."""


@dataclass(frozen=True)
class CoarseStart:
    """The first state, with how sure it is.

    Attributes
    ----------
    first : int
        Index of the instant.
    position : (lat rad, lon rad, h m)
    v_n : (3,)
    heading, pitch, roll : float
        rad
    gyro_bias : (3,)
        rad/s
    accel_scale : float
        Factor on the specific force.
    standing : bool
    heading_sigma, tilt_sigma, velocity_sigma, position_sigma : float
    fitted : bool
        Whether the heading is from the course of the fixes.
    compassed : bool
        Whether it is from the Earth rate; then no bias has been taken from the rest but about up.
    """

    first: int
    position: Place
    v_n: Array
    heading: float
    pitch: float
    roll: float
    gyro_bias: Array
    accel_scale: float
    standing: bool
    heading_sigma: float
    tilt_sigma: float
    velocity_sigma: float
    position_sigma: float
    fitted: bool
    compassed: bool = False

    @property
    def c_nb(self) -> Array:
        """(3, 3) attitude."""
        return c_nb_from_angles(self.heading, self.pitch, self.roll)


def coarse_start(
    drive: Drive,
    fixes: Fixes | None,
    *,
    position: Place | None = None,
    heading: float | None = None,
    attitude: tuple[float, float, float] | None = None,
    gyro_bias: float | None = None,
) -> CoarseStart:
    """Find the first state.

    Parameters
    ----------
    drive : Drive
    fixes : Fixes or None
        Those that may be used, at least two; the first ones show position, course and speed.
    position, heading, attitude
        What is given beats what is found: rad, rad, m; rad; (heading, pitch, roll) rad.
    gyro_bias : float or None
        Sigma of the gyro bias where it is known before, rad/s: standing, and with nothing else
        that tells the heading, the Earth rate may.
    """
    at_once = bool(drive.stops) and drive.stops[0].start < drive.t[0] + AT_ONCE
    standing = at_once or (fixes is None and bool(drive.stops))
    first = drive.stops[0].first if standing else _first_with_fix(drive, fixes)
    lat, _, height = _somewhere(fixes, position)
    gravity = normal_gravity(lat, height, drive.earth)
    bias, up_b, scale = _rest_figures(drive, standing, gravity)
    turned = _turning(drive, bias, up_b)
    courses = None if fixes is None else _courses(drive, fixes, turned, standing, first)
    told = heading is not None or attitude is not None
    found, sigma = (0.0, UNKNOWN_HEADING) if courses is None else courses
    north = None
    if standing and courses is None and not told and gyro_bias is not None:
        north = _compass(bias, up_b, lat, gyro_bias, drive)
    if north is not None:
        found, sigma, bias = north
    if attitude is not None:
        found, sigma = attitude[0], LEAST_HEADING
    if heading is not None:
        found, sigma = heading, 0.5 * LEAST_HEADING
    v_n, place, place_sigma = np.zeros(3), (0.0, 0.0, 0.0), 0.0
    if fixes is not None:
        v_n, place = _motion(drive, fixes, standing, first, found)
        moved = max(float(fixes.t[0]) - drive.stops[0].end, 0.0) if standing else 0.0
        place_sigma = 2.0 + REACH * moved
    level = up_b if standing or fixes is None else _rolling_level(drive, fixes, bias, scale, first)
    pitch, roll = _angles(level)
    if attitude is not None and not standing:
        pitch, roll = attitude[1:]
    rolling_speed = UNKNOWN_SPEED if fixes is None else 1.5
    return CoarseStart(
        first, position or place, v_n, float(np.remainder(found, 2.0 * np.pi)), pitch, roll, bias,
        scale, standing,
        heading_sigma=sigma,
        tilt_sigma=(1.5 if standing else 3.0) * DEG,
        velocity_sigma=0.1 if standing else rolling_speed,
        position_sigma=0.0 if position is not None else place_sigma,
        fitted=courses is not None and not told,
        compassed=north is not None,
    )  # fmt: skip


def _somewhere(fixes: Fixes | None, position: Place | None) -> Place:
    """A place near the start, for gravity."""
    if position is not None or fixes is None:
        return position or (0.0, 0.0, 0.0)
    return float(fixes.lat[0]), float(fixes.lon[0]), float(fixes.height[0])


def _first_with_fix(drive: Drive, fixes: Fixes | None) -> int:
    """The start of the log, or the first fix where that comes more than 5 s later."""
    if fixes is None or fixes.t[0] - drive.t[0] < 5.0:
        return 0
    return int(np.searchsorted(drive.t, fixes.t[0]))


def _rest_figures(drive: Drive, standing: bool, gravity: float) -> tuple[Array, Array, float]:
    """Gyro bias, direction of up in body axes, and gravity over the force."""
    if drive.stops:
        longest = max(drive.stops, key=lambda stop: stop.duration)
        rest = rest_of(drive, drive.stops[0] if standing else longest)
        size = float(np.linalg.norm(rest.f))
        return rest.omega, rest.f / size, gravity / size
    f = drive.f.mean(axis=0)
    size = float(np.linalg.norm(f))
    return np.zeros(3), f / size, gravity / size


def _compass(
    rate: Array, up_b: Array, lat: float, sigma: float, drive: Drive
) -> tuple[float, float, Array] | None:
    """(heading, its sigma, gyro bias) from the mean rate at rest, or None: the bias hides north.

    The level part of the rate is that of the Earth, Omega cos(lat) to the north, plus the bias.
    The bias about up follows from the rest; level, the filter shares out what the rate shows.
    """
    turn, climb = drive.earth.omega_ie * np.cos(lat), drive.earth.omega_ie * np.sin(lat)
    if sigma >= COMPASS_SIGMA * turn:
        return None
    level = c_nb_from_angles(0.0, *_angles(up_b)) @ rate  # right, forward, up at heading zero
    heading = float(np.arctan2(-level[0], level[1]))
    bias = (float(rate @ up_b) - climb) * up_b
    return heading, COMPASS_FACTOR * sigma / float(turn), bias


def _turning(drive: Drive, bias: Array, up_b: Array) -> Array:
    """(n,) rad: heading since the first sample, by the gyro alone."""
    rate = -(drive.omega - bias) @ up_b
    return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(drive.t))])


def _courses(
    drive: Drive, fixes: Fixes, turned: Array, standing: bool, first: int
) -> tuple[float, float] | None:
    """Heading at instant ``first`` and its sigma, rad: mean of course less turning."""
    departure = drive.stops[0].end + 0.5 if standing else float(drive.t[first])
    v = fixes.velocity(drive.earth)
    speed = np.hypot(v[:, 0], v[:, 1])
    index = np.flatnonzero((fixes.t > departure) & (speed > COURSE_SPEED))
    if index.size < 3:
        return None
    soon = fixes.t[index] < fixes.t[index[0]] + FORWARD_WAIT
    fast = index[soon & (speed[index] > FORWARD_SPEED)]
    index = fast if fast.size >= 3 else index
    index = index[fixes.t[index] < fixes.t[index[0]] + COURSE_SPAN]
    course = np.arctan2(v[index, 0], v[index, 1])
    if standing and fast.size < 3:
        course += np.pi * _backward(drive, fixes.t[index], speed[index])
    offset = course - np.interp(fixes.t[index], drive.t, turned - turned[first])
    mean = float(np.angle(np.sum(speed[index] * np.exp(1j * offset))))
    spread = float(np.std(np.angle(np.exp(1j * (offset - mean)))))
    return mean, max(LEAST_HEADING, spread)


def _backward(drive: Drive, t: Array, speed: Array) -> npt.NDArray[np.bool_]:
    """Whether the vehicle goes backward with ``speed`` at instants ``t``, by its forward force.

    That is told soon after the last stop before; later it goes as it did last.
    """
    stop = [stop for stop in drive.stops if stop.end < t[0]][-1]
    ahead = drive.f[:, 1] - drive.f[stop.first : stop.last + 1, 1].mean()
    gained = np.concatenate([[0.0], np.cumsum(0.5 * (ahead[1:] + ahead[:-1]) * np.diff(drive.t))])
    at = np.minimum(t, stop.end + REVERSE_SPAN)
    return np.asarray(np.interp(at, drive.t, gained) - gained[stop.last] < -0.5 * speed)


def _motion(
    drive: Drive, fixes: Fixes, standing: bool, first: int, heading: float
) -> tuple[Array, Place]:
    """Velocity and position at instant ``first``."""
    if standing:
        inside = fixes.t <= drive.stops[0].end
        inside[0] = True
        lat, lon, h = (float(np.median(x[inside])) for x in (fixes.lat, fixes.lon, fixes.height))
        return np.zeros(3), (lat, lon, h)
    v = fixes.velocity(drive.earth)
    speed = float(np.hypot(*v[min(1, v.shape[0] - 1)]))
    v_n = speed * np.array([np.sin(heading), np.cos(heading), 0.0])
    origin = (float(fixes.lat[0]), float(fixes.lon[0]), float(fixes.height[0]))
    back = -v_n * (fixes.t[0] - drive.t[first])
    lat, lon, h = (
        float(x) for x in geodetic_from_local_enu(back, origin=origin, earth=drive.earth)
    )
    return v_n, (lat, lon, h)


def _rolling_level(drive: Drive, fixes: Fixes, bias: Array, scale: float, first: int) -> Array:
    """Mean reaction to gravity over the first fixes: the force less what they show of motion."""
    v = fixes.velocity(drive.earth)
    speed = np.hypot(v[:, 0], v[:, 1])
    t = fixes.t
    use = np.flatnonzero((t > drive.t[first] + 0.5) & (t < drive.t[first] + COURSE_SPAN))
    if use.size < 3:
        return np.asarray(drive.f.mean(axis=0))
    along = np.gradient(speed, t)[use]
    mean = TimeIntegral(drive.t, np.concatenate([drive.f * scale, drive.omega - bias], axis=1))
    at = mean.mean(t[use] - 0.5, t[use] + 0.5)
    f = at[:, :3].copy()
    f[:, 1] -= along
    f[:, 0] += at[:, 5] * speed[use]  # turning left (omega up) accelerates to the left
    return np.asarray(f.mean(axis=0))


def _angles(f: Array) -> tuple[float, float]:
    """(pitch, roll), rad, of the reaction to gravity in body axes."""
    pitch = float(np.arctan2(f[1], np.hypot(f[0], f[2])))
    return pitch, float(np.arctan2(-f[0], f[2]))
