"""A trajectory: where the vehicle was, how fast, how turned, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vehnav.earth import WGS84, Ellipsoid, local_enu, radii
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
    at 1 Hz output either. ValueError outside the span.
    """
    if t_ns.size and (t_ns[0] < trajectory.t_ns[0] or t_ns[-1] > trajectory.t_ns[-1]):
        raise ValueError("interpolation outside the span of the trajectory")
    k = np.clip(np.searchsorted(trajectory.t_ns, t_ns, side="right") - 1, 0, trajectory.size - 2)
    h = (trajectory.t_ns[k + 1] - trajectory.t_ns[k]) * NS
    s = (t_ns - trajectory.t_ns[k]) * NS / h
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
    return (
        hermite(lat[k], lat[k + 1], v0[:, 1] / r_lat, v1[:, 1] / r_lat),
        np.remainder(lon_t + np.pi, 2 * np.pi) - np.pi,
        hermite(height[k], height[k + 1], v0[:, 2], v1[:, 2]),
    )


def interpolate(trajectory: Trajectory, t_ns: TimeArray) -> Trajectory:
    """The states at other instants inside the span, all quantities.

    Positions as :func:`interpolate_positions`; velocities and sigmas linear; attitude along the
    chord of the unit quaternions (0.01 deg from the arc for a turn of 20 deg between states);
    ``stopped`` as at the state before. ValueError outside the span or with fewer than two states.
    """
    if trajectory.size < 2:
        raise ValueError("interpolation needs two states")
    lat, lon, height = interpolate_positions(trajectory, t_ns)
    k = np.clip(np.searchsorted(trajectory.t_ns, t_ns, side="right") - 1, 0, trajectory.size - 2)
    s = (t_ns - trajectory.t_ns[k]) / (trajectory.t_ns[k + 1] - trajectory.t_ns[k])

    def linear(x: Array) -> Array:
        w = s.reshape(s.shape + (1,) * (x.ndim - 1))
        return np.asarray((1.0 - w) * x[k] + w * x[k + 1])

    q0, q1 = quaternion_from_c(trajectory.c_nb[k]), quaternion_from_c(trajectory.c_nb[k + 1])
    q1 = np.where(np.sum(q0 * q1, axis=1, keepdims=True) < 0.0, -q1, q1)
    sigma_pos, sigma_heading = trajectory.sigma_pos, trajectory.sigma_heading
    return Trajectory(
        t_ns=t_ns,
        lat=lat,
        lon=lon,
        height=height,
        v_n=linear(trajectory.v_n),
        c_nb=c_from_quaternion((1.0 - s)[:, None] * q0 + s[:, None] * q1),
        stopped=trajectory.stopped[k + (s >= 1.0)],
        sigma_pos=None if sigma_pos is None else linear(sigma_pos),
        sigma_heading=None if sigma_heading is None else linear(sigma_heading),
    )
