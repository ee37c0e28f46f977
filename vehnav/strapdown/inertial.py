"""The Earth seen from inertial Cartesian axes: local frame, ground velocity, gravitation.

Kernels on the radius vector in axes through the poles; where the Greenwich meridian is does not
matter to them.
"""

from __future__ import annotations

import math
from typing import Final

from vehnav.earth import Ellipsoid, normal_gravity
from vehnav.kernel import kernel
from vehnav.rotation import Mat3, Vec3, add, dot, mat_vec, scale, subtract

MU: Final = 3.986004418e14
"""m3/s2: the Earth's gravitational constant, for the J2 field."""
J2: Final = 1.08262982e-3


@kernel
def local_frame(r: Vec3, earth: Ellipsoid) -> tuple[Mat3, float, float]:
    """(rows east, north, up of C_ni; latitude rad; height m) at the radius vector r, m.

    Bowring's formula with sines and cosines instead of angles, twice: below 1e-9 m. The rotation of
    the Earth does not matter to it.
    """
    b = earth.a * math.sqrt(1.0 - earth.e2)
    ep2 = earth.e2 / (1.0 - earth.e2)
    p = math.sqrt(r[0] * r[0] + r[1] * r[1])
    x, y = 1.0, 0.0
    if p > 1e-9:
        x, y = r[0] / p, r[1] / p
    s, c = r[2] * earth.a, p * b
    for _ in range(2):
        w = math.sqrt(s * s + c * c)
        s, c = s / w, c / w
        sin_lat = r[2] + ep2 * b * s * s * s
        cos_lat = p - earth.e2 * earth.a * c * c * c
        s, c = b * sin_lat, earth.a * cos_lat
    w = math.sqrt(sin_lat * sin_lat + cos_lat * cos_lat)
    s, c = sin_lat / w, cos_lat / w
    h = p * c + r[2] * s - earth.a * math.sqrt(1.0 - earth.e2 * s * s)
    return (-y, x, 0.0, -s * x, -s * y, c, c * x, c * y, s), math.atan2(s, c), h


@kernel
def earth_spin(r: Vec3, earth: Ellipsoid) -> Vec3:
    """Omega x R, m/s: the velocity of the ground."""
    return (-earth.omega_ie * r[1], earth.omega_ie * r[0], 0.0)


@kernel
def normal_gravitation(r: Vec3, gravity_height: float, earth: Ellipsoid) -> Vec3:
    """g(R), m/s2, of (3): normal gravity along the ellipsoid normal, its centrifugal part removed.

    The same field as in the ENU mechanization; ``gravity_height`` m, or NaN for that of R.
    """
    frame, lat, h = local_frame(r, earth)
    gamma = normal_gravity(lat, h if math.isnan(gravity_height) else gravity_height, earth)
    centrifugal = earth.omega_ie * earth.omega_ie
    return (
        -gamma * frame[6] - centrifugal * r[0],
        -gamma * frame[7] - centrifugal * r[1],
        -gamma * frame[8],
    )


@kernel
def j2_gravitation(r: Vec3, earth: Ellipsoid) -> Vec3:
    """g(R), m/s2: central field and second zonal harmonic."""
    r2 = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    k = -MU / (r2 * math.sqrt(r2))
    j = 1.5 * J2 * earth.a * earth.a / r2
    z2 = 5.0 * r[2] * r[2] / r2
    side = k * (1.0 + j * (1.0 - z2))
    return (side * r[0], side * r[1], k * (1.0 + j * (3.0 - z2)) * r[2])


@kernel
def turned_with_earth(r: Vec3, dt: float, earth: Ellipsoid) -> Vec3:
    """Radius vector r after the Earth has turned by Omega dt under it."""
    s, c = math.sin(earth.omega_ie * dt), math.cos(earth.omega_ie * dt)
    return (c * r[0] - s * r[1], s * r[0] + c * r[1], r[2])


@kernel
def velocity_over_ground(r: Vec3, v: Vec3, earth: Ellipsoid) -> Vec3:
    """East, north, up velocity, m/s: C_ni (V - Omega x R)."""
    return mat_vec(local_frame(r, earth)[0], subtract(v, earth_spin(r, earth)))


@kernel
def carried(r: Vec3, v: Vec3, ground_new: Vec3, dt: float, earth: Ellipsoid) -> tuple[Vec3, Vec3]:
    """Radius vector and velocity when the velocity over ground becomes ``ground_new``.

    The vehicle turns with the Earth and moves over it by the mean of the two (trapezoid).
    """
    ground = subtract(v, earth_spin(r, earth))
    back = turned_with_earth(ground_new, -dt, earth)
    r_new = turned_with_earth(add(r, scale(0.5 * dt, add(ground, back))), dt, earth)
    return r_new, add(ground_new, earth_spin(r_new, earth))


@kernel
def clamped(r: Vec3, v: Vec3, dt: float, height: float, earth: Ellipsoid) -> tuple[Vec3, Vec3]:
    """Radius vector at ``height`` and velocity without its vertical part over ground.

    What is taken out came in evenly over the step, while the vertical turned: so it is taken out
    along the vertical of mid-step. Without that Coriolis would feel the half of it.
    """
    frame, _, h = local_frame(r, earth)
    up = (frame[6], frame[7], frame[8])
    ground = subtract(v, earth_spin(r, earth))
    climb = dot(ground, up)
    level = scale(1.0 / math.sqrt(dot(r, r)), subtract(ground, scale(climb, up)))
    up_rate = add(earth_spin(up, earth), level)
    up_then = subtract(up, scale(0.5 * dt, up_rate))
    return add(r, scale(height - h, up)), subtract(v, scale(climb, up_then))
