"""Navigation errors to sensor errors: what may a sensor have for a required accuracy (001).

Everything is linear, so a figure of merit grows in proportion to the sigmas that make it, and the
squares of independent classes of sources add up (spec B 1.4).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.budget.forward import EAST_NORTH, Budget
from vehnav.budget.metrics import METRICS, drms
from vehnav.budget.sources import CONSTANT, INITIAL_UNITS, Initial, parameter_value, unit_of
from vehnav.errors import ConfigError
from vehnav.sensors import CATALOGUE, FIELDS, Sensor

Array = npt.NDArray[np.float64]

CLASSES: Final = (
    "gyro_bias", "accel_bias", "gyro_sf", "accel_sf", "gyro_misalignment", "accel_misalignment",
    "arw", "vrw", "heading",
)  # fmt: skip
"""Classes among which ``equal`` shares the requirement (spec B 5.3); a tilt of its own, and the
velocity and position of the start, are none of the sensor."""
_HALVINGS: Final = 200


@dataclass(frozen=True)
class Allowed:
    """One parameter that was solved for.

    Attributes
    ----------
    parameter : str
    value, given : float
        Allowed and of the sensor in hand, in ``unit``.
    unit : str
    """

    parameter: str
    value: float
    given: float
    unit: str

    @property
    def factor(self) -> float | None:
        """Allowed over given; None where there is none in hand."""
        return self.value / self.given if self.given > 0.0 else None


def grades_within(allowed: Allowed) -> tuple[str, ...]:
    """Grades of the catalogue that have no more of a parameter than is allowed.

    Empty for what is not of the sensor; a grade without a figure for it is not named.
    """
    if allowed.parameter in INITIAL_UNITS:
        return ()
    factor, _ = unit_of(allowed.parameter)
    values = {
        name: parameter_value(sensor, Initial(), allowed.parameter) / factor
        for name, sensor in CATALOGUE.items()
    }
    return tuple(name for name, x in values.items() if 0.0 < x <= allowed.value * (1.0 + 1e-9))


@dataclass(frozen=True)
class Requirement:
    """What is asked for.

    Attributes
    ----------
    value : float
        m
    metric : str
        Key of :data:`vehnav.budget.metrics.METRICS`.
    time : float
        s
    """

    value: float
    metric: str
    time: float


@dataclass(frozen=True)
class Solution:
    """What a requirement allows.

    Attributes
    ----------
    how : str
        ``equal``, ``scale`` or a parameter.
    requirement : Requirement
    allowed : tuple of Allowed
    sensor, initial
        With the allowed values put in; as they were where nothing is feasible.
    achieved : float
        m
    others : float
        m: what the sources make that were not solved for.
    feasible : bool
    """

    how: str
    requirement: Requirement
    allowed: tuple[Allowed, ...]
    sensor: Sensor
    initial: Initial
    achieved: float
    others: float
    feasible: bool

    @property
    def text(self) -> str:
        """For a person."""
        need = self.requirement
        if not self.feasible:
            return (
                f"infeasible: the other sources alone make {self.others:.4g} m {need.metric} at "
                f"{need.time:g} s, of {need.value:g} m allowed"
            )
        return f"{need.metric} {self.achieved:.4g} m at {need.time:g} s"


def solve(budget: Budget, requirement: Requirement, how: str) -> Solution:
    """The sigmas that just meet a requirement.

    Parameters
    ----------
    budget : Budget
        Of the sensor in hand.
    requirement : Requirement
    how : str
        ``equal``: the classes of :data:`CLASSES` contribute equally to the DRMS, all else is none;
        ``scale``: the whole sensor times one factor, the start as it is; a parameter: that alone,
        all else as it is.

    Raises
    ------
    ConfigError
        There is no such parameter, or it does nothing on this drive.
    """
    if how == "equal":
        return _equal(budget, requirement)
    if how == "scale":
        names = [name for name in budget.by_parameter(requirement.time) if name in FIELDS]
        return _scaled(budget, requirement, how, names)
    _check(how)
    unit = _unit_covariance(budget, how, requirement.time)
    if not float(drms(unit)) > 0.0:
        raise ConfigError(f"--solve {how}: it does nothing on this drive")
    given = parameter_value(budget.sensor, budget.initial, how)
    parts = budget.by_parameter(requirement.time)
    others = sum((c for name, c in parts.items() if name != how), np.zeros((2, 2)))
    size = _meeting(requirement, others, unit)
    sizes = None if size is None else {how: size}
    return _either(budget, requirement, how, sizes, {how: given}, others)


def _check(name: str) -> None:
    known = (*dict.fromkeys(s.parameter for s in CONSTANT), "arw", "vrw")
    if name not in known:
        raise ConfigError(f"--solve {name}: expected equal, scale or one of {', '.join(known)}")


def _unit_covariance(budget: Budget, parameter: str, time: float) -> Array:
    """(2, 2) m2 per unit squared of one class, whatever the sensor has of it."""
    s = budget.sensitivity
    k = s.index(time)
    out = np.zeros((2, 2))
    if s.procedure.levelled and parameter == "tilt":
        return out
    for j, source in enumerate(CONSTANT):
        if source.parameter == parameter and not (s.held and j in (38, 41)):
            column = s.columns[k, EAST_NORTH, j][:, None]
            out += column @ column.T
    for n, process in enumerate(s.processes):
        if process.parameter == parameter:
            out += s.covariance[k, n, EAST_NORTH, EAST_NORTH]
    return out


def _meeting(need: Requirement, fixed: Array, unit: Array) -> float | None:
    """Factor k with metric(fixed + k^2 unit) = requirement; None where fixed alone is too much."""
    metric: Callable[[Array], Array] = METRICS[need.metric]
    if float(metric(fixed)) > need.value:
        return None
    low, high = 0.0, need.value / float(metric(unit))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if float(metric(fixed + middle * middle * unit)) < need.value:
            low = middle
        else:
            high = middle
        if high - low <= 1e-13 * high:
            break
    return 0.5 * (low + high)


def _equal(budget: Budget, need: Requirement) -> Solution:
    units = {name: _unit_covariance(budget, name, need.time) for name in CLASSES}
    units = {name: c for name, c in units.items() if float(drms(c)) > 0.0}
    share = {name: 1.0 / float(drms(c)) for name, c in units.items()}
    whole = sum((share[name] ** 2 * c for name, c in units.items()), np.zeros((2, 2)))
    factor = _meeting(need, np.zeros((2, 2)), whole)
    assigned = {name: (factor or 0.0) * size for name, size in share.items()}
    given = {name: parameter_value(budget.sensor, budget.initial, name) for name in assigned}
    bare = replace(budget, sensor=Sensor("equal shares"), initial=Initial(0.0, 0.0, 0.0, 0.0))
    return _finished(bare, need, "equal", assigned, given, 0.0)


def _scaled(budget: Budget, need: Requirement, how: str, names: Sequence[str]) -> Solution:
    parts = budget.by_parameter(need.time)
    fixed = sum((c for name, c in parts.items() if name not in names), np.zeros((2, 2)))
    moving = sum((c for name, c in parts.items() if name in names), np.zeros((2, 2)))
    if not float(drms(moving)) > 0.0:
        raise ConfigError(f"--solve {how}: the sensor {budget.sensor.name} has no errors to scale")
    given = {name: parameter_value(budget.sensor, budget.initial, name) for name in names}
    factor = _meeting(need, fixed, moving)
    sizes = None if factor is None else {name: factor * x for name, x in given.items()}
    return _either(budget, need, how, sizes, given, fixed)


def _either(
    budget: Budget,
    need: Requirement,
    how: str,
    sizes: Mapping[str, float] | None,
    given: Mapping[str, float],
    others: Array,
) -> Solution:
    left = float(METRICS[need.metric](others))
    if sizes is None:
        now = budget.totals(need.time)[need.metric]
        return Solution(how, need, (), budget.sensor, budget.initial, now, left, False)
    return _finished(budget, need, how, sizes, given, left)


def _finished(
    budget: Budget,
    need: Requirement,
    how: str,
    sizes: Mapping[str, float],
    given: Mapping[str, float],
    others: float,
) -> Solution:
    """The solution, its figure computed anew from the sensor that it describes."""
    sensor, initial = budget.sensor, budget.initial
    allowed = []
    for name, size in sizes.items():
        factor, unit = unit_of(name)
        allowed.append(Allowed(name, size / factor, given[name] / factor, unit))
        if name in INITIAL_UNITS:
            initial = replace(initial, **{name: size})
        else:
            sensor = with_parameter(sensor, name, size)
    again = replace(budget, sensor=sensor, initial=initial)
    achieved = again.totals(need.time)[need.metric]
    return Solution(how, need, tuple(allowed), sensor, initial, achieved, others, True)


def with_parameter(sensor: Sensor, parameter: str, value: float) -> Sensor:
    """The sensor with another value (SI) of a key of a sensor file."""
    place = FIELDS[parameter]
    changed: dict[str, Any] = {place.attribute: value}
    if place.part != "sensor":
        changed = {place.part: replace(getattr(sensor, place.part), **changed)}
    return replace(sensor, **changed)
