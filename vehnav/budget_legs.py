"""Predicted against real: the error that every leg of a log adds, by the budget and by GPS.

Every leg between two stops is dead-reckoned by itself, forward: level from the stop before it, gyro
bias from the stops so far, heading from the track of the run, velocity zero. Its end against GPS is
the real error; the budget of the same leg, for a sensor file or for what the log's own rest shows,
is the prediction. Nothing is fitted to the legs.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.alignment import gyro_bias, track_random_walk
from vehnav.budget.drive import IdealDrive, drive_of_trajectory
from vehnav.budget.forward import Budget
from vehnav.budget.linear import Procedure, Sensitivity, sensitivity
from vehnav.budget.metrics import cep
from vehnav.budget.sources import CONSTANT, TILT, Initial, constant_sigmas, processes_of, unit_of
from vehnav.classic import GUARD, Drive, noise_from_rest, rest_of
from vehnav.earth import ELLIPSOIDS, position_difference
from vehnav.errors import ConfigError, LogError
from vehnav.legs import LegNoise
from vehnav.logs.log import Gnss
from vehnav.pipeline import Run, StopSearch, search_stops
from vehnav.rotation import angles_from_c_nb
from vehnav.sensors import CATALOGUE, Sensor, Triad
from vehnav.stops import Stop
from vehnav.strapdown.enu import mechanize_enu
from vehnav.units import NS

Array = npt.NDArray[np.float64]

SHARE: Final = 0.95
FIX_SIGMA: Final = 1.5
"""m, of a mean of fixes in a stop where the receiver says nothing."""
DRIVEN: Final = 50.0
"""m from which a leg is a drive and not a creep in a queue."""
SLACK: Final = 1.0
"""s beside a stop whose fixes still count where there is none inside."""
HEADING: Final = float(np.radians(1.0))
"""rad, where the track of the run does not say how sure its heading is."""
USUAL: Final = "mems-consumer"
"""Grade whose sigmas say what size of a source is usual."""
EXPLAINS: Final = 0.8
"""Share of the squared error of a leg that one source must explain to be named."""


@dataclass(frozen=True)
class Leg:
    """One leg, predicted and real.

    Attributes
    ----------
    start, end : float
        s from the start of the log.
    distance : float
        m driven.
    predicted95 : float
        Radius, m, of the circle that should hold the error with 95 %.
    largest : str
        The source that makes most of it.
    real : float
        m against GPS.
    east, north : float
        Of the real error, m.
    lacks : str
        Where the error is outside: the one source that would explain it, with its size.
    """

    start: float
    end: float
    distance: float
    predicted95: float
    largest: str
    real: float
    east: float
    north: float
    lacks: str

    @property
    def inside(self) -> bool:
        """Whether the real error lies within the predicted circle."""
        return self.real <= self.predicted95


@dataclass(frozen=True)
class LegCheck:
    """All legs of a log that GPS can judge.

    Attributes
    ----------
    name : str
    sensor : str
    legs : tuple of Leg
    unjudged : int
        Legs without fixes at both ends.
    """

    name: str
    sensor: str
    legs: tuple[Leg, ...]
    unjudged: int

    @property
    def inside(self) -> float:
        """Share of the legs whose real error lies within the predicted 95 %."""
        return float(np.mean([leg.inside for leg in self.legs]))

    def driven(self) -> tuple[Leg, ...]:
        """Those of at least :data:`DRIVEN` metres."""
        return tuple(leg for leg in self.legs if leg.distance >= DRIVEN)

    def to_dict(self) -> dict[str, Any]:
        """As plain data, for ``--json``."""
        return {
            "source": self.name,
            "sensor": self.sensor,
            "inside": self.inside,
            "unjudged": self.unjudged,
            "legs": [
                {**{_UNITS.get(k, k): v for k, v in asdict(leg).items()}, "inside": leg.inside}
                for leg in self.legs
            ],
        }


_UNITS: Final = {
    "start": "start_s", "end": "end_s", "distance": "distance_m", "predicted95": "predicted95_m",
    "real": "real_m", "east": "east_m", "north": "north_m",
}  # fmt: skip


def check_legs(found: Run, sensor: Sensor | None) -> LegCheck:
    """Predicted and real error of every leg of a run.

    Parameters
    ----------
    found : Run
        Of a log with GPS.
    sensor : Sensor or None
        None: noise, bias walk and level from the log's own rest, as ``vehnav run`` takes them.

    Raises
    ------
    ConfigError
        The run has no legs between stops (a filter, or another span).
    LogError
        No GPS, or no leg with fixes at both ends.
    """
    gnss = found.log.gnss
    if gnss is None:
        raise LogError(f"{found.log.path}: no GPS, so nothing to judge the legs by")
    if found.config.aided:
        raise ConfigError("--legs judges legs between stops; take --method stops")
    search = search_stops(found.log, found.config)
    work = _Work(found, search, gnss, sensor)
    ends = [work.fix_at(stop) for stop in search.stops]
    legs, unjudged = [], 0
    for k in range(len(search.stops) - 1):
        fixes = ends[k], ends[k + 1]
        if fixes[0] is None or fixes[1] is None:
            unjudged += 1
        else:
            legs.append(work.leg(k, fixes[0], fixes[1]))
    if not legs:
        raise LogError(f"{found.log.path}: no leg has fixes at both ends")
    return LegCheck(found.log.path, work.sensor.name, tuple(legs), unjudged)


@dataclass(frozen=True)
class _Fix:
    """Mean of the fixes of a stop: lat, lon (rad), variance on each axis (m2)."""

    lat: float
    lon: float
    variance: float


class _Work:
    """What all legs of a log share."""

    def __init__(self, found: Run, search: StopSearch, gnss: Gnss, sensor: Sensor | None) -> None:
        samples = search.samples
        self.found, self.search, self.gnss = found, search, gnss
        self.earth = ELLIPSOIDS[found.config.ellipsoid]
        self.drive = Drive(
            samples.t, samples.omega, samples.f, samples.increments, search.stops, self.earth
        )
        self.noise = found.noise or noise_from_rest(self.drive)
        self.sensor = rest_sensor(self.noise) if sensor is None else sensor
        self.gnss_t = (gnss.t_ns - found.start_ns) * NS
        self.track_t = (found.trajectory.t_ns - found.start_ns) * NS
        self.bias, self.bias_sigma = self._gyro_bias()

    def fix_at(self, stop: Stop) -> _Fix | None:
        """The place of a stop by GPS; None where no fix is near."""
        for slack in (0.0, SLACK):
            near = (self.gnss_t >= stop.start - slack) & (self.gnss_t <= stop.end + slack)
            if np.any(near):
                sigma = self.gnss.sigma_pos
                size = FIX_SIGMA
                if sigma is not None and np.all(np.isfinite(sigma[near, :2])):
                    size = float(np.median(sigma[near, :2]))
                lat, lon = (float(np.median(x[near])) for x in (self.gnss.lat, self.gnss.lon))
                return _Fix(lat, lon, size**2)
        return None

    def _gyro_bias(self) -> tuple[Array, Array]:
        """((stops, 3), (stops,)) rad/s: by the stops so far, each weighed by its noise; sigma."""
        stops, track = self.search.stops, self.found.trajectory
        seen = np.zeros((len(stops), 3))
        for k, stop in enumerate(stops):
            row = min(int(np.searchsorted(self.track_t, stop.end)), track.size - 1)
            rest = rest_of(self.drive, stop)
            c_nb = rest.c_nb(float(angles_from_c_nb(track.c_nb[row])[0]))
            seen[k] = gyro_bias(rest, c_nb, float(track.lat[row]), earth=self.earth)
        length = np.array([max(stop.end - GUARD - stop.settled, 1.0) for stop in stops])
        middle = np.array([0.5 * (stop.start + stop.end) for stop in stops])
        variance = self.noise.gyro_white**2 / length
        walk = self.noise.gyro_bias_walk
        bias, p = track_random_walk(middle, seen, variance, walk, smooth=False)
        return bias, np.sqrt(p)

    def leg(self, number: int, start: _Fix, end: _Fix) -> Leg:
        """The leg after a stop."""
        before, after = self.search.stops[number : number + 2]
        track, t = self.found.trajectory, self.track_t
        rows = np.flatnonzero((t >= before.end - 1e-6) & (t <= after.start + 1e-6))
        first = int(rows[0])
        ideal = drive_of_trajectory(track.rows(rows), name="leg", earth=self.earth)
        error = self._dead_reckoned(number, first, start, end)
        sigma = track.sigma_heading
        heading = HEADING if sigma is None else max(float(sigma[first]), 1e-6)
        predicted, made = self._predicted(ideal, heading, float(self.bias_sigma[number]))
        predicted = predicted + np.eye(2) * (start.variance + end.variance)
        radius, real = float(cep(predicted, SHARE)), float(np.hypot(*error))
        return Leg(
            start=before.end,
            end=after.start,
            distance=ideal.path_length(),
            predicted95=radius,
            largest=made.rows(ideal.duration)[0].source,
            real=real,
            east=float(error[0]),
            north=float(error[1]),
            lacks="" if real <= radius else missing_source(made, error),
        )

    def _dead_reckoned(self, number: int, first: int, start: _Fix, end: _Fix) -> Array:
        """(2,) m east, north: displacement of the leg after a stop minus that of GPS."""
        before, after = self.search.stops[number : number + 2]
        track = self.found.trajectory
        height = float(track.height[first])
        c_nb = rest_of(self.drive, before).c_nb(float(angles_from_c_nb(track.c_nb[first])[0]))
        steps = self.drive.increments.part(before.last, after.first)
        found = mechanize_enu(
            steps.corrected(self.bias[number], 0.0),
            position=(start.lat, start.lon, height),
            c_nb=c_nb,
            earth=self.earth,
        ).position[-1]
        return position_difference(found[0], found[1], end.lat, end.lon, height, earth=self.earth)

    def _predicted(self, ideal: IdealDrive, heading: float, bias: float) -> tuple[Array, Budget]:
        """Covariance (2, 2) of the leg's error, and the budget that it is made of.

        ``heading`` rad, ``bias`` rad/s: one sigma of what is known; the level is off by the road.
        """
        sensor = replace(self.sensor, gyro=replace(self.sensor.gyro, bias=bias))
        found = sensitivity(
            ideal,
            Procedure(levelled=True),
            processes=processes_of(sensor),
            at=(ideal.duration,),
            points=2,
        )
        made = Budget(found, sensor, Initial(heading, self.noise.level, 0.0, 0.0))
        tilt = found.columns[-1][6:8, TILT] * self.noise.level
        return made.horizontal(ideal.duration) + tilt @ tilt.T, made


def rest_sensor(noise: LegNoise) -> Sensor:
    """What the rest of a log says of its sensor, as a record."""
    return Sensor(
        "the log's own rest",
        gyro=Triad(noise=noise.gyro_white, walk=noise.gyro_bias_walk),
        accel=Triad(noise=noise.accel_white, bias=noise.accel_bias),
    )


def missing_source(made: Budget, error: Array) -> str:
    """The source that explains an error at the end with the least of its usual size, in words."""
    found: Sensitivity = made.sensitivity
    usual = constant_sigmas(CATALOGUE[USUAL], Initial(), levelled=False, held=True)
    best: tuple[float, str] | None = None
    for j, source in enumerate(CONSTANT):
        column = found.columns[-1][6:8, j]
        size = float(column @ column)
        if usual[j] == 0.0 or size == 0.0 or source.parameter in ("velocity", "position"):
            continue
        amount = float(column @ error) / size
        explained = amount**2 * size / float(error @ error)
        strain = abs(amount) / float(usual[j])
        if explained >= EXPLAINS and (best is None or strain < best[0]):
            factor, unit = unit_of(source.parameter)
            best = strain, f"{source.name} {amount / factor:.3g} {unit}"
    return best[1] if best else "no single source"
