"""Clues to how the sensor sits, from the motion alone: departures, arrivals, turns, GPS.

All vectors are on the sensor axes s. Each clue is a direction with figures that say how much it is
worth; what follows from them together is decided in :mod:`vehnav.mounting_auto` (spec C section 2).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.rest import TimeIntegral
from vehnav.stops import Stop, quiet_bias
from vehnav.units import DEG

Array = npt.NDArray[np.float64]

MEAN: Final = 0.25
"""s: running mean that takes engine vibration out."""
NEAR: Final = 0.5
"""s next to a stop that do not count: clutch, brakes and rocking."""
FAR: Final = 5.0
"""s away from the stop up to which the vehicle is taken to speed up or slow down."""
MAX_YAW_RATE: Final = 8.0 * DEG
"""rad/s above which the force is that of a turn."""
GRID: Final = 0.05
"""s between the instants looked at near stops."""
TURN_GRID: Final = 0.5
"""s between the instants looked at for turns and GPS."""
MIN_TURNING: Final = 100.0 * DEG
"""rad of turning that a comparison of gyro and GPS course needs."""
MIN_SPEED: Final = 2.0
"""m/s below which GPS has no course."""
LAGS: Final = np.arange(0.0, 1.55, 0.1)
"""s by which the GPS may be late."""


@dataclass(frozen=True)
class Rest:
    """What the sensor shows at rest.

    Attributes
    ----------
    force : (3,)
        m/s2, mean specific force over the stops (over the log where there is none).
    rate : (3,)
        rad/s, mean rate there: the gyro bias.
    stops : int
    spread : float
        rad, largest angle of a stop's force from the mean.
    """

    force: Array
    rate: Array
    stops: int
    spread: float

    @property
    def up(self) -> Array:
        """(3,) unit vector of the specific force."""
        return np.asarray(self.force / np.linalg.norm(self.force))


@dataclass(frozen=True)
class Events:
    """Departures from stops and arrivals at them.

    Attributes
    ----------
    forward : (3,)
        Unit vector, horizontal.
    count : int
    consistency : float
        |sum| / sum | | of the speeds gained: 1 where all point the same way.
    speed : float
        m/s gained and lost in all of them.
    """

    forward: Array
    count: int
    consistency: float
    speed: float


@dataclass(frozen=True)
class Turns:
    """The force towards the inside of turns.

    Attributes
    ----------
    forward : (3,)
        Unit vector, horizontal; good for the sign, and to some 10 degrees.
    speed : float
        m/s: the force over the rate of turn.
    share : float
        Of the variance of the horizontal force that the rate of turn explains.
    turning : float
        rad turned in all.
    """

    forward: Array
    speed: float
    share: float
    turning: float


@dataclass(frozen=True)
class GpsMotion:
    """Horizontal velocity by GPS.

    Attributes
    ----------
    t : (m,)
        s
    v : (m, 2)
        East, north, m/s.
    """

    t: Array
    v: Array


GpsBetween = Callable[[float, float], GpsMotion | None]
"""Velocity from the fixes between two instants (s) alone; None where there are too few."""


@dataclass(frozen=True)
class GpsClue:
    """The gyro against the GPS course, the force against the GPS acceleration.

    Attributes
    ----------
    parity : float
        Correlation of the rate about the accelerometer's up with the course rate: negative where
        gyro and accelerometer are mirror images.
    gyro_slope : (3,)
        Gyro on the counter-clockwise course rate; its size is 1 where the gyro is in rad/s.
    forward : (3,)
        Unit vector along which the force follows the acceleration.
    fit : float
        Correlation of that, 0..1.
    mirrored : bool
        Whether the force fits better as the mirror image.
    turning : float
        rad turned by GPS.
    lag : float
        s by which GPS is late.
    until : float
        s: the last instant whose fixes were used.
    """

    parity: float
    gyro_slope: Array
    forward: Array
    fit: float
    mirrored: bool
    turning: float
    lag: float
    until: float


def at_rest(t: Array, gyro: Array, accel: Array, stops: list[Stop]) -> Rest:
    """Mean force and rate over the stops, weighed by their length."""
    if not stops:
        return Rest(np.asarray(accel.mean(axis=0)), quiet_bias(t, gyro), 0, 0.0)
    weight = np.array([stop.duration for stop in stops])
    weight /= weight.sum()
    f = np.array([accel[stop.first : stop.last + 1].mean(axis=0) for stop in stops])
    w = np.array([gyro[stop.first : stop.last + 1].mean(axis=0) for stop in stops])
    mean = weight @ f
    cosine = f @ mean / np.linalg.norm(f, axis=1) / np.linalg.norm(mean)
    spread = float(np.arccos(np.clip(cosine.min(), -1.0, 1.0)))
    return Rest(np.asarray(mean), np.asarray(weight @ w), len(stops), spread)


def departures_and_arrivals(t: Array, gyro: Array, accel: Array, stops: list[Stop]) -> Events:
    """Speed gained after each stop and lost before it: together they point forward.

    The mean over 0.25 s minus the force of THAT stop, its horizontal part, 0.5 to 5 s after the
    departure and before the arrival, wherever the vehicle turns by less than 8 deg/s.
    """
    both = TimeIntegral(t, np.concatenate([gyro, accel], axis=1))
    found = []
    for k, stop in enumerate(stops):
        inside = slice(stop.first, stop.last + 1)
        force, bias = accel[inside].mean(axis=0), gyro[inside].mean(axis=0)
        before = stops[k - 1].end if k else t[0]
        after = stops[k + 1].start if k + 1 < len(stops) else t[-1]
        for sign, first, last in (
            (-1.0, max(stop.start - FAR, before), stop.start - NEAR),
            (1.0, stop.end + NEAR, min(stop.end + FAR, after)),
        ):
            gained = _gained(both, force, bias, first, last)
            if gained is not None:
                found.append(sign * gained)
    if not found:
        return Events(np.zeros(3), 0, 0.0, 0.0)
    total = np.sum(found, axis=0)
    size, sizes = float(np.linalg.norm(total)), float(np.linalg.norm(found, axis=1).sum())
    return Events(total / max(size, 1e-12), len(found), size / max(sizes, 1e-12), sizes)


def _gained(
    both: TimeIntegral, force: Array, bias: Array, first: float, last: float
) -> Array | None:
    """(3,) m/s gained horizontally between two instants, turns left out; None if all is a turn."""
    up = force / np.linalg.norm(force)
    when = np.arange(first, last, GRID)
    if when.size < 0.5 / GRID:
        return None
    mean = both.mean(when - 0.5 * MEAN, when + 0.5 * MEAN)
    straight = np.abs((mean[:, :3] - bias) @ up) < MAX_YAW_RATE
    if straight.sum() < 0.5 / GRID:
        return None
    more = mean[straight, 3:] - force
    return np.asarray(horizontal(more, up).sum(axis=0) * GRID)


def turns(t: Array, gyro: Array, accel: Array, rest: Rest, stops: list[Stop]) -> Turns | None:
    """Regression of the horizontal force on the rate of turn w, with |w| as the braking in turns.

    The coefficient of w points left, for the force of a left turn (w > 0 about up) does. |w| is
    left out where nearly all turns go one way: the two cannot be told apart there.
    """
    when = np.arange(t[0] + 1.0, t[-1] - 1.0, TURN_GRID)
    moving = np.ones(when.size, bool)
    for stop in stops:
        moving &= (when < stop.start) | (when > stop.end)
    when = when[moving]
    if when.size < 20:
        return None
    both = TimeIntegral(t, np.concatenate([gyro, accel], axis=1))
    mean = both.mean(when - TURN_GRID, when + TURN_GRID)
    w = (mean[:, :3] - rest.rate) @ rest.up
    f = horizontal(mean[:, 3:] - rest.force, rest.up)
    turned = float(np.abs(w).sum()) * TURN_GRID
    if turned < MIN_TURNING:
        return None
    one_way = abs(float(w.sum())) * TURN_GRID > 0.7 * turned
    columns = [w] if one_way else [w, np.abs(w), np.ones_like(w)]
    left = np.linalg.lstsq(np.stack(columns, axis=1), f, rcond=None)[0][0]
    speed = float(np.linalg.norm(left))
    centre = np.zeros(3) if one_way else f.mean(axis=0)
    explained = speed**2 * float(np.sum((w - (0.0 if one_way else w.mean())) ** 2))
    share = explained / max(float(np.sum((f - centre) ** 2)), 1e-12)
    forward = np.cross(left, rest.up) / max(speed, 1e-12)
    return Turns(np.asarray(forward), speed, min(share, 1.0), turned)


def by_gps(t: Array, gyro: Array, accel: Array, rest: Rest, motion: GpsMotion) -> GpsClue | None:
    """Regressions of the gyro on the GPS course rate, of the force on the GPS acceleration.

    Both over 2 s, at the lag of GPS that fits best. The force is looked at as a complex number in
    the horizontal plane: acceleration along the track plus i times that across it (to the left)
    is turned into it by the angle of forward. None where GPS shows too little driving.
    """
    when = np.arange(t[0] + 1.0, t[-1] - 1.0, TURN_GRID)
    mean = TimeIntegral(t, np.concatenate([gyro, accel], axis=1)).mean(when - 1.0, when + 1.0)
    best: GpsClue | None = None
    for lag in LAGS:
        clue = _at_lag(when, mean, rest, motion, float(lag))
        if clue is not None and (
            best is None or clue.fit * abs(clue.parity) > best.fit * abs(best.parity)
        ):
            best = clue
    return best


def _at_lag(when: Array, mean: Array, rest: Rest, motion: GpsMotion, lag: float) -> GpsClue | None:
    ok = (when + lag - 1.0 >= motion.t[0]) & (when + lag + 1.0 <= motion.t[-1])
    v = [
        np.stack([np.interp(when + lag + d, motion.t, motion.v[:, k]) for k in (0, 1)], axis=1)
        for d in (-1.0, 0.0, 1.0)
    ]
    speed = np.hypot(*np.stack(v).transpose(2, 0, 1))
    ok &= speed.min(axis=0) > MIN_SPEED
    if ok.sum() < 10:
        return None
    (v0, _, v1), speed = (x[ok] for x in v), speed[:, ok]
    turn = np.arctan2(v0[:, 0] * v1[:, 1] - v0[:, 1] * v1[:, 0], np.sum(v0 * v1, axis=1)) / 2.0
    w = mean[ok, :3] - rest.rate
    swing = turn
    if not rest.stops:  # the bias is a guess then: only what varies counts
        w, swing = w - w.mean(axis=0), turn - turn.mean()
    about_up = w @ rest.up
    power = float(swing @ swing)
    parity = float(about_up @ swing) / max(float(np.linalg.norm(about_up)) * power**0.5, 1e-12)
    along = (speed[2] - speed[0]) / 2.0
    forward, fit, mirrored = _turned(mean[ok, 3:], rest, along + 1j * speed[1] * turn)
    return GpsClue(
        parity=parity,
        gyro_slope=swing @ w / max(power, 1e-12),
        forward=forward,
        fit=fit,
        mirrored=mirrored,
        turning=float(np.abs(turn).sum()) * TURN_GRID,
        lag=lag,
        until=float(motion.t[-1]),
    )


def _turned(f: Array, rest: Rest, wanted: npt.NDArray[np.complex128]) -> tuple[Array, float, bool]:
    """(forward, correlation, mirrored) of the turn of the plane that brings ``wanted`` onto f."""
    right, ahead = plane(rest.up)
    more = f - rest.force
    seen = more @ ahead + 1j * -(more @ right)
    seen = seen - (0.0 if rest.stops else seen.mean())
    best: tuple[complex, float, bool] = (1.0 + 0.0j, -1.0, False)
    for mirrored, ideal in ((False, wanted), (True, wanted.conj())):
        product = complex(np.vdot(ideal, seen))
        size = float(np.linalg.norm(ideal) * np.linalg.norm(seen))
        if abs(product) / max(size, 1e-12) > best[1]:
            best = product, abs(product) / max(size, 1e-12), mirrored
    product, fit, mirrored = best
    forward = ahead * product.real - right * product.imag
    return np.asarray(forward / max(abs(product), 1e-12)), fit, mirrored


def plane(up: Array) -> tuple[Array, Array]:
    """(right, ahead): unit vectors with up a right-handed triple; which ahead does not matter."""
    start = np.eye(3)[int(np.argmin(np.abs(up)))]
    ahead = horizontal(start, up)
    ahead = ahead / np.linalg.norm(ahead)
    return np.cross(ahead, up), ahead


def horizontal(v: Array, up: Array) -> Array:
    """(..., 3) v without its part along the unit vector up."""
    return np.asarray(v - (v @ up)[..., None] * up)
