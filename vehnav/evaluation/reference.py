"""GPS as a reference: how far it went, which way it drove, when it stood still.

Noise of a standing receiver must not add distance, and its wander must not turn the course. So
standing is found first, from motion over seconds, and only then are steps summed.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.earth import POLAR, position_difference
from vehnav.logs.log import Gnss
from vehnav.strapdown.quasi import wander_along
from vehnav.units import NS

Array = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

STANDING_BY_VELOCITY: Final = 0.3
"""m/s, of the mean velocity vector over 2 s: Doppler noise is 0.02 to 0.1 m/s."""
STANDING_BY_POSITION: Final = 0.5
"""m/s, of the motion between mean positions (spec C 1: the judge's limit for plain receivers)."""
POSITION_WINDOW: Final = 4.0
"""s on each side: white noise of 1 m at 1 Hz passes the limit 2 % of the time."""
VELOCITY_WINDOW: Final = 1.0
"""s on each side."""
COURSE_SPEED: Final = 1.0
"""m/s: below it the course is held."""
COURSE_WINDOW: Final = 1.5
"""s on each side, for the course of a receiver that logs no velocity (spec C 1: 3 s difference)."""
STEP: Final = 1.0
"""s: positions are averaged over it before their steps are summed."""
VELOCITY_TRUST: Final = 0.2
"""Paths by velocity and by position may differ by this share; else the velocity is not used."""
VELOCITY_SLACK: Final = 5.0
"""m: and by this much more, which noise may add."""


def tracks(gnss: Gnss) -> Array:
    """(m, 2) m: east and north of the fixes from the first one, summed along the track.

    Of a track that comes near a pole, the axes are those that are free in azimuth: the plane rolls
    along without turning (:func:`turning`).
    """
    step = position_difference(
        gnss.lat[1:], gnss.lon[1:], gnss.lat[:-1], gnss.lon[:-1], gnss.height[1:]
    )
    if np.any(np.abs(gnss.lat) > POLAR):
        step = turned(step, -turning(gnss)[:-1])
    return np.concatenate([np.zeros((1, 2)), np.cumsum(step, axis=0)])


def turning(gnss: Gnss) -> Array:
    """(m,) rad: wander angle of the axes of :func:`tracks`, zero away from the poles."""
    if not np.any(np.abs(gnss.lat) > POLAR):
        return np.zeros(gnss.t_ns.size)
    return wander_along(seconds(gnss), gnss.lat, gnss.lon)


def turned(plane: Array, angle: Array) -> Array:
    """(m, 2) vectors turned counter-clockwise by ``angle`` (m,), rad."""
    s, c = np.sin(angle), np.cos(angle)
    return np.column_stack([c * plane[:, 0] - s * plane[:, 1], s * plane[:, 0] + c * plane[:, 1]])


def _window_means(t: Array, x: Array, before: float, after: float) -> tuple[Array, Array]:
    """Means of t and x (m, k) over [t - before, t + after] around each sample."""
    lo = np.searchsorted(t, t - before - 1e-9, side="left")
    hi = np.searchsorted(t, t + after + 1e-9, side="right")
    columns = np.column_stack([t, x])
    total = np.concatenate([np.zeros((1, columns.shape[1])), np.cumsum(columns, axis=0)])
    mean = (total[hi] - total[lo]) / (hi - lo)[:, None]
    return mean[:, 0], mean[:, 1:]


def mean_motion(t: Array, position: Array, window: float) -> Array:
    """(m, 2) m/s: velocity between the mean positions of the ``window`` seconds on both sides."""
    if t.size < 2:
        return np.zeros_like(position)
    window = max(window, 1.5 * float(np.median(np.diff(t))))
    t0, before = _window_means(t, position, window, 0.0)
    t1, after = _window_means(t, position, 0.0, window)
    dt = t1 - t0
    alone = dt <= 0.0  # a fix without neighbours in the window
    velocity = (after - before) / np.where(alone, 1.0, dt)[:, None]
    slope = np.gradient(position, t, axis=0)
    return np.where(alone[:, None], slope, velocity)


def seconds(gnss: Gnss) -> Array:
    """(m,) s since the first fix."""
    return np.asarray((gnss.t_ns - gnss.t_ns[0]) * NS)


def _still_by_position(t: Array, position: Array) -> BoolArray:
    motion = mean_motion(t, position, POSITION_WINDOW)
    return np.asarray(np.hypot(motion[:, 0], motion[:, 1]) < STANDING_BY_POSITION)


def _still_by_velocity(gnss: Gnss, v_n: Array) -> BoolArray:
    v = turned(v_n[:, :2], -turning(gnss))
    _, mean = _window_means(seconds(gnss), v, VELOCITY_WINDOW, VELOCITY_WINDOW)
    return np.asarray(np.hypot(mean[:, 0], mean[:, 1]) < STANDING_BY_VELOCITY)


def trusted_velocity(gnss: Gnss) -> Array | None:
    """The receiver's velocity (m, 3) if its path agrees with the positions, else None.

    Drivers fill velocities with zeros, or with another unit; the positions are what is judged.
    """
    if gnss.v_n is None or gnss.t_ns.size < 2:
        return gnss.v_n
    t, position = seconds(gnss), tracks(gnss)
    by_position = _path_by_position(t, position, _still_by_position(t, position))[-1]
    by_velocity = _path_by_velocity(t, gnss.v_n, _still_by_velocity(gnss, gnss.v_n))[-1]
    apart = abs(by_velocity - by_position)
    return gnss.v_n if apart <= VELOCITY_TRUST * by_position + VELOCITY_SLACK else None


def standing(gnss: Gnss) -> BoolArray:
    """(m,) whether the receiver stands still at each fix."""
    v_n = trusted_velocity(gnss)
    if v_n is None:
        return _still_by_position(seconds(gnss), tracks(gnss))
    return _still_by_velocity(gnss, v_n)


def _path_by_velocity(t: Array, v_n: Array, still: BoolArray) -> Array:
    """Integral of the speed (trapezoid), zero between standing fixes."""
    speed = np.hypot(v_n[:, 0], v_n[:, 1])
    step = 0.5 * (speed[1:] + speed[:-1]) * np.diff(t)
    step[still[1:] & still[:-1]] = 0.0
    return np.concatenate([[0.0], np.cumsum(step)])


def _path_by_position(t: Array, position: Array, still: BoolArray) -> Array:
    """Steps between means over one second, zero between standing ones."""
    first = np.flatnonzero(np.diff(np.floor(t / STEP), prepend=-1.0) > 0.0)
    count = np.diff(np.append(first, t.size))
    t_mean = np.add.reduceat(t, first) / count
    mean = np.add.reduceat(position, first, axis=0) / count[:, None]
    rest = np.add.reduceat(still.astype(float), first) / count > 0.5
    step = np.hypot(*np.diff(mean, axis=0).T)
    step[rest[1:] & rest[:-1]] = 0.0
    path = np.concatenate([[0.0], np.cumsum(step)])
    # the first and last half second lie outside the means: continue at the pace of the next step
    ends = np.interp(t, t_mean, path)
    if step.size:
        pace = step[[0, -1]] / np.diff(t_mean)[[0, -1]]
        ends += np.minimum(t - t_mean[0], 0.0) * pace[0]
        ends += np.maximum(t - t_mean[-1], 0.0) * pace[1]
    return np.asarray(ends - ends[0])


def path_distance(gnss: Gnss) -> Array:
    """(m,) m: horizontal distance driven up to each fix, standing time removed.

    By the receiver's velocity where it has one that agrees with its positions to 20 %; else by
    its positions, averaged over a second.
    """
    if gnss.t_ns.size < 2:
        return np.zeros(gnss.t_ns.size)
    t, v_n = seconds(gnss), trusted_velocity(gnss)
    if v_n is not None:
        return _path_by_velocity(t, v_n, _still_by_velocity(gnss, v_n))
    position = tracks(gnss)
    return _path_by_position(t, position, _still_by_position(t, position))


def course(gnss: Gnss) -> Array:
    """(m,) rad clockwise from north: the way it drives; held while slower than 1 m/s.

    Before the first motion it is the first course; a receiver that never moves has course 0.
    """
    velocity = trusted_velocity(gnss)
    if velocity is None:
        velocity = turned(mean_motion(seconds(gnss), tracks(gnss), COURSE_WINDOW), turning(gnss))
    moving = np.hypot(velocity[:, 0], velocity[:, 1]) >= COURSE_SPEED
    moving &= ~standing(gnss)
    if not moving.any():
        return np.zeros(gnss.t_ns.size)
    angle = np.remainder(np.arctan2(velocity[:, 0], velocity[:, 1]), 2.0 * np.pi)
    last = np.maximum.accumulate(np.where(moving, np.arange(angle.size), -1))
    return np.asarray(angle[np.where(last < 0, np.argmax(moving), last)])
