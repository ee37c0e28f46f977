"""GNSS measurements of paper 003 in its two forms, and the direct one: z and H of 15 states.

``normal`` (29)-(31): differences of longitude and latitude, east and north velocity; singular at
the poles. ``quasi`` (32)-(35): the same in quasi-coordinates; singular at 0 N, 0 E and 0 N, 180 E.
``direct``: the difference of the Earth-fixed vectors turned into the wander axes; regular
everywhere, and what the filter uses. All are computed minus measured; the terms of the paper with
the estimated longitude error stand in H, where in closed loop they belong.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from vehnav.aiding.error_model import POSITION, STATES, VELOCITY
from vehnav.earth import WGS84, Ellipsoid, ecef_from_geodetic, geodetic_from_ecef
from vehnav.rotation import skew
from vehnav.strapdown.quasi import c_quasi, quasi_from_ecef, quasi_wander
from vehnav.strapdown.wander import c_nw, curvature, earth_axis, geodetic_from_c_we, mat3

Array = npt.NDArray[np.float64]
Form = Literal["direct", "normal", "quasi"]


@dataclass(frozen=True)
class Computed:
    """State of the mechanization: place, height (m), velocity (m/s)."""

    c_we: Array
    height: float
    v_w: Array

    def ecef(self, earth: Ellipsoid) -> Array:
        """(3,) m."""
        lat, lon, _ = geodetic_from_c_we(self.c_we)
        return ecef_from_geodetic(lat, lon, self.height, earth=earth)


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
    h_pos, h_vel = _rows_in_wander_axes(computed, earth)
    if form == "direct":
        z_pos = computed.c_we @ (computed.ecef(earth) - r_e)
        z_vel = computed.v_w - computed.c_we @ v_e
        return np.concatenate([z_pos[:2], z_vel[:2]]), np.concatenate([h_pos[:2], h_vel[:2]])
    if form == "normal":
        return _normal(computed, r_e, v_e, h_pos, h_vel, earth)
    return _quasi(computed, r_e, v_e, h_pos, h_vel, earth)


def _rows_in_wander_axes(computed: Computed, earth: Ellipsoid) -> tuple[Array, Array]:
    """Rows (3, 15) of Delta y and of Delta V = delta V + V x beta (spec B 3.4)."""
    k11, k12, k22 = curvature(earth_axis(mat3(computed.c_we)), computed.height, earth)
    h_pos, h_vel = np.zeros((3, STATES)), np.zeros((3, STATES))
    h_pos[:, POSITION] = np.eye(3)
    h_vel[:, VELOCITY] = np.eye(3)
    beta = np.zeros((3, STATES))
    beta[0, [6, 0, 1]] = 1.0, k12, k22
    beta[1, [7, 0, 1]] = 1.0, -k11, -k12
    beta[2, 8] = 1.0
    return h_pos, h_vel + skew(computed.v_w) @ beta


def _normal(
    computed: Computed, r_e: Array, v_e: Array, h_pos: Array, h_vel: Array, earth: Ellipsoid
) -> tuple[Array, Array]:
    """(29), (30), (31)."""
    lat, lon, wander = (float(x) for x in geodetic_from_c_we(computed.c_we))
    lat_s, lon_s, _ = (float(x) for x in geodetic_from_ecef(r_e, earth=earth))
    w2 = 1.0 - earth.e2 * np.sin(lat) ** 2
    r_n = earth.a / np.sqrt(w2) + computed.height
    r_m = earth.a * (1.0 - earth.e2) / w2**1.5 + computed.height
    d_lon = np.remainder(lon - lon_s + np.pi, 2.0 * np.pi) - np.pi
    turn = c_nw(wander)[:2, :2]
    v_n = turn @ computed.v_w[:2]
    east, north = _local_velocity(lat_s, lon_s, v_e)
    rows = turn @ h_vel[:2]
    pos = turn @ h_pos[:2]
    # meridians converge: north seen from the two places differs by sin(lat) d_lon
    bend = np.tan(lat) / r_n * pos[0]
    rows = rows + np.outer([v_n[1], -v_n[0]], bend)
    z = np.array([d_lon * r_n * np.cos(lat), (lat - lat_s) * r_m, v_n[0] - east, v_n[1] - north])
    return z, np.concatenate([pos, rows])


def _quasi(
    computed: Computed, r_e: Array, v_e: Array, h_pos: Array, h_vel: Array, earth: Ellipsoid
) -> tuple[Array, Array]:
    """(32), (33), (34), (35)."""
    lat, lon, r = (float(x) for x in quasi_from_ecef(computed.ecef(earth)))
    lat_s, lon_s, _ = (float(x) for x in quasi_from_ecef(r_e))
    d_lon = np.remainder(lon - lon_s + np.pi, 2.0 * np.pi) - np.pi
    turn = c_nw(float(quasi_wander(computed.c_we)))[:2, :2]
    v_q = (c_quasi(lat, lon) @ computed.c_we.T @ computed.v_w)[:2]
    v_s = (c_quasi(lat_s, lon_s) @ v_e)[:2]
    pos = turn @ h_pos[:2]
    bend = np.tan(lat) / r * pos[0]
    rows = turn @ h_vel[:2] + np.outer([v_q[1], -v_q[0]], bend)
    z = np.concatenate([[d_lon * r * np.cos(lat), (lat - lat_s) * r], v_q - v_s])
    return z, np.concatenate([pos, rows])


def _local_velocity(lat: float, lon: float, v_e: Array) -> tuple[float, float]:
    """East and north velocity of an Earth-fixed one."""
    east = -np.sin(lon) * v_e[0] + np.cos(lon) * v_e[1]
    along = np.cos(lon) * v_e[0] + np.sin(lon) * v_e[1]
    return float(east), float(np.cos(lat) * v_e[2] - np.sin(lat) * along)
