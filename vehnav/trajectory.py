"""A trajectory: where the vehicle was, how fast, how turned, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vehnav.earth import (
    POLAR,
    WGS84,
    Ellipsoid,
    c_en,
    ecef_from_geodetic,
    geodetic_from_ecef,
    in_axes_of,
    local_enu,
    radii,
)
from vehnav.rotation import c_from_quaternion, quaternion_from_c
from vehnav.units import NS

Array = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Trajectory:
    """States at n instants, in the local East-North-Up frame.

    Attributes
    ----------
    t_ns : (n,) int64
        Strictly increasing nanoseconds on the clock of the log.
    lat, lon, height : (n,)
        Geodetic, rad, rad, m.
    v_n : (n, 3)
        East, north, up velocity relative to the Earth, m/s.
    c_nb : (n, 3, 3)
        Direction cosines, body (right-forward-up) to ENU.
    stopped : (n,) bool
        Inside a detected stop.
    sigma_pos : (n, 3) or None
        Standard deviations east, north, up, m.
    sigma_heading : (n,) or None
        Standard deviation of the heading, rad.
    wander : (n,) or None
        Wander angle, rad, of axes free in azimuth that were carried along (paper 003), where they
        are wanted: quasi-coordinates are written with them.
    """

    t_ns: TimeArray
    lat: Array
    lon: Array
    height: Array
    v_n: Array
    c_nb: Array
    stopped: npt.NDArray[np.bool_]
    sigma_pos: Array | None = None
    sigma_heading: Array | None = None
    wander: Array | None = None

    @property
    def size(self) -> int:
        """Number of states."""
        return int(self.t_ns.size)

    def rows(self, index: slice | npt.NDArray[np.int64] | npt.NDArray[np.bool_]) -> Trajectory:
        """The trajectory of some of the instants."""
        return replace(
            self,
            t_ns=self.t_ns[index],
            lat=self.lat[index],
            lon=self.lon[index],
            height=self.height[index],
            v_n=self.v_n[index],
            c_nb=self.c_nb[index],
            stopped=self.stopped[index],
            sigma_pos=None if self.sigma_pos is None else self.sigma_pos[index],
            sigma_heading=None if self.sigma_heading is None else self.sigma_heading[index],
            wander=None if self.wander is None else self.wander[index],
        )

    def enu(self, origin: tuple[float, float, float], *, earth: Ellipsoid = WGS84) -> Array:
        """(n, 3) m: positions in the tangent plane at ``origin`` (lat rad, lon rad, height m)."""
        return local_enu(self.lat, self.lon, self.height, origin=origin, earth=earth)

    def path_length(self) -> float:
        """Horizontal distance driven, m: the integral of the horizontal speed (trapezoid)."""
        speed = np.hypot(self.v_n[:, 0], self.v_n[:, 1])
        dt = np.diff(self.t_ns) * NS
        return float(np.sum(0.5 * (speed[1:] + speed[:-1]) * dt))


def interpolate_positions(trajectory: Trajectory, t_ns: TimeArray) -> tuple[Array, Array, Array]:
    """(lat, lon, height) at instants inside the span of the trajectory.

    Cubic Hermite between the neighbouring states with their velocities, so that nothing is lost
    at 1 Hz output either; near the poles in Earth-fixed axes. ValueError outside the span.
    """
    if t_ns.size and (t_ns[0] < trajectory.t_ns[0] or t_ns[-1] > trajectory.t_ns[-1]):
        raise ValueError("interpolation outside the span of the trajectory")
    k = np.clip(np.searchsorted(trajectory.t_ns, t_ns, side="right") - 1, 0, trajectory.size - 2)
    h = np.asarray((trajectory.t_ns[k + 1] - trajectory.t_ns[k]) * NS, np.float64)
    s = np.asarray((t_ns - trajectory.t_ns[k]) * NS / h, np.float64)
    lat0 = trajectory.lat[k]
    v0, v1 = trajectory.v_n[k], trajectory.v_n[k + 1]
    h00, h10 = (1.0 + 2.0 * s) * (1.0 - s) ** 2, s * (1.0 - s) ** 2
    h01, h11 = s * s * (3.0 - 2.0 * s), s * s * (s - 1.0)

    r_lat, r_n = radii(lat0, trajectory.height[k])
    r_lon = r_n * np.cos(lat0)

    def hermite(x0: Array, x1: Array, d0: Array, d1: Array) -> Array:
        return np.asarray(h00 * x0 + h10 * h * d0 + h01 * x1 + h11 * h * d1)

    lat, lon, height = trajectory.lat, trajectory.lon, trajectory.height
    d_lon = np.remainder(lon[k + 1] - lon[k] + np.pi, 2 * np.pi) - np.pi  # across 180 degrees
    lon_t = hermite(lon[k], lon[k] + d_lon, v0[:, 0] / r_lon, v1[:, 0] / r_lon)
    lat_t = hermite(lat[k], lat[k + 1], v0[:, 1] / r_lat, v1[:, 1] / r_lat)
    lon_t = np.remainder(lon_t + np.pi, 2 * np.pi) - np.pi
    height_t = hermite(height[k], height[k + 1], v0[:, 2], v1[:, 2])
    polar = np.flatnonzero(np.abs(lat0) > POLAR)
    if polar.size:
        lat_t[polar], lon_t[polar], height_t[polar] = _polar_positions(
            trajectory, k[polar], s[polar], h[polar]
        )
    return lat_t, lon_t, height_t


def _polar_positions(
    trajectory: Trajectory, k: TimeArray, s: Array, length: Array
) -> tuple[Array, Array, Array]:
    """Between states k and k+1 at the share s of the step (``length``, s), regular at a pole."""
    lat, lon = trajectory.lat, trajectory.lon

    def state(k: TimeArray) -> tuple[Array, Array]:
        velocity = np.einsum("kij,kj->ki", c_en(lat[k], lon[k]), trajectory.v_n[k])
        place = ecef_from_geodetic(lat[k], lon[k], trajectory.height[k])
        return place, velocity * length[:, None]

    (r0, v0), (r1, v1) = state(k), state(k + 1)
    s = s[:, None]
    # differences, so that what is between two close states keeps its digits
    r = r0 + s * s * (3.0 - 2.0 * s) * (r1 - r0) + s * (1.0 - s) * ((1.0 - s) * v0 - s * v1)
    return geodetic_from_ecef(r)


def interpolate(trajectory: Trajectory, t_ns: TimeArray) -> Trajectory:
    """The states at other instants inside the span, all quantities.

    Positions as :func:`interpolate_positions`; velocities and sigmas linear; attitude along the
    chord of the unit quaternions (0.01 deg from the arc for a turn of 20 deg between states);
    ``stopped`` as at the state before; the wander angle is left out. Near the poles the states
    are first turned into the axes of the place between them. ValueError outside the span or with
    fewer than two states.
    """
    if trajectory.size < 2:
        raise ValueError("interpolation needs two states")
    lat, lon, height = interpolate_positions(trajectory, t_ns)
    k = np.clip(np.searchsorted(trajectory.t_ns, t_ns, side="right") - 1, 0, trajectory.size - 2)
    s = (t_ns - trajectory.t_ns[k]) / (trajectory.t_ns[k + 1] - trajectory.t_ns[k])

    def between(x0: Array, x1: Array) -> Array:
        w = s.reshape(s.shape + (1,) * (x0.ndim - 1))
        return np.asarray((1.0 - w) * x0 + w * x1)

    def state(x: Array, j: TimeArray) -> Array:
        return in_axes_of(x[j], trajectory.lat[j], trajectory.lon[j], to_lat=lat, to_lon=lon)

    v0, v1 = (state(trajectory.v_n, j) for j in (k, k + 1))
    q0, q1 = (quaternion_from_c(state(trajectory.c_nb, j)) for j in (k, k + 1))
    q1 = np.where(np.sum(q0 * q1, axis=1, keepdims=True) < 0.0, -q1, q1)
    sigma_pos, sigma_heading = trajectory.sigma_pos, trajectory.sigma_heading
    return Trajectory(
        t_ns=t_ns,
        lat=lat,
        lon=lon,
        height=height,
        v_n=between(v0, v1),
        c_nb=c_from_quaternion((1.0 - s)[:, None] * q0 + s[:, None] * q1),
        stopped=trajectory.stopped[k + (s >= 1.0)],
        sigma_pos=None if sigma_pos is None else between(sigma_pos[k], sigma_pos[k + 1]),
        sigma_heading=None
        if sigma_heading is None
        else between(sigma_heading[k], sigma_heading[k + 1]),
    )
