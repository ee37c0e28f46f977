"""Poisson direction-cosine mechanization in the local East-North-Up frame (paper 004).

The recursion takes increments over steps; one small kernel per equation, one loop. The attitude
obeys Poisson's equation (11) ``dM/dt = M [omega_b x] - [omega_gamma x] M``, solved exactly for the
step as ``M <- exp(-[zeta x]) M exp([phi x])``; the velocity obeys (9), the position (7) and (10).
The stop procedures of paper 002 act inside the loop: levelling adds its control rate to
``omega_gamma``, the reset sets V := 0.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import numpy.typing as npt

from vehnav.corrections import levelling_rate, velocity_reset
from vehnav.earth import (
    WGS84,
    Ellipsoid,
    curvature_radii,
    earth_rate,
    normal_gravity,
    transport_rate,
)
from vehnav.kernel import entry_kernel, kernel
from vehnav.rotation import (
    Mat3,
    Vec3,
    add,
    cross,
    dcm_from_rotvec,
    mat_mat,
    mat_vec,
    scale,
)
from vehnav.strapdown.body_step import (
    coning_factor,
    rotated_velocity_increment,
    rotation_vector,
    sculling,
)
from vehnav.strapdown.increments import Increments
from vehnav.strapdown.solution import Solution as Solution
from vehnav.strapdown.solution import StopControl as StopControl

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# ---- one equation each -------------------------------------------------------------------------


@kernel
def coriolis(v_n: Vec3, omega_ie_n: Vec3, omega_en_n: Vec3) -> Vec3:
    """-(2 omega_ie + omega_en) x v, m/s2 (004 eq. 5)."""
    return cross(v_n, add(scale(2.0, omega_ie_n), omega_en_n))


@kernel
def unfelt_acceleration(
    v_n: Vec3, omega_ie_n: Vec3, omega_en_n: Vec3, gravity: float, dv_n: Vec3
) -> Vec3:
    """What changes v_n besides the specific force, m/s2: Coriolis, gravity, turning axes (004, 9).

    ``dv_n`` is the velocity increment of the step in the axes of its start; the axes turn under
    it, by half of omega_in dt on average.
    """
    turning = scale(-0.5, cross(add(omega_ie_n, omega_en_n), dv_n))
    a = add(coriolis(v_n, omega_ie_n, omega_en_n), turning)
    return (a[0], a[1], a[2] - gravity)


@kernel
def attitude_update(c_nb: Mat3, zeta: Vec3, phi: Vec3) -> Mat3:
    """C <- exp(-[zeta x]) C exp([phi x]): Poisson's equation over one step (004 eq. 11)."""
    turned_frame = dcm_from_rotvec(scale(-1.0, zeta))
    return mat_mat(turned_frame, mat_mat(c_nb, dcm_from_rotvec(phi)))


@kernel
def held_velocity(v_n: Vec3, before: Mat3, after: Mat3) -> Vec3:
    """Velocity held in body axes over a gap: it turns with the vehicle, its size stays."""
    v_b = (
        before[0] * v_n[0] + before[3] * v_n[1] + before[6] * v_n[2],
        before[1] * v_n[0] + before[4] * v_n[1] + before[7] * v_n[2],
        before[2] * v_n[0] + before[5] * v_n[1] + before[8] * v_n[2],
    )
    return mat_vec(after, v_b)


# ---- one step ----------------------------------------------------------------------------------


