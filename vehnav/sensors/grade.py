"""What a grade of sensor is: a frozen record of figures, each one standard deviation, in SI."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Final, Literal

from vehnav.units import (
    DEG,
    DEG_PER_HOUR,
    DEG_PER_SQRT_HOUR,
    M_S_PER_SQRT_HOUR,
    MILLI_G,
    MRAD,
    PPM,
    STANDARD_GRAVITY,
)


@dataclass(frozen=True)
class Triad:
    """Three like instruments at right angles: gyroscopes (rad/s) or accelerometers (m/s2).

    Attributes
    ----------
    bias : float
        Constant over a run, drawn at switch-on.
    bias_instability, bias_time : float
        Standard deviation and time constant (s) of a first-order Gauss-Markov bias.
    scale, misalignment : float
        Scale factor error of each axis; each of the six small angles (rad) between the axes.
    noise : float
        White noise: angle or velocity random walk, unit per sqrt(Hz).
    walk : float
        Random walk of the rate, unit per sqrt(s).
    quantisation : float
        One count, in the unit; 0: none.
    full_scale, bandwidth : float
        Range, in the unit; -3 dB frequency of a first-order filter, Hz; inf: none.
    """

    bias: float = 0.0
    bias_instability: float = 0.0
    bias_time: float = 300.0
    scale: float = 0.0
    misalignment: float = 0.0
    noise: float = 0.0
    walk: float = 0.0
    quantisation: float = 0.0
    full_scale: float = math.inf
    bandwidth: float = math.inf

    @property
    def drift(self) -> float:
        """Random walk that the bias looks like for times short against ``bias_time``.

        The rate's own walk and that of the Gauss-Markov bias, sigma sqrt(2 / T); per sqrt(s).

        >>> round(Triad(bias_instability=3.0, bias_time=200.0, walk=0.4).drift, 12)
        0.5
        """
        return math.hypot(self.walk, self.bias_instability * math.sqrt(2.0 / self.bias_time))


@dataclass(frozen=True)
class Sensor:
    """An IMU grade.

    Attributes
    ----------
    name : str
    gyro, accel : Triad
    g_sensitivity : float
        Gyro error per specific force, (rad/s)/(m/s2), each of nine terms.
    stop_threshold : float or None
        Threshold of the stop detector that suits it, rad/s.
    sources : mapping of str to str
        TOML key -> where the figure is from.
    """

    name: str
    gyro: Triad = Triad()
    accel: Triad = Triad()
    g_sensitivity: float = 0.0
    stop_threshold: float | None = None
    sources: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))


@dataclass(frozen=True)
class Field:
    """Where a key of a sensor file goes, its factor to SI, its unit in the file."""

    part: Literal["gyro", "accel", "sensor"]
    attribute: str
    factor: float
    unit: str


FIELDS: Final[Mapping[str, Field]] = MappingProxyType(
    {
        "gyro_bias": Field("gyro", "bias", DEG_PER_HOUR, "deg/h"),
        "gyro_bias_instability": Field("gyro", "bias_instability", DEG_PER_HOUR, "deg/h"),
        "gyro_bias_time": Field("gyro", "bias_time", 1.0, "s"),
        "gyro_sf": Field("gyro", "scale", PPM, "ppm"),
        "gyro_misalignment": Field("gyro", "misalignment", MRAD, "mrad"),
        "arw": Field("gyro", "noise", DEG_PER_SQRT_HOUR, "deg/sqrt(h)"),
        "gyro_walk": Field("gyro", "walk", DEG_PER_HOUR / 60.0, "deg/h/sqrt(h)"),
        "gyro_quantisation": Field("gyro", "quantisation", DEG, "deg/s"),
        "gyro_range": Field("gyro", "full_scale", DEG, "deg/s"),
        "gyro_bandwidth": Field("gyro", "bandwidth", 1.0, "Hz"),
        "accel_bias": Field("accel", "bias", MILLI_G, "mg"),
        "accel_bias_instability": Field("accel", "bias_instability", MILLI_G, "mg"),
        "accel_bias_time": Field("accel", "bias_time", 1.0, "s"),
        "accel_sf": Field("accel", "scale", PPM, "ppm"),
        "accel_misalignment": Field("accel", "misalignment", MRAD, "mrad"),
        "vrw": Field("accel", "noise", M_S_PER_SQRT_HOUR, "m/s/sqrt(h)"),
        "accel_walk": Field("accel", "walk", MILLI_G / 60.0, "mg/sqrt(h)"),
        "accel_quantisation": Field("accel", "quantisation", MILLI_G, "mg"),
        "accel_range": Field("accel", "full_scale", STANDARD_GRAVITY, "g"),
        "accel_bandwidth": Field("accel", "bandwidth", 1.0, "Hz"),
        "g_sensitivity": Field("sensor", "g_sensitivity", DEG / STANDARD_GRAVITY, "deg/s/g"),
        "stop_threshold": Field("sensor", "stop_threshold", DEG, "deg/s"),
    }
)
"""TOML key -> place in :class:`Sensor`, factor to SI, unit in the file."""


def assemble(base: Sensor, name: str, figures: Mapping[str, tuple[float, str]]) -> Sensor:
    """``base`` with figures in the units of :data:`FIELDS`, and their sources, put in."""
    parts: dict[str, dict[str, float]] = {"gyro": {}, "accel": {}, "sensor": {}}
    for key, (value, _) in figures.items():
        place = FIELDS[key]
        parts[place.part][place.attribute] = value * place.factor
    whole: dict[str, Any] = parts["sensor"]
    return replace(
        base,
        name=name,
        gyro=replace(base.gyro, **parts["gyro"]),
        accel=replace(base.accel, **parts["accel"]),
        sources=MappingProxyType({**base.sources, **{k: s for k, (_, s) in figures.items() if s}}),
        **whole,
    )
