"""Paper 004's announced filter beside the error-state filter, on the same drawn logs.

The sensors are those of the paper, white noise and no bias (12); GNSS gives a position a second.
Both filters get the same increments, start and fixes and are told the same figures.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.aiding.filter import PARAMETERS, FilterStart, run_filter
from vehnav.aiding.fixes import Fixes
from vehnav.aiding.gaps import GapSigmas
from vehnav.aiding.land import Use, put_to_epochs
from vehnav.aiding.langevin_filter import filter_langevin, navigation_covariance, start_covariance
from vehnav.aiding.vehicle import SIZE, Noise
from vehnav.classic import Drive
from vehnav.earth import WGS84, c_en, ecef_from_geodetic, geodetic_from_ecef, position_difference
from vehnav.papers.displaced import displace
from vehnav.papers.drawn_runs import OFF, Way, navigation_errors, true_rows
from vehnav.rotation import rotvec_from_c
from vehnav.strapdown.increments import Increments
from vehnav.strapdown.langevin import GravityInput, c_nb_of, state_vector
from vehnav.strapdown.wander import c_nw, geodetic_from_c_we
from vehnav.units import DEG

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

GYRO_NOISE, ACCEL_NOISE = 0.03 * DEG * np.sqrt(0.1), 218e-6 * 9.80665 * np.sqrt(0.1)
"""rad/s/sqrt(Hz), m/s2/sqrt(Hz): the paper's 0.03 deg/s and 218 ug on every sample at 0.1 s."""
FIX_SIGMA = 3.0
"""m per axis, a position a second."""
START: Final = np.array([3.0] * 3 + [0.5] * 3 + [0.5 * DEG] * 2)
"""m, m/s, rad: sigmas of the start but for the heading."""
EVERY: Final = 10


@dataclass(frozen=True)
class Looks:
    """A filter looked at m times.

    Attributes
    ----------
    t : (m,)
        s
    horizontal, heading : (m,)
        Errors, m and rad.
    nees : (m,)
        Squared errors of the nine in the metric of the covariance.
    seconds : float
        Of computing.
    """

    t: Array
    horizontal: Array
    heading: Array
    nees: Array
    seconds: float


@dataclass(frozen=True)
class DrawnLog:
    """A log with its fixes and start.

    Attributes
    ----------
    way : Way
    increments : Increments
    row : (22,)
        Start of the error-state filter.
    sigmas : (9,)
        Of the start.
    fixes : Fixes
    """

    way: Way
    increments: Increments
    row: Array
    sigmas: Array
    fixes: Fixes


def draw_log(way: Way, heading_sigma: float, seed: int) -> DrawnLog:
    """Noise, fixes and start of a run; ``heading_sigma``: rad."""
    rng = np.random.default_rng([4, seed])
    root = np.sqrt(np.diff(way.t))[:, None]
    shape = way.dtheta.shape
    increments = Increments(
        way.t,
        way.dtheta + GYRO_NOISE * root * rng.standard_normal(shape),
        way.dvel + ACCEL_NOISE * root * rng.standard_normal(shape),
        np.zeros(way.t.size - 1, np.bool_),
    )
    sigmas = np.append(START, heading_sigma)
    first = way.truth.rows(slice(0, 1))
    (row,) = true_rows(first, np.swapaxes(c_en(first.lat, first.lon), 1, 2).reshape(-1, 9))
    displace(row, -sigmas * rng.standard_normal(9), WGS84)
    at = np.searchsorted(way.t, np.arange(1.0, way.t[-1] + 1e-6) - 1e-6)
    truth = way.truth.rows(at)
    r_e = ecef_from_geodetic(truth.lat, truth.lon, truth.height)
    place = geodetic_from_ecef(r_e + FIX_SIGMA * rng.standard_normal(r_e.shape))
    fixes = Fixes(way.t[at], *place, sigma_pos=np.full(r_e.shape, FIX_SIGMA))
    return DrawnLog(way, increments, row, sigmas, fixes)


