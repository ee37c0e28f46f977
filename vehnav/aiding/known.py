"""The noise of a known sensor in the place of that of its grade."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from vehnav.aiding.land import Tuning

DRIVING: Final = 4.0
"""White noise while driving over that at rest: as the stop methods have it (rectified vibration,
scale factor errors; :func:`vehnav.classic.noise_from_rest`)."""


def with_sensor(
    tuning: Tuning,
    *,
    name: str,
    gyro_noise: float = 0.0,
    gyro_walk: float = 0.0,
    accel_noise: float = 0.0,
    accel_walk: float = 0.0,
) -> Tuning:
    """Noise and bias walk of a sensor file; a figure of zero leaves that of the grade.

    Parameters
    ----------
    tuning : Tuning
        By grade; its zero-rate noise, constraints and priors stay.
    name : str
        Of the sensor, for the report.
    gyro_noise, accel_noise : float
        At rest, rad/s/sqrt(Hz), m/s2/sqrt(Hz).
    gyro_walk, accel_walk : float
        Of the biases, rad/s/sqrt(s), m/s2/sqrt(s).
    """
    own = tuning.noise
    noise = own._replace(
        gyro=DRIVING * gyro_noise or own.gyro,
        accel=DRIVING * accel_noise or own.accel,
        gyro_walk=gyro_walk or own.gyro_walk,
        accel_walk=accel_walk or own.accel_walk,
    )
    return replace(
        tuning, noise=noise, reason=f"{tuning.reason}; white noise and bias walk of sensor {name}"
    )
