"""Quaternion mechanization in inertial Cartesian axes (paper 000), with the stops of paper 002.

State: radius vector and absolute velocity in the inertial frame that coincides with the Earth-fixed
one at the first instant, and the quaternion body to inertial. As published: attitude by the third
order of Picard's series (13) with normalisation (14), velocity by (17)-(19) with gravitation of the
start of the step, position by (20). Ours, the default: rotation vector with coning for uneven
steps, the exact rotation (16) with sculling, gravitation of the middle of the step. What is held by
the published form is half a step late and costs a first-order error; see :data:`PUBLISHED`.

The vertical clamp takes the vertical velocity out after each step and moves the radius vector along
the ellipsoid normal back to the height of the start.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from vehnav.corrections import levelling_rate, velocity_reset
from vehnav.earth import WGS84, Ellipsoid, c_en, ecef_from_geodetic, normal_gravity
from vehnav.kernel import entry_kernel, kernel
from vehnav.rotation import (
    Vec3,
    add,
    cross,
    mat_t_vec,
    mat_vec,
    quaternion_from_c,
    scale,
    subtract,
)
from vehnav.strapdown.body_step import (
    coning_factor,
    rotated_velocity_increment,
    rotation_vector,
    sculling,
)
from vehnav.strapdown.increments import Increments
from vehnav.strapdown.inertial import (
    carried,
    clamped,
    earth_spin,
    j2_gravitation,
    local_frame,
    normal_gravitation,
    velocity_over_ground,
)
from vehnav.strapdown.quaternion import (
    Quat,
    dcm_of,
    normalised,
    picard_quaternion,
    product,
    quaternion_of_rotvec,
    rotate,
    rotate_back,
)
from vehnav.strapdown.solution import Solution, StopControl

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

PICARD_CONING: Final = 1.0 / 12.0
"""(13) prints 1/24 of the product for half the angle, whatever the steps."""


@dataclass(frozen=True)
class EciForm:
    """Which formulas the recursion takes.

    Attributes
    ----------
    attitude : {"rotation-vector", "picard"}
        ``picard``: (13) as printed, third order, the cross product with 1/24 for any steps.
    velocity : {"exact", "second-order"}
        ``exact``: (16) with sculling; ``second-order``: (17).
    gravity_time : {"middle", "start"}
        Where in the step gravitation is taken; ``start`` as (17) prints it.
    """

    attitude: Literal["rotation-vector", "picard"] = "rotation-vector"
    velocity: Literal["exact", "second-order"] = "exact"
    gravity_time: Literal["middle", "start"] = "middle"


SECOND_ORDER: Final = EciForm()
PUBLISHED: Final = EciForm("picard", "second-order", "start")
"""(13), (17)-(20). Gravitation half a step late: up to dt V_I of position (spec A 3.6)."""


# ---- one equation each -------------------------------------------------------------------------


@kernel
def second_order_increment(dtheta: Vec3, dvel: Vec3) -> Vec3:
    """Velocity increment b + theta x b / 2, m/s, in the body axes of the START of the step (17)."""
    return add(dvel, scale(0.5, cross(dtheta, dvel)))


# ---- one step ----------------------------------------------------------------------------------


@kernel
def eci_step(
    r: Vec3,
    v: Vec3,
    q: Quat,
    dt: float,
    now: tuple[Vec3, Vec3],
    before: tuple[Vec3, Vec3],
    c: float,
    form: tuple[bool, bool, bool],
    j2: bool,
    gravity_height: float,
    earth: Ellipsoid,
) -> tuple[Vec3, Vec3, Quat, Vec3]:
    """One step without stops: radius vector, velocity, quaternion, and C_ib dv (m/s).

    ``now``, ``before``: increments of the step and, scaled to its length, of the one before;
    ``c``: the :func:`coning_factor`, 0 where there is no step before; ``form``: Picard,
    second-order velocity, gravitation at the start; ``gravity_height`` as in ENU.
    """
    dtheta, dvel = now
    if form[0]:
        turn = picard_quaternion(dtheta, before[0], PICARD_CONING if c != 0.0 else 0.0)
    else:
        turn = quaternion_of_rotvec(rotation_vector(dtheta, before[0], c))
    if form[1]:
        dv_b = second_order_increment(dtheta, dvel)
    else:
        dv_b = add(
            rotated_velocity_increment(dtheta, dvel),
            sculling(dtheta, dvel, before[0], before[1], c),
        )
    dv = rotate(q, dv_b)
    at = r if form[2] else add(r, scale(0.5 * dt, v))
    g = j2_gravitation(at, earth) if j2 else normal_gravitation(at, gravity_height, earth)
    v_new = add(v, add(dv, scale(dt, g)))
    r_new = add(r, scale(0.5 * dt, add(v, v_new)))
    return r_new, v_new, normalised(product(q, turn)), dv


@kernel
def coasted(
    r: Vec3, v: Vec3, q: Quat, q_new: Quat, dt: float, earth: Ellipsoid
) -> tuple[Vec3, Vec3]:
    """Radius vector and velocity after a gap: the velocity over ground is held in body axes."""
    ground = subtract(v, earth_spin(r, earth))
    return carried(r, v, rotate(q_new, rotate_back(q, ground)), dt, earth)


@kernel
def levelled(
    r: Vec3, q: Quat, dv: Vec3, dt: float, gain: float, earth: Ellipsoid
) -> tuple[Quat, Vec3]:
    """Quaternion after levelling over the step, and the control rotation in ENU, rad.

    The computed ENU axes turn by the control rate; seen from the inertial frame the computed body
    turns the other way.
    """
    frame, lat, h = local_frame(r, earth)
    f_n = scale(1.0 / dt, mat_vec(frame, dv))
    rate = levelling_rate(f_n, gain, normal_gravity(lat, h, earth))
    turn = scale(abs(dt), rate)
    back = mat_t_vec(frame, scale(-1.0, turn))
    return normalised(product(quaternion_of_rotvec(back), q)), turn


# ---- the loop ----------------------------------------------------------------------------------


@kernel
def write_state(
    k: int,
    earth_turn: float,
    r: Vec3,
    v: Vec3,
    q: Quat,
    halted: bool,
    clamp: bool,
    height: float,
    earth: Ellipsoid,
    out_inertial: Array,
    out_position: Array,
    out_velocity: Array,
    out_attitude: Array,
) -> None:
    """Row k of the outputs; ``earth_turn`` (rad) since the start is what longitude loses.

    What is held is written as held, free of the rounding of V - Omega x R.
    """
    frame, lat, h = local_frame(r, earth)
    v_n = mat_vec(frame, subtract(v, earth_spin(r, earth)))
    if halted:
        v_n = velocity_reset()
    out_inertial[k, 0], out_inertial[k, 1], out_inertial[k, 2] = r
    out_position[k, 0] = lat
    out_position[k, 1] = math.atan2(r[1], r[0]) - earth_turn
    out_position[k, 2] = height if clamp else h
    out_velocity[k, 0], out_velocity[k, 1] = v_n[0], v_n[1]
    out_velocity[k, 2] = 0.0 if clamp else v_n[2]
    (
        out_attitude[k, 0], out_attitude[k, 1], out_attitude[k, 2],
        out_attitude[k, 3], out_attitude[k, 4], out_attitude[k, 5],
        out_attitude[k, 6], out_attitude[k, 7], out_attitude[k, 8],
    ) = dcm_of(frame, q)  # fmt: skip


@entry_kernel
def integrate_eci(
    t: Array,
    dtheta: Array,
    dvel: Array,
    coast: npt.NDArray[np.bool_],
    gain: Array,
    stop_id: IntArray,
    reset: bool,
    r: Vec3,
    v: Vec3,
    q: Quat,
    clamp: bool,
    height: float,
    gravity_height: float,
    form: tuple[bool, bool, bool],
    j2: bool,
    earth: Ellipsoid,
    out_inertial: Array,
    out_position: Array,
    out_velocity: Array,
    out_attitude: Array,
    out_v_before: Array,
    out_tilt: Array,
) -> None:
    """The loop over steps; see :func:`mechanize_eci`. Arrays C-ordered and writable."""
    th_prev = (0.0, 0.0, 0.0)
    dv_prev = (0.0, 0.0, 0.0)
    dt_prev = 0.0
    seen = -1
    v_before = (0.0, 0.0, 0.0)
    for k in range(t.shape[0]):
        stop = stop_id[k]
        turn = (0.0, 0.0, 0.0)
        if k > 0:
            dt = t[k] - t[k - 1]
            th = (dtheta[k - 1, 0], dtheta[k - 1, 1], dtheta[k - 1, 2])
            dv = (dvel[k - 1, 0], dvel[k - 1, 1], dvel[k - 1, 2])
            c = 0.0
            if dt_prev != 0.0 and not coast[k - 1]:
                c = coning_factor(dt, dt_prev)
                ratio = dt / dt_prev
                th_prev = scale(ratio, th_prev)
                dv_prev = scale(ratio, dv_prev)
            r_new, v_new, q_new, dv_i = eci_step(
                r, v, q, dt, (th, dv), (th_prev, dv_prev), c, form, j2, gravity_height, earth
            )
            if gain[k - 1] > 0.0:
                q_new, turn = levelled(r, q_new, dv_i, dt, gain[k - 1], earth)
            if coast[k - 1]:
                r_new, v_new = coasted(r, v, q, q_new, dt, earth)
            if clamp:
                r_new, v_new = clamped(r_new, v_new, dt, height, earth)
            if stop >= 0:
                v_before = velocity_over_ground(r_new, v_new, earth)
                if reset:
                    r_new, v_new = carried(r, v, velocity_reset(), dt, earth)
            r, v, q = r_new, v_new, q_new
            th_prev = th
            dv_prev = dv
            dt_prev = 0.0 if coast[k - 1] else dt
        elif stop >= 0:
            v_before = velocity_over_ground(r, v, earth)
            if reset:
                v = earth_spin(r, earth)
        if stop >= 0:
            if stop != seen:
                seen = stop
                out_v_before[stop, 0], out_v_before[stop, 1], out_v_before[stop, 2] = v_before
            out_tilt[stop, 0] += turn[0]
            out_tilt[stop, 1] += turn[1]
        write_state(
            k, earth.omega_ie * (t[k] - t[0]), r, v, q, reset and stop >= 0, clamp, height, earth,
            out_inertial, out_position, out_velocity, out_attitude,
        )  # fmt: skip


# ---- the call from Python ----------------------------------------------------------------------


@dataclass(frozen=True)
class EciSolution(Solution):
    """A :class:`Solution`, and the radius vector in inertial axes.

    Attributes
    ----------
    r_i : (n, 3)
        m; the frame coincides with the Earth-fixed one at the first instant.
    """

    r_i: Array


def mechanize_eci(
    increments: Increments,
    *,
    position: tuple[float, float, float],
    v_n: tuple[float, float, float] = (0.0, 0.0, 0.0),
    c_nb: Array,
    control: StopControl | None = None,
    vertical: Literal["clamp", "free"] = "clamp",
    gravity_at: Literal["reference", "height"] = "reference",
    gravity: Literal["normal", "j2"] = "normal",
    form: EciForm = SECOND_ORDER,
    earth: Ellipsoid = WGS84,
) -> EciSolution:
    """Integrate increments in the inertial frame (paper 000, corrections of 002).

    Same arguments and results as :func:`vehnav.strapdown.enu.mechanize_enu`, and:

    Parameters
    ----------
    gravity : {"normal", "j2"}
        ``normal``: the field of the ENU mechanization; ``j2``: two terms of the gravitation,
        at the computed height always.
    form : EciForm
        :data:`SECOND_ORDER` or :data:`PUBLISHED`, or a mixture.

    Raises
    ------
    ValueError
        If the levelling gain times the step reaches 1: the loop would not settle (spec A 4.3).
    """
    n = increments.t.size
    control = control or StopControl.none(n)
    if np.any(control.gain * np.abs(increments.dt) >= 1.0):
        raise ValueError("levelling gain (k g) times the step must stay below 1")
    r, v, q, start = _inertial_start(position, v_n, c_nb, earth)
    r_i, where, velocity = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    attitude = np.empty((n, 9))
    v_before, tilt = np.zeros((control.count, 3)), np.zeros((control.count, 2))
    flags = (
        form.attitude == "picard",
        form.velocity == "second-order",
        form.gravity_time == "start",
    )
    integrate_eci(
        _ready(increments.t), _ready(increments.dtheta), _ready(increments.dvel),
        np.require(increments.coast, np.bool_, ["C", "W"]), _ready(control.gain),
        np.require(control.stop_id, np.int64, ["C", "W"]), control.reset,
        r, v, q, vertical == "clamp", start[2],
        start[2] if gravity_at == "reference" else math.nan, flags, gravity == "j2", earth,
        r_i, where, velocity, attitude, v_before, tilt,
    )  # fmt: skip
    where[:, 1] = start[1] + np.unwrap(where[:, 1] - start[1])
    where[0] = start
    return EciSolution(where, velocity, attitude.reshape(n, 3, 3), v_before, tilt, r_i)


def _inertial_start(
    position: tuple[float, float, float],
    v_n: tuple[float, float, float],
    c_nb: Array,
    earth: Ellipsoid,
) -> tuple[Vec3, Vec3, Quat, Vec3]:
    """R_0, V_0 = V_rel + Omega x R_0, the quaternion of C_en C_nb; and the position as floats."""
    lat, lon, height = (float(x) for x in position)
    c = c_en(lat, lon)
    x, y, z = (float(k) for k in ecef_from_geodetic(lat, lon, height, earth=earth))
    a0, a1, a2 = (float(k) for k in c @ np.asarray(v_n, float))
    w, i, j, k = (float(e) for e in quaternion_from_c(c @ np.asarray(c_nb, float)))
    v = (a0 - earth.omega_ie * y, a1 + earth.omega_ie * x, a2)
    return (x, y, z), v, (w, i, j, k), (lat, lon, height)


def _ready(x: Array) -> Array:
    """C-ordered and writable: any other layout costs a recompilation."""
    return np.require(x, np.float64, ["C", "W"])
