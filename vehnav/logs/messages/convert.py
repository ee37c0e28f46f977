"""Columns as stored -> SI, radians, east-north-up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vehnav.logs.log import Array
from vehnav.logs.messages.roles import Role
from vehnav.units import DEG

Columns = dict[str, npt.NDArray[Any]]

MAX_ACROSS = 0.3
"""A twist whose sideways part is larger than this share of its forward part is no vehicle's."""


def vector(columns: Columns, role: Role, name: str) -> Array:
    """(n, k) numbers of a quantity in SI."""
    return scaled(columns[name].astype(np.float64, copy=False), role.quantities[name].factor)


def scaled(values: Array, factor: float) -> Array:
    """Numbers times a factor, without a copy where it is 1."""
    return values if factor == 1.0 else values * factor


def scalar(columns: Columns, role: Role, name: str) -> Array:
    """(n,) numbers of a quantity in SI."""
    return vector(columns, role, name)[:, 0]


@dataclass(frozen=True)
class Fixes:
    """Columns of :func:`vehnav.logs.check.clean_gnss`."""

    lat: Array
    lon: Array
    height: Array
    v_n: Array | None
    sigma_pos: Array | None
    status: npt.NDArray[np.int64] | None


def fixes(columns: Columns, role: Role) -> Fixes:
    """Fixes of a topic; a height that is not there is nan."""
    lat = scalar(columns, role, "lat")
    height = scalar(columns, role, "height") if "height" in columns else np.full(lat.size, np.nan)
    return Fixes(
        lat,
        scalar(columns, role, "lon"),
        height,
        _velocity(columns, role),
        _sigma(columns, role),
        _status(columns),
    )


def _velocity(columns: Columns, role: Role) -> Array | None:
    """East, north, up."""
    if "v_ned" in columns:
        v = vector(columns, role, "v_ned")
        return np.column_stack((v[:, 1], v[:, 0], -v[:, 2]))
    if "v_track" in columns:  # degrees clockwise from north, speed, climb
        track, speed, climb = vector(columns, role, "v_track").T
        return np.column_stack((speed * np.sin(track * DEG), speed * np.cos(track * DEG), climb))
    return vector(columns, role, "v_enu") if "v_enu" in columns else None


def _sigma(columns: Columns, role: Role) -> Array | None:
    """East, north, up, from the diagonal of a covariance or from stated accuracies."""
    if "covariance" in columns and columns["covariance"].shape[1] == 9:
        variance = vector(columns, role, "covariance")[:, (0, 4, 8)]
        known = np.isfinite(variance) & (variance > 0)
        if "covariance_type" in columns:
            known &= columns["covariance_type"] != 0
        sigma = np.sqrt(np.where(known, variance, 0.0))
        return sigma if known.any() else None
    if "accuracy" in columns:
        horizontal, vertical = vector(columns, role, "accuracy").T
        return np.column_stack((horizontal, horizontal, vertical))
    return None


def _status(columns: Columns) -> npt.NDArray[np.int64] | None:
    """As NavSatStatus: -1 is no fix."""
    if "fix_type" in columns:  # u-blox and PX4: 0 and 1 are no fix by satellites
        fix_type = columns["fix_type"][:, 0].astype(np.int64)
        return np.where(fix_type >= 2, 0, -1)
    return columns["status"][:, 0].astype(np.int64) if "status" in columns else None


def forward_speed(columns: Columns, role: Role) -> tuple[Array, str]:
    """(n,) m/s, and why it may not be a vehicle's forward speed, or ""."""
    if "speed" in columns:
        return scalar(columns, role, "speed"), ""
    linear = vector(columns, role, "linear")
    rms = np.sqrt(np.mean(np.where(np.isfinite(linear), linear, 0.0) ** 2, axis=0))
    if rms[0] == 0.0 and rms[1] == 0.0:
        return linear[:, 0], "it is zero throughout"
    if rms[1] > MAX_ACROSS * rms[0]:
        return linear[:, 0], f"it moves sideways ({rms[1]:.2g} m/s rms, forward {rms[0]:.2g})"
    return linear[:, 0], ""
