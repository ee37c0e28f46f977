"""The constant errors of one run, or of many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vehnav.sensors.catalogue import CATALOGUE
from vehnav.sensors.grade import Sensor, Triad

Array = npt.NDArray[np.float64]
Rng = np.random.Generator | Sequence[np.random.Generator]


@dataclass(frozen=True)
class SensorErrors:
    """Constant errors drawn for one run, or for N runs along a leading axis.

    Attributes
    ----------
    gyro_bias, accel_bias : (..., 3)
        rad/s, m/s2.
    gyro_matrix, accel_matrix : (..., 3, 3)
        Scale factors on the diagonal, misalignments beside it: error = matrix @ true.
    g_sensitivity : (..., 3, 3)
        Gyro error per specific force, (rad/s)/(m/s2).
    """

    gyro_bias: Array
    gyro_matrix: Array
    g_sensitivity: Array
    accel_bias: Array
    accel_matrix: Array


def run_rngs(seed: int, runs: int) -> list[np.random.Generator]:
    """One independent generator per run; run k is the same whatever the number of runs."""
    return [np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(runs)]


def normal(rng: Rng, shape: tuple[int, ...]) -> Array:
    """Standard normal numbers; one generator per run gives a leading axis."""
    if isinstance(rng, np.random.Generator):
        return rng.standard_normal(shape)
    return np.stack([r.standard_normal(shape) for r in rng])


def draw_errors(sensor: Sensor, rng: Rng) -> SensorErrors:
    """Draw the constant errors: of one run from a Generator, of N runs from N Generators."""

    def matrix(triad: Triad) -> Array:
        sigma = np.where(np.eye(3, dtype=bool), triad.scale, triad.misalignment)
        return normal(rng, (3, 3)) * sigma

    return SensorErrors(
        gyro_bias=normal(rng, (3,)) * sensor.gyro.bias,
        gyro_matrix=matrix(sensor.gyro),
        g_sensitivity=normal(rng, (3, 3)) * sensor.g_sensitivity,
        accel_bias=normal(rng, (3,)) * sensor.accel.bias,
        accel_matrix=matrix(sensor.accel),
    )


def no_errors() -> SensorErrors:
    """The errors of a perfect sensor."""
    return draw_errors(CATALOGUE["ideal"], np.random.default_rng(0))
