"""Quaternions (w, x, y, z) as kernels: Picard's series, products, rotations (paper 000)."""

from __future__ import annotations

import math

from vehnav.kernel import kernel
from vehnav.rotation import Mat3, Vec3, add, cross, mat_mat, scale

Quat = tuple[float, float, float, float]


@kernel
def product(p: Quat, q: Quat) -> Quat:
    """P o q: right multiplication as in (10)."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] + p[2] * q[0] + p[3] * q[1] - p[1] * q[3],
        p[0] * q[3] + p[3] * q[0] + p[1] * q[2] - p[2] * q[1],
    )


@kernel
def normalised(q: Quat) -> Quat:
    """Q over its norm (14)."""
    k = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return (k * q[0], k * q[1], k * q[2], k * q[3])


@kernel
def picard_quaternion(dtheta: Vec3, dtheta_prev: Vec3, c: float) -> Quat:
    """Rotation of the body over the step to the third order of Picard's series (13).

    1 - theta^2/8, theta (1/2 - theta^2/48) + c/2 [theta* x theta]; theta* is the increment before,
    scaled to the length of this step. (13) prints c = 1/12, right for even steps only; the
    factor of :func:`vehnav.strapdown.body_step.coning_factor` is right for uneven ones too.
    """
    theta2 = dtheta[0] * dtheta[0] + dtheta[1] * dtheta[1] + dtheta[2] * dtheta[2]
    part = add(scale(0.5 - theta2 / 48.0, dtheta), scale(0.5 * c, cross(dtheta_prev, dtheta)))
    return (1.0 - theta2 / 8.0, part[0], part[1], part[2])


@kernel
def quaternion_of_rotvec(phi: Vec3) -> Quat:
    """Exact quaternion of a rotation vector, rad; series below 0.06 rad (next term 1e-17)."""
    half2 = 0.25 * (phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
    if half2 < 1e-3:
        w = 1.0 - half2 / 2.0 * (1.0 - half2 / 12.0 * (1.0 - half2 / 30.0 * (1.0 - half2 / 56.0)))
        s = 1.0 - half2 / 6.0 * (1.0 - half2 / 20.0 * (1.0 - half2 / 42.0 * (1.0 - half2 / 72.0)))
    else:
        half = math.sqrt(half2)
        w, s = math.cos(half), math.sin(half) / half
    return (w, 0.5 * s * phi[0], 0.5 * s * phi[1], 0.5 * s * phi[2])


@kernel
def rotate(q: Quat, v: Vec3) -> Vec3:
    """Q o v o q~ of a unit quaternion (18)."""
    u = (q[1], q[2], q[3])
    once = cross(u, v)
    twice = cross(u, once)
    return add(v, add(scale(2.0 * q[0], once), scale(2.0, twice)))


@kernel
def rotate_back(q: Quat, v: Vec3) -> Vec3:
    """q~ o v o q of a unit quaternion: the inverse of :func:`rotate`."""
    return rotate((q[0], -q[1], -q[2], -q[3]), v)


@kernel
def dcm_of(frame: Mat3, q: Quat) -> Mat3:
    """Frame C(q): C_nb of the rows of C_ni and of the quaternion body to inertial."""
    w, x, y, z = q
    c = (
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    )  # fmt: skip
    return mat_mat(frame, c)
