"""Drives of the budget tests, straight from the simulator, and the nonlinear judge."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from vehnav.budget import IdealDrive
from vehnav.budget.drive import standing_spans
from vehnav.budget.sources import OFF_DIAGONAL
from vehnav.earth import curvature_radii, position_difference
from vehnav.rotation import c_from_rotvec
from vehnav.simulate import ideal_log, make_scenario, stamps
from vehnav.strapdown.enu import Solution, mechanize_enu
from vehnav.strapdown.increments import Increments
from vehnav.units import NS

LEVEL = "static,lat=55,height=0"
TOWN = "town"


@cache
def drive(text: str, duration: float = 600.0, rate: float = 100.0) -> IdealDrive:
    """The simulator's own ideal increments and truth: nothing of drive_of_trajectory is in it."""
    scenario = make_scenario(text, duration=duration)
    truth, ideal = ideal_log(scenario.motion, stamps(duration, rate), sampling="increments")
    t = (truth.t_ns - truth.t_ns[0]) * NS
    steps = Increments(t, ideal.gyro[1:], ideal.accel[1:], np.zeros(t.size - 1, bool))
    return IdealDrive(
        text, steps, truth.lat, truth.lon, truth.height, truth.v_n, truth.c_nb,
        standing_spans(t, truth.stopped), scenario.motion.earth,
    )  # fmt: skip


def perturbed(
    ideal: IdealDrive,
    *,
    gyro: Any = 0.0,
    accel: Any = 0.0,
    psi: Any = (0.0, 0.0, 0.0),
    velocity: Any = (0.0, 0.0, 0.0),
    position: Any = (0.0, 0.0, 0.0),
    held: bool = True,
) -> Solution:
    """The nonlinear algorithm with errors added to the increments and to the start."""
    lat, lon, h = ideal.lat[0], ideal.lon[0], ideal.height[0]
    r_m, r_n = curvature_radii(lat, h, ideal.earth)
    east, north, up = (float(x) for x in position)
    steps = ideal.increments
    return mechanize_enu(
        Increments(steps.t, steps.dtheta + gyro, steps.dvel + accel, steps.coast),
        position=(lat + north / r_m, lon + east / (r_n * np.cos(lat)), h + up),
        v_n=tuple(ideal.v_n[0] + np.asarray(velocity)),
        c_nb=c_from_rotvec(-np.asarray(psi)) @ ideal.c_nb[0],
        vertical="clamp" if held else "free",
        gravity_at="height",
        earth=ideal.earth,
    )


def error_of_column(ideal: IdealDrive, column: int, size: float, *, held: bool = True) -> Solution:
    """The nonlinear algorithm with one constant source of the budget (numbered as its columns)."""
    steps = ideal.increments
    if column >= 33:
        part = ("psi", "velocity", "position")[(column - 33) // 3]
        value = np.zeros(3)
        value[(column - 33) % 3] = size
        return perturbed(ideal, **{part: value}, held=held)
    if column >= 24:
        matrix = np.zeros((3, 3))
        matrix[(column - 24) // 3, (column - 24) % 3] = size
        return perturbed(ideal, gyro=steps.dvel @ matrix.T, held=held)
    reading, number = (steps.dtheta, steps.dvel)[column // 12], column % 12
    bias, matrix = np.zeros(3), np.zeros((3, 3))
    if number < 3:
        bias[number] = size
    elif number < 6:
        matrix[number - 3, number - 3] = size
    else:
        matrix[OFF_DIAGONAL[number - 6]] = size
    error = bias * steps.dt[:, None] + reading @ matrix.T
    return perturbed(ideal, **{("gyro", "accel")[column // 12]: error}, held=held)


def apart(a: Solution, b: Solution) -> np.ndarray:
    """(2,) m: east and north of the ends, a minus b."""
    first, second = a.position[-1], b.position[-1]
    return position_difference(first[0], first[1], second[0], second[1], second[2])
