"""Fitting a trajectory to the reference before judging: on request, and said in the report.

Least squares over the judged fixes, in the tangent plane at the first one (Umeyama 1991 without
scale): ``yaw`` turns about the vertical through the trajectory's first judged position,
``yaw+translation`` turns and moves, ``full`` turns about any axis and moves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from vehnav.earth import c_en, geodetic_from_local_enu, local_enu
from vehnav.trajectory import Trajectory

Array = npt.NDArray[np.float64]
Align = Literal["none", "yaw", "yaw+translation", "full"]

ALIGNMENTS: Final[tuple[Align, ...]] = ("none", "yaw", "yaw+translation", "full")


@dataclass(frozen=True)
class Fit:
    """What was done to the trajectory: p' = C p + d in the plane.

    Attributes
    ----------
    align : str
    c : (3, 3)
    d : (3,)
        m.
    origin : (lat rad, lon rad, height m)
        Of the plane.
    """

    align: Align
    c: Array
    d: Array
    origin: tuple[float, float, float]

    @property
    def turned(self) -> float:
        """Angle of the rotation about the vertical, rad, clockwise (as headings count)."""
        return float(np.arctan2(self.c[0, 1] - self.c[1, 0], self.c[0, 0] + self.c[1, 1]))


def fit(position: Array, reference: Array, align: Align) -> tuple[Array, Array]:
    """(C, d) that bring ``position`` (n, 3) closest to ``reference`` (n, 3).

    ValueError for ``full`` when the points lie on a line, which leaves a rotation free.
    """
    if align == "none":
        return np.eye(3), np.zeros(3)
    pivot = align == "yaw"
    p0 = position[0] if pivot else position.mean(axis=0)
    q0 = position[0] if pivot else reference.mean(axis=0)
    a, b = position - p0, reference - q0
    if align == "full":
        c = _rotation(a, b)
    else:
        angle = np.arctan2(
            np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), np.sum(a[:, :2] * b[:, :2])
        )
        s, k = np.sin(angle), np.cos(angle)
        c = np.array([[k, -s, 0.0], [s, k, 0.0], [0.0, 0.0, 1.0]])
    return c, q0 - c @ p0


def _rotation(a: Array, b: Array) -> Array:
    """The rotation C that minimises sum |C a - b|^2 (Kabsch; Umeyama for the reflection)."""
    u, size, vt = np.linalg.svd(b.T @ a)
    if size[1] < 1e-9 * max(size[0], 1e-300):
        raise ValueError("the points lie on a line: a full alignment has no unique rotation")
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(vt))])
    return np.asarray(u @ flip @ vt)


def aligned(
    states: Trajectory, lat: Array, lon: Array, height: Array, align: Align
) -> tuple[Trajectory, Fit]:
    """The states fitted to the reference (lat rad, lon rad, height m), and the fit."""
    origin = (float(lat[0]), float(lon[0]), float(height[0]))
    position = states.enu(origin)
    c, d = fit(position, local_enu(lat, lon, height, origin=origin), align)
    result = Fit(align, c, d, origin)
    if align == "none":
        return states, result
    new_lat, new_lon, new_height = geodetic_from_local_enu(position @ c.T + d, origin=origin)
    c_e0 = c_en(origin[0], origin[1])
    to_plane = c_e0.T @ c_en(states.lat, states.lon)
    from_plane = np.swapaxes(c_en(new_lat, new_lon), 1, 2) @ c_e0
    turn = from_plane @ c @ to_plane
    moved = replace(
        states,
        lat=new_lat,
        lon=new_lon,
        height=new_height,
        v_n=np.einsum("kij,kj->ki", turn, states.v_n),
        c_nb=turn @ states.c_nb,
    )
    return moved, result
