"""The Earth: ellipsoid, curvature, rotation, normal gravity, coordinates.

Judged by pyproj in the tests. Kernels (scalars and tuples) for the per-sample loops; numpy
functions of the same quantities for whole arrays.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from vehnav.kernel import entry_kernel, kernel

Array = npt.NDArray[np.float64]
Vec3 = tuple[float, float, float]


class Ellipsoid(NamedTuple):
    """Ellipsoid of revolution with its normal gravity and rotation (spec: papers 003, 004).

    Attributes
    ----------
    a : float
        Semi-major axis, m.
    e2 : float
        First eccentricity squared.
    gamma_e, gamma_p : float
        Normal gravity at the equator and at the poles, m/s2.
    omega_ie : float
        Rotation rate of the Earth, rad/s.
    f : float
        Flattening, as it enters the height term of gravity.
    m : float
        omega_ie^2 a^2 b / GM, as it enters the height term of gravity.
    """

    a: float
    e2: float
    gamma_e: float
    gamma_p: float
    omega_ie: float
    f: float
    m: float


WGS84: Final = Ellipsoid(
    a=6378137.0,
    e2=0.00669437999014,
    gamma_e=9.7803253359,
    gamma_p=9.8321849379,
    omega_ie=7.292115e-5,
    f=1.0 / 298.257223563,
    m=0.00344978650684,
)
KRASOVSKY: Final = Ellipsoid(
    a=6378245.0,
    e2=0.0066934,
    gamma_e=9.780,
    gamma_p=9.832,
    omega_ie=7.292116e-5,
    f=1.0 / 298.3,
    m=0.0034500,
)
"""As paper 004 prints it: rounded e2 and gravity; the paper takes gravity at h = 0."""
ELLIPSOIDS: Final = {"wgs84": WGS84, "krasovsky": KRASOVSKY}
POLAR: Final = math.radians(85.0)
"""rad of latitude beyond which East-North-Up of two near places is not taken as one: the axes turn
by a tenth of a degree over a kilometre, by 45 degrees over a metre at a metre from the pole."""


# ---- kernels -----------------------------------------------------------------------------------


@entry_kernel  # Python calls it, too: not to be compiled by every process
def curvature_radii(lat: float, h: float, earth: Ellipsoid) -> tuple[float, float]:
    """(R_M + h, R_N + h), m: radii of the meridian and of the prime vertical (004 eq. 7)."""
    s = math.sin(lat)
    w2 = 1.0 - earth.e2 * s * s
    r_n = earth.a / math.sqrt(w2)
    return (r_n * (1.0 - earth.e2) / w2 + h, r_n + h)


@entry_kernel
def normal_gravity(lat: float, h: float, earth: Ellipsoid) -> float:
    """Magnitude of normal gravity, m/s2: Somigliana (004, after eq. 9), second-order free air.

    gamma(h) = gamma (1 - 2 (1 + f + m - 2 f sin^2 lat) h/a + 3 h^2/a^2).
    """
    s2 = math.sin(lat) * math.sin(lat)
    k = math.sqrt(1.0 - earth.e2) * earth.gamma_p / earth.gamma_e - 1.0
    gamma = earth.gamma_e * (1.0 + k * s2) / math.sqrt(1.0 - earth.e2 * s2)
    x = h / earth.a
    return gamma * (1.0 - 2.0 * (1.0 + earth.f + earth.m - 2.0 * earth.f * s2) * x + 3.0 * x * x)


@entry_kernel
def earth_rate(lat: float, earth: Ellipsoid) -> Vec3:
    """omega_ie_n, rad/s: the Earth rate in East-North-Up."""
    return (0.0, earth.omega_ie * math.cos(lat), earth.omega_ie * math.sin(lat))


@kernel
def transport_rate(v_n: Vec3, radius_m: float, radius_n: float, tan_lat: float) -> Vec3:
    """omega_en_n, rad/s: the ENU frame turns because the vehicle moves (004, before eq. 12)."""
    return (-v_n[1] / radius_m, v_n[0] / radius_n, v_n[0] * tan_lat / radius_n)


# ---- arrays ------------------------------------------------------------------------------------


def ecef_from_geodetic(
    lat: npt.ArrayLike, lon: npt.ArrayLike, h: npt.ArrayLike, *, earth: Ellipsoid = WGS84
) -> Array:
    """Cartesian Earth-fixed coordinates (..., 3), m, of geodetic ones (rad, rad, m)."""
    lat, lon, h = np.broadcast_arrays(*(np.asarray(x, float) for x in (lat, lon, h)))
    r_n = earth.a / np.sqrt(1.0 - earth.e2 * np.sin(lat) ** 2)
    p = (r_n + h) * np.cos(lat)
    z = (r_n * (1.0 - earth.e2) + h) * np.sin(lat)
    return np.stack([p * np.cos(lon), p * np.sin(lon), z], axis=-1)


def geodetic_from_ecef(
    r_e: npt.ArrayLike, *, earth: Ellipsoid = WGS84
) -> tuple[Array, Array, Array]:
    """(lat rad, lon rad, height m) of Cartesian Earth-fixed coordinates (..., 3), m.

    Bowring's formula, repeated: below 1e-9 m for heights from -10 km to 100 km.
    """
    r_e = np.asarray(r_e, float)
    x, y, z = r_e[..., 0], r_e[..., 1], r_e[..., 2]
    b = earth.a * math.sqrt(1.0 - earth.e2)
    ep2 = earth.e2 / (1.0 - earth.e2)
    p = np.hypot(x, y)
    beta = np.arctan2(z * earth.a, p * b)
    for _ in range(3):
        lat = np.arctan2(
            z + ep2 * b * np.sin(beta) ** 3, p - earth.e2 * earth.a * np.cos(beta) ** 3
        )
        beta = np.arctan2(b * np.sin(lat), earth.a * np.cos(lat))
    s, c = np.sin(lat), np.cos(lat)
    h = p * c + z * s - earth.a * np.sqrt(1.0 - earth.e2 * s * s)
    return lat, np.arctan2(y, x), h


def c_en(lat: npt.ArrayLike, lon: npt.ArrayLike) -> Array:
    """C_en (..., 3, 3): turns East-North-Up components into Earth-fixed ones."""
    lat, lon = np.broadcast_arrays(np.asarray(lat, float), np.asarray(lon, float))
    sp, cp, sl, cl = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    zero = np.zeros_like(sp)
    rows = [[-sl, -sp * cl, cp * cl], [cl, -sp * sl, cp * sl], [zero, cp, sp]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def turn_of_axes(
    lat: npt.ArrayLike, lon: npt.ArrayLike, to_lat: npt.ArrayLike, to_lon: npt.ArrayLike
) -> Array:
    """(..., 3, 3): turns East-North-Up components of one place into those of another (rad)."""
    return np.asarray(np.swapaxes(c_en(to_lat, to_lon), -1, -2) @ c_en(lat, lon))


def in_axes_of(x: Array, lat: Array, lon: Array, *, to_lat: Array, to_lon: Array) -> Array:
    """Vectors or matrices in East-North-Up of one place, in the axes of another where these turn.

    That is where the other place lies beyond :data:`POLAR`; elsewhere East-North-Up of two near
    places is taken as one, and the values stay as they are.

    Parameters
    ----------
    x : (n, 3) or (n, 3, m)
        Vectors, or matrices whose first index is East-North-Up (C_nb); any unit.
    lat, lon : (n,)
        rad: where they are given.
    to_lat, to_lon : (n,)
        rad: the other places.

    Returns
    -------
    (n, 3) or (n, 3, m)
        ``x`` itself where no place is polar, else new.
    """
    polar = np.flatnonzero(np.abs(to_lat) > POLAR)
    if not polar.size:
        return x
    turn = turn_of_axes(lat[polar], lon[polar], to_lat[polar], to_lon[polar])
    out = x.copy()
    out[polar] = np.einsum("kij,kj...->ki...", turn, x[polar])
    return out


def local_enu(
    lat: npt.ArrayLike,
    lon: npt.ArrayLike,
    h: npt.ArrayLike,
    *,
    origin: tuple[float, float, float],
    earth: Ellipsoid = WGS84,
) -> Array:
    """East, north, up (..., 3), m, in the tangent plane at ``origin`` (lat rad, lon rad, h m)."""
    d_e = ecef_from_geodetic(lat, lon, h, earth=earth) - ecef_from_geodetic(*origin, earth=earth)
    return np.asarray(d_e @ c_en(origin[0], origin[1]))


def geodetic_from_local_enu(
    r_n: npt.ArrayLike, *, origin: tuple[float, float, float], earth: Ellipsoid = WGS84
) -> tuple[Array, Array, Array]:
    """Inverse of :func:`local_enu`: (lat rad, lon rad, h m) of tangent-plane coordinates, m."""
    d_e = np.asarray(r_n, float) @ c_en(origin[0], origin[1]).T
    return geodetic_from_ecef(d_e + ecef_from_geodetic(*origin, earth=earth), earth=earth)


def radii(lat: Array, h: Array, *, earth: Ellipsoid = WGS84) -> tuple[Array, Array]:
    """(R_M + h, R_N + h), m, of arrays: :func:`curvature_radii` without the loop (004 eq. 7)."""
    w2 = 1.0 - earth.e2 * np.sin(lat) ** 2
    r_n = earth.a / np.sqrt(w2)
    return np.asarray(r_n * (1.0 - earth.e2) / w2 + h), np.asarray(r_n + h)


def position_difference(
    lat: npt.ArrayLike,
    lon: npt.ArrayLike,
    lat_ref: npt.ArrayLike,
    lon_ref: npt.ArrayLike,
    h: npt.ArrayLike = 0.0,
    *,
    earth: Ellipsoid = WGS84,
) -> Array:
    """(east, north) (..., 2), m, of a position minus a reference: R dlat and R cos(lat) dlon.

    Radii at the mean latitude; the difference of longitudes is wrapped to +-180 degrees. Within
    1e-6 of the geodesic for differences up to some kilometres. Beyond :data:`POLAR` it is the
    difference of the Earth-fixed vectors in the axes of the reference, right at the pole too.
    """
    lat, lon, lat_ref, lon_ref, h = (np.asarray(x, float) for x in (lat, lon, lat_ref, lon_ref, h))
    mean = 0.5 * (lat + lat_ref)
    r_lat, r_lon = radii(mean, h, earth=earth)
    d_lon = np.remainder(lon - lon_ref + math.pi, 2.0 * math.pi) - math.pi
    out = np.stack(np.broadcast_arrays(r_lon * np.cos(mean) * d_lon, r_lat * (lat - lat_ref)), -1)
    polar = np.abs(lat_ref) > POLAR
    if np.any(polar):
        d_e = ecef_from_geodetic(lat, lon, h, earth=earth)
        d_e = d_e - ecef_from_geodetic(lat_ref, lon_ref, h, earth=earth)
        exact = np.einsum("...ji,...j->...i", c_en(lat_ref, lon_ref), d_e)[..., :2]
        out = np.where(polar[..., None], exact, out)
    return out
