"""Logs of other kinds than the real ones that the filter was set on; the truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vehnav.config import Config
from vehnav.earth import position_difference
from vehnav.pipeline import run
from vehnav.simulate import GnssModel, WheelModel, simulate

CITY = "city,duration=300,seed=4,first_stop=30,stop_every=95"
CLEAN = GnssModel(drift=0.0, noise=0.5)


def drive(scenario=CITY, **more):
    return simulate(
        scenario, **({"sensor": "mems-industrial", "seed": 3, "rate_hz": 50.0, "gnss": CLEAN} | more)
    )  # fmt: skip


def errors(made, found):
    """(n,) m, horizontal, and over sigma of one axis."""
    track = found.trajectory
    truth = made.truth.rows(np.searchsorted(made.truth.t_ns, track.t_ns))
    d = position_difference(track.lat, track.lon, truth.lat, truth.lon)
    error = np.hypot(d[:, 0], d[:, 1])
    variance = 0.5 * (track.sigma_pos[:, 0] ** 2 + track.sigma_pos[:, 1] ** 2)
    return error, error / np.sqrt(variance + CLEAN.noise**2)


@pytest.mark.parametrize("noise", [0.3, 0.5])
def test_noise_of_the_wheel_is_no_scale(noise):
    """Its square over that of the speed would come out of the scale: 220 m with 0.5 m/s."""
    made = drive(wheel=WheelModel(noise=noise))
    error, ratio = errors(made, run(made.log(), Config(method="filter")))
    assert error.max() < 10.0
    assert ratio.max() < 3.5


def test_a_dead_wheel_sensor_is_not_believed():
    """All readings zero: no better than without it, and no worse."""
    made = drive(wheel=WheelModel())
    log = made.log()
    dead = replace(log, speed=replace(log.speed, speed=np.zeros_like(log.speed.speed)))
    for gps, most in (("aid", 3.0), ("start", 50.0)):
        with_it, without = (
            errors(made, run(x, Config(method="smooth", gps=gps)))[0].max()
            for x in (dead, replace(log, speed=None))
        )
        assert with_it < max(2.0 * without, most)
