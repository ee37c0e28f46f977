"""Place and axes of the wander frame as matrices (paper 003, equations 2, 3 and 24)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vehnav.earth import c_en

Array = npt.NDArray[np.float64]


def c_nw(wander: npt.ArrayLike) -> Array:
    """(..., 3, 3): turns wander axes into East-North-Up, the transpose of A(epsilon) (3)."""
    s, c = np.sin(np.asarray(wander, float)), np.cos(np.asarray(wander, float))
    zero, one = np.zeros_like(s), np.ones_like(s)
    rows = [[c, -s, zero], [s, c, zero], [zero, zero, one]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def c_we_from_geodetic(
    lat: npt.ArrayLike, lon: npt.ArrayLike, wander: npt.ArrayLike = 0.0
) -> Array:
    """C_we = A(epsilon) B_0 (..., 3, 3) of latitude, longitude and wander angle, rad (3)."""
    lat, lon, wander = np.broadcast_arrays(*(np.asarray(x, float) for x in (lat, lon, wander)))
    return np.asarray(np.swapaxes(c_en(lat, lon) @ c_nw(wander), -1, -2))


def geodetic_from_c_we(c_we: npt.ArrayLike) -> tuple[Array, Array, Array]:
    """(lat, lon, wander angle), rad, of C_we (..., 3, 3) (24); at a pole lon and wander are 0/pi.

    ``lon + wander`` (north) alone is defined there; their sum stays right.
    """
    b = np.asarray(c_we, float)
    b13, b23, b33 = b[..., 0, 2], b[..., 1, 2], b[..., 2, 2]
    b31, b32 = b[..., 2, 0], b[..., 2, 1]
    return np.arctan2(b33, np.hypot(b13, b23)), np.arctan2(b32, b31), np.arctan2(b13, b23)
