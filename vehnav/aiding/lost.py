"""A filter that is lost: fixes refused one after the other are right, and the solution is wrong.

A single fix far off is refused, and one that is refused moves nothing. What has gone astray by a
long gap, a failing gyro or a wrong start would so never come back. When nothing but refused fixes
came for a while, the solution is set on them.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.aiding.blocks import attitude_of, place_of, take_off, velocity_of
from vehnav.aiding.measurements import gnss_position
from vehnav.earth import Ellipsoid
from vehnav.kernel import kernel
from vehnav.rotation import Vec3, dcm_from_rotvec, mat_t_vec, mat_vec
from vehnav.units import DEG

Array = npt.NDArray[np.float64]

SECONDS: Final = 20.0
"""s of refused fixes, one after the other: longer than most reflections at a building last."""
FEWEST: Final = 5
"""Refused fixes, at least."""
FASTEST_BACKWARD: Final = 6.0
"""m/s over which the course is the heading."""
WRONG_HEADING: Final = 30.0 * DEG
"""rad between course and heading, over which the heading is wrong too."""
VELOCITY: Final = 3.0
"""m/s: sigma of the velocity between two fixes."""
HEADING: Final = 15.0 * DEG
"""rad: sigma of its course."""
TILT: Final = 3.0 * DEG
"""rad: sigma of the level then."""
SIZE: Final = 6
"""Numbers kept: refused in a row, time of the first and of the last, place of the last."""


@kernel
def refused(lost: Array, t: float, fix: Array, was: bool) -> None:
    """Write down whether a fix was refused."""
    if not was:
        lost[0] = 0.0
        return
    if lost[0] == 0.0:
        lost[1] = t
    lost[0] += 1.0
    lost[2] = t
    lost[3:6] = fix[:3]


@kernel
def set_on_fix(
    lost: Array, t: float, fix: Array, ago: float, p: Array, row: Array, jump: Array,
    earth: Ellipsoid,
) -> bool:  # fmt: skip
    """Where the filter is lost: set a row on a fix, open its covariance. ``jump`` (9,): taken off.

    Velocity, and heading where it is far off, are those between this fix and the one before.
    """
    if lost[0] < FEWEST or t - lost[1] < SECONDS or t <= lost[2]:
        return False
    place, v, c_wb = place_of(row), velocity_of(row), attitude_of(row)
    away = gnss_position(place, row[9], v, (fix[0], fix[1], fix[2]), ago, earth)
    dt = t - lost[2]
    moved = ((fix[0] - lost[3]) / dt, (fix[1] - lost[4]) / dt, (fix[2] - lost[5]) / dt)
    seen = mat_vec(place, moved)
    turn = 0.0
    if np.sqrt(seen[0] * seen[0] + seen[1] * seen[1]) > FASTEST_BACKWARD:
        east, north = c_wb[1], c_wb[4]  # the forward axis
        turn = np.arctan2(east * seen[1] - north * seen[0], east * seen[0] + north * seen[1])
        if abs(turn) < WRONG_HEADING:
            turn = 0.0
    level: Vec3 = (seen[0], seen[1], 0.0)
    before = mat_t_vec(dcm_from_rotvec((0.0, 0.0, turn)), level)
    for j in range(3):
        jump[j] = away[j]
        jump[3 + j] = v[j] - before[j]
    jump[8] = turn
    open_covariance(p, jump)
    take_off(row, jump, earth)
    lost[0] = 0.0
    return True


@kernel
def open_covariance(p: Array, jump: Array) -> None:
    """Add what the jump leaves open."""
    for j in range(3):
        p[j, j] += jump[j] * jump[j]
        p[3 + j, 3 + j] += VELOCITY * VELOCITY
    p[6, 6] += TILT * TILT
    p[7, 7] += TILT * TILT
    if jump[8] != 0.0:
        p[8, 8] += HEADING * HEADING