def by_error_states(log: DrawnLog) -> Looks:
    """The closed-loop filter of nine error states (the others known)."""
    figures = dict.fromkeys(Noise._fields, 0.0)
    figures |= {"gyro": GYRO_NOISE, "accel": ACCEL_NOISE}
    noise = Noise(**(figures | {"huber": OFF, "gate": OFF}))
    t, p = log.way.t, np.zeros((SIZE, SIZE))
    p[range(9), range(9)] = log.sigmas**2
    rates, nothing = np.zeros((t.size, 3)), np.zeros(t.size - 1)
    drive = Drive(t, rates, rates, log.increments, [], WGS84)
    aids = put_to_epochs(
        t, np.zeros(t.size, np.bool_), log.fixes, None, Use(False, False, False), drive
    )
    begin = time.perf_counter()
    found = run_filter(
        log.increments, GapSigmas(np.zeros((t.size - 1, 3)), nothing), aids,
        FilterStart(log.row, np.zeros(PARAMETERS), p), noise=noise, earth=WGS84,
    )  # fmt: skip
    seconds = time.perf_counter() - begin
    looks = np.arange(EVERY, aids.epochs.size, EVERY)
    at = aids.epochs[looks]
    errors = navigation_errors(log.way.truth.rows(at), found.rows[at])
    return _looks(t[at], errors, found.covariance[looks, :9, :9], seconds)


def by_direction_cosines(log: DrawnLog) -> Looks:
    """The nonlinear filter on the model (16)."""
    t, fixes = log.way.t, log.fixes
    grid = np.unique(np.append(np.arange(0, t.size, round(0.1 / (t[1] - t[0]))), t.size - 1))
    fix = np.full(grid.size, -1, np.int64)
    fix[np.searchsorted(t[grid], fixes.t - 1e-6)] = np.arange(fixes.t.size)
    y = start_state(log.row)
    dt = np.diff(t)[:, None]
    begin = time.perf_counter()
    found = filter_langevin(
        t, np.concatenate([log.increments.dvel, log.increments.dtheta], axis=1) / dt, y,
        start_covariance(y, np.diag(log.sigmas**2)), epochs=grid, fix=fix,
        fixes=np.column_stack([fixes.lat, fixes.lon, fixes.height]), fix_sigma=FIX_SIGMA,
        accel_density=ACCEL_NOISE, gyro_density=GYRO_NOISE,
        gravity=GravityInput(height=float(y[2])),
    )  # fmt: skip
    seconds = time.perf_counter() - begin
    looks = np.arange(EVERY, grid.size, EVERY)
    states = found.states[looks]
    p = navigation_covariance(states, found.covariance[looks])
    return _looks(t[grid[looks]], state_errors(log.way, grid[looks], states), p, seconds)


def start_state(row: Array) -> Array:
    """Y (15,) of a navigation row."""
    lat, lon, wander = (float(x) for x in geodetic_from_c_we(row[:9].reshape(3, 3)))
    turn = c_nw(wander)
    return state_vector((lat, lon, row[9]), turn @ row[10:13], turn @ row[13:].reshape(3, 3))


def state_errors(way: Way, at: IntArray, states: Array) -> Array:
    """(m, 9) of states (m, 15): position, m, velocity, m/s, and psi, rad, computed minus true."""
    truth = way.truth.rows(at)
    flat = position_difference(
        states[:, 0], states[:, 1], truth.lat, truth.lon, truth.height, earth=WGS84
    )
    up = states[:, 2] - truth.height
    psi = rotvec_from_c(truth.c_nb @ np.swapaxes(c_nb_of(states), 1, 2))
    return np.concatenate([flat, up[:, None], states[:, 3:6] - truth.v_n, psi], axis=1)


def _looks(t: Array, errors: Array, p: Array, seconds: float) -> Looks:
    weighed = np.linalg.solve(p, errors[:, :, None])[:, :, 0]
    nees = np.sum(errors * weighed, axis=1)
    return Looks(t, np.hypot(errors[:, 0], errors[:, 1]), errors[:, 8], nees, seconds)
