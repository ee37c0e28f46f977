"""What the options ask for, in the terms of the physics: the pipeline's dictionary."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from vehnav.classic import Corrections, Drive, noise_from_rest, noise_of_sensor
from vehnav.config import Config
from vehnav.errors import ConfigError, Finding
from vehnav.legs import LegNoise
from vehnav.prepare import Samples
from vehnav.start import Given
from vehnav.stops import RMS_RULE, StopRule
from vehnav.units import DEG

METHODS: Final = {
    "free": Corrections(levelling=False, reset=False, refine=False),
    "levelling": Corrections(levelling=True, reset=False, refine=False),
    "reset": Corrections(levelling=False, reset=True, refine=False),
    "as_published": Corrections(levelling=True, reset=True, refine=False),
    "default": Corrections(),
}
"""The methods of the table that every run prints (paper 002's comparison, and ours)."""


def corrections_of(config: Config) -> Corrections:
    """Which procedures the options ask for."""
    if config.method == "free":
        return METHODS["free"]
    refine = not config.as_published and config.levelling and config.reset
    return Corrections(config.levelling, config.reset, refine, config.causal)


def stop_rule(config: Config) -> StopRule:
    """The rule of the options, with the defaults of its statistic."""
    rule = StopRule() if config.stop_statistic == "slow" else RMS_RULE
    known = config.known_sensor
    if config.stop_threshold is not None:
        rule = replace(rule, threshold=config.stop_threshold * DEG)
    elif known is not None and known.stop_threshold is not None:
        rule = replace(rule, threshold=known.stop_threshold)
    if config.stop_window is not None:
        rule = replace(rule, window=config.stop_window)
    if config.stop_dwell is not None:
        rule = replace(rule, dwell=config.stop_dwell)
    return rule


def given_start(config: Config) -> Given:
    """What the options say of the start, in radians."""
    position, heading, attitude = (
        config.start_position,
        config.start_heading,
        config.start_attitude,
    )
    return Given(
        position=None if position is None else (position[0] * DEG, position[1] * DEG, position[2]),
        heading=None if heading is None else heading * DEG,
        attitude=None
        if attitude is None
        else (attitude[0] * DEG, attitude[1] * DEG, attitude[2] * DEG),
        gps_seconds=config.gps_start_seconds,
        lever_arm=config.lever_arm,
    )


def leg_noise(drive: Drive, config: Config) -> LegNoise:
    """From the log's own rest, and from the sensor where one is named."""
    noise = noise_from_rest(drive)
    known = config.known_sensor
    if known is None:
        return noise
    return noise_of_sensor(
        noise,
        gyro_noise=known.gyro.noise,
        gyro_walk=known.gyro.drift,
        accel_noise=known.accel.noise,
        accel_bias=known.accel.bias,
    )


def sensor_findings(config: Config) -> list[Finding]:
    """That a named sensor's noise was taken by a stop method."""
    if config.known_sensor is None:
        return []
    text = (
        f"noise of sensor {config.known_sensor.name} ({config.sensor}) weighs the stops where it "
        "is more than the log's own rest shows; its bias walk and accelerometer bias as they are"
    )
    return [Finding("sensor-noise", "info", text)]


def check_levelling_rate(config: Config, samples: Samples) -> None:
    """ConfigError where the levelling loop would not settle: k g dt must stay below 1 (A 4.3)."""
    longest = float(np.max(np.diff(samples.t)))
    if config.levelling_rate is not None and config.levelling_rate * longest >= 1.0:
        raise ConfigError(
            f"--levelling-rate {config.levelling_rate:g} 1/s: times the longest step, "
            f"{longest:.3f} s, it must stay below 1"
        )