@kernel
def enu_step(
    position: Vec3,
    v_n: Vec3,
    c_nb: Mat3,
    memory: tuple[float, Vec3],
    dt: float,
    now: tuple[Vec3, Vec3],
    before: tuple[Vec3, Vec3],
    c: float,
    gain: float,
    stopped: bool,
    coast: bool,
    clamp: bool,
    gravity_height: float,
    earth: Ellipsoid,
) -> tuple[Vec3, Vec3, Mat3, tuple[float, Vec3], Vec3, Vec3]:
    """One step of the recursion.

    ``position`` is (lat rad, lon rad, h m); ``memory`` the meridian radius, m, and the acceleration
    that no sensor feels, m/s2 (:func:`unfelt_acceleration`), of the step before, which predict the
    middle of this one; ``now``, ``before``: the
    increments (dtheta, dvel) of this step and, scaled to its length, of the one before; ``c`` the
    :func:`coning_factor`; ``gain`` the levelling gain (1/s, 0 off); ``stopped``: V := 0 at the
    end; ``gravity_height``: where gravity is taken, m, or NaN for the height at mid-step. Returns
    position, velocity, attitude, memory, the velocity before the reset (m/s) and the control
    rotation (rad) of the step.
    """
    lat, lon, h = position
    dtheta, dvel = now
    phi = rotation_vector(dtheta, before[0], c)
    dv_b = add(
        rotated_velocity_increment(dtheta, dvel),
        sculling(dtheta, dvel, before[0], before[1], c),
    )
    dv_n = mat_vec(c_nb, dv_b)

    v_mid = v_n if coast else add(v_n, scale(0.5, add(dv_n, scale(dt, memory[1]))))
    if clamp:
        v_mid = (v_mid[0], v_mid[1], 0.0)
    lat_mid = lat + 0.5 * dt * v_mid[1] / memory[0]
    h_mid = h + 0.25 * dt * (v_n[2] + v_mid[2])
    radius_m, radius_n = curvature_radii(lat_mid, h_mid, earth)
    gravity = normal_gravity(
        lat_mid, h_mid if math.isnan(gravity_height) else gravity_height, earth
    )
    cos_lat = math.cos(lat_mid)
    omega_ie_n = earth_rate(lat_mid, earth)
    omega_en_n = transport_rate(v_mid, radius_m, radius_n, math.sin(lat_mid) / cos_lat)

    zeta = scale(dt, add(omega_ie_n, omega_en_n))
    control = (0.0, 0.0, 0.0)
    if gain > 0.0:
        # |dt|: a run backward in time settles too
        control = scale(abs(dt), levelling_rate(scale(1.0 / dt, dv_n), gain, gravity))
    c_new = attitude_update(c_nb, add(zeta, control), phi)

    unfelt = unfelt_acceleration(v_mid, omega_ie_n, omega_en_n, gravity, dv_n)
    v_new = add(v_n, add(dv_n, scale(dt, unfelt)))
    if coast:
        v_new = held_velocity(v_n, c_nb, c_new)
        unfelt = memory[1]
    if clamp:
        v_new = (v_new[0], v_new[1], 0.0)
    v_before = v_new
    if stopped:
        v_new = velocity_reset()

    half = 0.5 * dt
    new_position = (
        lat + half * (v_n[1] + v_new[1]) / radius_m,
        lon + half * (v_n[0] + v_new[0]) / (radius_n * cos_lat),
        h + half * (v_n[2] + v_new[2]),
    )
    return new_position, v_new, c_new, (radius_m, unfelt), v_before, control


@kernel
def start_memory(
    position: Vec3, v_n: Vec3, c_nb: Mat3, dvel: Vec3, gravity_height: float, earth: Ellipsoid
) -> tuple[float, Vec3]:
    """What :func:`enu_step` remembers of the step before, for the first one."""
    lat, _, h = position
    radius_m, radius_n = curvature_radii(lat, h, earth)
    gravity = normal_gravity(lat, h if math.isnan(gravity_height) else gravity_height, earth)
    omega_en_n = transport_rate(v_n, radius_m, radius_n, math.tan(lat))
    dv_n = mat_vec(c_nb, dvel)
    return radius_m, unfelt_acceleration(v_n, earth_rate(lat, earth), omega_en_n, gravity, dv_n)


