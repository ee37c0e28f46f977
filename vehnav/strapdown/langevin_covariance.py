"""Covariance of paper 004's model: its linearisation and the propagation along a trajectory."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import numpy.typing as npt

from vehnav.earth import KRASOVSKY, Ellipsoid, curvature_radii, normal_gravity
from vehnav.rotation import skew
from vehnav.strapdown.langevin import F0, NORMAL, GravityInput, c_nb_of

Array = npt.NDArray[np.float64]


def radii_slopes(lat: float, earth: Ellipsoid) -> tuple[float, float]:
    """(dR_M/dlat, dR_N/dlat), m/rad."""
    s, c = math.sin(lat), math.cos(lat)
    w2 = 1.0 - earth.e2 * s * s
    r_n = earth.a / math.sqrt(w2)
    r_m = r_n * (1.0 - earth.e2) / w2
    return 3.0 * r_m * earth.e2 * s * c / w2, r_n * earth.e2 * s * c / w2


def gravity_slope(lat: float, height: float, earth: Ellipsoid) -> float:
    """Derivative of gamma by latitude, m/s2/rad, of Somigliana with its height term."""
    s, c = math.sin(lat), math.cos(lat)
    k = math.sqrt(1.0 - earth.e2) * earth.gamma_p / earth.gamma_e - 1.0
    w2, x = 1.0 - earth.e2 * s * s, height / earth.a
    relative = k / (1.0 + k * s * s) + 0.5 * earth.e2 / w2
    falling = 1.0 - 2.0 * (1.0 + earth.f + earth.m - 2.0 * earth.f * s * s) * x + 3.0 * x * x
    relative += 4.0 * earth.f * x / falling
    return 2.0 * s * c * relative * normal_gravity(lat, height, earth)


def geodetic_slopes(y: Array, earth: Ellipsoid) -> Array:
    """(2, 6): derivatives of the rates of latitude and longitude (7) by position and velocity."""
    lat, _, h, v_e, v_n, _ = (float(x) for x in y[:6])
    s, c = math.sin(lat), math.cos(lat)
    r_m, r_n = curvature_radii(lat, h, earth)
    slope_m, slope_n = radii_slopes(lat, earth)
    out = np.zeros((2, 6))
    out[0, [0, 2, 4]] = -v_n * slope_m / r_m**2, -v_n / r_m**2, 1.0 / r_m
    out[1, 0] = v_e / (r_n * c) * (s / c - slope_n / r_n)
    out[1, [2, 3]] = -v_e / (r_n**2 * c), 1.0 / (r_n * c)
    return out


def jacobian(
    Y: npt.ArrayLike,
    Z: npt.ArrayLike,
    *,
    vertical: Literal["clamp", "free"] = "free",
    gravity: GravityInput = NORMAL,
    earth: Ellipsoid = KRASOVSKY,
) -> Array:
    """A = dF/dY (15, 15) of (16): arguments as :func:`vehnav.strapdown.langevin.F`."""
    y, z = np.asarray(Y, float), np.asarray(Z, float)
    c_nb, v = c_nb_of(y), y[3:6]
    s, c = math.sin(y[0]), math.cos(y[0])
    rates = geodetic_slopes(y, earth)
    r_m, r_n = curvature_radii(float(y[0]), float(y[2]), earth)
    d_lat, d_lon, u = v[1] / r_m, v[0] / (r_n * c), earth.omega_ie
    # omega_en = (-lat', lon' cos, lon' sin) and omega_ie = u (0, cos, sin), by position, velocity
    en = np.stack([-rates[0], c * rates[1], s * rates[1]])
    en[:, 0] += d_lon * np.array([0.0, -s, c])
    ie = np.zeros((3, 6))
    ie[:, 0] = u * np.array([0.0, -s, c])
    omega_en, omega_ie = np.array([-d_lat, d_lon * c, d_lon * s]), u * np.array([0.0, c, s])

    out = np.zeros((15, 15))
    out[:2, :6] = rates
    out[2, 5] = 1.0
    out[3:6, :6] = skew(v) @ (2.0 * ie + en)
    out[3:6, 3:6] -= skew(2.0 * omega_ie + omega_en)
    slope = gravity_slope(float(y[0]), gravity.height, earth)
    out[3:6, 0] -= slope * np.array([gravity.east, gravity.north, 1.0])
    out[3:6, 6:] = np.kron(z[:3], np.eye(3))
    for j in range(3):
        out[6 + 3 * j : 9 + 3 * j, :6] = skew(c_nb[:, j]) @ (ie + en)
    out[6:, 6:] = np.kron(skew(z[3:]).T, np.eye(3)) - np.kron(np.eye(3), skew(omega_ie + omega_en))
    if vertical == "clamp":
        out[[2, 5]] = 0.0
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
