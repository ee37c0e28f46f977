"""Strapdown in blocks between epochs, and the feedback of estimated errors, on rows of numbers.

A navigation row holds 22 numbers: place ``c_we`` (9), height, velocity ``v_w`` (3), attitude
``c_wb`` (9). A parameter row holds what is estimated besides: entry k belongs to state 9 + k of
:mod:`vehnav.aiding.error_model` and :mod:`vehnav.aiding.vehicle` (biases first, then the
vehicle's).
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.earth import Ellipsoid
from vehnav.kernel import entry_kernel, kernel
from vehnav.rotation import Mat3, Vec3, dcm_from_rotvec, mat_mat, mat_vec
from vehnav.strapdown.body_step import coning_factor
from vehnav.strapdown.wander import curvature, earth_axis, start_memory, wander_step

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

ROW: Final = 22
"""Numbers in a navigation row."""
HEIGHT: Final = 9
V: Final = 10
C: Final = 13


@kernel
def place_of(row: Array) -> Mat3:
    """c_we of a row."""
    return (row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7], row[8])


@kernel
def velocity_of(row: Array) -> Vec3:
    """v_w of a row."""
    return (row[10], row[11], row[12])


@kernel
def attitude_of(row: Array) -> Mat3:
    """c_wb of a row."""
    return (row[13], row[14], row[15], row[16], row[17], row[18], row[19], row[20], row[21])


@kernel
def write_row(row: Array, c_we: Mat3, h: float, v: Vec3, c_wb: Mat3) -> None:
    """Fill a navigation row."""
    for j in range(9):
        row[j] = c_we[j]
        row[13 + j] = c_wb[j]
    row[9] = h
    row[10], row[11], row[12] = v


@kernel
def increment(t: Array, dtheta: Array, dvel: Array, k: int, par: Array) -> tuple[float, Vec3, Vec3]:
    """(dt, dtheta, dvel) of step k with the estimated biases and scales taken off."""
    dt = t[k + 1] - t[k]
    scale_z = 1.0 - par[10]
    return (
        dt,
        (
            dtheta[k, 0] - par[3] * dt,
            dtheta[k, 1] - par[4] * dt,
            (dtheta[k, 2] - par[5] * dt) * scale_z,
        ),
        (
            dvel[k, 0] - par[0] * dt,
            (dvel[k, 1] - par[1] * dt) * (1.0 - par[12]),
            dvel[k, 2] - par[2] * dt,
        ),
    )


@kernel
def run_block(
    t: Array,
    dtheta: Array,
    dvel: Array,
    coast: npt.NDArray[np.bool_],
    first: int,
    last: int,
    rows: Array,
    par: Array,
    absolute: bool,
    earth: Ellipsoid,
) -> None:
    """Integrate from row ``first`` to row ``last`` of ``rows`` with constant parameters."""
    row = rows[first]
    c_we, h, v, c_wb = place_of(row), row[9], velocity_of(row), attitude_of(row)
    dt_prev, th_prev, dv_prev = 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if first > 0 and not coast[first - 1]:
        dt_prev, th_prev, dv_prev = increment(t, dtheta, dvel, first - 1, par)
    dt, th, dv = increment(t, dtheta, dvel, first, par)
    memory = start_memory(c_we, h, v, mat_vec(c_wb, dv), np.nan, absolute, earth)
    for k in range(first, last):
        dt, th, dv = increment(t, dtheta, dvel, k, par)
        c = 0.0
        if dt_prev > 0.0 and not coast[k]:
            c = coning_factor(dt, dt_prev)
            r = dt / dt_prev
            th_prev = (r * th_prev[0], r * th_prev[1], r * th_prev[2])
            dv_prev = (r * dv_prev[0], r * dv_prev[1], r * dv_prev[2])
        c_we, h, v, c_wb, memory, _, _ = wander_step(
            c_we, h, v, c_wb, memory, dt, (th, dv), (th_prev, dv_prev), c, 0.0, False, coast[k],
            False, np.nan, absolute, earth,
        )  # fmt: skip
        write_row(rows[k + 1], c_we, h, v, c_wb)
        dt_prev, th_prev, dv_prev = (0.0 if coast[k] else dt), th, dv


@kernel
def take_off(row: Array, x: Array, earth: Ellipsoid) -> None:
    """Remove the navigation errors ``x`` (9 or more) from a row (spec B 3.5).

    gamma from the position error turns the place; alpha the attitude and the velocity.
    """
    place = place_of(row)
    k11, k12, k22 = curvature(earth_axis(place), row[9], earth)
    gamma = (-(k12 * x[0] + k22 * x[1]), k11 * x[0] + k12 * x[1], 0.0)
    turn = dcm_from_rotvec((x[6], x[7], x[8]))
    v = velocity_of(row)
    write_row(
        row,
        mat_mat(dcm_from_rotvec(gamma), place),
        row[9] - x[2],
        mat_vec(turn, (v[0] - x[3], v[1] - x[4], v[2] - x[5])),
        mat_mat(turn, attitude_of(row)),
    )


@entry_kernel
def take_off_parameters(par: Array, x: Array) -> None:
    """Remove the errors ``x`` (all states) from a parameter row."""
    for j in range(6):
        par[j] += x[9 + j]  # the corrected sensor is wrong by minus the bias error
    for j in range(6, par.shape[0]):
        par[j] -= x[9 + j]


@entry_kernel
def blend_corrections(
    t: Array,
    epochs: IntArray,
    rows: Array,
    after: Array,
    before: Array,
    earth: Ellipsoid,
) -> None:
    """Take smoothed errors off all rows, in place; linear in time between epochs.

    ``after`` (m, 9): error of the row of each epoch as it stands; ``before`` (m, 9): of the same
    row before the filter's own feedback, which is where the block that leads to it ends.
    """
    x = np.zeros(9)
    for e in range(epochs.shape[0] - 1):
        a, b = epochs[e], epochs[e + 1]
        for k in range(a + 1, b):
            s = (t[k] - t[a]) / (t[b] - t[a])
            for j in range(9):
                x[j] = (1.0 - s) * after[e, j] + s * before[e + 1, j]
            take_off(rows[k], x, earth)
    for e in range(epochs.shape[0]):
        for j in range(9):
            x[j] = after[e, j]
        take_off(rows[epochs[e]], x, earth)
