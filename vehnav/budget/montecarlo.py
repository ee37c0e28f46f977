"""The check of the linear budget: the nonlinear mechanization with drawn errors (001, figure 1b).

Ideal and perturbed algorithm get the same readings; the perturbed one gets the errors of a sensor
and of the start on top. Both do at the stops what the budget assumes: V := 0, and the level by a
running mean over the window. The difference of their positions is the error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.budget.drive import IdealDrive
from vehnav.budget.linear import Procedure
from vehnav.budget.metrics import EMPIRICAL
from vehnav.budget.sources import Initial
from vehnav.earth import curvature_radii, earth_rate, position_difference
from vehnav.parallel import by_threads
from vehnav.rotation import c_from_rotvec
from vehnav.sensors import Sensor, SensorErrors, corrupt, draw_errors, run_rngs
from vehnav.strapdown.enu import mechanize_enu
from vehnav.strapdown.increments import Increments
from vehnav.strapdown.solution import StopControl

Array = npt.NDArray[np.float64]

STEP: Final = 0.02
"""s: what a shorter step of a vehicle's IMU adds is not told by the difference of two runs."""
_FIRST: Final = 1.001
"""Of a step: the first level of a running mean counts in full, but the loop must settle."""


@dataclass(frozen=True)
class MonteCarlo:
    """Errors of drawn sensors.

    Attributes
    ----------
    t : (q,)
        s.
    errors : (runs, q, 3)
        East, north, up, m.
    seed : int
    """

    t: Array
    errors: Array
    seed: int

    @property
    def runs(self) -> int:
        """Number of drawn sensors."""
        return int(self.errors.shape[0])

    def totals(self, time: float) -> dict[str, float]:
        """Every metric at a time, m."""
        k = int(np.argmin(np.abs(self.t - time)))
        return {name: figure(self.errors[:, k, :2]) for name, figure in EMPIRICAL.items()}


def monte_carlo(
    drive: IdealDrive,
    sensor: Sensor,
    initial: Initial,
    procedure: Procedure,
    *,
    at: Sequence[float],
    runs: int,
    seed: int = 0,
    held: bool = True,
) -> MonteCarlo:
    """Run the perturbed algorithm with ``runs`` drawn sensors, on all cores.

    The readings are summed to steps of :data:`STEP` for both algorithms alike. Run k is the same
    whatever the number of runs. ``at``: times, s. ValueError for no run.
    """
    if runs < 1:
        raise ValueError("runs must be at least 1")
    drive = drive.thinned(STEP)
    index = np.minimum(np.searchsorted(drive.t, np.asarray(at, float) - 1e-6), drive.t.size - 1)
    work = _Experiment(drive, sensor, initial, procedure, index, held)
    base = work.positions(None)

    def one(rng: np.random.Generator) -> Array:
        found = work.positions(rng)
        across = position_difference(found[:, 0], found[:, 1], base[:, 0], base[:, 1], base[:, 2])
        return np.column_stack([across, found[:, 2] - base[:, 2]])

    return MonteCarlo(drive.t[index], np.array(by_threads(one, run_rngs(seed, runs))), seed)


@dataclass(frozen=True)
class _Experiment:
    """What all runs share."""

    drive: IdealDrive
    sensor: Sensor
    initial: Initial
    procedure: Procedure
    index: npt.NDArray[np.int64]
    held: bool

    def positions(self, rng: np.random.Generator | None) -> Array:
        """(q, 3) lat, lon, height of one run; without ``rng`` of the ideal algorithm."""
        drive, steps = self.drive, self.drive.increments
        place = np.array([drive.lat[0], drive.lon[0], drive.height[0]])
        v_n, c_nb = drive.v_n[0], drive.c_nb[0]
        if rng is not None:
            errors = draw_errors(self.sensor, rng)
            start = _Start(self, errors, rng)
            place, v_n, c_nb = place + start.position, v_n + start.velocity, start.c_nb
            measured = corrupt(
                steps.dtheta, steps.dvel, t=steps.t[1:], sensor=self.sensor, errors=errors,
                rng=rng, sampling="increments",
            )  # fmt: skip
            steps = Increments(steps.t, measured.gyro, measured.accel, steps.coast)
        if self.procedure.gyro_from_stops:
            steps = self._without_gyro_bias(steps)
        lat, lon, height = (float(x) for x in place)
        east, north, up = (float(x) for x in v_n)
        found = mechanize_enu(
            steps,
            position=(lat, lon, height),
            v_n=(east, north, up),
            c_nb=c_nb,
            control=stop_control(drive, self.procedure),
            vertical="clamp" if self.held else "free",
            gravity_at="height",
            earth=drive.earth,
        )
        return found.position[self.index]

    def _without_gyro_bias(self, steps: Increments) -> Increments:
        """What the gyros show in a stop besides the Earth rate, taken off until the next stop."""
        t, drive = steps.t, self.drive
        bias = np.zeros((t.size - 1, 3))
        for a, b in spans(t, self.procedure.stops):
            rest = drive.c_nb[a].T @ np.array(earth_rate(float(drive.lat[a]), drive.earth))
            bias[a:] = steps.dtheta[a:b].sum(axis=0) / (t[b] - t[a]) - rest
        return steps.corrected(bias, 0.0)


