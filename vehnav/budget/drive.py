"""The ideal drive of an error budget: what perfect sensors read on it, and the states they give.

Paper 001 (figure 1b) runs an ideal and a perturbed algorithm on the same readings n and omega.
:class:`IdealDrive` holds these readings as increments with the states; :class:`Grid` their means
over intervals of about 0.1 s, on which the error equations are integrated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.earth import (
    WGS84,
    Ellipsoid,
    curvature_radii,
    earth_rate,
    normal_gravity,
    transport_rate,
)
from vehnav.kernel import entry_kernel
from vehnav.rest import runs
from vehnav.rotation import add, c_from_rotvec, cross, rotvec_from_c, scale, subtract
from vehnav.strapdown.enu import unfelt_acceleration
from vehnav.strapdown.increments import Increments
from vehnav.trajectory import Trajectory
from vehnav.units import NS

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

GRID_STEP: Final = 0.1
"""s of an interval: from 0.02 to 1 s the DRMS moves by 0.06 % (spec B 1.5)."""


@dataclass(frozen=True)
class IdealDrive:
    """A drive without errors.

    Attributes
    ----------
    name : str
        For a person.
    increments : Increments
        What perfect sensors read over the n-1 steps; its ``t`` are the n instants, s, from 0.
    lat, lon, height : (n,)
        rad, rad, m.
    v_n : (n, 3), c_nb : (n, 3, 3)
    stops : tuple of (start, end)
        s; when the vehicle stands.
    earth : Ellipsoid
    start_ns : int
        Stamp of t = 0.
    """

    name: str
    increments: Increments
    lat: Array
    lon: Array
    height: Array
    v_n: Array
    c_nb: Array
    stops: tuple[tuple[float, float], ...]
    earth: Ellipsoid = WGS84
    start_ns: int = 0

    @property
    def t(self) -> Array:
        """(n,) s since the start."""
        return self.increments.t

    @property
    def duration(self) -> float:
        """Length, s."""
        return float(self.t[-1])

    def thinned(self, step: float) -> IdealDrive:
        """The drive with increments summed over as many steps as fit into ``step`` s."""
        every = max(1, int(step / float(np.median(self.increments.dt)) + 1e-6))
        if every == 1:
            return self
        index = np.arange(0, self.t.size, every)
        if index[-1] != self.t.size - 1:
            index = np.append(index, self.t.size - 1)
        steps = self.increments
        return replace(
            self,
            increments=Increments(
                steps.t[index],
                np.add.reduceat(steps.dtheta, index[:-1], axis=0),
                np.add.reduceat(steps.dvel, index[:-1], axis=0),
                np.logical_or.reduceat(steps.coast, index[:-1]),
            ),
            lat=self.lat[index],
            lon=self.lon[index],
            height=self.height[index],
            v_n=self.v_n[index],
            c_nb=self.c_nb[index],
        )

    def path_length(self) -> float:
        """Horizontal way, m."""
        speed = np.hypot(self.v_n[:, 0], self.v_n[:, 1])
        return float(np.sum(0.5 * (speed[1:] + speed[:-1]) * np.diff(self.t)))


def standing_spans(t: Array, stopped: npt.NDArray[np.bool_]) -> tuple[tuple[float, float], ...]:
    """(start, end), s, of every stretch of two or more instants marked as stopped."""
    return tuple((float(t[a]), float(t[b])) for a, b in runs(stopped).tolist() if b > a)


def drive_of_trajectory(track: Trajectory, *, name: str, earth: Ellipsoid = WGS84) -> IdealDrive:
    """The readings that lead along a trajectory: the mechanization of paper 004 turned round.

    dtheta from C_k+1 = exp(-[zeta x]) C_k exp([dtheta x]), dvel from the velocities less Coriolis
    and gravity; where the trajectory stands its velocity counts as zero. ValueError for fewer than
    two states.
    """
    if track.size < 2:
        raise ValueError("a drive needs two states")
    t = (track.t_ns - track.t_ns[0]) * NS
    v_n = np.ascontiguousarray(np.where(track.stopped[:, None], 0.0, track.v_n))
    zeta, dv_n = np.empty((t.size - 1, 3)), np.empty((t.size - 1, 3))
    lat, height = np.ascontiguousarray(track.lat), np.ascontiguousarray(track.height)
    frame_and_force(t, lat, height, v_n, earth, zeta, dv_n)
    c0, c1 = track.c_nb[:-1], track.c_nb[1:]
    dtheta = rotvec_from_c(np.swapaxes(c0, 1, 2) @ c_from_rotvec(zeta) @ c1)
    dv_b = np.einsum("kji,kj->ki", c0, dv_n)
    return IdealDrive(
        name=name,
        increments=Increments(
            t, dtheta, dv_b - 0.5 * np.cross(dtheta, dv_b), np.zeros(t.size - 1, bool)
        ),
        lat=lat,
        lon=track.lon,
        height=height,
        v_n=v_n,
        c_nb=track.c_nb,
        stops=standing_spans(t, track.stopped),
        earth=earth,
        start_ns=int(track.t_ns[0]),
    )


@entry_kernel
def frame_and_force(
    t: Array,
    lat: Array,
    height: Array,
    v_n: Array,
    earth: Ellipsoid,
    out_zeta: Array,
    out_dv: Array,
) -> None:
    """Turn of the axes (rad) and integral of the specific force in them (m/s) over every step."""
    for k in range(t.shape[0] - 1):
        dt = t[k + 1] - t[k]
        phi, h = 0.5 * (lat[k] + lat[k + 1]), 0.5 * (height[k] + height[k + 1])
        v0 = (v_n[k, 0], v_n[k, 1], v_n[k, 2])
        v1 = (v_n[k + 1, 0], v_n[k + 1, 1], v_n[k + 1, 2])
        v = scale(0.5, add(v0, v1))
        r_m, r_e = curvature_radii(phi, h, earth)
        omega_ie = earth_rate(phi, earth)
        omega_en = transport_rate(v, r_m, r_e, math.tan(phi))
        zeta = scale(dt, add(omega_ie, omega_en))
        rest = unfelt_acceleration(
            v, omega_ie, omega_en, normal_gravity(phi, h, earth), (0.0, 0.0, 0.0)
        )
        felt = subtract(subtract(v1, v0), scale(dt, rest))
        felt = add(felt, scale(0.5, cross(zeta, felt)))  # the axes turn under the increment
        out_zeta[k, 0], out_zeta[k, 1], out_zeta[k, 2] = zeta
        out_dv[k, 0], out_dv[k, 1], out_dv[k, 2] = felt


# ---- intervals ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Grid:
    """A drive over m intervals between m+1 instants; means over the intervals.

    Attributes
    ----------
    t : (m+1,)
        s.
    stop : (m+1,) int64
        Number of the corrected stop that an instant lies in, -1 elsewhere.
    lat, height : (m,)
        rad, m.
    v_n : (m, 3)
        m/s.
    c_nb : (m, 9)
        By rows.
    gyro : (m, 27)
        C[r, i] omega_k, rad/s: axis i of the gyros takes part in the rate about k; order r, i, k.
    force : (m, 27)
        C[r, i] f_k, m/s2, the same.
    """

    t: Array
    stop: IntArray
    lat: Array
    height: Array
    v_n: Array
    c_nb: Array
    gyro: Array
    force: Array

    @property
    def size(self) -> int:
        """Number of intervals."""
        return int(self.lat.size)


def grid_of(
    drive: IdealDrive, stops: tuple[tuple[float, float], ...], *, step: float = GRID_STEP
) -> Grid:
    """Means over intervals of about ``step`` s, with edges at both ends of the stops.

    The products of attitude and reading are averaged at the steps of the drive, so that turns and
    vibration within an interval are not lost.
    """
    index, stop = _edges(drive.t, stops, step)
    m = index.size - 1
    lat, height, v_n = np.empty(m), np.empty(m), np.empty((m, 3))
    c_nb, gyro, force = np.empty((m, 9)), np.empty((m, 27)), np.empty((m, 27))
    n = drive.t.size
    interval_means(
        _ready(drive.t), index, _ready(drive.lat), _ready(drive.height), _ready(drive.v_n),
        _ready(drive.c_nb.reshape(n, 9)), _ready(drive.increments.dtheta),
        _ready(drive.increments.dvel), lat, height, v_n, c_nb, gyro, force,
    )  # fmt: skip
    return Grid(drive.t[index], stop, lat, height, v_n, c_nb, gyro, force)


def _edges(
    t: Array, stops: tuple[tuple[float, float], ...], step: float
) -> tuple[IntArray, IntArray]:
    """(indices of the instants of the grid, number of the stop of each)."""
    count = max(1, round(float(t[-1] - t[0]) / step))
    regular = np.searchsorted(t, np.linspace(t[0], t[-1], count + 1) - 1e-9)
    ends = np.searchsorted(t, np.array(stops, float).reshape(-1, 2) - 1e-9)
    ends = np.minimum(ends, t.size - 1)
    index = np.unique(np.concatenate([regular, ends.ravel(), [0, t.size - 1]]).astype(np.int64))
    number = np.full(index.size, -1, dtype=np.int64)
    for k, (a, b) in enumerate(ends.tolist()):
        number[(index >= a) & (index <= b)] = k
    return index, number


def _ready(x: Array) -> Array:
    """C-ordered and writable: any other layout costs a recompilation."""
    return np.require(x, np.float64, ["C", "W"])


@entry_kernel
def interval_means(
    t: Array,
    index: IntArray,
    lat: Array,
    height: Array,
    v_n: Array,
    c_nb: Array,
    dtheta: Array,
    dvel: Array,
    out_lat: Array,
    out_height: Array,
    out_v: Array,
    out_c: Array,
    out_gyro: Array,
    out_force: Array,
) -> None:
    """Means over the intervals; see :func:`grid_of`."""
    c = np.empty(9)
    for m in range(out_lat.shape[0]):
        out_lat[m], out_height[m] = 0.0, 0.0
        out_v[m], out_c[m], out_gyro[m], out_force[m] = 0.0, 0.0, 0.0, 0.0
        a, b = index[m], index[m + 1]
        whole = t[b] - t[a]
        for k in range(a, b):
            w = 0.5 * (t[k + 1] - t[k]) / whole
            out_lat[m] += w * (lat[k] + lat[k + 1])
            out_height[m] += w * (height[k] + height[k + 1])
            for j in range(3):
                out_v[m, j] += w * (v_n[k, j] + v_n[k + 1, j])
            for j in range(9):
                c[j] = 0.5 * (c_nb[k, j] + c_nb[k + 1, j])
                out_c[m, j] += 2.0 * w * c[j]
                for i in range(3):  # increments divided by the whole: mean of C times rate
                    out_gyro[m, 3 * j + i] += c[j] * dtheta[k, i] / whole
                    out_force[m, 3 * j + i] += c[j] * dvel[k, i] / whole
