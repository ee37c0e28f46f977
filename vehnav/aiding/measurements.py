"""What is measured: rows of the measurement matrix and innovations, computed minus measured.

Each kernel writes the row ``h`` (all states) of a scalar measurement ``z = h x + noise`` and
returns z. With the dynamic velocity error (:mod:`vehnav.aiding.error_model`) everything that sees
the velocity in body axes has no attitude in its row (003 eq. 37).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vehnav.earth import Ellipsoid
from vehnav.kernel import kernel
from vehnav.rotation import Mat3, Vec3, mat_t_vec, mat_vec
from vehnav.strapdown.wander import curvature, earth_axis

Array = npt.NDArray[np.float64]


@kernel
def ecef_of(place: Mat3, h: float, earth: Ellipsoid) -> Vec3:
    """Earth-fixed position, m, of a place matrix and a height (003 eq. 9)."""
    radius = earth.a / np.sqrt(1.0 - earth.e2 * place[8] * place[8])
    return (
        (radius + h) * place[6],
        (radius + h) * place[7],
        (radius * (1.0 - earth.e2) + h) * place[8],
    )


@kernel
def zero_velocity(h: Array, j: int, v: Vec3) -> float:
    """Axis j of the velocity is zero: z = V' (003, as 37).

    At a stop the velocity that a tilt makes, g times it in a second, brings the tilt out: levelling
    and reset of paper 002 are this measurement with a gain that is chosen.
    """
    h[:] = 0.0
    h[3 + j] = 1.0
    return v[j]


@kernel
def zero_rate(h: Array, j: int, rate: Vec3, c_wb: Mat3, axis: Vec3, omega_ie: float) -> float:
    """Axis j (body) of the mean rate at rest is the Earth's: z = omega' - C_bw u.

    The row holds the attitude too, through the Earth rate: at long stops a good gyro finds north.
    """
    h[:] = 0.0
    h[12 + j] = 1.0
    u = (omega_ie * axis[0], omega_ie * axis[1], omega_ie * axis[2])
    c0, c1, c2 = c_wb[j], c_wb[3 + j], c_wb[6 + j]  # column j: body axis j in w
    # -C_bw (beta x u), beta taken as alpha: the difference is a position error over R
    h[6] = -(c2 * u[1] - c1 * u[2])
    h[7] = -(c0 * u[2] - c2 * u[0])
    h[8] = -(c1 * u[0] - c0 * u[1])
    return rate[j] - mat_t_vec(c_wb, u)[j]


@kernel
def body_velocity(h: Array, j: int, c_wb: Mat3, weight: float) -> None:
    """Add ``weight`` times the error of body axis j of the velocity: C_bw delta V."""
    h[3] += weight * c_wb[j]
    h[4] += weight * c_wb[3 + j]
    h[5] += weight * c_wb[6 + j]


@kernel
def no_side_slip(h: Array, v: Vec3, c_wb: Mat3, rate: Vec3, par: Array) -> float:
    """Z = v_right - (mu v - l omega_up + k v^2 omega_up) (aiding/vehicle.py)."""
    h[:] = 0.0
    v_b = mat_t_vec(c_wb, v)
    speed = v_b[1]
    mu, lever, slip = float(par[7]), float(par[9]), float(par[11])
    body_velocity(h, 0, c_wb, 1.0)
    body_velocity(h, 1, c_wb, -mu - 2.0 * slip * speed * rate[2])
    h[16] = -speed
    h[18] = rate[2]
    h[20] = -speed * speed * rate[2]
    return v_b[0] - mu * speed - (slip * speed * speed - lever) * rate[2]


@kernel
def no_lift(h: Array, v: Vec3, c_wb: Mat3, ahead: float, par: Array) -> float:
    """Z = v_up - (p + q f) v, f = ``ahead`` the forward specific force, m/s2."""
    h[:] = 0.0
    v_b = mat_t_vec(c_wb, v)
    body_velocity(h, 2, c_wb, 1.0)
    rise = float(par[8] + par[13] * ahead)
    body_velocity(h, 1, c_wb, -rise)
    h[17] = -v_b[1]
    h[22] = -ahead * v_b[1]
    return v_b[2] - rise * v_b[1]


@kernel
def odometer(h: Array, v: Vec3, c_wb: Mat3, speed: float, par: Array) -> float:
    """Z = (1 + kappa) v_forward - speed (003 eq. 36, 37; kappa of spec B 6).

    The row has the computed speed: the noise of the reading, in both, would pull the scale along.
    """
    h[:] = 0.0
    scale, forward = 1.0 + float(par[6]), mat_t_vec(c_wb, v)[1]
    body_velocity(h, 1, c_wb, scale)
    h[15] = forward
    return scale * forward - speed


@kernel
def gnss_position(
    place: Mat3, height: float, v: Vec3, fix: Vec3, ago: float, earth: Ellipsoid
) -> Vec3:
    """Z (3) = C_we (r' - r_s) ("direct" form, spec B 3.5); rows: 1 at y_j.

    ``ago``: s by which the fix is older than the state; the state is carried back with V.
    """
    r = ecef_of(place, height, earth)
    z = mat_vec(place, (r[0] - fix[0], r[1] - fix[1], r[2] - fix[2]))
    return (z[0] - ago * v[0], z[1] - ago * v[1], z[2] - ago * v[2])


@kernel
def arms_of(c_wb: Mat3, rate: Vec3, arm: Vec3) -> tuple[Vec3, Vec3]:
    """What the lever arm ``arm`` (body axes) adds to position and velocity, wander axes.

    C_wb l and C_wb (omega x l); the rate of the axes themselves over the Earth is nothing to it.
    """
    turning = (
        rate[1] * arm[2] - rate[2] * arm[1],
        rate[2] * arm[0] - rate[0] * arm[2],
        rate[0] * arm[1] - rate[1] * arm[0],
    )
    return mat_vec(c_wb, arm), mat_vec(c_wb, turning)


@kernel
def take_arms_off(fix: Array, place: Mat3, arms: tuple[Vec3, Vec3], out: Array) -> None:
    """The fix (13,) as the IMU's place would have it, into ``out``."""
    out[:] = fix
    for k in range(2):
        d = mat_t_vec(place, arms[k])
        for j in range(3):
            out[3 * k + j] -= d[j]


@kernel
def add_arm(h: Array, axis: Vec3, arm: Vec3) -> None:
    """Add the attitude to a row along ``axis``: (C' - C) l = (C' l) x alpha."""
    h[6] += axis[1] * arm[2] - axis[2] * arm[1]
    h[7] += axis[2] * arm[0] - axis[0] * arm[2]
    h[8] += axis[0] * arm[1] - axis[1] * arm[0]


@kernel
def gnss_velocity(h: Array, j: int, place: Mat3, height: float, v: Vec3, earth: Ellipsoid) -> None:
    """Row of z = V' - C_we V_e: the full velocity error delta V + V x beta."""
    h[:] = 0.0
    h[3 + j] = 1.0
    k11, k12, k22 = curvature(earth_axis(place), height, earth)
    b = (0.0, -v[2], v[1])
    if j == 1:
        b = (v[2], 0.0, -v[0])
    if j == 2:
        b = (-v[1], v[0], 0.0)
    h[6], h[7], h[8] = b
    h[0] = b[0] * k12 - b[1] * k11
    h[1] = b[0] * k22 - b[1] * k12
