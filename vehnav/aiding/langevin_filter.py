"""What paper 004 announces: a nonlinear filter on its model (16), with the position of GNSS.

The state is the model's own: latitude, longitude, height, velocity and the nine direction cosines,
15 numbers; there are no biases, for the paper takes the sensors as calibrated. An extended Kalman
filter: the state by Runge-Kutta, the covariance by the Jacobian of the drift and the noise input
F0, the measurement in metres. The direction cosines keep their six conditions in the prediction;
an update leaves them to the second order, so the matrix is made orthonormal after it.

The model is singular at the poles, as the paper's coordinates are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vehnav.aiding.kalman import propagate, symmetrise, transition_rows, update
from vehnav.earth import WGS84, Ellipsoid, curvature_radii, radii
from vehnav.kernel import entry_kernel, kernel
from vehnav.rotation import skew
from vehnav.strapdown.langevin import GravityInput, c_nb_of, rk4_step, state_of, write_state
from vehnav.strapdown.langevin_covariance import fill_jacobian

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

LANGEVIN_STATES = 15
ALL = 1e9
"""Sigmas of an innovation: none is weighed down or rejected."""


@dataclass(frozen=True)
class LangevinSolution:
    """At the m epochs, after the fix of each.

    Attributes
    ----------
    states : (m, 15)
    covariance : (m, 15, 15)
    """

    states: Array
    covariance: Array


@kernel
def add_noise(p: Array, y: Array, accel: float, gyro: float, dt: float, g: Array) -> None:
    """P += F0 Q F0^T dt of (16); ``g`` (15, 6): room for F0."""
    g[:, :] = 0.0
    for a in range(3):
        for j in range(3):
            g[3 + a, j] = y[6 + 3 * j + a] * accel
            # column j of M [v x]: v_(j+2) M_(j+1) - v_(j+1) M_(j+2)
            g[6 + 3 * j + a, 3 + (j + 2) % 3] = y[6 + 3 * ((j + 1) % 3) + a] * gyro
            g[6 + 3 * j + a, 3 + (j + 1) % 3] = -y[6 + 3 * ((j + 2) % 3) + a] * gyro
    for a in range(3, 15):
        for b in range(3, 15):
            total = 0.0
            for j in range(6):
                total += g[a, j] * g[b, j]
            p[a, b] += total * dt


@kernel
def position_measurement(h: Array, y: Array, fix: Array, j: int, earth: Ellipsoid) -> float:
    """North (0), east (1) or up (2) of the state minus that of the fix, m, and its row."""
    radius_m, radius_n = curvature_radii(y[0], y[2], earth)
    scale = 1.0
    if j == 0:
        scale = radius_m
    if j == 1:
        scale = radius_n * np.cos(y[0])
    h[:] = 0.0
    h[j] = scale
    return float((y[j] - fix[j]) * scale)


@kernel
def orthonormalise(y: Array) -> None:
    """Direction cosines to the nearest orthonormal ones: M <- M (3 - M^T M) / 2, repeated."""
    for _ in range(6):
        old = y[6:].copy()
        for j in range(3):
            for a in range(3):
                y[6 + 3 * j + a] = 1.5 * old[3 * j + a]
            for k in range(3):
                dot = 0.0
                for a in range(3):
                    dot += old[3 * j + a] * old[3 * k + a]
                for a in range(3):
                    y[6 + 3 * j + a] -= 0.5 * dot * old[3 * k + a]


@entry_kernel
def run_langevin(
    t: Array,
    z: Array,
    epochs: IntArray,
    fix: IntArray,
    fixes: Array,
    fix_sigma: float,
    noise: tuple[float, float],
    gravity: GravityInput,
    earth: Ellipsoid,
    states: Array,
    covariance: Array,
) -> None:
    """The loop over epochs; row 0 of ``states`` and ``covariance`` holds the start."""
    n = LANGEVIN_STATES
    y, p = states[0].copy(), covariance[0].copy()
    a, phi, work, g = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, 6))
    x, h, gain, mean = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(6)
    for e in range(epochs.shape[0]):
        if e > 0:
            first, last = epochs[e - 1], epochs[e]
            length = t[last] - t[first]
            mean[:] = 0.0
            before = y.copy()
            state = state_of(y)
            for k in range(first, last):
                dt = t[k + 1] - t[k]
                held = ((z[k, 0], z[k, 1], z[k, 2]), (z[k, 3], z[k, 4], z[k, 5]))
                state = rk4_step(state, dt, (held, held, held), False, gravity, earth)
                for j in range(6):
                    mean[j] += z[k, j] * dt / length
            write_state(y, state)
            middle = 0.5 * (before + y)
            fill_jacobian(a, middle, mean, False, gravity, earth)
            transition_rows(a, length, phi)
            add_noise(p, before, noise[0], noise[1], 0.5 * length, g)
            propagate(p, phi, work)
            add_noise(p, y, noise[0], noise[1], 0.5 * length, g)
        if fix[e] >= 0:
            x[:] = 0.0
            for j in range(3):
                found = position_measurement(h, y, fixes[fix[e]], j, earth)
                update(x, p, h, found, fix_sigma * fix_sigma, ALL, ALL, gain)
            for j in range(n):
                y[j] -= x[j]
            orthonormalise(y)
        symmetrise(p)
        states[e] = y
        covariance[e] = p


def filter_langevin(
    t: Array,
    Z: Array,
    Y0: Array,
    P0: Array,
    *,
    epochs: IntArray,
    fix: IntArray,
    fixes: Array,
    fix_sigma: float,
    accel_density: float,
    gyro_density: float,
    gravity: GravityInput,
    earth: Ellipsoid = WGS84,
) -> LangevinSolution:
    """Filter measurements of the inertial sensors with positions of GNSS.

    Parameters
    ----------
    t : (n,)
        s.
    Z : (n-1, 6)
        Specific force, m/s2, and angular rate, rad/s, held over the steps: means over them.
    Y0, P0 : (15,), (15, 15)
        At t[0]; the covariance of the direction cosines by :func:`start_covariance`.
    epochs : (m,) int64
        Instants of the covariance, the first one 0.
    fix : (m,) int64
        Number of the fix of each epoch, -1: none.
    fixes : (k, 3)
        lat rad, lon rad, h m.
    fix_sigma : float
        m per axis.
    accel_density, gyro_density : float
        White noise, m/s2/sqrt(Hz), rad/s/sqrt(Hz).
    gravity : GravityInput
        Height at which gravity is taken.
    """
    m = epochs.size
    states, covariance = np.zeros((m, LANGEVIN_STATES)), np.zeros((m, 15, 15))
    states[0], covariance[0] = Y0, P0
    run_langevin(
        np.require(t, float, ["C", "W"]), np.require(Z, float, ["C", "W"]),
        np.require(epochs, np.int64, ["C", "W"]), np.require(fix, np.int64, ["C", "W"]),
        np.require(fixes, float, ["C", "W"]), float(fix_sigma),
        (float(accel_density), float(gyro_density)), gravity, earth, states, covariance,
    )  # fmt: skip
    return LangevinSolution(states, covariance)


def attitude_rows(y: npt.ArrayLike) -> Array:
    """(..., 9, 3): direction cosines by columns per radian of psi, ``C' = (1 - [psi x]) C``."""
    c = c_nb_of(y)
    unit = np.stack([skew(e) for e in np.eye(3)])
    turned = -np.einsum("iab,...bj->...jai", unit, c)
    return np.asarray(turned.reshape(*turned.shape[:-3], 9, 3))


