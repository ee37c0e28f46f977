"""Covariance of paper 004's model: its linearisation and the propagation along a trajectory."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import numpy.typing as npt

from vehnav.earth import KRASOVSKY, Ellipsoid, curvature_radii, normal_gravity
from vehnav.kernel import kernel
from vehnav.rotation import Vec3, add, cross, scale
from vehnav.strapdown.langevin import F0, NORMAL, GravityInput

Array = npt.NDArray[np.float64]


@kernel
def radii_slopes(lat: float, earth: Ellipsoid) -> tuple[float, float]:
    """(dR_M/dlat, dR_N/dlat), m/rad."""
    s, c = math.sin(lat), math.cos(lat)
    w2 = 1.0 - earth.e2 * s * s
    r_n = earth.a / math.sqrt(w2)
    r_m = r_n * (1.0 - earth.e2) / w2
    return 3.0 * r_m * earth.e2 * s * c / w2, r_n * earth.e2 * s * c / w2


@kernel
def gravity_slope(lat: float, height: float, earth: Ellipsoid) -> float:
    """Derivative of gamma by latitude, m/s2/rad, of Somigliana with its height term."""
    s, c = math.sin(lat), math.cos(lat)
    k = math.sqrt(1.0 - earth.e2) * earth.gamma_p / earth.gamma_e - 1.0
    w2, x = 1.0 - earth.e2 * s * s, height / earth.a
    relative = k / (1.0 + k * s * s) + 0.5 * earth.e2 / w2
    falling = 1.0 - 2.0 * (1.0 + earth.f + earth.m - 2.0 * earth.f * s * s) * x + 3.0 * x * x
    relative += 4.0 * earth.f * x / falling
    return 2.0 * s * c * relative * normal_gravity(lat, height, earth)


@kernel
def rate_slopes(y: Array, earth: Ellipsoid) -> tuple[Vec3, Vec3, Vec3, Vec3]:
    """What the rates (7) and those of the axes hang on.

    Returns (lat' by lat, h, V_N), (lon' by lat, h, V_E), omega_ie and omega_en, rad/s.
    """
    lat, h, v_e, v_n = y[0], y[2], y[3], y[4]
    s, c = math.sin(lat), math.cos(lat)
    r_m, r_n = curvature_radii(lat, h, earth)
    slope_m, slope_n = radii_slopes(lat, earth)
    d_lon = v_e / (r_n * c)
    by_north = (-v_n * slope_m / (r_m * r_m), -v_n / (r_m * r_m), 1.0 / r_m)
    by_east = (d_lon * (s / c - slope_n / r_n), -d_lon / r_n, 1.0 / (r_n * c))
    omega_ie = (0.0, earth.omega_ie * c, earth.omega_ie * s)
    return by_north, by_east, omega_ie, (-v_n / r_m, d_lon * c, d_lon * s)


@kernel
def fill_jacobian(
    out: Array, y: Array, z: Array, clamp: bool, gravity: GravityInput, earth: Ellipsoid
) -> None:
    """Write A = dF/dY of (16) into ``out`` (15, 15)."""
    out[:, :] = 0.0
    by_north, by_east, omega_ie, omega_en = rate_slopes(y, earth)
    s, c, v = math.sin(y[0]), math.cos(y[0]), (y[3], y[4], y[5])
    out[0, 0], out[0, 2], out[0, 4] = by_north
    out[1, 0], out[1, 2], out[1, 3] = by_east
    out[2, 5] = 1.0
    for j in range(6):  # rates of the axes: omega_en = (-lat', lon' cos, lon' sin), u (0, cos, sin)
        en, ie = (-out[0, j], c * out[1, j], s * out[1, j]), (0.0, 0.0, 0.0)
        if j == 0:
            d_lon = omega_en[1] / c
            en = (en[0], en[1] - s * d_lon, en[2] + c * d_lon)
            ie = (0.0, -omega_ie[2], omega_ie[1])
        turn = add(ie, en)
        out[3, j], out[4, j], out[5, j] = cross(v, add(turn, ie))
        for k in range(3):
            column = (y[6 + 3 * k], y[7 + 3 * k], y[8 + 3 * k])
            a = 6 + 3 * k
            out[a, j], out[a + 1, j], out[a + 2, j] = cross(column, turn)
    _subtract_skew(out, 3, 3, add(scale(2.0, omega_ie), omega_en))
    slope = gravity_slope(y[0], gravity.height, earth)
    out[3, 0] -= slope * gravity.east
    out[4, 0] -= slope * gravity.north
    out[5, 0] -= slope
    for k in range(3):
        _subtract_skew(out, 6 + 3 * k, 6 + 3 * k, add(omega_ie, omega_en))
        for a in range(3):
            out[3 + a, 6 + 3 * k + a] = z[k]
            n, m = 6 + 3 * ((k + 1) % 3), 6 + 3 * ((k + 2) % 3)  # M' = M [omega_b x]: columns mix
            out[6 + 3 * k + a, n + a] += z[3 + (k + 2) % 3]
            out[6 + 3 * k + a, m + a] -= z[3 + (k + 1) % 3]
    if clamp:
        out[2, :] = 0.0
        out[5, :] = 0.0


@kernel
def _subtract_skew(out: Array, row: int, column: int, w: Vec3) -> None:
    """Take [w x] off a block of three by three."""
    out[row, column + 1] += w[2]
    out[row, column + 2] -= w[1]
    out[row + 1, column] -= w[2]
    out[row + 1, column + 2] += w[0]
    out[row + 2, column] += w[1]
    out[row + 2, column + 1] -= w[0]


def jacobian(
    Y: npt.ArrayLike,
    Z: npt.ArrayLike,
    *,
    vertical: Literal["clamp", "free"] = "free",
    gravity: GravityInput = NORMAL,
    earth: Ellipsoid = KRASOVSKY,
) -> Array:
    """A = dF/dY (15, 15) of (16): arguments as :func:`vehnav.strapdown.langevin.F`."""
    out = np.empty((15, 15))
    y, z = np.array(Y, float), np.array(Z, float)
    fill_jacobian(out, y, z, vertical == "clamp", gravity, earth)
    return out


def propagate_covariance(
    t: Array,
    Y: Array,
    Z: Array,
    *,
    P0: Array,
    accel_density: float,
    gyro_density: float,
    vertical: Literal["clamp", "free"] = "clamp",
    gravity: GravityInput = NORMAL,
    earth: Ellipsoid = KRASOVSKY,
) -> Array:
    """Covariances P (n, 15, 15) of the linearised model along a trajectory.

    ``dP/dt = A P + P A' + F0 Q F0'``; over each step the transition matrix to the second order
    with A of its start, the noise by the trapezoid of both ends.

    Parameters
    ----------
    t : (n,)
        s; steps of a second are short enough for a vehicle.
    Y, Z : (n, 15), (n, 6)
        Nominal states and measurements.
    P0 : (15, 15)
    accel_density, gyro_density : float
        White noise, m/s2/sqrt(Hz) and rad/s/sqrt(Hz) (two-sided: N of a random walk N sqrt(t)).
        A noise of standard deviation sd on every sample, dt apart, has sd sqrt(dt).
    """
    q = np.array([accel_density**2] * 3 + [gyro_density**2] * 3)
    out = np.empty((t.size, 15, 15))
    out[0] = P0
    for k in range(1, t.size):
        dt = t[k] - t[k - 1]
        a = jacobian(Y[k - 1], Z[k - 1], vertical=vertical, gravity=gravity, earth=earth) * dt
        phi = np.eye(15) + a + 0.5 * a @ a
        g0, g1 = _noise_input(Y[k - 1], vertical), _noise_input(Y[k], vertical)
        before = out[k - 1] + 0.5 * dt * (g0 * q) @ g0.T
        p = phi @ before @ phi.T + 0.5 * dt * (g1 * q) @ g1.T
        out[k] = 0.5 * (p + p.T)
    return out


def _noise_input(y: Array, vertical: str) -> Array:
    g = F0(y)
    if vertical == "clamp":
        g[5] = 0.0
    return g
