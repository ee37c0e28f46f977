"""The sensor file of a measured sensor: what the rest tells, and of the nearest grade what not."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal

import numpy as np

from vehnav.allan import AxisFit, Figure
from vehnav.errors import ConfigError, LogError
from vehnav.export.atomic import atomic_path
from vehnav.noise.rest import RestNoise
from vehnav.sensors import CATALOGUE, FIELDS, Sensor, sensor_toml
from vehnav.sensors.grade import Field, assemble
from vehnav.sensors.likeness import Likeness, figure_of, likeness
from vehnav.toml_text import on_one_line

Part = Literal["gyro", "accel"]

KEYS: Final[Mapping[Part, tuple[str, str, str]]] = {
    "gyro": ("arw", "gyro_bias_instability", "gyro_walk"),
    "accel": ("vrw", "accel_bias_instability", "accel_walk"),
}
"""Keys of noise, bias instability and walk in a sensor file."""
WORDS: Final = {
    "arw": "gyro noise",
    "gyro_bias": "gyro bias",
    "gyro_bias_instability": "gyro bias instability",
    "gyro_walk": "gyro rate random walk",
    "vrw": "accelerometer noise",
    "accel_bias_instability": "accelerometer bias instability",
    "accel_walk": "accelerometer random walk",
}
CHIP: Final = (
    "gyro_quantisation", "gyro_range", "gyro_bandwidth",
    "accel_quantisation", "accel_range", "accel_bandwidth",
)  # fmt: skip
"""What belongs to one chip, not to its grade: never taken over."""


@dataclass(frozen=True)
class Estimate:
    """A measured sensor, complete.

    Attributes
    ----------
    sensor : Sensor
        For ``--sensor``; its sources say what is measured and what is taken over.
    told : mapping of str to Figure
        Key of a sensor file -> rms over the axes, SI.
    untold : mapping of str to str
        Key -> why the rest does not tell it.
    grades : tuple of Likeness
        The catalogue, nearest first.
    """

    sensor: Sensor
    told: Mapping[str, Figure]
    untold: Mapping[str, str]
    grades: tuple[Likeness, ...]

    @property
    def text(self) -> str:
        """As a file."""
        head = [
            f"# Measured at rest by 'vehnav sensor'; {self.grades[0].name} is the nearest grade."
        ]
        head += [f"# Not told: {WORDS[key]}: {why}." for key, why in self.untold.items()]
        return "\n".join(on_one_line(line) for line in head) + "\n" + sensor_toml(self.sensor)


def estimate(noise: RestNoise, *, name: str | None = None) -> Estimate:
    """The sensor of a log.

    Parameters
    ----------
    noise : RestNoise
    name : str or None
        Of the sensor; None: of the log.

    Raises
    ------
    LogError
        No axis shows any noise.
    """
    told: dict[str, Figure] = {}
    untold: dict[str, str] = {}
    limits: dict[str, float] = {}
    times: dict[str, float] = {}
    for part, keys in KEYS.items():
        fits = getattr(noise, part).fits
        for key, kind in zip(keys, ("white", "bias", "walk"), strict=True):
            figures = [getattr(fit, kind) for fit in fits]
            if any(f.value is not None for f in figures):
                told[key] = _mean_square(figures)
            else:
                untold[key] = _why(key, kind, fits, noise)
                limits[key] = max((f.limit for f in figures if f.limit), default=math.inf)
        known = [fit.time for fit in fits if fit.time is not None]
        if known:
            times[f"{part}_bias_time"] = float(np.exp(np.mean(np.log(known))))
    _gyro_bias(noise, told, untold)
    if not {"arw", "vrw"} & set(told):
        raise LogError(
            f"{noise.log.path}: no axis changes at rest; the recording is rounded to counts larger "
            "than the noise, or is not of a sensor"
        )
    figures_si = {key: f.value for key, f in told.items() if f.value is not None}
    grades = likeness(figures_si)
    base = _of_grade(CATALOGUE[grades[0].name], limits)
    own = Path(noise.log.path).stem if name is None else name
    measured = _measured(noise, told, times, base)
    return Estimate(assemble(base, on_one_line(own), measured), told, untold, tuple(grades))


def write_sensor(found: Estimate, path: str | os.PathLike[str]) -> None:
    """Write :attr:`Estimate.text` whole or not at all; ConfigError unless the suffix is .toml."""
    check_suffix(path)
    with atomic_path(path) as temporary:
        temporary.write_text(found.text, encoding="utf-8")


def check_suffix(path: str | os.PathLike[str]) -> None:
    """ConfigError where ``--sensor`` would not know the file for one."""
    if Path(path).suffix.lower() != ".toml":
        raise ConfigError(f"{path}: a sensor file ends in .toml")


# ---- the figures -------------------------------------------------------------------------------


def _mean_square(figures: Sequence[Figure]) -> Figure:
    """Root mean square over the axes, with its sigma; one that only has a limit counts as zero."""
    pairs = [(f.value, f.sigma) for f in figures if f.value is not None and f.sigma is not None]
    count = len(pairs) + sum(f.limit is not None for f in figures)
    root = math.sqrt(sum(v * v for v, _ in pairs) / count)
    sigma = math.sqrt(sum((v * s) ** 2 for v, s in pairs)) / (count * root)
    return Figure(root, sigma)


def _gyro_bias(noise: RestNoise, told: dict[str, Figure], untold: dict[str, str]) -> None:
    """Rms of the three biases of this log: three draws of what the grade calls its bias."""
    other = float(np.mean(noise.gyro_bias_sigma**2))
    square = float(np.mean(noise.gyro_bias**2)) - other
    if square > 2.0 * other:
        root = math.sqrt(square)
        told["gyro_bias"] = Figure(root, root / math.sqrt(6.0))  # three degrees of freedom
    else:
        untold["gyro_bias"] = (
            "smaller than its uncertainty, which is noise and, in rests whose heading is not "
            "known, the Earth rate"
        )


def _why(key: str, kind: str, fits: Sequence[AxisFit], noise: RestNoise) -> str:
    """Why no axis tells a figure."""
    reach = max(fit.reach for fit in fits)
    place = FIELDS[key]
    limits = [f.limit for f in (getattr(fit, kind) for fit in fits) if f.limit is not None]
    if all(fit.dead for fit in fits):
        return "the readings do not change at rest"
    if kind == "bias" and any(fit.still_growing for fit in fits):
        return (
            f"the deviation still grows after the longest time seen ({_seconds(reach)}), which is "
            "told as a random walk; a longer rest would show where it ends"
        )
    if not limits:
        return f"the longest rest, {_seconds(noise.longest)}, is too short"
    limit = max(limits) / place.factor
    return f"under {two_digits(limit)} {place.unit} (95 %) in what {_seconds(reach)} show"


def two_digits(value: float) -> str:
    """A number with two digits that count.

    >>> two_digits(298.0), two_digits(0.0456)
    ('300', '0.046')
    """
    return f"{float(f'{value:.2g}'):g}"


def _seconds(value: float) -> str:
    return f"{value:.0f} s" if value < 600.0 else f"{value / 60.0:.0f} min"


# ---- the file ----------------------------------------------------------------------------------


def _of_grade(grade: Sensor, limits: Mapping[str, float]) -> Sensor:
    """The nearest grade without what belongs to a chip, cut to the limits of this rest."""
    plain = Sensor("")
    sources = {
        key: f"not measured: of {grade.name}; {text}"
        for key, text in grade.sources.items()
        if key not in CHIP
    }
    base = grade
    for key in CHIP:
        base = _with(base, FIELDS[key], _get(plain, FIELDS[key]))
    for key, limit in limits.items():
        if figure_of(base, key) > limit:
            base = _with(base, FIELDS[key], limit)
            sources[key] = f"95 % limit of this rest; {grade.name} has more"
    return replace(base, sources=sources)


def _get(sensor: Sensor, place: Field) -> float:
    return float(getattr(getattr(sensor, place.part), place.attribute))


def _with(sensor: Sensor, place: Field, value: float) -> Sensor:
    part = replace(getattr(sensor, place.part), **{place.attribute: value})
    return replace(sensor, gyro=part) if place.part == "gyro" else replace(sensor, accel=part)


def _measured(
    noise: RestNoise, told: Mapping[str, Figure], times: Mapping[str, float], grade: Sensor
) -> dict[str, tuple[float, str]]:
    """What the rest tells, in the units of the file, with the axes as source."""
    out: dict[str, tuple[float, str]] = {}
    for part, keys in KEYS.items():
        fits = getattr(noise, part).fits
        for key, kind in zip(keys, ("white", "bias", "walk"), strict=True):
            if key in told and told[key].value is not None:
                out[key] = _row(key, told[key], [getattr(fit, kind) for fit in fits])
    for key, time in times.items():
        out[key] = (_round(time), "measured with the bias instability")
    bias = told.get("gyro_bias")
    if bias is not None and bias.value is not None:
        factor = FIELDS["gyro_bias"].factor
        axes = ", ".join(f"{b / factor:.4g}" for b in noise.gyro_bias)
        out["gyro_bias"] = (_round(bias.value / factor), f"rms of this log's x, y, z: {axes}")
    excess = noise.force_excess
    if excess is not None and abs(excess) > grade.accel.bias:
        factor = FIELDS["accel_bias"].factor
        out["accel_bias"] = (
            _round(abs(excess) / factor),
            f"measured along gravity: {excess / factor:+.3g} (one draw; may be a scale error)",
        )
    return out


def _row(key: str, figure: Figure, axes: Sequence[Figure]) -> tuple[float, str]:
    factor = FIELDS[key].factor
    values = ", ".join("-" if f.value is None else f"{f.value / factor:.4g}" for f in axes)
    value, sigma = figure.value or 0.0, figure.sigma or 0.0
    return _round(value / factor), f"measured, +- {sigma / factor:.2g}; x, y, z: {values}"


def _round(value: float) -> float:
    return float(f"{value:.5g}")
