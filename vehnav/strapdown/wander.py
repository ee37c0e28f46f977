"""Free-azimuth mechanization (paper 003, equations 22-25): regular everywhere, poles included.

The axes w are East-North-Up turned about up by the wander angle epsilon (counter-clockwise). The
place is the matrix ``c_we`` (the paper's B: Earth-fixed to w), the attitude ``c_wb`` (the paper's
L transposed). Nothing divides by cos(lat): the rate of the axes has no free part about up
(relative-free azimuth, Omega_3 = 0) or none in inertial space (absolute-free, omega_3 = 0).
Latitude, longitude and epsilon are outputs alone (24).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from vehnav.corrections import levelling_rate, velocity_reset
from vehnav.earth import WGS84, Ellipsoid, normal_gravity
from vehnav.kernel import entry_kernel, kernel
from vehnav.rotation import Mat3, Vec3, add, cross, mat_vec, scale
from vehnav.strapdown.body_step import (
    coning_factor,
    rotated_velocity_increment,
    rotation_vector,
    sculling,
)
from vehnav.strapdown.enu import attitude_update, held_velocity, unfelt_acceleration
from vehnav.strapdown.increments import Increments
from vehnav.strapdown.place import c_nw as c_nw
from vehnav.strapdown.place import c_we_from_geodetic as c_we_from_geodetic
from vehnav.strapdown.place import geodetic_from_c_we as geodetic_from_c_we
from vehnav.strapdown.solution import Solution, StopControl

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Azimuth = Literal["relative", "absolute"]
Memory = tuple[Vec3, Vec3]

# ---- one equation each -------------------------------------------------------------------------


@kernel
def earth_axis(c_we: Mat3) -> Vec3:
    """(b13, b23, b33): the rotation axis of the Earth in wander axes; b33 is sin(lat)."""
    return (c_we[2], c_we[5], c_we[8])


@kernel
def curvature(axis: Vec3, h: float, earth: Ellipsoid) -> Vec3:
    """(k11, k12, k22), 1/m: curvature of the ellipsoid along the wander axes, exact (spec B 0)."""
    w2 = 1.0 - earth.e2 * axis[2] * axis[2]
    w = math.sqrt(w2)
    radius_n = earth.a / w + h
    radius_m = earth.a * (1.0 - earth.e2) / (w2 * w) + h
    d = earth.a * earth.e2 / (w2 * w * radius_m * radius_n)
    return (
        1.0 / radius_n + d * axis[0] * axis[0],
        d * axis[0] * axis[1],
        1.0 / radius_n + d * axis[1] * axis[1],
    )


@kernel
def relative_rate(
    axis: Vec3, h: float, v_w: Vec3, absolute: bool, omega_ie: float, earth: Ellipsoid
) -> Vec3:
    """omega_ew_w, rad/s: the axes turn because the vehicle moves (003, after eq. 22).

    About up: nothing (relative-free azimuth), or minus the Earth rate (absolute-free).
    """
    k11, k12, k22 = curvature(axis, h, earth)
    about_up = -omega_ie * axis[2] if absolute else 0.0
    return (-(k12 * v_w[0] + k22 * v_w[1]), k11 * v_w[0] + k12 * v_w[1], about_up)


@kernel
def gravity_at(axis: Vec3, h: float, earth: Ellipsoid) -> float:
    """Normal gravity, m/s2, where the Earth axis has the components ``axis``."""
    return normal_gravity(math.asin(max(-1.0, min(1.0, axis[2]))), h, earth)


@kernel
def place_update(c_we: Mat3, turn: Vec3) -> Mat3:
    """C_we <- exp(-[turn x]) C_we (23), by columns: c - t x c + t x (t x c) / 2.

    The turn of a step is some 1e-8 rad: the third order is below rounding, and adding the small
    part to the old one keeps the digits that a product with nearly a unit matrix would lose.
    """
    x = _turned((c_we[0], c_we[3], c_we[6]), turn)
    y = _turned((c_we[1], c_we[4], c_we[7]), turn)
    z = _turned((c_we[2], c_we[5], c_we[8]), turn)
    return (x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2])


@kernel
def _turned(column: Vec3, turn: Vec3) -> Vec3:
    once = cross(turn, column)
    return add(column, add(scale(-1.0, once), scale(0.5, cross(turn, once))))


# ---- one step ----------------------------------------------------------------------------------


@kernel
def wander_step(
    c_we: Mat3,
    h: float,
    v_w: Vec3,
    c_wb: Mat3,
    memory: Memory,
    dt: float,
    now: tuple[Vec3, Vec3],
    before: tuple[Vec3, Vec3],
    c: float,
    gain: float,
    stopped: bool,
    coast: bool,
    clamp: bool,
    gravity_height: float,
    absolute: bool,
    earth: Ellipsoid,
) -> tuple[Mat3, float, Vec3, Mat3, Memory, Vec3, Vec3]:
    """One step of (22)-(25), second order (spec B 3.3); arguments as :func:`enu.enu_step`.

    ``memory``: the rate of the axes, rad/s, and the acceleration that no sensor feels, m/s2, of
    the step before. Returns place, height, velocity, attitude, memory, the velocity before the
    reset and the control rotation.
    """
    dtheta, dvel = now
    phi = rotation_vector(dtheta, before[0], c)
    dv_b = add(
        rotated_velocity_increment(dtheta, dvel),
        sculling(dtheta, dvel, before[0], before[1], c),
    )
    dv_w = mat_vec(c_wb, dv_b)

    v_mid = v_w if coast else add(v_w, scale(0.5, add(dv_w, scale(dt, memory[1]))))
    if clamp:
        v_mid = (v_mid[0], v_mid[1], 0.0)
    axis = add(earth_axis(c_we), scale(-0.5 * dt, cross(memory[0], earth_axis(c_we))))
    h_mid = h + 0.25 * dt * (v_w[2] + v_mid[2])
    omega_ie_w = scale(earth.omega_ie, axis)
    omega_ew_w = relative_rate(axis, h_mid, v_mid, absolute, earth.omega_ie, earth)
    gravity = gravity_at(axis, h_mid if math.isnan(gravity_height) else gravity_height, earth)

    zeta = scale(dt, add(omega_ie_w, omega_ew_w))
    control = (0.0, 0.0, 0.0)
    if gain > 0.0:
        control = scale(abs(dt), levelling_rate(scale(1.0 / dt, dv_w), gain, gravity))
    c_new = attitude_update(c_wb, add(zeta, control), phi)

    unfelt = unfelt_acceleration(v_mid, omega_ie_w, omega_ew_w, gravity, dv_w)
    v_new = add(v_w, add(dv_w, scale(dt, unfelt)))
    if coast:
        v_new = held_velocity(v_w, c_wb, c_new)
        unfelt = memory[1]
    if clamp:
        v_new = (v_new[0], v_new[1], 0.0)
    v_before = v_new
    if stopped:
        v_new = velocity_reset()

    mean = scale(0.5, add(v_w, v_new))
    turn = scale(dt, relative_rate(axis, h_mid, mean, absolute, earth.omega_ie, earth))
    return (
        place_update(c_we, turn),
        h + dt * mean[2],
        v_new,
        c_new,
        (omega_ew_w, unfelt),
        v_before,
        control,
    )


@kernel
def start_memory(
    c_we: Mat3,
    h: float,
    v_w: Vec3,
    dv_w: Vec3,
    gravity_height: float,
    absolute: bool,
    earth: Ellipsoid,
) -> Memory:
    """What :func:`wander_step` remembers of the step before, for the first one."""
    axis = earth_axis(c_we)
    gravity = gravity_at(axis, h if math.isnan(gravity_height) else gravity_height, earth)
    omega_ew_w = relative_rate(axis, h, v_w, absolute, earth.omega_ie, earth)
    omega_ie_w = scale(earth.omega_ie, axis)
    return omega_ew_w, unfelt_acceleration(v_w, omega_ie_w, omega_ew_w, gravity, dv_w)


@entry_kernel
def integrate_wander(
    t: Array,
    dtheta: Array,
    dvel: Array,
    coast: npt.NDArray[np.bool_],
    gain: Array,
    stop_id: IntArray,
    reset: bool,
    c_we: Mat3,
    h: float,
    v_w: Vec3,
    c_wb: Mat3,
    clamp: bool,
    gravity_height: float,
    absolute: bool,
    earth: Ellipsoid,
    out: tuple[Array, Array, Array, Array],
    out_v_before: Array,
    out_tilt: Array,
) -> None:
    """The loop over steps; see :func:`mechanize_wander`. ``out``: c_we, h, v_w, c_wb by rows."""
    th_prev = (0.0, 0.0, 0.0)
    dv_prev = (0.0, 0.0, 0.0)
    dt_prev = 0.0
    seen = -1
    dv_w = mat_vec(c_wb, (dvel[0, 0], dvel[0, 1], dvel[0, 2]))
    memory = start_memory(c_we, h, v_w, dv_w, gravity_height, absolute, earth)
    if stop_id[0] >= 0:
        seen = stop_id[0]
        out_v_before[seen, 0], out_v_before[seen, 1], out_v_before[seen, 2] = v_w
        if reset:
            v_w = (0.0, 0.0, 0.0)
    for k in range(t.shape[0]):
        if k > 0:
            dt = t[k] - t[k - 1]
            th = (dtheta[k - 1, 0], dtheta[k - 1, 1], dtheta[k - 1, 2])
            dv = (dvel[k - 1, 0], dvel[k - 1, 1], dvel[k - 1, 2])
            c = 0.0
            if dt_prev != 0.0 and not coast[k - 1]:
                c = coning_factor(dt, dt_prev)
                th_prev = scale(dt / dt_prev, th_prev)
                dv_prev = scale(dt / dt_prev, dv_prev)
            stop = stop_id[k]
            c_we, h, v_w, c_wb, memory, v_before, control = wander_step(
                c_we, h, v_w, c_wb, memory, dt, (th, dv), (th_prev, dv_prev), c, gain[k - 1],
                reset and stop >= 0, coast[k - 1], clamp, gravity_height, absolute, earth,
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
        out[1][k] = h
        out[2][k, 0], out[2][k, 1], out[2][k, 2] = v_w
        for j in range(9):
            out[0][k, j] = c_we[j]
            out[3][k, j] = c_wb[j]


# ---- the result --------------------------------------------------------------------------------


@dataclass(frozen=True)
class WanderSolution:
    """What the free-azimuth mechanization returns, at the n instants of the increments.

    Attributes
    ----------
    c_we : (n, 3, 3)
        Place: Earth-fixed to wander axes.
    height : (n,)
        m
    v_w : (n, 3)
        m/s
    c_wb : (n, 3, 3)
    v_before_reset : (stops, 3)
        m/s, wander axes.
    tilt_correction : (stops, 2)
        rad, about the wander axes.
    at_stop : (stops,) int64
        Index of the first instant of each stop.
    """

    c_we: Array
    height: Array
    v_w: Array
    c_wb: Array
    v_before_reset: Array
    tilt_correction: Array
    at_stop: IntArray

    def enu(self) -> Solution:
        """In East-North-Up: latitude and longitude and heading degenerate at a pole only."""
        lat, lon, wander = geodetic_from_c_we(self.c_we)
        turn = c_nw(wander)
        at_stop = turn[self.at_stop]
        return Solution(
            position=np.stack([lat, lon, self.height], axis=1),
            v_n=np.einsum("kij,kj->ki", turn, self.v_w),
            c_nb=turn @ self.c_wb,
            v_before_reset=np.einsum("kij,kj->ki", at_stop, self.v_before_reset),
            tilt_correction=np.einsum("kij,kj->ki", at_stop[:, :2, :2], self.tilt_correction),
        )


# ---- the call from Python ----------------------------------------------------------------------


def mechanize_wander(
    increments: Increments,
    *,
    c_we: Array,
    height: float,
    v_w: tuple[float, float, float] = (0.0, 0.0, 0.0),
    c_wb: Array,
    azimuth: Azimuth = "relative",
    control: StopControl | None = None,
    vertical: Literal["clamp", "free"] = "clamp",
    gravity_reference: Literal["reference", "height"] = "reference",
    earth: Ellipsoid = WGS84,
) -> WanderSolution:
    """Integrate increments in free-azimuth axes (paper 003), with the corrections of paper 002.

    Parameters
    ----------
    increments : Increments
        Forward, or reversed in time.
    c_we : (3, 3)
        Place at the first instant: :func:`c_we_from_geodetic`.
    height : float
        m
    v_w : (3,)
        m/s, wander axes.
    c_wb : (3, 3)
        Body to wander axes.
    azimuth : {"relative", "absolute"}
        Free relative to the Earth (4) or to inertial space (5).
    control : StopControl, optional
        Stops; none by default.
    vertical : {"clamp", "free"}
        Whether the height is held.
    gravity_reference : {"reference", "height"}
        Height at which gravity is taken: that of the start, or the computed one.
    earth : Ellipsoid

    Raises
    ------
    ValueError
        If the levelling gain times the step reaches 1.
    """
    n = increments.t.size
    control = control or StopControl.none(n)
    if np.any(control.gain * np.abs(increments.dt) >= 1.0):
        raise ValueError("levelling gain (k g) times the step must stay below 1")
    out = (np.empty((n, 9)), np.empty(n), np.empty((n, 3)), np.empty((n, 9)))
    v_before, tilt = np.zeros((control.count, 3)), np.zeros((control.count, 2))
    integrate_wander(
        _ready(increments.t), _ready(increments.dtheta), _ready(increments.dvel),
        np.require(increments.coast, np.bool_, ["C", "W"]), _ready(control.gain),
        np.require(control.stop_id, np.int64, ["C", "W"]), control.reset,
        mat3(c_we), float(height), (float(v_w[0]), float(v_w[1]), float(v_w[2])), mat3(c_wb),
        vertical == "clamp", height if gravity_reference == "reference" else math.nan,
        azimuth == "absolute", earth, out, v_before, tilt,
    )  # fmt: skip
    numbers, first = np.unique(control.stop_id, return_index=True)
    at_stop = np.zeros(control.count, np.int64)
    at_stop[numbers[numbers >= 0]] = first[numbers >= 0]
    return WanderSolution(
        out[0].reshape(n, 3, 3), out[1], out[2], out[3].reshape(n, 3, 3), v_before, tilt, at_stop
    )


def mat3(c: Array) -> Mat3:
    """A (3, 3) array as the nine numbers of a kernel."""
    c0, c1, c2, c3, c4, c5, c6, c7, c8 = (float(x) for x in np.asarray(c).ravel())
    return (c0, c1, c2, c3, c4, c5, c6, c7, c8)


def _ready(x: Array) -> Array:
    """C-ordered and writable: any other layout costs a recompilation."""
    return np.require(x, np.float64, ["C", "W"])
