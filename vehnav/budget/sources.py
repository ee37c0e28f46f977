"""The sources of error of a budget: columns of the sensitivity matrix, their sigmas, their units.

Sensor errors in body axes (001, spec B 1.2)::

    d omega = b_g + (S_g + M_g) omega + G f + noise,    d f = b_a + (S_a + M_a) f + noise

S diagonal, M off the diagonal. Initial errors are those of attitude, velocity and position in
East-North-Up. Random processes have one sigma for the three axes of a triad. Counts, bandwidth and
range are no linear sources; the Monte Carlo has them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from vehnav.sensors import FIELDS, Sensor
from vehnav.units import DEG

Array = npt.NDArray[np.float64]

AXES: Final = ("right", "forward", "up")
DIRECTIONS: Final = ("east", "north", "up")
OFF_DIAGONAL: Final = ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))
"""(axis that errs, axis whose input it takes part of)."""
SENSOR_COLUMNS: Final = 33
"""Constant errors of the sensor, the nine g-sensitivities included; then nine initial errors."""
COLUMNS: Final = SENSOR_COLUMNS + 9
TILT: Final = slice(33, 35)


@dataclass(frozen=True)
class Initial:
    """Errors of the start, one sigma each.

    Attributes
    ----------
    heading, tilt : float
        rad; the tilt about each horizontal axis (not used where the start is levelled).
    velocity : float
        m/s along each axis.
    position : float
        m along each axis.
    """

    heading: float = 0.1 * DEG
    tilt: float = 0.02 * DEG
    velocity: float = 0.05
    position: float = 1.0


INITIAL_UNITS: Final[Mapping[str, tuple[float, str]]] = MappingProxyType(
    {
        "heading": (DEG, "deg"),
        "tilt": (DEG, "deg"),
        "velocity": (1.0, "m/s"),
        "position": (1.0, "m"),
    }
)
"""Field of :class:`Initial` -> its unit in SI, its unit."""


@dataclass(frozen=True)
class Source:
    """One source: a column, or a random process.

    Attributes
    ----------
    name : str
        For a table: ``gyro_bias forward``.
    parameter : str
        The class it belongs to: a key of a sensor file, or a field of :class:`Initial`.
    """

    name: str
    parameter: str


def _constant_sources() -> tuple[Source, ...]:
    out = []
    for triad in ("gyro", "accel"):
        out += [Source(f"{triad}_bias {a}", f"{triad}_bias") for a in AXES]
        out += [Source(f"{triad}_sf {a}", f"{triad}_sf") for a in AXES]
        out += [
            Source(f"{triad}_misalignment {AXES[i]} by {AXES[k]}", f"{triad}_misalignment")
            for i, k in OFF_DIAGONAL
        ]
    out += [Source(f"g_sensitivity {a} by {b}", "g_sensitivity") for a in AXES for b in AXES]
    out += [Source(f"tilt about {d}", "tilt") for d in DIRECTIONS[:2]]
    out += [Source("heading", "heading")]
    out += [Source(f"{p} {d}", p) for p in ("velocity", "position") for d in DIRECTIONS]
    return tuple(out)


CONSTANT: Final = _constant_sources()
"""The columns in their order."""


@dataclass(frozen=True)
class Process:
    """A random process of a triad, of unit sigma.

    Attributes
    ----------
    parameter : str
        Key of a sensor file.
    gyro : bool
        Of the gyros, else of the accelerometers.
    kind : {"white", "walk", "markov"}
    time : float
        Time constant of a Markov bias, s.
    """

    parameter: str
    gyro: bool
    kind: Literal["white", "walk", "markov"]
    time: float = 0.0


def processes_of(sensor: Sensor) -> tuple[Process, ...]:
    """The processes of a sensor: white noise always, the others where it has them."""
    out = [Process("arw", True, "white"), Process("vrw", False, "white")]
    for gyro, name, triad in ((True, "gyro", sensor.gyro), (False, "accel", sensor.accel)):
        if triad.walk > 0.0:
            out.append(Process(f"{name}_walk", gyro, "walk"))
        if triad.bias_instability > 0.0:
            out.append(Process(f"{name}_bias_instability", gyro, "markov", triad.bias_time))
    return tuple(out)


def parameter_value(sensor: Sensor, initial: Initial, parameter: str) -> float:
    """Sigma, SI, of a key of a sensor file or of a field of :class:`Initial`."""
    if parameter in INITIAL_UNITS:
        return float(getattr(initial, parameter))
    place = FIELDS[parameter]
    part = sensor if place.part == "sensor" else getattr(sensor, place.part)
    return float(getattr(part, place.attribute))


def unit_of(parameter: str) -> tuple[float, str]:
    """(unit in SI, unit) of a parameter."""
    if parameter in INITIAL_UNITS:
        return INITIAL_UNITS[parameter]
    return FIELDS[parameter].factor, FIELDS[parameter].unit


def constant_sigmas(sensor: Sensor, initial: Initial, *, levelled: bool, held: bool) -> Array:
    """(COLUMNS,) sigma of every column, SI.

    A levelled start has no tilt of its own: the accelerometers decide it. With the height held its
    error and that of the vertical velocity are none.
    """
    out = np.array([parameter_value(sensor, initial, s.parameter) for s in CONSTANT])
    if levelled:
        out[TILT] = 0.0
    if held:
        out[[38, 41]] = 0.0
    return out