@entry_kernel
def integrate_enu(
    t: Array,
    dtheta: Array,
    dvel: Array,
    coast: npt.NDArray[np.bool_],
    gain: Array,
    stop_id: IntArray,
    reset: bool,
    position: Vec3,
    v_n: Vec3,
    c_nb: Mat3,
    clamp: bool,
    gravity_height: float,
    earth: Ellipsoid,
    out_position: Array,
    out_velocity: Array,
    out_attitude: Array,
    out_v_before: Array,
    out_tilt: Array,
) -> None:
    """The loop over steps; see :func:`mechanize_enu`. Arrays C-ordered and writable."""
    th_prev = (0.0, 0.0, 0.0)
    dv_prev = (0.0, 0.0, 0.0)
    dt_prev = 0.0
    seen = -1
    memory = start_memory(
        position, v_n, c_nb, (dvel[0, 0], dvel[0, 1], dvel[0, 2]), gravity_height, earth
    )
    if stop_id[0] >= 0:
        seen = stop_id[0]
        out_v_before[seen, 0], out_v_before[seen, 1], out_v_before[seen, 2] = v_n
        if reset:
            v_n = (0.0, 0.0, 0.0)
    for k in range(t.shape[0]):
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
            stop = stop_id[k]
            position, v_n, c_nb, memory, v_before, control = enu_step(
                position, v_n, c_nb, memory, dt, (th, dv), (th_prev, dv_prev), c,
                gain[k - 1], reset and stop >= 0, coast[k - 1], clamp, gravity_height, earth,
            )  # fmt: skip
            if stop >= 0:
                if stop != seen:
                    seen = stop
                    out_v_before[stop, 0], out_v_before[stop, 1], out_v_before[stop, 2] = v_before
                out_tilt[stop, 0] += control[0]
                out_tilt[stop, 1] += control[1]
            th_prev = th
            dv_prev = dv
            dt_prev = 0.0 if coast[k - 1] else dt
        out_position[k, 0], out_position[k, 1], out_position[k, 2] = position
        out_velocity[k, 0], out_velocity[k, 1], out_velocity[k, 2] = v_n
        (
            out_attitude[k, 0], out_attitude[k, 1], out_attitude[k, 2],
            out_attitude[k, 3], out_attitude[k, 4], out_attitude[k, 5],
            out_attitude[k, 6], out_attitude[k, 7], out_attitude[k, 8],
        ) = c_nb  # fmt: skip


# ---- the call from Python ----------------------------------------------------------------------


def mechanize_enu(
    increments: Increments,
    *,
    position: tuple[float, float, float],
    v_n: tuple[float, float, float] = (0.0, 0.0, 0.0),
    c_nb: Array,
    control: StopControl | None = None,
    vertical: Literal["clamp", "free"] = "clamp",
    gravity_at: Literal["reference", "height"] = "reference",
    earth: Ellipsoid = WGS84,
) -> Solution:
    """Integrate increments in the local East-North-Up frame (paper 004, corrections of 002).

    Parameters
    ----------
    increments : Increments
        Forward, or reversed in time.
    position : (lat rad, lon rad, h m)
        At the first instant.
    v_n : (east, north, up), m/s
    c_nb : (3, 3)
        Body to ENU at the first instant.
    control : StopControl, optional
        Stops; none by default.
    vertical : {"clamp", "free"}
        ``clamp`` holds the height and V_up = 0. ``free`` integrates them, which is unstable
        with gravity at the computed height (spec A 1.3).
    gravity_at : {"reference", "height"}
        Height at which gravity is taken: that of the start, or the computed one.
    earth : Ellipsoid

    Raises
    ------
    ValueError
        If the levelling gain times the step reaches 1: the loop would not settle (spec A 4.3).
    """
    n = increments.t.size
    control = control or StopControl.none(n)
    if np.any(control.gain * np.abs(increments.dt) >= 1.0):
        raise ValueError("levelling gain (k g) times the step must stay below 1")
    out_position, out_velocity, out_attitude = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 9))
    v_before, tilt = np.zeros((control.count, 3)), np.zeros((control.count, 2))
    lat, lon, height = (float(x) for x in position)
    c0, c1, c2, c3, c4, c5, c6, c7, c8 = (float(x) for x in np.asarray(c_nb).ravel())
    integrate_enu(
        _ready(increments.t), _ready(increments.dtheta), _ready(increments.dvel),
        np.require(increments.coast, np.bool_, ["C", "W"]), _ready(control.gain),
        np.require(control.stop_id, np.int64, ["C", "W"]), control.reset,
        (lat, lon, height), (float(v_n[0]), float(v_n[1]), float(v_n[2])),
        (c0, c1, c2, c3, c4, c5, c6, c7, c8),
        vertical == "clamp", height if gravity_at == "reference" else math.nan, earth,
        out_position, out_velocity, out_attitude, v_before, tilt,
    )  # fmt: skip
    return Solution(out_position, out_velocity, out_attitude.reshape(n, 3, 3), v_before, tilt)


def _ready(x: Array) -> Array:
    """C-ordered and writable: any other layout costs a recompilation."""
    return np.require(x, np.float64, ["C", "W"])
