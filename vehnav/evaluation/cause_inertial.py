"""Responses of a stop method without look-ahead: the linear error model with its exact maps.

The rows are those of :mod:`vehnav.aiding.error_model` (003 eq. 27 in East-North-Up, height held).
A velocity reset and a levelling are linear maps of the errors (spec B 1.3, step 4): at a stop the
velocity error vanishes, and the tilt becomes what the accelerometer error looks like.

A gyro triad turned against the accelerometers by an angle cannot be told from an accelerometer bias
of g times that angle (1 mrad: 1 mg): the attitude follows the gyros, the force the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.aiding.error_model import (
    ACCEL,
    ATTITUDE,
    GYRO,
    NAVIGATION,
    POSITION,
    STATES,
    VELOCITY,
)
from vehnav.classic import GUARD, MEAN_OFFSET
from vehnav.earth import WGS84, Ellipsoid, curvature_radii, earth_rate, normal_gravity
from vehnav.evaluation.cause_models import (
    ACCEL_PRIOR,
    HEADING_PRIOR,
    SCALE_PRIOR,
    SHEAR_PRIOR,
    TILT_PRIOR,
    Columns,
    Design,
    Motion,
    at_instants,
    drift_covariance,
    gyro_prior,
    motion_of,
    put_start_and_delay,
    start_and_delay,
)
from vehnav.legs import LegNoise
from vehnav.rotation import skew
from vehnav.trajectory import Trajectory
from vehnav.units import DEG, DEG_PER_HOUR, MILLI_G

Array = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

AXES: Final = ("right", "forward", "up")
SETTLED: Final = 1.0
"""s into a stop from which levelling works, about."""
WALK: Final = 0.05
"""Walk of the accelerometer bias per sqrt(s) over its white noise: the ratio that the project takes
for gyros (:func:`vehnav.classic.noise_from_rest`)."""


@dataclass(frozen=True)
class _Layout:
    """Which columns are which."""

    start: slice
    delay: slice
    heading: slice
    gyro: slice
    scale: slice
    accel: slice
    accel_scale: slice
    accel_right: slice
    shear: slice
    level: slice
    gyro_drift: slice
    accel_drift: slice


def inertial_design(
    track: Trajectory,
    t_ns: TimeArray,
    *,
    levelling: bool,
    reset: bool,
    noise: LegNoise,
    position_sigma: float,
) -> Design:
    """Columns of a method that integrates forward with the given corrections at the stops.

    Parameters
    ----------
    track : Trajectory
        What the equations are linearised about: the best track of the drive there is.
    t_ns : (m,) int64
        Judged instants, from the first stop on.
    levelling, reset : bool
        What the method does at a stop.
    noise : LegNoise
    position_sigma : float
        m, of the start on each axis.
    """
    motion = motion_of(track)
    edges = motion.edges()
    columns, at = _columns(motion, edges, noise, position_sigma, levelling=levelling)
    state, held = _start(motion, at, columns.count)
    moved, turn = _propagate(motion, edges, at, state, held, levelling=levelling, reset=reset)
    response = at_instants(motion.seconds(t_ns), motion.t, moved)
    put_start_and_delay(response, at.start, at.delay, track, t_ns)
    noise_names = ("level", "gyro-drift", "accel-drift")
    return Design(tuple(columns.sources), response, columns.prior(), turn, noise_names)


def _columns(
    motion: Motion, edges: Array, noise: LegNoise, position_sigma: float, *, levelling: bool
) -> tuple[Columns, _Layout]:
    columns = Columns()
    add = columns.add
    start, delay = start_and_delay(columns, position_sigma)
    heading = add("heading", "initial heading", "deg", DEG, HEADING_PRIOR)
    gyro = [
        add(f"gyro-bias-{axis}", f"gyro bias ({axis})", "deg/h", DEG_PER_HOUR, gyro_prior(noise))
        for axis in AXES
    ]
    scale = add("gyro-scale-up", "gyro scale (up)", "%", 0.01, SCALE_PRIOR)
    accel = [
        add(f"accel-bias-{axis}", f"accelerometer bias ({axis})", "mg", MILLI_G, ACCEL_PRIOR)
        for axis in AXES[:2]
    ]
    accel_scale = add("accel-scale", "accelerometer scale (forward)", "%", 0.01, SCALE_PRIOR)
    right = add("accel-scale-right", "accelerometer scale (right)", "%", 0.01, SCALE_PRIOR)
    shear = add("accel-shear", "angle between the accelerometers", "deg", DEG, SHEAR_PRIOR)
    levels = motion.stops if levelling else min(motion.stops, 1)
    sigma = [noise.level] * (2 * levels) if levels else [TILT_PRIOR] * 2
    name = "levels at the stops" if levels > 1 else "level at the start"
    level = add("level", name, "deg", DEG, sigma)
    one = drift_covariance(edges, noise.gyro_white, noise.gyro_bias_walk)
    gyro_drift = add("gyro-drift", "gyro noise and drift under way", "deg/h", DEG_PER_HOUR,
                     np.kron(one, np.eye(3)))  # fmt: skip
    one = drift_covariance(edges, noise.accel_white, WALK * noise.accel_white)
    accel_drift = add("accel-drift", "accelerometer noise and drift under way", "mg", MILLI_G,
                      np.kron(one, np.eye(2)))  # fmt: skip
    return columns, _Layout(
        start, delay, heading, slice(gyro[0].start, gyro[2].stop), scale,
        slice(accel[0].start, accel[1].stop), accel_scale, right, shear,
        level, gyro_drift, accel_drift,
    )  # fmt: skip


def _start(motion: Motion, at: _Layout, count: int) -> tuple[Array, Array]:
    """State (9, p) at the first instant, and constant sensor errors (6, p: accel, gyro).

    Levelled at the first stop, an accelerometer bias is a tilt; and as the gyro bias found there
    is the mean rate less the Earth rate in the computed axes, an attitude error makes a gyro error
    ``C_nb^T (alpha x omega_ie)``: the platform stands still then, and errs when the vehicle turns.
    """
    state, held = np.zeros((NAVIGATION, count)), np.zeros((6, count))
    state[ATTITUDE.start + 2, at.heading] = 1.0
    held[0:2, at.accel] = np.eye(2)
    held[3:6, at.gyro] = np.eye(3)
    state[ATTITUDE.start : ATTITUDE.start + 2, at.level.start : at.level.start + 2] = np.eye(2)
    if motion.stops:
        c_nb = motion.c_nb[0]
        state[ATTITUDE.start : ATTITUDE.start + 2] += _level(c_nb, _gravity(motion)) @ held[:3]
        omega_ie = np.array(earth_rate(float(motion.lat[0]), WGS84))
        held[3:6] += c_nb.T @ np.cross(state[ATTITUDE].T, omega_ie).T
    return state, held


def _gravity(motion: Motion) -> float:
    return float(normal_gravity(float(motion.lat[0]), float(motion.height[0]), WGS84))


def _level(c_nb: Array, gravity: float) -> Array:
    """(2, 3): tilt alpha_1,2 that levelling leaves per accelerometer error in body axes.

    The level force vanishes: ``-g alpha_2 + (C d_f)_1 = 0``, ``g alpha_1 + (C d_f)_2 = 0``.
    """
    return np.asarray(np.stack([-c_nb[1], c_nb[0]]) / gravity)


def error_matrices(
    lat: Array, v_n: Array, c_nb: Array, *, height: float, earth: Ellipsoid = WGS84
) -> Array:
    """(g, 9, 15), 1/s: :func:`vehnav.aiding.error_model.error_matrix` along a drive, height held.

    All instants at once in East-North-Up. Radii and gravity are those of the first instant: they
    change by 1e-5 over 100 km.

    Parameters
    ----------
    lat : (g,)
        rad
    v_n : (g, 3), c_nb : (g, 3, 3)
    height : float
        m
    """
    radius_m, radius_n = curvature_radii(float(lat[0]), height, earth)
    gravity = normal_gravity(float(lat[0]), height, earth)
    zero = np.zeros_like(lat)
    u = earth.omega_ie * np.stack([zero, np.cos(lat), np.sin(lat)], axis=1)
    east = v_n[:, 0] / radius_n
    omega = np.stack([-v_n[:, 1] / radius_m, east, east * np.tan(lat)], axis=1)
    beta = np.zeros((NAVIGATION // 3, STATES))  # alpha - gamma in terms of the states
    beta[:, ATTITUDE] = np.eye(3)
    beta[0, 1], beta[1, 0] = 1.0 / radius_m, -1.0 / radius_n
    v_x, u_x = skew(v_n), skew(u)
    f = np.zeros((lat.size, NAVIGATION, STATES))
    f[:, POSITION] = v_x @ beta
    f[:, POSITION, POSITION] -= skew(omega)
    f[:, POSITION, VELOCITY] += np.eye(3)
    f[:, VELOCITY] = -v_x @ u_x @ beta  # V x (beta x u)
    f[:, VELOCITY, VELOCITY] -= skew(omega + 2.0 * u)
    f[:, 3, 7] -= gravity
    f[:, 4, 6] += gravity
    f[:, VELOCITY, ACCEL] = c_nb
    f[:, VELOCITY, GYRO] = v_x @ c_nb
    f[:, ATTITUDE] = -skew(omega + u) @ beta
    f[:, ATTITUDE, GYRO] -= c_nb
    f[:, 2], f[:, 5] = 0.0, 0.0
    f[:, 6] -= f[:, 1] / radius_m  # gamma' of the position's own rate
    f[:, 7] += f[:, 0] / radius_n
    return f


def _steps(motion: Motion) -> tuple[Array, Array]:
    """Transition (g-1, 9, 9) and response to constant sensor errors (g-1, 9, 6) of every step."""
    f = error_matrices(motion.lat, motion.v_n, motion.c_nb, height=float(motion.height[0]))
    f = 0.5 * (f[1:] + f[:-1])
    dt = np.diff(motion.t)[:, None, None]
    now = f[:, :, :NAVIGATION] * dt
    phi = np.eye(NAVIGATION) + now + 0.5 * now @ now
    drive = f[:, :, ACCEL.start : GYRO.stop] * dt
    return phi, drive + 0.5 * now @ drive


def _forces(motion: Motion) -> Array:
    """(g-1, 2) m/s2: mean specific force right and forward over each step."""
    dt = np.diff(motion.t)[:, None]
    f_n = np.diff(motion.v_n, axis=0) / dt
    f_n[:, 2] += _gravity(motion)
    axes = 0.5 * (motion.c_nb[1:, :, :2] + motion.c_nb[:-1, :, :2])
    return np.asarray(np.einsum("kij,ki->kj", axes, f_n))


def _kept_tilt(motion: Motion) -> Array:
    """(g-1,): what each step of a stop leaves of a tilt, 1 where nothing is levelled.

    The running mean has the gain 1/(t + 0.5 s): a tilt at t is (t + 0.5)/(t' + 0.5) of itself at
    t', and a gyro bias keeps half of what it turns in the stop.
    """
    kept = np.ones(motion.t.size - 1)
    for number in range(motion.stops):
        inside = np.flatnonzero(motion.stop == number)
        t = motion.t[inside]
        since = np.clip(np.minimum(t, t[-1] - GUARD) - t[0] - SETTLED, 0.0, None)
        kept[inside[:-1]] = (since[:-1] + MEAN_OFFSET) / (since[1:] + MEAN_OFFSET)
    return kept


def _propagate(
    motion: Motion,
    edges: Array,
    at: _Layout,
    state: Array,
    held: Array,
    *,
    levelling: bool,
    reset: bool,
) -> tuple[Array, Array]:
    """Position (g, 2, p) and attitude (g, 3, p) errors along the drive, per unit of the columns."""
    phi, drive = _steps(motion)
    turning = motion.turned()[:, 2] / np.diff(motion.t)
    force, gravity = _forces(motion), _gravity(motion)
    kept = _kept_tilt(motion)
    middle = 0.5 * (motion.t[1:] + motion.t[:-1])
    piece = np.clip(np.searchsorted(edges, middle, side="right") - 1, 0, edges.size - 2)
    moved = np.zeros((motion.t.size, 2, state.shape[1]))
    turn = np.zeros((motion.t.size, 3, state.shape[1]))
    turn[0] = state[ATTITUDE]
    for k in range(motion.t.size - 1):
        now = held.copy()
        now[1, at.accel_scale], now[0, at.accel_right] = force[k, 1], force[k, 0]
        now[0, at.shear], now[1, at.shear] = force[k, 1], force[k, 0]
        now[5, at.scale] = turning[k]
        first = at.gyro_drift.start + 3 * int(piece[k])
        now[3:6, first : first + 3] += np.eye(3)
        first = at.accel_drift.start + 2 * int(piece[k])
        now[0:2, first : first + 2] += np.eye(2)
        state = phi[k] @ state + drive[k] @ now
        stop = int(motion.stop[k + 1])
        if stop >= 0 and reset:
            state[VELOCITY] = 0.0
        if kept[k] < 1.0 and levelling:
            level = _level(motion.c_nb[k + 1], gravity) @ now[:3]
            first = at.level.start + 2 * stop
            level[:, first : first + 2] += np.eye(2)
            tilt = slice(ATTITUDE.start, ATTITUDE.start + 2)
            state[tilt] = level + kept[k] * (state[tilt] - level)
        moved[k + 1], turn[k + 1] = state[POSITION.start : POSITION.start + 2], state[ATTITUDE]
    return moved, turn
