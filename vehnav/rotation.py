"""Rotations: direction cosines, rotation vectors, heading-pitch-roll, quaternions.

Judged by ``scipy.spatial.transform`` in the tests. Kernels hold a matrix as nine numbers by rows
and a vector as three; numpy functions take (..., 3, 3) and (..., 3).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from vehnav.kernel import kernel

Array = npt.NDArray[np.float64]
Vec3 = tuple[float, float, float]
Mat3 = tuple[float, float, float, float, float, float, float, float, float]


# ---- kernels -----------------------------------------------------------------------------------


@kernel
def cross(a: Vec3, b: Vec3) -> Vec3:
    """A x b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel
def add(a: Vec3, b: Vec3) -> Vec3:
    """A + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@kernel
def subtract(a: Vec3, b: Vec3) -> Vec3:
    """A - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@kernel
def scale(k: float, a: Vec3) -> Vec3:
    """K a."""
    return (k * a[0], k * a[1], k * a[2])


@kernel
def dot(a: Vec3, b: Vec3) -> float:
    """Scalar product of a and b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def mat_vec(m: Mat3, v: Vec3) -> Vec3:
    """M v."""
    return (
        m[0] * v[0] + m[1] * v[1] + m[2] * v[2],
        m[3] * v[0] + m[4] * v[1] + m[5] * v[2],
        m[6] * v[0] + m[7] * v[1] + m[8] * v[2],
    )


@kernel
def mat_t_vec(m: Mat3, v: Vec3) -> Vec3:
    """M^T v."""
    return (
        m[0] * v[0] + m[3] * v[1] + m[6] * v[2],
        m[1] * v[0] + m[4] * v[1] + m[7] * v[2],
        m[2] * v[0] + m[5] * v[1] + m[8] * v[2],
    )


@kernel
def mat_mat(a: Mat3, b: Mat3) -> Mat3:
    """A B."""
    return (
        a[0] * b[0] + a[1] * b[3] + a[2] * b[6],
        a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
        a[0] * b[2] + a[1] * b[5] + a[2] * b[8],
        a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
        a[3] * b[1] + a[4] * b[4] + a[5] * b[7],
        a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
        a[6] * b[0] + a[7] * b[3] + a[8] * b[6],
        a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
        a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
    )


@kernel
def rotation_coefficients(theta2: float) -> tuple[float, float, float]:
    """(sin t / t, (1 - cos t) / t^2, (1 - sin t / t) / t^2) of t = sqrt(theta2).

    Series below t = 0.1 (next term under 1e-16); closed forms above.
    """
    if theta2 < 0.01:
        s = 1.0 - theta2 / 6.0 * (
            1.0 - theta2 / 20.0 * (1.0 - theta2 / 42.0 * (1.0 - theta2 / 72.0))
        )
        c = 0.5 - theta2 / 24.0 * (
            1.0 - theta2 / 30.0 * (1.0 - theta2 / 56.0 * (1.0 - theta2 / 90.0))
        )
        d = (1.0 / 6.0) * (
            1.0
            - theta2 / 20.0 * (1.0 - theta2 / 42.0 * (1.0 - theta2 / 72.0 * (1.0 - theta2 / 110.0)))
        )
        return (s, c, d)
    theta = math.sqrt(theta2)
    s = math.sin(theta) / theta
    return (s, (1.0 - math.cos(theta)) / theta2, (1.0 - s) / theta2)


@kernel
def dcm_from_rotvec(phi: Vec3) -> Mat3:
    """exp([phi x]): rotation by the vector phi, rad (Rodrigues)."""
    x, y, z = phi
    s, c, _ = rotation_coefficients(x * x + y * y + z * z)
    return (
        1.0 - c * (y * y + z * z),
        c * x * y - s * z,
        c * x * z + s * y,
        c * x * y + s * z,
        1.0 - c * (x * x + z * z),
        c * y * z - s * x,
        c * x * z - s * y,
        c * y * z + s * x,
        1.0 - c * (x * x + y * y),
    )


# ---- arrays ------------------------------------------------------------------------------------


def skew(v: npt.ArrayLike) -> Array:
    """[v x] (..., 3, 3) of v (..., 3): ``skew(a) @ b`` is the cross product."""
    v = np.asarray(v, float)
    zero = np.zeros_like(v[..., 0])
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def c_from_rotvec(phi: npt.ArrayLike) -> Array:
    """exp([phi x]) (..., 3, 3) of rotation vectors (..., 3), rad."""
    phi = np.asarray(phi, float)
    t2 = np.sum(phi * phi, axis=-1)[..., None, None]
    t = np.sqrt(t2)
    with np.errstate(invalid="ignore", divide="ignore"):
        s = np.where(t2 < 1e-8, 1.0 - t2 / 6.0, np.sin(t) / t)
        c = np.where(t2 < 1e-4, 0.5 - t2 / 24.0 + t2 * t2 / 720.0, (1.0 - np.cos(t)) / t2)
    k = skew(phi)
    return np.asarray(np.eye(3) + s * k + c * (k @ k))


def c_nb_from_angles(heading: npt.ArrayLike, pitch: npt.ArrayLike, roll: npt.ArrayLike) -> Array:
    """C_nb (..., 3, 3) of heading (clockwise from north), pitch (nose up), roll (right side down).

    Angles in rad; body axes right-forward-up; order heading, pitch, roll (spec A 1.1).

    >>> (c_nb_from_angles(np.pi / 2, 0.0, 0.0) @ [0.0, 1.0, 0.0]).round(12).tolist()
    [1.0, 0.0, 0.0]
    """
    heading, pitch, roll = np.broadcast_arrays(
        *(np.asarray(x, float) for x in (heading, pitch, roll))
    )
    sk, ck = np.sin(heading), np.cos(heading)
    sp, cp = np.sin(pitch), np.cos(pitch)
    sr, cr = np.sin(roll), np.cos(roll)
    rows = [
        [ck * cr + sk * sp * sr, sk * cp, ck * sr - sk * sp * cr],
        [-sk * cr + ck * sp * sr, ck * cp, -sk * sr - ck * sp * cr],
        [-cp * sr, sp, cp * cr],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def angles_from_c_nb(c_nb: npt.ArrayLike) -> tuple[Array, Array, Array]:
    """(heading in [0, 2 pi), pitch, roll), rad, of C_nb (..., 3, 3); inverse of the above."""
    c = np.asarray(c_nb, float)
    heading = np.remainder(np.arctan2(c[..., 0, 1], c[..., 1, 1]), 2.0 * np.pi)
    pitch = np.arctan2(c[..., 2, 1], np.hypot(c[..., 2, 0], c[..., 2, 2]))
    roll = np.arctan2(-c[..., 2, 0], c[..., 2, 2])
    return heading, pitch, roll


def quaternion_from_c(c: npt.ArrayLike) -> Array:
    """Unit quaternion (..., 4) as (w, x, y, z), w >= 0, of a rotation matrix (..., 3, 3).

    The largest of the four components is found first (Shepperd), so no case loses digits.
    """
    c = np.asarray(c, float)
    diag = np.stack([c[..., 0, 0], c[..., 1, 1], c[..., 2, 2]], axis=-1)
    trace = diag.sum(axis=-1)
    four_q2 = np.stack(
        [1.0 + trace, *(1.0 + 2.0 * diag[..., k] - trace for k in range(3))], axis=-1
    )
    xy, xz, yz = (
        (c[..., 0, 1], c[..., 1, 0]),
        (c[..., 0, 2], c[..., 2, 0]),
        (c[..., 1, 2], c[..., 2, 1]),
    )
    wx, wy, wz = yz[1] - yz[0], xz[0] - xz[1], xy[1] - xy[0]
    sxy, sxz, syz = xy[0] + xy[1], xz[0] + xz[1], yz[0] + yz[1]
    rows = np.stack(
        [
            np.stack([four_q2[..., 0], wx, wy, wz], axis=-1),
            np.stack([wx, four_q2[..., 1], sxy, sxz], axis=-1),
            np.stack([wy, sxy, four_q2[..., 2], syz], axis=-1),
            np.stack([wz, sxz, syz, four_q2[..., 3]], axis=-1),
        ],
        axis=-2,
    )
    best = np.argmax(four_q2, axis=-1)[..., None, None]
    q = np.take_along_axis(rows, best, axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.asarray(np.where(q[..., :1] < 0.0, -q, q))


def exact_degrees(angle: npt.ArrayLike) -> Array:
    """Degrees whose ``np.radians`` is the same float64 again, where there is such a number.

    Angles that were read as degrees always have one, at most two steps of the last bit from
    ``np.degrees``; a file written with it reads back bit for bit.
    """
    rad = np.asarray(angle, float)
    nearest = np.degrees(rad)
    below, above = np.nextafter(nearest, -np.inf), np.nextafter(nearest, np.inf)
    best = nearest.copy()
    for candidate in (np.nextafter(below, -np.inf), np.nextafter(above, np.inf), below, above):
        best = np.where((np.radians(best) != rad) & (np.radians(candidate) == rad), candidate, best)
    return np.asarray(best)


def c_from_quaternion(q: npt.ArrayLike) -> Array:
    """Rotation matrix (..., 3, 3) of quaternions (..., 4) as (w, x, y, z); normalised first.

    >>> c_from_quaternion([0.0, 0.0, 0.0, 2.0]).tolist()
    [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    unit: Array = np.asarray(q, float)
    unit = unit / np.linalg.norm(unit, axis=-1, keepdims=True)
    w, x, y, z = unit[..., 0], unit[..., 1], unit[..., 2], unit[..., 3]
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def rotvec_from_c(c: npt.ArrayLike) -> Array:
    """Rotation vectors (..., 3), rad, at most pi long, of rotation matrices (..., 3, 3).

    >>> rotvec_from_c(c_from_rotvec([0.1, -0.2, 0.3])).round(12).tolist()
    [0.1, -0.2, 0.3]
    """
    q = quaternion_from_c(c)
    size = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(size, q[..., :1])
    return np.asarray(q[..., 1:] * np.where(size > 0.0, angle / np.maximum(size, 1e-300), 2.0))
