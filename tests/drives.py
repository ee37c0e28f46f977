"""Drives made from closed forms: what they cost and where they are is known without the package."""

from __future__ import annotations

import numpy as np

from vehnav.earth import geodetic_from_local_enu
from vehnav.logs.log import Gnss
from vehnav.rotation import c_nb_from_angles
from vehnav.trajectory import Trajectory

ORIGIN = (np.radians(42.34), np.radians(-71.09), 30.0)
T0_NS = 1_711_483_800_000_000_000


class Circle:
    """A drive on a circle of radius 100 m at 10 m/s, starting northward at the origin."""

    radius = 100.0
    speed = 10.0

    def enu(self, t: np.ndarray) -> np.ndarray:
        a = self.speed * t / self.radius
        return np.column_stack(
            [self.radius * (1 - np.cos(a)), self.radius * np.sin(a), np.zeros_like(a)]
        )

    def v(self, t: np.ndarray) -> np.ndarray:
        a = self.speed * t / self.radius
        return np.column_stack([self.speed * np.sin(a), self.speed * np.cos(a), np.zeros_like(a)])

    def heading(self, t: np.ndarray) -> np.ndarray:
        return self.speed * t / self.radius


def stamps(t: np.ndarray) -> np.ndarray:
    return T0_NS + np.rint(t * 1e9).astype(np.int64)


def trajectory_of(t: np.ndarray, enu: np.ndarray, v: np.ndarray, heading: np.ndarray) -> Trajectory:
    lat, lon, height = geodetic_from_local_enu(enu, origin=ORIGIN)
    return Trajectory(
        t_ns=stamps(t),
        lat=lat,
        lon=lon,
        height=height,
        v_n=v,
        c_nb=c_nb_from_angles(heading, 0.0, 0.0),
        stopped=np.hypot(v[:, 0], v[:, 1]) < 0.01,
    )


def gnss_of(t: np.ndarray, enu: np.ndarray, v: np.ndarray | None = None) -> Gnss:
    lat, lon, height = geodetic_from_local_enu(enu, origin=ORIGIN)
    return Gnss(t_ns=stamps(t), lat=lat, lon=lon, height=height, v_n=v)
