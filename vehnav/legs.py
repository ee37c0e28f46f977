"""The drive between two stops, known from both ends (beyond paper 002).

A leg runs from the last instant of one stop to the first of the next. At its end the dead-reckoned
velocity should be zero and the platform level; what is found instead, velocity and tilt, is the
work of a residual gyro bias, an accelerometer bias, the noise of the levels and white noise. Each
of them has a known course over the leg, by the linear error equations (001 eq. 10-12)::

    d psi/dt = C_nb d omega,    d dv/dt = psi x f_n + C_nb d f,    d dr/dt = dv

with psi the rotation from the true to the computed frame, dv, dr the errors of velocity and
position (estimate minus truth), d omega and d f the sensor errors in body axes. So the errors found
at the end, weighed by their covariance, tell the errors at every instant: Gaussian regression with
four observations a leg. A plain linear distribution of the velocity is the special case of one
constant acceleration error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vehnav.rotation import skew

Array = npt.NDArray[np.float64]

PSI = slice(0, 3)
VELOCITY = slice(3, 5)
POSITION = slice(5, 7)
STATES = 7
"""Errors of a leg: psi east, north, up; velocity east, north; position east, north."""
OBSERVED = [3, 4, 0, 1]
"""What a stop shows of them: velocity east, north; tilt east, north."""


@dataclass(frozen=True)
class LegNoise:
    """One-sigma figures of what goes wrong on a leg.

    Attributes
    ----------
    gyro_white : float
        rad/sqrt(s), while driving.
    accel_white : float
        m/s/sqrt(s), while driving.
    gyro_bias_walk : float
        rad/s/sqrt(s): how fast the gyro bias leaves the one interpolated between stops.
    accel_bias : float
        m/s2, constant over the log.
    level : float
        rad, of the level found at a stop (road and suspension included).
    gravity : float
        m/s2
    """

    gyro_white: float
    accel_white: float
    gyro_bias_walk: float
    accel_bias: float
    level: float
    gravity: float


@dataclass(frozen=True)
class Sensitivity:
    """Errors of a leg per unit of a source, at m instants of a coarse grid.

    Attributes
    ----------
    t : (m,)
        s since the start of the leg.
    gyro, accel, tilt : (m, 7, 3)
        Per unit of constant d omega (body), d f (body), and of psi at the start.
    level_start, level_end : (3, 3)
        psi that levelling leaves per unit d f: the accelerometer's error looks like tilt.
    """

    t: Array
    gyro: Array
    accel: Array
    tilt: Array
    level_start: Array
    level_end: Array


@dataclass(frozen=True)
class LegErrors:
    """What a leg's ends tell of its inside.

    Attributes
    ----------
    t : (m,)
        s since the start of the leg.
    mean : (m, 7)
        Expected errors (estimate minus truth), to be subtracted.
    variance : (m, 7)
        Variances of what remains.
    end_covariance : (2, 2)
        Of the position at the end of the leg, m2.
    gyro_bias : (3,)
        Expected d omega, rad/s.
    """

    t: Array
    mean: Array
    variance: Array
    end_covariance: Array
    gyro_bias: Array


def sensitivity(t: Array, c_nb: Array, v_n: Array, *, gravity: float) -> Sensitivity:
    """Integrate the error equations for unit sources along a leg.

    Parameters
    ----------
    t : (m,)
        s, the coarse grid.
    c_nb : (m, 3, 3), v_n : (m, 3)
        The dead-reckoned attitude and velocity on it.
    gravity : float
        m/s2
    """
    t = t - t[0]
    m = t.size
    f_n = np.gradient(v_n, t, axis=0)
    f_n[:, 2] += gravity
    cross_f = -skew(f_n)  # psi x f = -[f x] psi
    gyro, accel, tilt = (np.zeros((m, STATES, 3)) for _ in range(3))
    gyro[:, PSI] = _cumulative(t, c_nb)
    tilt[:, PSI] = np.eye(3)
    for out, drive in (
        (gyro, cross_f @ gyro[:, PSI]),
        (accel, c_nb),
        (tilt, cross_f),
    ):
        out[:, VELOCITY] = _cumulative(t, drive)[:, :2]
        out[:, POSITION] = _cumulative(t, out[:, VELOCITY])
    return Sensitivity(t, gyro, accel, tilt, _level(c_nb[0], gravity), _level(c_nb[-1], gravity))


def fit_legs(
    legs: list[Sensitivity],
    found: Array,
    noise: LegNoise,
    *,
    gyro_applied: Array | None = None,
    accel_applied: Array | None = None,
) -> tuple[list[LegErrors], Array]:
    """Errors of every leg from what was found at the stops, and the common accelerometer bias.

    Parameters
    ----------
    legs : list of Sensitivity
    found : (legs, 4)
        Velocity (east, north, m/s) before the reset and tilt (east, north, rad) that levelling
        took out, at the end of each leg.
    noise : LegNoise
    gyro_applied : (legs, 3), accel_applied : (3,)
        Corrections that the solution has in it already (a second pass): the priors stay those of
        the uncorrected sensor.

    Returns
    -------
    errors : list of LegErrors
    accel_bias : (3,)
        m/s2, body, beyond ``accel_applied``.
    """
    gyro_mean = np.zeros((len(legs), 3)) if gyro_applied is None else -gyro_applied
    accel_mean = np.zeros(3) if accel_applied is None else -accel_applied
    parts = [_Leg(leg, noise) for leg in legs]
    information = np.eye(3) / noise.accel_bias**2
    score = information @ accel_mean
    for part, z, mean in zip(parts, found, gyro_mean, strict=True):
        weighted = part.h_accel.T @ part.inverse
        information = information + weighted @ part.h_accel
        score = score + weighted @ (z - part.h_gyro @ mean)
    covariance: Array = np.asarray(np.linalg.inv(information), dtype=np.float64)
    accel_bias: Array = np.asarray(covariance @ score, dtype=np.float64)
    errors = [
        part.errors(z, mean, accel_bias, covariance)
        for part, z, mean in zip(parts, found, gyro_mean, strict=True)
    ]
    return errors, accel_bias


def open_leg(leg: Sensitivity, noise: LegNoise) -> LegErrors:
    """Variances on a stretch whose far end is no stop: before the first or after the last."""
    part = _Leg(leg, noise)
    accel = part.j_accel @ np.diag([noise.accel_bias**2] * 3) @ part.j_accel.transpose(0, 2, 1)
    full = part.prior + accel
    variance = np.diagonal(full, axis1=1, axis2=2)
    end = full[-1][POSITION, POSITION]
    return LegErrors(leg.t, np.zeros((leg.t.size, STATES)), variance, end, np.zeros(3))


class _Leg:
    """Covariances of one leg: of its errors, of what its end shows, and between the two."""

    def __init__(self, leg: Sensitivity, noise: LegNoise) -> None:
        self.leg = leg
        duration = leg.t[-1]
        self.gyro_variance = noise.gyro_bias_walk**2 * duration
        self.j_accel = leg.accel + leg.tilt @ leg.level_start
        self.h_gyro = leg.gyro[-1][OBSERVED]
        self.h_accel = self.j_accel[-1][OBSERVED]
        self.h_accel[2:] -= leg.level_end[:2]
        h_tilt = leg.tilt[-1][OBSERVED][:, :2]
        j_tilt = leg.tilt[:, :, :2]
        level = noise.level**2
        self.cross = (
            self.gyro_variance * leg.gyro @ self.h_gyro.T
            + level * j_tilt @ h_tilt.T
            + _noise_cross(leg.t, noise)
        )
        seen = (
            self.gyro_variance * self.h_gyro @ self.h_gyro.T
            + level * h_tilt @ h_tilt.T
            + _noise_cross(leg.t[-1:], noise, duration)[0][OBSERVED]
        )
        seen[2:, 2:] += level * np.eye(2)  # the level at the end is as uncertain as at the start
        self.inverse = np.linalg.inv(0.5 * (seen + seen.T))
        self.prior = (
            self.gyro_variance * leg.gyro @ leg.gyro.transpose(0, 2, 1)
            + level * j_tilt @ j_tilt.transpose(0, 2, 1)
            + _noise_variance(leg.t, noise)
        )

    def errors(self, z: Array, gyro_mean: Array, accel: Array, covariance: Array) -> LegErrors:
        """Regression on the four observations ``z``."""
        gain = self.cross @ self.inverse
        rest = z - self.h_gyro @ gyro_mean - self.h_accel @ accel
        mean = self.leg.gyro @ gyro_mean + self.j_accel @ accel + gain @ rest
        m = self.j_accel - gain @ self.h_accel
        full = (
            self.prior
            - gain @ self.cross.transpose(0, 2, 1)
            + m @ covariance @ m.transpose(0, 2, 1)
        )
        variance = np.maximum(np.diagonal(full, axis1=1, axis2=2), 0.0)
        gyro = gyro_mean + self.gyro_variance * self.h_gyro.T @ self.inverse @ rest
        return LegErrors(self.leg.t, mean, variance, full[-1][POSITION, POSITION], gyro)


def _level(c_nb: Array, gravity: float) -> Array:
    """(3, 3) psi per unit d f that makes the computed level force zero: psi x g + C d f = 0."""
    out = np.zeros((3, 3))
    out[0], out[1] = c_nb[1] / gravity, -c_nb[0] / gravity
    return out


def _noise_variance(t: Array, noise: LegNoise) -> Array:
    """(m, 7, 7): covariance of the errors at t from white noise since the start, level road.

    Tilt is a random walk, velocity g times its integral, position the integral of that.
    """
    q, s, g = noise.gyro_white**2, noise.accel_white**2, noise.gravity
    out = np.zeros((t.size, STATES, STATES))
    out[:, [0, 1, 2], [0, 1, 2]] = (q * t)[:, None]
    for k, tilt, sign in ((0, 1, 1.0), (1, 0, -1.0)):  # dv_E = g psi_N, dv_N = -g psi_E
        v, r = 3 + k, 5 + k
        out[:, v, v] = g * g * q * t**3 / 3.0 + s * t
        out[:, r, r] = g * g * q * t**5 / 20.0 + s * t**3 / 3.0
        out[:, v, r] = out[:, r, v] = g * g * q * t**4 / 8.0 + s * t**2 / 2.0
        out[:, v, tilt] = out[:, tilt, v] = sign * g * q * t**2 / 2.0
        out[:, r, tilt] = out[:, tilt, r] = sign * g * q * t**3 / 6.0
    return out


def _noise_cross(t: Array, noise: LegNoise, duration: float | None = None) -> Array:
    """(m, 7, 4): covariance between the errors at t and the observed ones at the end.

    The noise after t moves the end but not the error at t; until then both share it.
    """
    end = t[-1] if duration is None else duration
    now = _noise_variance(t, noise)
    rest, g = end - t, noise.gravity
    cross = np.zeros((t.size, STATES, 4))
    for k, tilt, sign in ((0, 1, 1.0), (1, 0, -1.0)):
        cross[:, :, k] = now[:, :, 3 + k] + sign * g * rest[:, None] * now[:, :, tilt]
        cross[:, :, 2 + k] = now[:, :, k]
    return cross


def _cumulative(t: Array, y: Array) -> Array:
    """Integral of y (m, ...) from the first instant, trapezoid."""
    step = np.diff(t).reshape((-1,) + (1,) * (y.ndim - 1))
    out = np.zeros_like(y)
    np.cumsum(0.5 * (y[1:] + y[:-1]) * step, axis=0, out=out[1:])
    return out
