"""Paper 004's stochastic model of vehicle motion, in the form of Langevin (16), and its engine.

State ``Y = [lat, lon, h, V_E, V_N, V_h, M]`` (15): M is C_nb by columns. Input ``Z`` (6): specific
force and angular rate as measured, body axes. ``dY/dt = F(Y, Z) + F0(Y) xi`` with white noise xi
of the accelerometers and gyroscopes. The published integration is the classical Runge-Kutta method
with the measurements held over the step; it is here to reproduce the paper: a held sample is half
a step late. Navigation uses :mod:`vehnav.strapdown.enu`.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from vehnav.earth import KRASOVSKY, Ellipsoid, curvature_radii, earth_rate, normal_gravity
from vehnav.kernel import entry_kernel, kernel
from vehnav.rotation import Mat3, Vec3, add, cross, mat_vec, scale, skew

Array = npt.NDArray[np.float64]
State = tuple[Vec3, Vec3, Mat3]
Hold = Literal["left", "right", "average", "linear"]
Scheme = Literal["rk4", "euler"]
_HOLDS: tuple[Hold, ...] = ("left", "right", "average", "linear")


class GravityInput(NamedTuple):
    """What the paper feeds the gravity vector with, besides the normal field.

    Attributes
    ----------
    north, east : float
        Deflection of the vertical, rad: positive when the zenith is displaced north, east.
    anomaly : float
        Gravity anomaly, m/s2: added to normal gravity.
    height : float
        Where normal gravity is taken, m; the paper takes it on the ellipsoid.
    """

    north: float = 0.0
    east: float = 0.0
    anomaly: float = 0.0
    height: float = 0.0


NORMAL = GravityInput()


# ---- the model, one equation each --------------------------------------------------------------


@kernel
def gravity_vector(lat: float, gravity: GravityInput, earth: Ellipsoid) -> Vec3:
    """(g_E, g_N, g_h), m/s2: -gamma eta, -gamma xi, -(gamma + anomaly) (004, after eq. 9)."""
    gamma = normal_gravity(lat, gravity.height, earth)
    return (-gamma * gravity.east, -gamma * gravity.north, -(gamma + gravity.anomaly))


@kernel
def geodetic_rate(position: Vec3, v_n: Vec3, earth: Ellipsoid) -> Vec3:
    """(lat, lon, h) rates: equations (7) and (10)."""
    radius_m, radius_n = curvature_radii(position[0], position[2], earth)
    return (v_n[1] / radius_m, v_n[0] / (radius_n * math.cos(position[0])), v_n[2])


@kernel
def poisson_rate(c: Mat3, omega_b: Vec3, omega_n: Vec3) -> Mat3:
    """M [omega_b x] - [omega_gamma x] M (11)."""
    x, y, z = omega_b
    e, n, u = omega_n
    return (
        c[1] * z - c[2] * y + u * c[3] - n * c[6],
        c[2] * x - c[0] * z + u * c[4] - n * c[7],
        c[0] * y - c[1] * x + u * c[5] - n * c[8],
        c[4] * z - c[5] * y - u * c[0] + e * c[6],
        c[5] * x - c[3] * z - u * c[1] + e * c[7],
        c[3] * y - c[4] * x - u * c[2] + e * c[8],
        c[7] * z - c[8] * y + n * c[0] - e * c[3],
        c[8] * x - c[6] * z + n * c[1] - e * c[4],
        c[6] * y - c[7] * x + n * c[2] - e * c[5],
    )


@kernel
def state_rate(
    state: State, f_b: Vec3, omega_b: Vec3, clamp: bool, gravity: GravityInput, earth: Ellipsoid
) -> State:
    """Right-hand sides of (7), (9), (10), (11); ``clamp`` holds h and V_h."""
    position, v_n, c = state
    rate = geodetic_rate(position, v_n, earth)
    s, k = math.sin(position[0]), math.cos(position[0])
    omega_en_n = (-rate[0], rate[1] * k, rate[1] * s)
    omega_ie_n = earth_rate(position[0], earth)
    coriolis = cross(v_n, add(scale(2.0, omega_ie_n), omega_en_n))
    dv = add(add(mat_vec(c, f_b), coriolis), gravity_vector(position[0], gravity, earth))
    if clamp:
        rate, dv = (rate[0], rate[1], 0.0), (dv[0], dv[1], 0.0)
    return rate, dv, poisson_rate(c, omega_b, add(omega_ie_n, omega_en_n))


@kernel
def state_of(y: Array) -> State:
    """Position, velocity and C_nb of a state Y (15,)."""
    return (
        (y[0], y[1], y[2]),
        (y[3], y[4], y[5]),
        (y[6], y[9], y[12], y[7], y[10], y[13], y[8], y[11], y[14]),
    )


@kernel
def write_state(y: Array, state: State) -> None:
    """Fill a state Y (15,): C_nb by columns."""
    p, v, m = state
    y[0], y[1], y[2] = p
    y[3], y[4], y[5] = v
    y[6], y[7], y[8] = m[0], m[3], m[6]
    y[9], y[10], y[11] = m[1], m[4], m[7]
    y[12], y[13], y[14] = m[2], m[5], m[8]


# ---- Runge-Kutta with held measurements --------------------------------------------------------


@kernel
def moved(state: State, k: float, rate: State) -> State:
    """State + k rate."""
    c, d = state[2], rate[2]
    return (
        add(state[0], scale(k, rate[0])),
        add(state[1], scale(k, rate[1])),
        (
            c[0] + k * d[0], c[1] + k * d[1], c[2] + k * d[2],
            c[3] + k * d[3], c[4] + k * d[4], c[5] + k * d[5],
            c[6] + k * d[6], c[7] + k * d[7], c[8] + k * d[8],
        ),
    )  # fmt: skip


@kernel
def middle(a: Vec3, b: Vec3) -> Vec3:
    """(a + b) / 2."""
    return scale(0.5, add(a, b))


@kernel
def held_inputs(
    here: tuple[Vec3, Vec3], there: tuple[Vec3, Vec3], hold: int
) -> tuple[tuple[Vec3, Vec3], tuple[Vec3, Vec3], tuple[Vec3, Vec3]]:
    """Measurements at the start, middle and end of a step from the samples at its ends."""
    mean = (middle(here[0], there[0]), middle(here[1], there[1]))
    if hold == 0:
        return here, here, here
    if hold == 1:
        return there, there, there
    if hold == 2:
        return mean, mean, mean
    return here, mean, there


@kernel
def rk4_step(
    state: State,
    dt: float,
    inputs: tuple[tuple[Vec3, Vec3], tuple[Vec3, Vec3], tuple[Vec3, Vec3]],
    clamp: bool,
    gravity: GravityInput,
    earth: Ellipsoid,
) -> State:
    """One step of the classical Runge-Kutta method."""
    (f0, w0), (f1, w1), (f2, w2) = inputs
    k1 = state_rate(state, f0, w0, clamp, gravity, earth)
    k2 = state_rate(moved(state, 0.5 * dt, k1), f1, w1, clamp, gravity, earth)
    k3 = state_rate(moved(state, 0.5 * dt, k2), f1, w1, clamp, gravity, earth)
    k4 = state_rate(moved(state, dt, k3), f2, w2, clamp, gravity, earth)
    half = moved(moved(state, dt / 6.0, k1), dt / 3.0, k2)
    return moved(moved(half, dt / 3.0, k3), dt / 6.0, k4)


@entry_kernel
def integrate_langevin(
    t: Array,
    z: Array,
    position: Vec3,
    v_n: Vec3,
    c: Mat3,
    hold: int,
    euler: bool,
    clamp: bool,
    gravity: GravityInput,
    earth: Ellipsoid,
    every: int,
    out: Array,
) -> None:
    """The loop over steps; every ``every``-th state goes to ``out`` (rows, 15)."""
    state = (position, v_n, c)
    for k in range(t.shape[0]):
        if k > 0:
            dt = t[k] - t[k - 1]
            here = (
                (z[k - 1, 0], z[k - 1, 1], z[k - 1, 2]),
                (z[k - 1, 3], z[k - 1, 4], z[k - 1, 5]),
            )
            there = ((z[k, 0], z[k, 1], z[k, 2]), (z[k, 3], z[k, 4], z[k, 5]))
            inputs = held_inputs(here, there, hold)
            if euler:
                f, w = inputs[0]
                state = moved(state, dt, state_rate(state, f, w, clamp, gravity, earth))
            else:
                state = rk4_step(state, dt, inputs, clamp, gravity, earth)
        if k % every == 0:
            write_state(out[k // every], state)


# ---- the model for Python ----------------------------------------------------------------------


def state_vector(position: npt.ArrayLike, v_n: npt.ArrayLike, c_nb: npt.ArrayLike) -> Array:
    """Y (15,) of position (lat rad, lon rad, h m), velocity ENU (m/s) and C_nb (3, 3)."""
    columns = np.asarray(c_nb, float).T.ravel()
    return np.concatenate([np.asarray(position, float), np.asarray(v_n, float), columns])


def c_nb_of(y: npt.ArrayLike) -> Array:
    """C_nb (..., 3, 3) of states Y (..., 15)."""
    y = np.asarray(y, float)
    return np.swapaxes(y[..., 6:].reshape(*y.shape[:-1], 3, 3), -1, -2)


def _split(y: npt.ArrayLike) -> State:
    y0, y1, y2, v0, v1, v2, *m = (float(x) for x in np.asarray(y, float))
    c = (m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8])
    return (y0, y1, y2), (v0, v1, v2), c


def F(
    Y: npt.ArrayLike,
    Z: npt.ArrayLike,
    *,
    vertical: Literal["clamp", "free"] = "free",
    gravity: GravityInput = NORMAL,
    earth: Ellipsoid = KRASOVSKY,
) -> Array:
    """F(Y, Z) (15,): the drift of the model (16).

    Parameters
    ----------
    Y : (15,)
        lat, lon (rad), h (m), V_E, V_N, V_h (m/s), columns of C_nb.
    Z : (6,)
        Measured specific force, m/s2, and angular rate, rad/s; body axes right-forward-up.
    """
    z = [float(x) for x in np.asarray(Z, float)]
    f_b, omega_b = (z[0], z[1], z[2]), (z[3], z[4], z[5])
    rate = state_rate(_split(Y), f_b, omega_b, vertical == "clamp", gravity, earth)
    p, v, c = rate
    return np.array([*p, *v, c[0], c[3], c[6], c[1], c[4], c[7], c[2], c[5], c[8]])


def F0(Y: npt.ArrayLike) -> Array:
    """F0(Y) (15, 6): how the noise (w of the accelerometers, v of the gyroscopes) enters (16)."""
    c = c_nb_of(Y)
    out = np.zeros((15, 6))
    out[3:6, :3] = c
    for j in range(3):  # the columns of M [v x]
        out[6 + 3 * j : 9 + 3 * j, 3:] = -c @ skew(np.eye(3)[j])
    return out


def integrate(
    t: Array,
    Z: Array,
    Y0: npt.ArrayLike,
    *,
    hold: Hold = "left",
    scheme: Scheme = "rk4",
    vertical: Literal["clamp", "free"] = "clamp",
    gravity: GravityInput = NORMAL,
    earth: Ellipsoid = KRASOVSKY,
    every: int = 1,
) -> Array:
    """States (rows, 15) of the deterministic equations (7), (9)-(11), as published.

    Parameters
    ----------
    t : (n,)
        s.
    Z : (n, 6)
        Measurements at the instants; noise, if any, already in them (12).
    Y0 : (15,)
        State at t[0].
    hold : {"left", "right", "average", "linear"}
        What is taken inside the step of the samples at its ends; the paper: ``left``.
    scheme : {"rk4", "euler"}
    every : int
        Only every so many states are returned.
    """
    if t.size != len(Z):
        raise ValueError(f"{t.size} instants, but {len(Z)} measurements")
    position, v_n, c = _split(Y0)
    out = np.empty(((t.size - 1) // every + 1, 15))
    integrate_langevin(
        np.require(t, float, ["C", "W"]), np.require(Z, float, ["C", "W"]), position, v_n, c,
        _HOLDS.index(hold), scheme == "euler", vertical == "clamp", gravity, earth, every, out,
    )  # fmt: skip
    return out
