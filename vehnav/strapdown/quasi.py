"""Quasi-Greenwich coordinates and headings (paper 003, equations 1 and 9-17).

The Earth-fixed axes turned so that the geographic poles lie on the quasi-equator: latitude and
longitude, heading and wander angle of the turned axes are regular near the poles (and singular at
0 N 0 E and 0 N 180 E instead). The quasi-latitude is geocentric. Conversions are exact; the
approximations that the paper prints, (13) and (14), are kept as functions with their error.
"""

from __future__ import annotations

from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from vehnav.earth import WGS84, Ellipsoid, ecef_from_geodetic, geodetic_from_ecef

Array = npt.NDArray[np.float64]
Azimuth = Literal["relative", "absolute"]

C_QE: Final = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""S of (1): Earth-fixed to quasi-Greenwich axes. The North pole gets (lat_q, lon_q) = (0, 0)."""


def quasi_from_ecef(r_e: npt.ArrayLike) -> tuple[Array, Array, Array]:
    """(lat_q, lon_q, r): rad, rad, m, of Earth-fixed coordinates (..., 3), m (10), (12)."""
    r_q = np.asarray(r_e, float) @ C_QE.T
    x, y, z = r_q[..., 0], r_q[..., 1], r_q[..., 2]
    p = np.hypot(x, y)
    return np.arctan2(z, p), np.arctan2(y, x), np.hypot(p, z)


def quasi_from_geodetic(
    lat: npt.ArrayLike, lon: npt.ArrayLike, h: npt.ArrayLike, *, earth: Ellipsoid = WGS84
) -> tuple[Array, Array, Array]:
    """(lat_q, lon_q, r) of geodetic coordinates, by the exact path (9), (1), (10)."""
    return quasi_from_ecef(ecef_from_geodetic(lat, lon, h, earth=earth))


def geodetic_from_quasi(
    lat_q: npt.ArrayLike, lon_q: npt.ArrayLike, r: npt.ArrayLike, *, earth: Ellipsoid = WGS84
) -> tuple[Array, Array, Array]:
    """(lat, lon, h) of quasi-coordinates and radius: the way back."""
    lat_q, lon_q, r = (np.asarray(x, float) for x in (lat_q, lon_q, r))
    p = r * np.cos(lat_q)
    r_q = np.stack([p * np.cos(lon_q), p * np.sin(lon_q), r * np.sin(lat_q)], axis=-1)
    return geodetic_from_ecef(r_q @ C_QE, earth=earth)


def c_quasi(lat_q: npt.ArrayLike, lon_q: npt.ArrayLike) -> Array:
    """(..., 3, 3): Earth-fixed to quasi-east, quasi-north and along the radius: B_0(q) S (6)."""
    lat_q, lon_q = np.broadcast_arrays(np.asarray(lat_q, float), np.asarray(lon_q, float))
    sp, cp, sl, cl = np.sin(lat_q), np.cos(lat_q), np.sin(lon_q), np.cos(lon_q)
    rows = [[-sl, cl, np.zeros_like(sl)], [-sp * cl, -sp * sl, cp], [cp * cl, cp * sl, sp]]
    return np.asarray(np.stack([np.stack(row, axis=-1) for row in rows], axis=-2) @ C_QE)


def quasi_wander(c_we: npt.ArrayLike) -> Array:
    """Quasi-wander angle, rad, of C_we (..., 3, 3) (16): B^q = B S^T, so b^q_i3 = -b_i1."""
    b = np.asarray(c_we, float)
    return np.asarray(np.arctan2(-b[..., 0, 0], -b[..., 1, 0]))


def gyro_heading(c_wb: npt.ArrayLike) -> Array:
    """Gyro heading, rad in [0, 2 pi), clockwise from the second wander axis (after eq. 15)."""
    c = np.asarray(c_wb, float)
    return np.asarray(np.remainder(np.arctan2(c[..., 0, 1], c[..., 1, 1]), 2.0 * np.pi))


def quasi_heading(c_we: npt.ArrayLike, c_wb: npt.ArrayLike) -> Array:
    """Heading from quasi-north, rad in [0, 2 pi) (17): gyro heading minus quasi-wander angle."""
    return np.asarray(np.remainder(gyro_heading(c_wb) - quasi_wander(c_we), 2.0 * np.pi))


def wander_along(
    t: npt.ArrayLike,
    lat: npt.ArrayLike,
    lon: npt.ArrayLike,
    *,
    azimuth: Azimuth = "relative",
    earth: Ellipsoid = WGS84,
) -> Array:
    """Wander angle (n,), rad, of axes free in azimuth that are carried along a track (4), (5).

    They point east and north at the first instant. ``lon + wander`` changes by (1 - sin lat) times
    the longitude: regular at the North pole, as is ``lon - wander`` at the South pole.

    Parameters
    ----------
    t, lat, lon : (n,)
        s, rad, rad.
    azimuth : {"relative", "absolute"}
        Free relative to the Earth or to inertial space.
    """
    t, lat, lon = (np.asarray(x, float) for x in (t, lat, lon))
    s = np.sin(0.5 * (lat[1:] + lat[:-1]))
    d_lon = np.remainder(np.diff(lon) + np.pi, 2.0 * np.pi) - np.pi
    u = earth.omega_ie if azimuth == "absolute" else 0.0
    return np.concatenate([[0.0], np.cumsum(-s * (d_lon + u * np.diff(t)))])


def geocentric_latitude_approximation(lat: npt.ArrayLike, *, earth: Ellipsoid = WGS84) -> Array:
    """(13) as printed: lat - e^2/2 sin 2 lat. Off by up to 93 m (at 60 degrees)."""
    lat = np.asarray(lat, float)
    return np.asarray(lat - 0.5 * earth.e2 * np.sin(2.0 * lat))


def quasi_approximation(c_we: npt.ArrayLike, *, earth: Ellipsoid = WGS84) -> tuple[Array, Array]:
    """(lat_q, lon_q), rad, by (14) as printed. Off by up to 93 m, by 5 m within 1 deg of a pole."""
    b = np.asarray(c_we, float)
    b31, b32, b33 = b[..., 2, 0], b[..., 2, 1], b[..., 2, 2]
    stretch = 1.0 + earth.e2 * b33**2
    lat_q = np.arcsin(np.clip(-b31 * stretch, -1.0, 1.0))
    return lat_q, np.arctan2(b32 * stretch, b33 * (1.0 - earth.e2 * (1.0 - b33**2)))
