"""An ideal record becomes a measured one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from vehnav.sensors.draw import Rng, SensorErrors, normal
from vehnav.sensors.grade import Sensor, Triad
from vehnav.sensors.processes import low_pass, markov, random_walk, steps_of

Array = npt.NDArray[np.float64]
Sampling = Literal["rates", "increments"]


@dataclass(frozen=True)
class Measured:
    """What the instruments give.

    Attributes
    ----------
    gyro, accel : (..., n, 3)
        Rates (rad/s, m/s2) or increments (rad, m/s), as the ideal record.
    saturated : int
        Readings that reached the range and were cut to it, of both triads.
    """

    gyro: Array
    accel: Array
    saturated: int


def corrupt(
    gyro: Array,
    accel: Array,
    *,
    t: Array,
    sensor: Sensor,
    errors: SensorErrors,
    rng: Rng,
    sampling: Sampling,
) -> Measured:
    """Apply the errors of a sensor to an ideal record.

    Parameters
    ----------
    gyro, accel : (n, 3)
        Ideal rates, rad/s and m/s2, or increments over the step before each sample, rad and m/s.
    t : (n,)
        Seconds, increasing.
    sensor : Sensor
        Its random processes, bandwidth, range and counts.
    errors : SensorErrors
        The constant errors; for N runs with a leading axis.
    rng : Generator, or N Generators for N runs
        Drawn in a fixed order, gyroscopes first.
    sampling : {"rates", "increments"}

    Returns
    -------
    Measured
        (n, 3) arrays, or (N, n, 3) for N runs.

    Notes
    -----
    measured = (1 + M) ideal + b + G f + Markov + walk + white; white noise of density N has the
    standard deviation N / sqrt(dt) in a rate and N sqrt(dt) in an increment. Then bandwidth,
    range, counts; the rounding of increments is carried on, as a counter does.
    """
    scale = steps_of(t)[:, None] if sampling == "increments" else np.ones((t.size, 1))
    omega, force = gyro / scale, accel / scale
    g_effect = _turned(errors.g_sensitivity, force)
    readings = []
    saturated = 0
    for triad, ideal, matrix, bias, extra in (
        (sensor.gyro, omega, errors.gyro_matrix, errors.gyro_bias, g_effect),
        (sensor.accel, force, errors.accel_matrix, errors.accel_bias, 0.0),
    ):
        rate = ideal + _turned(matrix, ideal) + bias[..., None, :] + extra
        rate, cut = _limited(_noisy(rate, triad, t=t, rng=rng), triad, t=t)
        saturated += cut
        readings.append(_counted(rate * scale, triad, t=t, sampling=sampling))
    return Measured(gyro=readings[0], accel=readings[1], saturated=saturated)


def _turned(matrix: Array, vectors: Array) -> Array:
    """(..., n, 3): matrix (..., 3, 3) times each of vectors (n, 3)."""
    return np.asarray(vectors @ np.swapaxes(matrix, -1, -2))


def _noisy(rate: Array, triad: Triad, *, t: Array, rng: Rng) -> Array:
    """Markov bias, rate random walk and white noise added; what is zero draws nothing."""
    if triad.bias_instability > 0.0:
        rate = rate + markov(t, sigma=triad.bias_instability, time=triad.bias_time, rng=rng)
    if triad.walk > 0.0:
        rate = rate + random_walk(t, sigma=triad.walk, rng=rng)
    if triad.noise > 0.0:
        rate = rate + normal(rng, (t.size, 3)) * (triad.noise / np.sqrt(steps_of(t)))[:, None]
    return rate


def _limited(rate: Array, triad: Triad, *, t: Array) -> tuple[Array, int]:
    """Bandwidth, then range; with the number of readings cut."""
    if np.isfinite(triad.bandwidth):
        rate = low_pass(t, rate, bandwidth=triad.bandwidth)
    over = np.abs(rate) > triad.full_scale
    return np.clip(rate, -triad.full_scale, triad.full_scale), int(np.count_nonzero(over))


def _counted(reading: Array, triad: Triad, *, t: Array, sampling: Sampling) -> Array:
    """Whole counts; of increments, counts of the running sum, so that no rounding adds up."""
    if triad.quantisation == 0.0:
        return reading
    if sampling == "rates":
        return np.asarray(np.rint(reading / triad.quantisation) * triad.quantisation)
    quantum = triad.quantisation * float(np.median(np.diff(t)))
    counts = np.rint(np.cumsum(reading, axis=-2) / quantum)
    first = counts[..., :1, :]
    return np.asarray(np.concatenate([first, np.diff(counts, axis=-2)], axis=-2) * quantum)
