"""The error model of the project: states, their signs, their equations (papers 001 and 003).

**Signs, defined here and nowhere else.** Every error is the estimate minus the truth.

=========  ==========  =========================================================================
states     symbol      meaning
=========  ==========  =========================================================================
POSITION   Delta y     computed minus true position, m, in the computed axes w
VELOCITY   delta V     *dynamic* velocity error, m/s: computed velocity minus the true one as the
                       computer's instrument frame sees it, ``V' - C_wb' C_bw V``
ATTITUDE   alpha_1,2   tilt of the computed axes, rad: ``C' = (1 - [alpha x]) C``; about up
           beta_3      the kinematic azimuth error: heading error, clockwise positive
ACCEL      Delta f     error of the specific force after correction, m/s2, body axes; the bias
                       that the filter takes off is too small by it
GYRO       Delta omega error of the angular rate after correction, rad/s, body axes
=========  ==========  =========================================================================

Paper 003 writes ``nu`` for minus our ``Delta omega`` and has 13 states (26): no height, no vertical
velocity (:data:`PAPER_STATES`). The full velocity error is ``Delta V = delta V + V x beta``
(:func:`total_velocity_error`). With the dynamic velocity error no specific force stands in the
matrix, the velocity in body axes is wrong by ``C_bw delta V`` alone, and so the measurements of an
odometer, of a zero velocity and of a wheel that cannot slide see no attitude error (37).

Frames: the model axes w have their own place error, so that the tilt against the true vertical is
``alpha = beta + gamma`` with ``gamma_1 = -(k12 y1 + k22 y2)``, ``gamma_2 = k11 y1 + k12 y2`` and
``gamma_3 = 0``: any law of the azimuth may be used, East-North-Up too.

:func:`error_matrix_001` is the model of paper 001 in East-North-Up with total errors; its attitude
error Psi has the sign of alpha.
"""

from __future__ import annotations

import math
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from vehnav.earth import WGS84, Ellipsoid, curvature_radii, normal_gravity
from vehnav.kernel import kernel
from vehnav.rotation import Mat3, Vec3
from vehnav.strapdown.wander import curvature, earth_axis, gravity_at, mat3, relative_rate

Array = npt.NDArray[np.float64]

POSITION: Final = slice(0, 3)
VELOCITY: Final = slice(3, 6)
ATTITUDE: Final = slice(6, 9)
ACCEL: Final = slice(9, 12)
GYRO: Final = slice(12, 15)
NAVIGATION: Final = 9
"""States of position, velocity and attitude: the rows of the error matrix."""
STATES: Final = 15
PAPER_STATES: Final = (0, 1, 3, 4, 6, 7, 8, 9, 10, 11, 12, 13, 14)
"""The 13 states of paper 003 (26) among the 15."""


@kernel
def fill_error_matrix(
    f: Array,
    axis: Vec3,
    h: float,
    v: Vec3,
    c_wb: Mat3,
    omega_ew: Vec3,
    held: bool,
    earth: Ellipsoid,
) -> None:
    """Write the nine rows of F (003 eq. 27, full form of spec B 3.4) into ``f`` (9, 15 or more).

    ``axis``: the Earth's axis in w; ``omega_ew``: rate of the axes, rad/s; ``held``: the height
    and its velocity come from outside, their rows are zero. Columns of the sensors are written
    too; columns beyond 15 are left alone.
    """
    f[:9, :15] = 0.0
    k11, k12, k22 = curvature(axis, h, earth)
    u1, u2, u3 = earth.omega_ie * axis[0], earth.omega_ie * axis[1], earth.omega_ie * axis[2]
    o1, o2, o3 = omega_ew
    w1, w2, w3 = o1 + u1, o2 + u2, o3 + u3
    g = gravity_at(axis, h, earth)
    v1, v2, v3 = v
    # beta = alpha - gamma in terms of the states: beta_1 = alpha_1 + k12 y1 + k22 y2, ...
    # -- position: y' = dV + V x beta - Omega x y
    f[0, 3], f[1, 4], f[2, 5] = 1.0, 1.0, 1.0
    f[0, 1], f[0, 2] = o3, -o2
    f[1, 0], f[1, 2] = -o3, o1
    f[2, 0], f[2, 1] = o2, -o1
    _add_beta(f, 0, (0.0, -v3, v2), k11, k12, k22)
    _add_beta(f, 1, (v3, 0.0, -v1), k11, k12, k22)
    _add_beta(f, 2, (-v2, v1, 0.0), k11, k12, k22)
    # -- velocity: dV' = (-g a2, g a1, -dg) - (Omega + 2u) x dV + V x w + df,
    #    w = beta x u + C d_omega
    f[3, 7], f[4, 6] = -g, g
    f[5, 2] = 2.0 * g * (1.0 + earth.f + earth.m - 2.0 * earth.f * axis[2] * axis[2]) / earth.a
    slope = 2.0 * axis[2] * _gravity_slope(earth)
    f[5, 0] = -slope * (k11 * axis[0] + k12 * axis[1])
    f[5, 1] = -slope * (k12 * axis[0] + k22 * axis[1])
    d1, d2, d3 = o1 + 2.0 * u1, o2 + 2.0 * u2, o3 + 2.0 * u3
    f[3, 4], f[3, 5] = d3, -d2
    f[4, 3], f[4, 5] = -d3, d1
    f[5, 3], f[5, 4] = d2, -d1
    # V x (beta x u) = beta (V.u) - u (V.beta)
    vu = v1 * u1 + v2 * u2 + v3 * u3
    _add_beta(f, 3, (vu - u1 * v1, -u1 * v2, -u1 * v3), k11, k12, k22)
    _add_beta(f, 4, (-u2 * v1, vu - u2 * v2, -u2 * v3), k11, k12, k22)
    _add_beta(f, 5, (-u3 * v1, -u3 * v2, vu - u3 * v3), k11, k12, k22)
    for j in range(3):
        ca, cb, cc = c_wb[j], c_wb[3 + j], c_wb[6 + j]
        f[3, 9 + j], f[4, 9 + j], f[5, 9 + j] = ca, cb, cc
        f[3, 12 + j] = v2 * cc - v3 * cb
        f[4, 12 + j] = v3 * ca - v1 * cc
        f[5, 12 + j] = v1 * cb - v2 * ca
        f[6, 12 + j], f[7, 12 + j], f[8, 12 + j] = -ca, -cb, -cc
    # -- attitude: beta' = beta x omega - C d_omega; alpha' = beta' + gamma'
    _add_beta(f, 6, (0.0, w3, -w2), k11, k12, k22)
    _add_beta(f, 7, (-w3, 0.0, w1), k11, k12, k22)
    _add_beta(f, 8, (w2, -w1, 0.0), k11, k12, k22)
    if held:
        f[2, :15] = 0.0
        f[5, :15] = 0.0
    for j in range(15):
        f[6, j] -= k12 * f[0, j] + k22 * f[1, j]
        f[7, j] += k11 * f[0, j] + k12 * f[1, j]