class _Start:
    """Drawn errors of the start: position (lat, lon, h), velocity, attitude."""

    def __init__(self, work: _Experiment, errors: SensorErrors, rng: np.random.Generator) -> None:
        drive, initial, sensor = work.drive, work.initial, work.sensor
        level = np.array([1.0, 1.0, 0.0 if work.held else 1.0])
        r_m, r_n = curvature_radii(float(drive.lat[0]), float(drive.height[0]), drive.earth)
        east, north, up = rng.standard_normal(3) * initial.position * level
        self.position = np.array([north / r_m, east / (r_n * np.cos(drive.lat[0])), up])
        self.velocity = rng.standard_normal(3) * initial.velocity * level
        psi = rng.standard_normal(3) * [initial.tilt, initial.tilt, initial.heading]
        white = rng.standard_normal((2, 3))
        c = drive.c_nb[0]
        if work.procedure.levelled:
            window = work.procedure.window
            gravity = np.array([0.0, 0.0, 9.81])
            f = c.T @ gravity
            force = c @ (errors.accel_bias + errors.accel_matrix @ f) + white[0] * (
                sensor.accel.noise / np.sqrt(window)
            )
            u = c.T @ np.array(earth_rate(float(drive.lat[0]), drive.earth))
            rate = -c @ (errors.gyro_bias + errors.gyro_matrix @ u + errors.g_sensitivity @ f)
            turned = 0.5 * window * rate + white[1] * sensor.gyro.noise * np.sqrt(window / 3.0)
            psi[:2] = _levelling(gravity + force)[:2] + turned[:2]
        self.c_nb = c_from_rotvec(-psi) @ c


def _levelling(f_n: Array) -> Array:
    """Psi, rad, of a platform turned so that the force ``f_n`` (3,) that it shows is its up."""
    axis = np.array([-f_n[1], f_n[0], 0.0])
    across = float(np.hypot(axis[0], axis[1]))
    return axis * (np.arctan2(across, f_n[2]) / across) if across > 0.0 else axis


def spans(t: Array, stops: tuple[tuple[float, float], ...]) -> list[tuple[int, int]]:
    """First and last instant of every stop that has two."""
    ends = np.searchsorted(t, np.array(stops, float).reshape(-1, 2) - 1e-9)
    ends = np.minimum(ends, t.size - 1)
    return [(int(a), int(b)) for a, b in ends if b > a]


def stop_control(drive: IdealDrive, procedure: Procedure) -> StopControl:
    """Reset throughout the stops, level by the running mean over the window at their ends."""
    t = drive.t
    number, gain = np.full(t.size, -1, dtype=np.int64), np.zeros(t.size - 1)
    dt = np.diff(t)
    found = spans(t, procedure.stops)
    for k, (a, b) in enumerate(found):
        number[a : b + 1] = k
        first = max(a, int(np.searchsorted(t, t[b] - procedure.window - 1e-9)))
        steps = np.arange(min(first, b - 1), b)
        gain[steps] = 1.0 / (t[steps] - t[steps[0]] + _FIRST * dt[steps])
    return StopControl(number, gain, reset=True, count=len(found))
