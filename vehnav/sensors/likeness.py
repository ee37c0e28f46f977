"""Which grade of the catalogue a measured sensor is like."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from vehnav.sensors.catalogue import CATALOGUE
from vehnav.sensors.grade import FIELDS, Sensor

COMPARED: Final = ("arw", "vrw", "gyro_bias")
"""What every grade has and a log at rest shows: these decide."""


@dataclass(frozen=True)
class Likeness:
    """A grade beside a measured sensor.

    Attributes
    ----------
    name : str
        Of the grade.
    distance : float
        Mean size of the decimal logarithm of the ratios that decide.
    ratios : mapping of str to float
        Key of a sensor file -> measured figure over that of the grade, where both have one.
    """

    name: str
    distance: float
    ratios: Mapping[str, float]

    @property
    def factor(self) -> float:
        """The distance as a factor: 1 is the same, 10 an order of magnitude away."""
        return float(10.0**self.distance)


def figure_of(sensor: Sensor, key: str) -> float:
    """A figure of a sensor in SI; 0 where it has none."""
    place = FIELDS[key]
    part = sensor if place.part == "sensor" else getattr(sensor, place.part)
    return float(getattr(part, place.attribute) or 0.0)


def likeness(figures: Mapping[str, float]) -> list[Likeness]:
    """The grades, the nearest first; ``figures`` in SI by the keys of a sensor file.

    >>> likeness({"arw": 0.125 / 60 * math.pi / 180, "vrw": 0.02 / 60})[0].name
    'hg1700'
    """
    measured = {key: value for key, value in figures.items() if value > 0.0}
    out = []
    for name, grade in CATALOGUE.items():
        own = {key: figure_of(grade, key) for key in measured}
        ratios = {key: measured[key] / value for key, value in own.items() if value > 0.0}
        deciding = [abs(math.log10(ratios[key])) for key in COMPARED if key in ratios]
        if deciding:
            out.append(Likeness(name, sum(deciding) / len(deciding), ratios))
    return sorted(out, key=lambda item: item.distance)