@kernel
def _gravity_slope(earth: Ellipsoid) -> float:
    """D gamma / d sin^2 lat, m/s2, to 1 %: Somigliana to the first order in e^2."""
    ratio = math.sqrt(1.0 - earth.e2) * earth.gamma_p / earth.gamma_e
    return earth.gamma_e * (ratio - 1.0 + 0.5 * earth.e2)


@kernel
def _add_beta(f: Array, row: int, c: Vec3, k11: float, k12: float, k22: float) -> None:
    """Add c . beta to a row, beta written in the states."""
    f[row, 6] += c[0]
    f[row, 7] += c[1]
    f[row, 8] += c[2]
    f[row, 0] += c[0] * k12 - c[1] * k11
    f[row, 1] += c[0] * k22 - c[1] * k12


def error_matrix(
    *,
    c_we: Array,
    height: float,
    v_w: npt.ArrayLike,
    c_wb: Array,
    absolute: bool = False,
    held: bool = False,
    earth: Ellipsoid = WGS84,
) -> Array:
    """F (9, 15), 1/s: rates of the first nine states by all fifteen (003 eq. 27 and 28).

    Parameters
    ----------
    c_we, height, v_w, c_wb
        Place, m, m/s and attitude of the mechanization, wander axes.
    absolute : bool
        Absolute-free azimuth instead of relative-free.
    held : bool
        Whether height and vertical velocity come from outside.
    """
    f = np.zeros((NAVIGATION, STATES))
    place, attitude = mat3(c_we), mat3(c_wb)
    v = _tuple3(v_w)
    axis = earth_axis(place)
    omega_ew = relative_rate(axis, height, v, absolute, earth.omega_ie, earth)
    fill_error_matrix(f, axis, height, v, attitude, omega_ew, held, earth)
    return f


@kernel
def beta_from_states(x: Array, k: Vec3) -> Vec3:
    """Kinematic attitude error beta = alpha - gamma, rad, of states ``x``; k: (k11, k12, k22)."""
    return (
        x[6] + k[1] * x[0] + k[2] * x[1],
        x[7] - k[0] * x[0] - k[1] * x[1],
        x[8],
    )


def total_velocity_error(x: Array, v_w: npt.ArrayLike, k: Vec3) -> Array:
    """(3,) m/s: Delta V = delta V + V x beta, computed minus true velocity in w (spec B 3.4)."""
    return np.asarray(x[VELOCITY] + np.cross(np.asarray(v_w, float), beta_from_states(x, k)))


SIMPLIFIED, PAPER, FULL = 0, 1, 2
"""How much of the model of paper 001 is kept (:func:`error_matrix_001`)."""
MODELS: Final = {"simplified": SIMPLIFIED, "paper": PAPER, "full": FULL}


