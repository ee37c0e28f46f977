"""Responses of the offline solution: what stops cannot see.

Its velocity and level are tied down at both ends of every leg, and the gyro bias at the stops. What
is left turns the track (heading, and what changes it under way) or stretches it (accelerometer
scales), and the noise of each leg.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.evaluation.cause_models import (
    DRIFT_PRIOR,
    HEADING_PRIOR,
    SCALE_PRIOR,
    SHEAR_PRIOR,
    Columns,
    Design,
    Motion,
    at_instants,
    motion_of,
    put_start_and_delay,
    start_and_delay,
)
from vehnav.legs import LegNoise
from vehnav.trajectory import Trajectory
from vehnav.units import DEG, DEG_PER_HOUR

Array = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

GRAVITY: Final = 9.81
"""m/s2; its part along a slope is all that matters here."""
SHAPES: Final = (1.0, 0.5, 0.25)
"""Sigmas of the three shapes of a leg's error over :func:`leg_sigma`: what stays as a shift, and
two that are gone at its end (a position between two stops is less well tied than at them)."""


def offline_design(
    track: Trajectory, t_ns: TimeArray, *, noise: LegNoise, position_sigma: float
) -> Design:
    """Columns of the default method.

    A heading error beta (clockwise) turns what the velocity gains: ``d dV_E = beta dV_N``,
    ``d dV_N = -beta dV_E``; a gyro error about up changes it by ``d beta = -d omega_z``. The
    accelerometers err in proportion to the force, less the part that levelling took for tilt at
    both ends of the leg. What is found of a velocity error at the end of a leg was distributed over
    it linearly (:func:`tied`): a constant heading error turns the way, a forward scale stretches
    it.

    Parameters
    ----------
    track : Trajectory
    t_ns : (m,) int64
        Judged instants, from the first stop on.
    noise : LegNoise
    position_sigma : float
        m, of the start on each axis.
    """
    motion = motion_of(track)
    legs, t = motion.legs(), motion.t
    duration = np.array([t[b] - t[a] for a, b in legs])
    columns = Columns()
    add = columns.add
    start, delay = start_and_delay(columns, position_sigma)
    heading = add("heading", "initial heading", "deg", DEG, HEADING_PRIOR)
    scale = add("gyro-scale-up", "gyro scale (up)", "%", 0.01, SCALE_PRIOR)
    bias = add("gyro-bias-up", "gyro bias under way (up)", "deg/h", DEG_PER_HOUR, DRIFT_PRIOR)
    forward = add("accel-scale", "distance scale (accelerometer forward)", "%", 0.01, SCALE_PRIOR)
    right = add("accel-scale-right", "accelerometer scale (right)", "%", 0.01, SCALE_PRIOR)
    shear = add("accel-shear", "angle between the accelerometers", "deg", DEG, SHEAR_PRIOR)
    drift = add("heading-drift", "gyro noise and drift on the legs", "deg", DEG,
                noise.gyro_white * np.sqrt(duration))  # fmt: skip
    sigma = np.outer([leg_sigma(x, noise) for x in duration], np.repeat(SHAPES, 2))
    leg = add("leg", "noise of accelerometers and levels on the legs", "m", 1.0, sigma.ravel())
    beta = np.zeros((t.size, columns.count))
    beta[:, heading] = 1.0
    beta[1:, scale] = -np.cumsum(motion.turned()[:, 2:], axis=0)
    moving = np.diff(t) * ((motion.stop[1:] < 0) | (motion.stop[:-1] < 0))
    beta[1:, bias] = -np.cumsum(moving)[:, None]
    for k, (a, b) in enumerate(legs):
        beta[:, drift.start + k] = np.clip((t - t[a]) / (t[b] - t[a]), 0.0, 1.0)
    gained = np.diff(motion.v_n[:, :2], axis=0)
    across = np.stack([gained[:, 1], -gained[:, 0]], axis=1)
    middle = 0.5 * (beta[1:] + beta[:-1])
    rate = tied(motion, legs, across[:, :, None] * middle[:, None, :])
    for columns_of, matrix in ((forward, [[0, 0], [0, 1]]), (right, [[1, 0], [0, 0]]),
                               (shear, [[0, 1], [1, 0]])):  # fmt: skip
        rate[:, :, columns_of] = velocity_errors(motion, legs, np.array(matrix, float))[:, :, None]
    moved = np.zeros_like(rate)
    np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t)[:, None, None], axis=0, out=moved[1:])
    for k, (a, b) in enumerate(legs):
        first = leg.start + 2 * len(SHAPES) * k
        for j, shape in enumerate(_shapes(np.clip((t - t[a]) / (t[b] - t[a]), 0.0, 1.0))):
            for axis in range(2):
                moved[:, axis, first + 2 * j + axis] = shape
    response = at_instants(motion.seconds(t_ns), t, moved)
    put_start_and_delay(response, start, delay, track, t_ns)
    return Design(
        tuple(columns.sources), response, columns.prior(),
        np.zeros((0, 3, columns.count)), ("heading-drift", "leg"),
    )  # fmt: skip


def tied(motion: Motion, legs: list[tuple[int, int]], gained: Array) -> Array:
    """(g, 2, p) m/s: velocity errors from their increments (g-1, 2, p), zero at both ends of a leg.

    A leg without a stop at its end is left open.
    """
    out = np.zeros((motion.t.size, *gained.shape[1:]))
    for a, b in legs:
        found = np.cumsum(gained[a:b], axis=0)
        out[a + 1 : b + 1] = found
        if motion.stop[b] >= 0:
            s = (motion.t[a + 1 : b + 1] - motion.t[a]) / (motion.t[b] - motion.t[a])
            out[a + 1 : b + 1] -= s[:, None, None] * found[-1]
    return out


def velocity_errors(motion: Motion, legs: list[tuple[int, int]], matrix: Array) -> Array:
    """(g, 2) m/s: velocity error per unit of an accelerometer error ``matrix`` (2, 2).

    The error is ``d f = matrix @ f`` with f the specific force right and forward.
    """
    dt = np.diff(motion.t)
    f_n = np.diff(motion.v_n, axis=0) / dt[:, None]
    f_n[:, 2] += GRAVITY
    c = 0.5 * (motion.c_nb[1:] + motion.c_nb[:-1])[:, :, :2]
    error = np.einsum("kij,jl,kml,km->ki", c, matrix, c, f_n)[:, :2]
    for a, b in legs:
        first = _level_error(motion.c_nb[a], matrix)
        last = _level_error(motion.c_nb[b], matrix) if motion.stop[b] >= 0 else first
        s = (0.5 * (motion.t[a:b] + motion.t[a + 1 : b + 1]) - motion.t[a])[:, None]
        error[a:b] -= first + s / (motion.t[b] - motion.t[a]) * (last - first)
    return tied(motion, legs, (error * dt[:, None])[:, :, None])[:, :, 0]


def _level_error(c_nb: Array, matrix: Array) -> Array:
    """(2,) m/s2: error of the level force at rest, which levelling takes for tilt."""
    return np.asarray(c_nb[:2, :2] @ matrix @ (GRAVITY * c_nb[2, :2]))


def _shapes(s: Array) -> tuple[Array, Array, Array]:
    """Error of a leg over its time s from 0 to 1: a shift that stays, a bump, a bump both ways."""
    bump = (4.0 * s * (1.0 - s)) ** 2
    return s * s * (3.0 - 2.0 * s), bump, 3.5 * bump * (1.0 - 2.0 * s)


def leg_sigma(duration: float, noise: LegNoise) -> float:
    """Position, m per axis, at the end of a leg whose velocity and tilt are known at both ends.

    Of the triple integral of white noise its first two integrals at the end leave the variance
    g^2 q T^5 / 720, of the double integral the first leaves s T^3 / 12 (Gaussian conditioning).
    """
    gyro = (noise.gravity * noise.gyro_white) ** 2 * duration**5 / 720.0
    return float(np.sqrt(gyro + noise.accel_white**2 * duration**3 / 12.0))
