"""A scenario, a sensor and a seed become a log with its truth."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from vehnav.errors import ConfigError, Finding
from vehnav.logs.log import Gnss, Imu, Log, Speed
from vehnav.sensors import (
    Sampling,
    Sensor,
    SensorErrors,
    corrupt,
    draw_errors,
    load_sensor,
    run_rngs,
)
from vehnav.simulate.motion import Motion
from vehnav.simulate.receivers import GnssModel, WheelModel, simulate_gnss, simulate_speed
from vehnav.simulate.scenarios import Scenario, make_scenario
from vehnav.simulate.truth import ideal_record
from vehnav.trajectory import Trajectory
from vehnav.units import NS

Array = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

START_NS: Final = 1_767_225_600_000_000_000
"""2026-01-01T00:00:00Z: when simulated logs begin unless told otherwise."""
MOST_SAMPLES: Final = 20_000_000
"""Of a drive, which is in memory as a whole, about 1 kB each: a day at 200 Hz, two at 100 Hz."""
DEFAULT_GNSS: Final = GnssModel()


@dataclass(frozen=True)
class SimulatedLog:
    """One run.

    Attributes
    ----------
    scenario : str
        Name of the scenario.
    truth : Trajectory
        At the stamps of the IMU; ``stopped`` where the vehicle stands.
    ideal, imu : Imu
        Perfect and measured, body axes right-forward-up.
    gnss, speed : Gnss, Speed or None
    errors : SensorErrors
        The constant errors that were drawn.
    sensor : Sensor
    seed, run : int
    findings : tuple of Finding
        What the instruments could not show (saturation).
    """

    scenario: str
    truth: Trajectory
    ideal: Imu
    imu: Imu
    gnss: Gnss | None
    speed: Speed | None
    errors: SensorErrors
    sensor: Sensor
    seed: int
    run: int = 0
    findings: tuple[Finding, ...] = ()

    def log(self) -> Log:
        """The recording, as a reader would deliver it (axes right-forward-up)."""
        return Log(
            path=f"simulate:{self.scenario}",
            imu=replace(self.imu, axes="RFU"),
            gnss=self.gnss,
            speed=self.speed,
            findings=self.findings,
        )


def stamps(duration: float, rate_hz: float, *, start_ns: int = START_NS) -> TimeArray:
    """(n,) int64 ns: evenly from ``start_ns`` over ``duration`` s, both ends included."""
    if not (duration > 0.0 and rate_hz > 0.0):
        raise ConfigError("duration and rate must be positive")
    count = math.floor(min(duration * rate_hz + 1e-6, 1e18)) + 1
    if count < 2:
        raise ConfigError(f"{duration:g} s at {rate_hz:g} Hz is less than two samples")
    if count > MOST_SAMPLES:
        raise ConfigError(
            f"{duration:g} s at {rate_hz:g} Hz are {count / 1e6:.4g} million samples, of about "
            f"1 kB of memory each; at most {MOST_SAMPLES / 1e6:g} million are made: "
            f"{MOST_SAMPLES / rate_hz:.6g} s at this rate"
        )
    return np.asarray(start_ns + np.rint(np.arange(count) * (1e9 / rate_hz)).astype(np.int64))


def ideal_log(motion: Motion, t_ns: TimeArray, *, sampling: Sampling) -> tuple[Trajectory, Imu]:
    """Truth and perfect IMU at stamps ``t_ns``; the first is t = 0 of the motion.

    An increment covers the step before its stamp; the first one covers a step before the first
    stamp, for which the motion is continued backward.
    """
    t = (t_ns - t_ns[0]) * NS
    lead = sampling == "increments"
    edges = np.concatenate([[-t[1]], t]) if lead else t
    record = ideal_record(motion, edges, increments=lead)
    s = record.states
    here = slice(1, None) if lead else slice(None)
    truth = Trajectory(
        t_ns=t_ns,
        lat=s.lat[here],
        lon=np.remainder(s.lon[here] + np.pi, 2.0 * np.pi) - np.pi,
        height=s.height[here],
        v_n=s.v_n[here],
        c_nb=s.c_nb[here],
        stopped=motion.standing(t),
    )
    gyro, accel = (record.dtheta, record.dvel) if lead else (s.omega_ib_b, s.f_b)
    return truth, Imu(t_ns, gyro, accel, sampling=sampling, source="/imu", frame_id="imu_link")


@dataclass(frozen=True)
class Setup:
    """What is simulated besides the scenario.

    Attributes
    ----------
    sensor : Sensor
    rate_hz : float
        Of the IMU.
    sampling : {"rates", "increments"}
    gnss, wheel : model or None
        None: the log has none.
    start_ns : int
        First stamp.
    """

    sensor: Sensor
    rate_hz: float = 100.0
    sampling: Sampling = "rates"
    gnss: GnssModel | None = DEFAULT_GNSS
    wheel: WheelModel | None = None
    start_ns: int = START_NS


def simulate(
    scenario: str | Scenario,
    *,
    sensor: str | Sensor = "mems-industrial",
    seed: int = 0,
    rate_hz: float = 100.0,
    sampling: Literal["rates", "increments"] = "rates",
    gnss: GnssModel | None = DEFAULT_GNSS,
    wheel: WheelModel | None = None,
    start_ns: int = START_NS,
) -> SimulatedLog:
    """Make one log.

    Parameters
    ----------
    scenario : str or Scenario
        ``"city"``, ``"circle,lat=47.2,duration=900"``, ...; see
        :data:`vehnav.simulate.scenarios.SCENARIOS`.
    sensor : str or Sensor
        Grade of the catalogue, file, or record.
    seed : int
        Of the errors; the way itself hangs on the scenario only.
    rate_hz : float
        Of the IMU.
    sampling : {"rates", "increments"}
        Point samples, or increments over the step before each stamp.
    gnss, wheel : GnssModel, WheelModel or None
        None: the log has none.
    start_ns : int
        First stamp, Unix ns.

    Raises
    ------
    ConfigError
        Unknown scenario, parameter or sensor, or values that make no log.
    """
    setup = Setup(_sensor(sensor), rate_hz, sampling, gnss, wheel, start_ns)
    return next(simulate_runs(scenario, setup, seed=seed, runs=1))


def simulate_runs(
    scenario: str | Scenario, setup: Setup, *, seed: int, runs: int
) -> Iterator[SimulatedLog]:
    """Monte Carlo: the same truth, other errors. Run k is the same whatever their number."""
    if runs < 1:
        raise ConfigError(f"runs must be at least 1, not {runs}")
    way = make_scenario(scenario) if isinstance(scenario, str) else scenario
    t_ns = stamps(way.motion.duration, setup.rate_hz, start_ns=setup.start_ns)
    truth, ideal = ideal_log(way.motion, t_ns, sampling=setup.sampling)
    for run, rng in enumerate(run_rngs(seed, runs)):
        yield _one_run(way, setup, truth, ideal, rng, seed=seed, run=run)


def _sensor(sensor: str | Sensor) -> Sensor:
    return sensor if isinstance(sensor, Sensor) else load_sensor(sensor)


def _one_run(
    way: Scenario,
    setup: Setup,
    truth: Trajectory,
    ideal: Imu,
    rng: np.random.Generator,
    *,
    seed: int,
    run: int,
) -> SimulatedLog:
    """Errors of one run; IMU, GPS and wheels draw from streams of their own."""
    imu_rng, gnss_rng, wheel_rng = rng.spawn(3)
    errors = draw_errors(setup.sensor, imu_rng)
    measured = corrupt(
        ideal.gyro,
        ideal.accel,
        t=(ideal.t_ns - ideal.t_ns[0]) * NS,
        sensor=setup.sensor,
        errors=errors,
        rng=imu_rng,
        sampling=setup.sampling,
    )
    findings: tuple[Finding, ...] = ()
    if measured.saturated:
        text = f"{measured.saturated} readings reached the range of {setup.sensor.name}"
        findings = (Finding("saturated", "warning", text),)
    model = setup.gnss
    return SimulatedLog(
        scenario=way.name,
        truth=truth,
        ideal=ideal,
        imu=replace(ideal, gyro=measured.gyro, accel=measured.accel),
        gnss=None
        if model is None
        else simulate_gnss(truth, model, gnss_rng, earth=way.motion.earth),
        speed=None if setup.wheel is None else simulate_speed(truth, setup.wheel, wheel_rng),
        errors=errors,
        sensor=setup.sensor,
        seed=seed,
        run=run,
        findings=findings,
    )
