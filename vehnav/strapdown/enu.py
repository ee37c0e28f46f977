"""Poisson direction-cosine mechanization in the local East-North-Up frame (paper 004).

The recursion takes increments over steps; one small kernel per equation, one loop. The attitude
obeys Poisson's equation (11) ``dM/dt = M [omega_b x] - [omega_gamma x] M``, solved exactly for the
step as ``M <- exp(-[zeta x]) M exp([phi x])``; the velocity obeys (9), the position (7) and (10).
The stop procedures of paper 002 act inside the loop: levelling adds its control rate to
``omega_gamma``, the reset sets V := 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
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
    rotation_coefficients,
    scale,
    subtract,
)
from vehnav.strapdown.increments import Increments

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# ---- one equation each -------------------------------------------------------------------------


@kernel
def coning_factor(dt: float, dt_prev: float) -> float:
    """Factor on the cross products of neighbouring increments: 1/12 for even steps.

    dt_n / (6 (dt_n + dt_prev)), for previous increments scaled to dt_n; exact for a rate that is
    linear in time over two uneven steps (spec A 3.2).
    """
    return dt / (6.0 * (dt + dt_prev))


@kernel
def rotation_vector(dtheta: Vec3, dtheta_prev: Vec3, c: float) -> Vec3:
    """Phi, rad: rotation of the body over the step, with coning (000 eq. 12; spec A 5.4)."""
    return add(dtheta, scale(c, cross(dtheta_prev, dtheta)))


@kernel
def rotated_velocity_increment(dtheta: Vec3, dvel: Vec3) -> Vec3:
    """Velocity increment resolved in the body axes of the START of the step (000 eq. 16).

    Exact for a specific force and a rate that are constant in body axes over the step.
    """
    theta2 = dtheta[0] * dtheta[0] + dtheta[1] * dtheta[1] + dtheta[2] * dtheta[2]
    _, c, d = rotation_coefficients(theta2)
    once = cross(dtheta, dvel)
    twice = cross(dtheta, once)
    return add(dvel, add(scale(c, once), scale(d, twice)))


@kernel
def sculling(dtheta: Vec3, dvel: Vec3, dtheta_prev: Vec3, dvel_prev: Vec3, c: float) -> Vec3:
    """Velocity correction for rate and force that vary together, m/s (spec A 5.4)."""
    return scale(c, add(cross(dtheta_prev, dvel), cross(dvel_prev, dtheta)))


@kernel
def coriolis(v_n: Vec3, omega_ie_n: Vec3, omega_en_n: Vec3) -> Vec3:
    """-(2 omega_ie + omega_en) x v, m/s2 (004 eq. 5)."""
    return cross(v_n, add(scale(2.0, omega_ie_n), omega_en_n))


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
    place: tuple[float, float],
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
) -> tuple[Vec3, Vec3, Mat3, tuple[float, float], Vec3, Vec3]:
    """One step of the recursion.

    ``position`` is (lat rad, lon rad, h m); ``place`` the meridian radius, m, and gravity, m/s2,
    of the step before, good enough to predict the middle of this one; ``now``, ``before``: the
    increments (dtheta, dvel) of this step and, scaled to its length, of the one before; ``c`` the
    :func:`coning_factor`; ``gain`` the levelling gain (1/s, 0 off); ``stopped``: V := 0 at the
    end; ``gravity_height``: where gravity is taken, m, or NaN for the height at mid-step. Returns
    position, velocity, attitude, place, the velocity before the reset (m/s) and the control
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

    v_mid = v_n if coast else add(v_n, scale(0.5, (dv_n[0], dv_n[1], dv_n[2] - place[1] * dt)))
    if clamp:
        v_mid = (v_mid[0], v_mid[1], 0.0)
    lat_mid = lat + 0.5 * dt * v_mid[1] / place[0]
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
        control = scale(dt, levelling_rate(scale(1.0 / dt, dv_n), gain, gravity))
    c_new = attitude_update(c_nb, add(zeta, control), phi)

    dv_n = subtract(dv_n, scale(0.5, cross(zeta, dv_n)))
    v_new = add(v_n, add(dv_n, scale(dt, coriolis(v_mid, omega_ie_n, omega_en_n))))
    v_new = (v_new[0], v_new[1], v_new[2] - gravity * dt)
    if coast:
        v_new = held_velocity(v_n, c_nb, c_new)
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
    return new_position, v_new, c_new, (radius_m, gravity), v_before, control


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
    place = (
        curvature_radii(position[0], position[2], earth)[0],
        normal_gravity(position[0], position[2], earth),
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
            position, v_n, c_nb, place, v_before, control = enu_step(
                position, v_n, c_nb, place, dt, (th, dv), (th_prev, dv_prev), c,
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


@dataclass(frozen=True)
class StopControl:
    """What to do at each instant and step because of stops.

    Attributes
    ----------
    stop_id : (n,) int64
        Number of the stop that an instant lies in, -1 while moving.
    gain : (n-1,)
        Levelling gain over each step, 1/s; 0 where off.
    reset : bool
        Whether V := 0 at the instants of a stop.
    count : int
        Number of stops.
    """

    stop_id: IntArray
    gain: Array
    reset: bool
    count: int

    @classmethod
    def none(cls, n: int) -> StopControl:
        """No stops, for n instants."""
        return cls(np.full(n, -1, dtype=np.int64), np.zeros(n - 1), reset=False, count=0)

    def part(self, first: int, last: int) -> StopControl:
        """For the instants ``first`` to ``last``, both included; stops keep their numbers."""
        return StopControl(
            self.stop_id[first : last + 1], self.gain[first:last], self.reset, self.count
        )

    def reversed(self) -> StopControl:
        """For increments run backward."""
        return StopControl(
            self.stop_id[::-1].copy(), self.gain[::-1].copy(), self.reset, self.count
        )


@dataclass(frozen=True)
class Solution:
    """What the mechanization returns, at the n instants of the increments.

    Attributes
    ----------
    position : (n, 3)
        lat rad, lon rad, h m.
    v_n : (n, 3)
        East, north, up, m/s.
    c_nb : (n, 3, 3)
    v_before_reset : (stops, 3)
        Velocity found on the first instant of each stop, before the reset, m/s.
    tilt_correction : (stops, 2)
        Rotation about east and north that levelling applied in each stop, rad.
    """

    position: Array
    v_n: Array
    c_nb: Array
    v_before_reset: Array
    tilt_correction: Array


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
