"""Runs of the filter whose errors are drawn from its own model: paper 003's 13 states.

Truth and perfect increments come from the simulator; constant biases, white noise, the start and
the fixes are drawn. The filter is told exactly that model, so that its squared errors in the metric
of its covariance must have the mean 13.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.aiding.blocks import ROW
from vehnav.aiding.error_model import ACCEL, GYRO, PAPER_STATES
from vehnav.aiding.filter import PARAMETERS, Filtered, FilterStart, run_filter
from vehnav.aiding.fixes import Fixes
from vehnav.aiding.gaps import GapSigmas
from vehnav.aiding.gnss_forms import Form
from vehnav.aiding.land import Use, put_to_epochs
from vehnav.aiding.vehicle import CUT, SIZE, Noise, Prior
from vehnav.classic import Drive
from vehnav.earth import WGS84, c_en, ecef_from_geodetic, geodetic_from_ecef
from vehnav.papers.displaced import displace
from vehnav.simulate.generate import ideal_log, stamps
from vehnav.simulate.scenarios import make_scenario
from vehnav.strapdown.increments import Increments
from vehnav.trajectory import Trajectory
from vehnav.units import DEG, DEG_PER_HOUR, NS

Array = npt.NDArray[np.float64]

GYRO_BIAS, ACCEL_BIAS = 1.0 * DEG_PER_HOUR, 1e-3 * 9.80665
GYRO_NOISE, ACCEL_NOISE = 0.125 * DEG / 60.0, 0.02 / 60.0
"""Of an HG1700: 1 deg/h, 1 mg, 0.125 deg/sqrt(h), 0.02 m/s/sqrt(h); SI."""
FIX_NOISE, FIX_VELOCITY_NOISE = 1.5, 0.05
"""m and m/s per axis, every second."""
OFF: Final = 1e9
"""Sigmas of an innovation that is neither weighed down nor rejected."""
EVERY: Final = 10
"""Epochs of 0.1 s between two looks at the errors."""


@dataclass(frozen=True)
class Way:
    """A truth at n instants with its perfect increments."""

    t: Array
    truth: Trajectory
    dtheta: Array
    dvel: Array

    @classmethod
    def of(cls, scenario: str, rate: float = 50.0) -> Way:
        """A scenario of the simulator."""
        motion = make_scenario(scenario).motion
        t_ns = stamps(motion.duration, rate)
        truth, imu = ideal_log(motion, t_ns, sampling="increments")
        return cls((t_ns - t_ns[0]) * NS, truth, imu.gyro[1:], imu.accel[1:])

    def increments(self) -> Increments:
        """Without errors."""
        return Increments(self.t, self.dtheta, self.dvel, np.zeros(self.t.size - 1, np.bool_))


@dataclass(frozen=True)
class Judged:
    """What m looks at a run show.

    Attributes
    ----------
    t : (m,)
        s
    nees : (m,)
        Squared errors of the 13 states in the metric of the covariance.
    horizontal : (m,)
        Position error, m.
    """

    t: Array
    nees: Array
    horizontal: Array


def noise() -> Noise:
    """White noise of the sensor, nothing else."""
    figures = dict.fromkeys(Noise._fields, 0.0)
    figures |= {"gyro": GYRO_NOISE, "accel": ACCEL_NOISE}
    return Noise(**(figures | {"huber": OFF, "gate": OFF}))


def prior() -> Array:
    """P (24, 24): 1 m, 0.05 m/s, 0.05 deg, 0.5 deg of heading and the biases; no vehicle."""
    known = Prior(
        tilt=0.05 * DEG, heading=0.5 * DEG, velocity=0.05, position=(1.0, 1.0, 1.0),
        gyro=GYRO_BIAS, accel=ACCEL_BIAS, odometer=0.0, mount=0.0, lever=0.0, gyro_scale=0.0,
        accel_scale=0.0, slip=0.0, squat=0.0, cut=0.0,
    )  # fmt: skip
    return known.covariance()


def draw_run(way: Way, form: Form, seed: int) -> Judged:
    """Draw the errors, filter with fixes in a form, look at the errors."""
    rng = np.random.default_rng([3, seed])
    p = prior()
    x = np.zeros(SIZE)  # not shaken
    x[:CUT] = rng.standard_normal(CUT) * np.sqrt(np.diag(p)[:CUT])
    dt = np.diff(way.t)[:, None]
    shape = way.dtheta.shape
    dtheta = way.dtheta + x[GYRO] * dt + GYRO_NOISE * np.sqrt(dt) * rng.standard_normal(shape)
    dvel = way.dvel + x[ACCEL] * dt + ACCEL_NOISE * np.sqrt(dt) * rng.standard_normal(shape)
    increments = Increments(way.t, dtheta, dvel, np.zeros(way.t.size - 1, np.bool_))
    first = way.truth.rows(slice(0, 1))
    (row,) = true_rows(first, np.swapaxes(c_en(first.lat, first.lon), 1, 2).reshape(-1, 9))
    displace(row, -x[:9], WGS84)
    rates = np.zeros((way.t.size, 3))
    drive = Drive(way.t, rates, rates, increments, [], WGS84)
    standing = np.zeros(way.t.size, np.bool_)
    aids = put_to_epochs(
        way.t, standing, draw_fixes(way, form, rng), None, Use(False, False, False), drive
    )
    found = run_filter(
        increments, GapSigmas(np.zeros(shape), np.zeros(shape[0])), aids,
        FilterStart(row, np.zeros(PARAMETERS), p), noise=noise(), earth=WGS84,
    )  # fmt: skip
    return judge(way, aids.epochs, x, found)


def draw_fixes(way: Way, form: Form, rng: np.random.Generator) -> Fixes:
    """A fix a second with white errors in Earth-fixed axes."""
    at = np.searchsorted(way.t, np.arange(1.0, way.t[-1] + 1e-6) - 1e-6)
    truth = way.truth.rows(at)
    r_e = ecef_from_geodetic(truth.lat, truth.lon, truth.height)
    v_e = np.einsum("kij,kj->ki", c_en(truth.lat, truth.lon), truth.v_n)
    r_e = r_e + FIX_NOISE * rng.standard_normal(r_e.shape)
    v_e = v_e + FIX_VELOCITY_NOISE * rng.standard_normal(v_e.shape)
    lat, lon, height = geodetic_from_ecef(r_e)
    return Fixes(
        way.t[at], lat, lon, height, np.einsum("kji,kj->ki", c_en(lat, lon), v_e),
        np.full(r_e.shape, FIX_NOISE), np.full(r_e.shape, FIX_VELOCITY_NOISE), form,
    )  # fmt: skip


def judge(way: Way, epochs: npt.NDArray[np.int64], x: Array, found: Filtered) -> Judged:
    """Errors at every tenth epoch; ``x``: the true sensor errors in the order of the states."""
    looks = np.arange(EVERY, epochs.size, EVERY)
    at, states = epochs[looks], np.array(PAPER_STATES)
    errors = navigation_errors(way.truth.rows(at), found.rows[at])
    left = x[9:15] - found.parameters[looks, :6]
    error_13 = np.concatenate([errors, left], axis=1)[:, states]
    p = found.covariance[looks][:, states[:, None], states]
    weighed = np.linalg.solve(p, error_13[:, :, None])[:, :, 0]
    nees = np.sum(error_13 * weighed, axis=1)
    return Judged(way.t[at], nees, np.hypot(errors[:, 0], errors[:, 1]))


def navigation_errors(truth: Trajectory, rows: Array) -> Array:
    """(m, 9) errors of navigation rows (m, 22) by the definitions of the error model."""
    true = true_rows(truth, rows[:, :9])
    up = rows[:, 6:9]
    lat, lon = np.arctan2(up[:, 2], np.hypot(up[:, 0], up[:, 1])), np.arctan2(up[:, 1], up[:, 0])
    r_e = ecef_from_geodetic(lat, lon, rows[:, 9])
    r_e = r_e - ecef_from_geodetic(truth.lat, truth.lon, truth.height)
    turn = _matrices(true[:, 13:]) @ np.swapaxes(_matrices(rows[:, 13:]), 1, 2)  # 1 + [alpha x]
    alpha = 0.5 * np.stack(
        [turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0],
         turn[:, 1, 0] - turn[:, 0, 1]], axis=1,
    )  # fmt: skip
    velocity = rows[:, 10:13] - np.einsum("kji,kj->ki", turn, true[:, 10:13])
    return np.concatenate([_turned(_matrices(rows[:, :9]), r_e), velocity, alpha], axis=1)


def true_rows(truth: Trajectory, places: Array) -> Array:
    """(m, 22) the truth in axes that are ``places`` (m, 9) turned to the true up without twist."""
    place = _matrices(places)
    c = c_en(truth.lat, truth.lon)
    up = _turned(place, c[:, :, 2])
    across = np.zeros_like(place)  # [a x], a = up x e3: the shortest turn of up into the third axis
    across[:, 0, 2], across[:, 1, 2] = -up[:, 0], -up[:, 1]
    across[:, 2, 0], across[:, 2, 1] = up[:, 0], up[:, 1]
    turn = np.eye(3) + across + across @ across / (1.0 + up[:, 2])[:, None, None]
    c_we = turn @ place
    c_wn = c_we @ c
    rows = np.empty((truth.size, ROW))
    rows[:, :9], rows[:, 9] = c_we.reshape(-1, 9), truth.height
    rows[:, 10:13] = _turned(c_wn, truth.v_n)
    rows[:, 13:] = (c_wn @ truth.c_nb).reshape(-1, 9)
    return rows


def _matrices(x: Array) -> Array:
    return x.reshape(-1, 3, 3)


def _turned(c: Array, x: Array) -> Array:
    """C x for (m, 3, 3) and (m, 3)."""
    return np.asarray(np.einsum("kij,kj->ki", c, x))