@kernel
def fill_error_matrix_001(
    f: Array, lat: float, h: float, v: Vec3, f_n: Vec3, kept: int, held: bool, earth: Ellipsoid
) -> None:
    """Write F (9, 9) of :func:`error_matrix_001` into ``f``; ``kept``: a value of MODELS."""
    for i in range(9):
        for j in range(9):
            f[i, j] = 0.0
    r_m, r_e = curvature_radii(lat, h, earth)
    sin, cos = math.sin(lat), math.cos(lat)
    tan = sin / cos
    u_n, u_u = earth.omega_ie * cos, earth.omega_ie * sin
    v_e, v_n, v_u = v
    w_e, w_n, w_u = -v_n / r_m, v_e / r_e, v_e * tan / r_e
    i_n, i_u = u_n + w_n, u_u + w_u
    f[0, 1], f[0, 2] = i_u, -i_n  # Psi x omega_in
    f[1, 0], f[1, 2] = -i_u, w_e
    f[2, 0], f[2, 1] = i_n, -w_e
    f[3, 1], f[3, 2] = -f_n[2], f_n[1]  # n x Psi
    f[4, 0], f[4, 2] = f_n[2], -f_n[0]
    f[5, 0], f[5, 1] = -f_n[1], f_n[0]
    f[6, 3], f[7, 4], f[8, 5] = 1.0, 1.0, 1.0
    if kept != SIMPLIFIED:  # Delta omega_ie + Delta omega_en
        f[0, 4], f[1, 3], f[2, 3] = -1.0 / r_m, 1.0 / r_e, tan / r_e
        f[1, 7] = -u_u / r_m
        f[2, 7] = (u_n + v_e / (r_e * cos * cos)) / r_m
        f[0, 8], f[1, 8], f[2, 8] = v_n / (r_m * r_m), -w_n / r_e, -w_u / r_e
    if kept == FULL:
        _add_delta_w(f, v, (w_e, w_n, w_u), (u_n, u_u), r_m, r_e, tan)
        f[5, 8] += 2.0 * normal_gravity(lat, h, earth) / math.sqrt(r_m * r_e)
        f[6, 6] += v_u / r_e - v_n * tan / r_m
        f[6, 7] += v_e * tan / r_m
        f[6, 8] -= v_e / r_e
        f[7, 7] += v_u / r_m
        f[7, 8] -= v_n / r_m
    if held:
        for j in range(9):
            f[5, j], f[8, j] = 0.0, 0.0


@kernel
def _add_delta_w(
    f: Array, v: Vec3, w: Vec3, u: tuple[float, float], r_m: float, r_e: float, tan: float
) -> None:
    """V x (2 Delta omega_ie + Delta omega_en) - (2 omega_ie + omega_en) x Delta v (001 eq. 9)."""
    v_e, v_n, v_u = v
    for j in range(3, 9):
        # the rows of Psi hold Delta omega_ie + Delta omega_en already; Delta omega_ie once more
        d_e, d_n, d_u = f[0, j], f[1, j], f[2, j]
        if j == 7:
            d_n -= u[1] / r_m
            d_u += u[0] / r_m
        f[3, j] += v_n * d_u - v_u * d_n
        f[4, j] += v_u * d_e - v_e * d_u
        f[5, j] += v_e * d_n - v_n * d_e
    c_e, c_n, c_u = w[0], w[1] + 2.0 * u[0], w[2] + 2.0 * u[1]
    f[3, 4] += c_u
    f[3, 5] -= c_n
    f[4, 3] -= c_u
    f[4, 5] += c_e
    f[5, 3] += c_n
    f[5, 4] -= c_e


def error_matrix_001(
    *,
    lat: float,
    height: float,
    v_n: npt.ArrayLike,
    f_n: npt.ArrayLike,
    model: Literal["full", "paper", "simplified"] = "full",
    held: bool = True,
    earth: Ellipsoid = WGS84,
) -> Array:
    """F (9, 9), 1/s, of Psi, Delta v, Delta r in East-North-Up (001 eq. 9-11; spec B 1.2).

    Sensor errors enter as ``Psi' += -C_nb d_omega``, ``dv' += C_nb d_f``.

    Parameters
    ----------
    lat, height : float
        rad, m.
    v_n, f_n : (3,)
        Velocity, m/s, and specific force, m/s2.
    model : {"full", "paper", "simplified"}
        ``paper`` neglects Delta w and takes Delta r' = Delta v; ``simplified`` Delta omega_ig too.
    held : bool
        Whether height and vertical velocity come from outside.
    """
    f = np.zeros((9, 9))
    fill_error_matrix_001(f, lat, height, _tuple3(v_n), _tuple3(f_n), MODELS[model], held, earth)
    return f


def transition(f: Array, dt: float) -> Array:
    """(n, n): 1 + F dt + F^2 dt^2 / 2 for the rows that F (m, n) has, the rest constant."""
    n = f.shape[1]
    full = np.zeros((n, n))
    full[: f.shape[0]] = f
    return np.asarray(np.eye(n) + full * dt + 0.5 * dt * dt * full @ full)


def _tuple3(x: npt.ArrayLike) -> Vec3:
    a, b, c = (float(y) for y in np.asarray(x, float))
    return (a, b, c)
