"""What the options ask for, in the terms of the physics: the pipeline's dictionary."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from vehnav.classic import Corrections, Drive, noise_from_rest, noise_of_sensor
from vehnav.config import Config
from vehnav.errors import ConfigError
from vehnav.legs import LegNoise
from vehnav.prepare import Samples
from vehnav.sensors import load_sensor
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
    in_file = None if config.sensor is None else load_sensor(config.sensor).stop_threshold
    if config.stop_threshold is not None:
        rule = replace(rule, threshold=config.stop_threshold * DEG)
    elif in_file is not None:
        rule = replace(rule, threshold=in_file)
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
    )


def leg_noise(drive: Drive, config: Config) -> LegNoise:
    """From the log's own rest, and from the sensor where one is named."""
    noise = noise_from_rest(drive)
    if config.sensor is None:
        return noise
    sensor = load_sensor(config.sensor)
    gyro = sensor.gyro
    wandering = gyro.bias_instability * (2.0 / gyro.bias_time) ** 0.5  # of a Gauss-Markov bias
    return noise_of_sensor(
        noise,
        gyro_noise=gyro.noise,
        gyro_walk=float(np.hypot(gyro.walk, wandering)),
        accel_noise=sensor.accel.noise,
        accel_bias=sensor.accel.bias,
    )


def check_levelling_rate(config: Config, samples: Samples) -> None:
    """ConfigError where the levelling loop would not settle: k g dt must stay below 1 (A 4.3)."""
    longest = float(np.max(np.diff(samples.t)))
    if config.levelling_rate is not None and config.levelling_rate * longest >= 1.0:
        raise ConfigError(
            f"--levelling-rate {config.levelling_rate:g} 1/s: times the longest step, "
            f"{longest:.3f} s, it must stay below 1"
        )
