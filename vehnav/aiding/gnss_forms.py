"""GNSS measurements of paper 003 in its two forms, and the direct one: z and H of 15 states.

``normal`` (29)-(31): differences of longitude and latitude, east and north velocity; singular at
the poles. ``quasi`` (32)-(35): the same in quasi-coordinates; singular at 0 N, 0 E and 0 N, 180 E.
``direct``: the difference of the Earth-fixed vectors turned into the wander axes; regular
everywhere, and the filter's default. All are computed minus measured; the terms of the paper with
the estimated longitude error stand in H, where in closed loop they belong. Height and vertical
velocity are those of the direct form in all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, get_args

import numpy as np
import numpy.typing as npt

from vehnav.aiding.error_model import STATES
from vehnav.aiding.measurements import ecef_of, gnss_velocity
from vehnav.earth import WGS84, Ellipsoid, curvature_radii
from vehnav.kernel import kernel
from vehnav.rotation import Mat3, Vec3, mat_t_vec, mat_vec
from vehnav.strapdown.wander import mat3

Array = npt.NDArray[np.float64]
Form = Literal["direct", "normal", "quasi"]
Seen = tuple[tuple[float, float, float, float], tuple[Vec3, Vec3], float, tuple[float, float]]
FORMS: Final[tuple[Form, ...]] = get_args(Form)
DIRECT: Final = 0
NORMAL: Final = 1
QUASI: Final = 2


# ---- coordinates of the forms ------------------------------------------------------------------


@kernel
def geodetic_angles(r_e: Vec3, earth: Ellipsoid) -> tuple[float, float]:
    """(lat, lon), rad, of Earth-fixed coordinates, m: Bowring's formula, repeated."""
    p = math.sqrt(r_e[0] * r_e[0] + r_e[1] * r_e[1])
    b = earth.a * math.sqrt(1.0 - earth.e2)
    ep2 = earth.e2 / (1.0 - earth.e2)
    beta = math.atan2(r_e[2] * earth.a, p * b)
    lat = 0.0
    for _ in range(3):
        s, c = math.sin(beta), math.cos(beta)
        lat = math.atan2(r_e[2] + ep2 * b * s * s * s, p - earth.e2 * earth.a * c * c * c)
        beta = math.atan2(b * math.sin(lat), earth.a * math.cos(lat))
    return lat, math.atan2(r_e[1], r_e[0])


@kernel
def in_quasi_axes(x: Vec3) -> Vec3:
    """S x (1): Earth-fixed components in quasi-Greenwich axes."""
    return (x[2], x[1], -x[0])


@kernel
def angles_in_form(form: int, r_e: Vec3, earth: Ellipsoid) -> tuple[float, float]:
    """(lat, lon), rad: geodetic, or quasi-coordinates (11)."""
    if form == NORMAL:
        return geodetic_angles(r_e, earth)
    q = in_quasi_axes(r_e)
    return math.atan2(q[2], math.sqrt(q[0] * q[0] + q[1] * q[1])), math.atan2(q[1], q[0])


@kernel
def velocity_in_form(form: int, lat: float, lon: float, v_e: Vec3) -> tuple[float, float]:
    """East and north velocity of the form at its own (lat, lon), m/s; quasi: (34)."""
    v = in_quasi_axes(v_e) if form == QUASI else v_e
    s, c = math.sin(lon), math.cos(lon)
    return c * v[1] - s * v[0], math.cos(lat) * v[2] - math.sin(lat) * (c * v[0] + s * v[1])


