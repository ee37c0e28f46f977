"""A drive with all that is assumed about it: budgets of sensors on it, ranks, stop intervals."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from vehnav.budget.drive import IdealDrive
from vehnav.budget.forward import Budget
from vehnav.budget.linear import Model, Procedure, Sensitivity, chosen_stops, sensitivity
from vehnav.budget.montecarlo import MonteCarlo, monte_carlo
from vehnav.budget.sources import INITIAL_UNITS, Initial, Process, processes_of
from vehnav.errors import ConfigError
from vehnav.sensors import Sensor


@dataclass(frozen=True)
class Study:
    """What a budget is asked about.

    Attributes
    ----------
    drive : IdealDrive
    procedure : Procedure
    initial : Initial
    times : tuple of float
        s, at which totals are wanted; the last one is that of the tables.
    model : {"full", "paper", "simplified"}
    held : bool
        Height and vertical velocity come from outside.
    """

    drive: IdealDrive
    procedure: Procedure
    initial: Initial
    times: tuple[float, ...]
    model: Model = "full"
    held: bool = True
    _known: dict[tuple[Process, ...], Sensitivity] = field(default_factory=dict, repr=False)

    @property
    def time(self) -> float:
        """The last of the times, s."""
        return self.times[-1]

    def budget(self, sensor: Sensor) -> Budget:
        """Errors of a sensor on the drive; the drive is integrated once per kind of sensor."""
        processes = processes_of(sensor)
        if processes not in self._known:
            self._known[processes] = sensitivity(
                self.drive,
                self.procedure,
                processes=processes,
                at=self.times,
                model=self.model,
                held=self.held,
            )
        return Budget(self._known[processes], sensor, self.initial)

    def monte_carlo(self, sensor: Sensor, initial: Initial, *, runs: int, seed: int) -> MonteCarlo:
        """The nonlinear mechanization with drawn errors under the same assumptions."""
        return monte_carlo(
            self.drive,
            sensor,
            initial,
            self.procedure,
            at=self.times,
            runs=runs,
            seed=seed,
            held=self.held,
        )

    def ranked(self, sensors: Iterable[Sensor], metric: str) -> list[Budget]:
        """Budgets of sensors, the best first."""
        found = [self.budget(sensor) for sensor in sensors]
        return sorted(found, key=lambda budget: budget.totals(self.time)[metric])

    def with_gyro_from_stops(self) -> Study:
        """With the gyro bias that a stop shows taken off until the next."""
        return replace(self, procedure=replace(self.procedure, gyro_from_stops=True), _known={})

    def with_interval(self, every: float | None) -> Study:
        """With those stops that are at least ``every`` s apart; None: with no stop."""
        stops = () if every is None else chosen_stops(self.drive, every)
        return replace(self, procedure=replace(self.procedure, stops=stops), _known={})


@dataclass(frozen=True)
class Interval:
    """Errors with a correction at stops at least so far apart.

    Attributes
    ----------
    every : float or None
        s asked for; None: no stop at all.
    stops : int
        That are used.
    longest : float
        s: the longest time without a correction, up to the time judged.
    budget : Budget
    """

    every: float | None
    stops: int
    longest: float
    budget: Budget


def interval_sweep(study: Study, sensor: Sensor, intervals: Sequence[float]) -> list[Interval]:
    """Error against the interval between corrections (the question of paper 002).

    With every stop of the drive, with those at least so far apart, and without any.
    """
    out = []
    for every in (0.0, *sorted(set(intervals)), None):
        chosen = study.with_interval(every)
        stops = [span for span in chosen.procedure.stops if span[0] < study.time]
        edges = [0.0, *(x for span in stops for x in span), study.time]
        longest = max(b - a for a, b in zip(edges[::2], edges[1::2], strict=True))
        out.append(Interval(every, len(stops), longest, chosen.budget(sensor)))
    return out


def load_initial(path: str | Path) -> tuple[Initial, bool] | None:
    """Errors of the start from ``[initial]`` of a TOML file, and whether it is levelled.

    Keys ``heading``, ``tilt`` (deg), ``velocity`` (m/s), ``position`` (m); a file without a tilt
    means a levelled start. None where the file has no such table. ConfigError for what cannot be
    read, an unknown key, or a value that is no number of at least zero.
    """
    try:
        document = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"{path}: not a readable TOML file: {error}") from error
    table = document.get("initial")
    if not isinstance(table, dict):
        return None
    values = {}
    for key, value in table.items():
        if key not in INITIAL_UNITS:
            raise ConfigError(
                f"{path}: unknown key {key!r} in [initial]; known: {', '.join(INITIAL_UNITS)}"
            )
        factor, unit = INITIAL_UNITS[key]
        if isinstance(value, bool) or not isinstance(value, int | float) or not value >= 0.0:
            raise ConfigError(f"{path}: [initial] {key} must be a number >= 0 ({unit})")
        values[key] = float(value) * factor
    return Initial(**values), "tilt" not in values
