"""Sensor errors to navigation errors: a sensor and a start in the sensitivities of a drive."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from vehnav.budget.linear import PLACE, PSI, Sensitivity
from vehnav.budget.metrics import METRICS
from vehnav.budget.sources import (
    CONSTANT,
    Initial,
    constant_sigmas,
    parameter_value,
    unit_of,
)
from vehnav.sensors import Sensor

Array = npt.NDArray[np.float64]

DOUBTFUL: Final = 0.1
"""rad of attitude error above which the linear budget is off by a few per cent (spec B 1.5)."""
INVALID: Final = 0.5
"""rad above which it says nothing."""
EAST_NORTH: Final = slice(6, 8)


@dataclass(frozen=True)
class Row:
    """One source at one time.

    Attributes
    ----------
    source, parameter : str
    sigma : float
        In ``unit``.
    unit : str
    east, north : float
        m: the effect of plus one sigma; of a random process its standard deviations.
    share : float
        Of the total DRMS squared.
    """

    source: str
    parameter: str
    sigma: float
    unit: str
    east: float
    north: float
    share: float

    @property
    def radial(self) -> float:
        """M."""
        return float(np.hypot(self.east, self.north))


@dataclass(frozen=True)
class Validity:
    """Whether the linear equations may be trusted up to a time.

    Attributes
    ----------
    max_psi : float
        Largest root of the summed squares of the attitude error, rad.
    """

    max_psi: float

    @property
    def verdict(self) -> Literal["valid", "doubtful", "invalid"]:
        """By the bounds of spec B 1.5."""
        if self.max_psi > INVALID:
            return "invalid"
        return "doubtful" if self.max_psi > DOUBTFUL else "valid"

    @property
    def text(self) -> str:
        """For a person."""
        size = f"attitude error {self.max_psi:.3g} rad ({np.degrees(self.max_psi):.2g} deg)"
        return {
            "valid": f"linear: {size}, within {DOUBTFUL:g} rad",
            "doubtful": f"linear to some per cent only: {size}; --mc checks it",
            "invalid": f"the linear budget is not valid: {size}, beyond {INVALID:g} rad; use --mc",
        }[self.verdict]


@dataclass(frozen=True)
class Budget:
    """Errors of a sensor on a drive.

    Attributes
    ----------
    sensitivity : Sensitivity
        Its processes are those of the sensor.
    sensor : Sensor
    initial : Initial
    """

    sensitivity: Sensitivity
    sensor: Sensor
    initial: Initial

    @cached_property
    def sigmas(self) -> Array:
        """(COLUMNS,) SI."""
        s = self.sensitivity
        return constant_sigmas(
            self.sensor, self.initial, levelled=s.procedure.levelled, held=s.held
        )

    @cached_property
    def process_sigmas(self) -> Array:
        """(p,) SI."""
        names = [p.parameter for p in self.sensitivity.processes]
        return np.array([parameter_value(self.sensor, self.initial, name) for name in names])

    @cached_property
    def covariance(self) -> Array:
        """(q, 9, 9): Psi, velocity and position error at every instant."""
        scaled = self.sensitivity.columns * self.sigmas
        noise = np.einsum("p,qpij->qij", self.process_sigmas**2, self.sensitivity.covariance)
        return np.asarray(scaled @ np.swapaxes(scaled, 1, 2) + noise)

    @property
    def t(self) -> Array:
        """(q,) s."""
        return self.sensitivity.t

    def horizontal(self, time: float) -> Array:
        """(2, 2) m2: covariance of the east and north error."""
        return np.asarray(self.covariance[self.sensitivity.index(time)][EAST_NORTH, EAST_NORTH])

    def sigma_up(self, time: float) -> float:
        """Standard deviation of the height, m."""
        return float(np.sqrt(self.covariance[self.sensitivity.index(time)][8, 8]))

    def totals(self, time: float) -> dict[str, float]:
        """Every metric at a time, m."""
        c = self.horizontal(time)
        return {name: float(metric(c)) for name, metric in METRICS.items()}

    def curve(self, metric: str) -> Array:
        """(q,) m: a metric at every instant."""
        return METRICS[metric](self.covariance[:, EAST_NORTH, EAST_NORTH])

    def validity(self, time: float) -> Validity:
        """Of the linear equations up to a time."""
        until = self.sensitivity.index(time) + 1
        trace = np.trace(self.covariance[:until, PSI, PSI], axis1=1, axis2=2)
        return Validity(float(np.sqrt(trace.max())))

    def valid_until(self) -> float:
        """S: the last instant up to which the linear equations are not invalid."""
        psi = np.sqrt(np.trace(self.covariance[:, PSI, PSI], axis1=1, axis2=2))
        beyond = np.flatnonzero(psi > INVALID)
        return float(self.t[max(int(beyond[0]) - 1, 0)] if beyond.size else self.t[-1])

    def rows(self, time: float) -> list[Row]:
        """Sources at a time, the largest first; those of no size are left out."""
        k = self.sensitivity.index(time)
        total = float(np.trace(self.covariance[k][EAST_NORTH, EAST_NORTH]))
        effects = (self.sensitivity.columns[k] * self.sigmas)[EAST_NORTH]
        out = []
        for j, source in enumerate(CONSTANT):
            if self.sigmas[j] > 0.0:
                east, north = (float(x) for x in effects[:, j])
                out.append(self._row(source.name, source.parameter, self.sigmas[j], east, north,
                                     total))  # fmt: skip
        for n, process in enumerate(self.sensitivity.processes):
            sigma = float(self.process_sigmas[n])
            if sigma > 0.0:
                variance = np.diagonal(self.sensitivity.covariance[k, n])[PLACE] * sigma**2
                east, north = (float(np.sqrt(max(x, 0.0))) for x in variance[:2])
                out.append(self._row(process.parameter, process.parameter, sigma, east, north,
                                     total))  # fmt: skip
        return sorted(out, key=lambda row: -row.radial)

    def _row(
        self, name: str, parameter: str, sigma: float, east: float, north: float, total: float
    ) -> Row:
        factor, unit = unit_of(parameter)
        share = (east * east + north * north) / total if total > 0.0 else 0.0
        return Row(name, parameter, float(sigma) / factor, unit, east, north, share)

    def by_parameter(self, time: float) -> Mapping[str, Array]:
        """Class of sources -> its (2, 2) covariance, m2; they add up to the whole."""
        k = self.sensitivity.index(time)
        effects = (self.sensitivity.columns[k] * self.sigmas)[EAST_NORTH]
        out: dict[str, Array] = {}
        for j, source in enumerate(CONSTANT):
            if self.sigmas[j] > 0.0:
                column = effects[:, j : j + 1]
                out[source.parameter] = out.get(source.parameter, 0.0) + column @ column.T
        for n, process in enumerate(self.sensitivity.processes):
            if self.process_sigmas[n] > 0.0:
                unit = self.sensitivity.covariance[k, n][EAST_NORTH, EAST_NORTH]
                out[process.parameter] = unit * self.process_sigmas[n] ** 2
        return out