def start_covariance(y: Array, navigation: Array, *, earth: Ellipsoid = WGS84) -> Array:
    """P0 (15, 15) of that of position (m, east, north, up), velocity and psi (9, 9)."""
    g = error_rows(y, earth=earth)
    return np.asarray(g @ navigation @ g.T)


def error_rows(y: npt.ArrayLike, *, earth: Ellipsoid = WGS84) -> Array:
    """(..., 15, 9): states by errors of position (m, east, north, up), velocity and psi."""
    y = np.asarray(y, float)
    radius_m, radius_n = radii(y[..., 0], y[..., 2], earth=earth)
    g = np.zeros((*y.shape[:-1], 15, 9))
    g[..., 0, 1], g[..., 2, 2] = 1.0 / radius_m, 1.0
    g[..., 1, 0] = 1.0 / (radius_n * np.cos(y[..., 0]))
    g[..., 3:6, 3:6] = np.eye(3)
    g[..., 6:, 6:] = attitude_rows(y)
    return g


def navigation_covariance(y: Array, p: Array, *, earth: Ellipsoid = WGS84) -> Array:
    """(..., 9, 9) of position (m), velocity and psi: the way back from P (..., 15, 15).

    The rows of the direction cosines are orthogonal, each of squared length 2.
    """
    g = error_rows(y, earth=earth)
    back = np.swapaxes(g / np.sum(g * g, axis=-2, keepdims=True), -1, -2)
    return np.asarray(back @ p @ np.swapaxes(back, -1, -2))