@kernel
def see_fix(
    form: int, place: Mat3, height: float, v: Vec3, fix: tuple[Vec3, Vec3], ago: float,
    earth: Ellipsoid,
) -> Seen:  # fmt: skip
    """Both differences in a form, and what its rows are made of.

    ``fix``: Earth-fixed position and velocity of the receiver, ``ago`` s older than the state,
    which is carried back with its velocity. Returns z (2 of position, m, 2 of velocity, m/s; (29),
    (31) or (32), (35)); east and north of the form in wander axes; the bend of its meridians
    tan(lat) / R, 1/m; and the computed velocity east and north, m/s.
    """
    r, v_e = ecef_of(place, height, earth), mat_t_vec(place, v)
    r = (r[0] - ago * v_e[0], r[1] - ago * v_e[1], r[2] - ago * v_e[2])
    if form == DIRECT:
        d = mat_vec(place, (r[0] - fix[0][0], r[1] - fix[0][1], r[2] - fix[0][2]))
        u = mat_vec(place, fix[1])
        axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
        return (d[0], d[1], v[0] - u[0], v[1] - u[1]), axes, 0.0, (v[0], v[1])
    lat, lon = angles_in_form(form, r, earth)
    lat_s, lon_s = angles_in_form(form, fix[0], earth)
    if form == NORMAL:
        radius_m, radius_n = curvature_radii(lat, height, earth)
    else:
        radius_m = math.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
        radius_n = radius_m
    d_lon = (lon - lon_s + math.pi) % (2.0 * math.pi) - math.pi
    east, north = velocity_in_form(form, lat, lon, v_e)
    east_s, north_s = velocity_in_form(form, lat_s, lon_s, fix[1])
    z = (
        d_lon * radius_n * math.cos(lat), (lat - lat_s) * radius_m, east - east_s, north - north_s,
    )  # fmt: skip
    return z, axes_in_form(form, lat, lon, place), math.tan(lat) / radius_n, (east, north)


@kernel
def axes_in_form(form: int, lat: float, lon: float, place: Mat3) -> tuple[Vec3, Vec3]:
    """East and north of the form in wander axes, unit vectors.

    The paper turns by the wander angle (30) or the quasi-wander angle (33) alone. Quasi-north lies
    in the geocentric plane: against the wander axes it is tilted too, by up to 3e-3 rad.
    """
    sl, cl, sp, cp = math.sin(lon), math.cos(lon), math.sin(lat), math.cos(lat)
    east, north = (-sl, cl, 0.0), (-sp * cl, -sp * sl, cp)
    if form == QUASI:  # S^T x (1)
        east, north = (-east[2], east[1], east[0]), (-north[2], north[1], north[0])
    return mat_vec(place, east), mat_vec(place, north)


# ---- rows --------------------------------------------------------------------------------------


@kernel
def position_row(h: Array, j: int, seen: Seen) -> None:
    """Row of the east (j = 0) or north (1) difference: (30), (33)."""
    h[:] = 0.0
    h[0], h[1], h[2] = seen[1][j]


@kernel
def velocity_row(
    h: Array, j: int, seen: Seen, place: Mat3, height: float, v: Vec3, earth: Ellipsoid
) -> None:
    """Row of the east or north velocity difference, with the bend of the meridians: (31), (35).

    North seen from two places differs by sin(lat) times the difference of longitudes.
    """
    _, axes, bend, velocity = seen
    axis = axes[j]
    one, total = np.empty(h.shape[0]), np.zeros(h.shape[0])
    for a in range(3):
        gnss_velocity(one, a, place, height, v, earth)
        for b in range(h.shape[0]):
            total[b] += axis[a] * one[b]
    turned = bend * (velocity[1] if j == 0 else -velocity[0])
    for a in range(3):
        total[a] += turned * axes[0][a]
    h[:] = total


# ---- for Python --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Computed:
    """State of the mechanization: place, height (m), velocity (m/s)."""

    c_we: Array
    height: float
    v_w: Array


def gnss_measurement(
    form: Form, computed: Computed, r_e: Array, v_e: Array, *, earth: Ellipsoid = WGS84
) -> tuple[Array, Array]:
    """(z (4,), H (4, 15)): two of position, m, two of velocity, m/s.

    Parameters
    ----------
    form : {"direct", "normal", "quasi"}
    computed : Computed
    r_e, v_e : (3,)
        Earth-fixed position and velocity of the receiver.
    """
    place, v, fix = mat3(computed.c_we), _vec3(computed.v_w), (_vec3(r_e), _vec3(v_e))
    seen = see_fix(FORMS.index(form), place, computed.height, v, fix, 0.0, earth)
    h = np.zeros((4, STATES))
    for j in range(2):
        position_row(h[j], j, seen)
        velocity_row(h[2 + j], j, seen, place, computed.height, v, earth)
    return np.array(seen[0]), h


def _vec3(x: npt.ArrayLike) -> Vec3:
    a, b, c = (float(y) for y in np.asarray(x, float))
    return (a, b, c)
