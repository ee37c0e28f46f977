"""Noisy fixes: their sigma where the log has none, and stops that noise must not veto."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vehnav.aided import _moves, run_aided
from vehnav.aiding.fix_noise import FLOOR
from vehnav.choices import given_start
from vehnav.classic import Drive
from vehnav.config import Config
from vehnav.earth import WGS84, position_difference
from vehnav.pipeline import run, search_stops
from vehnav.simulate import GnssModel, simulate

TOWN = "city,duration=240,seed=4,first_stop=30,stop_every=120"


def found_sigma(noise, *, logged=False, gps="aid"):
    """What the filter takes for the sigma of white noise, m."""
    gnss = GnssModel(noise=noise, drift=0.0)
    log = simulate(TOWN, sensor="mems-industrial", seed=3, rate_hz=50.0, gnss=gnss).log()
    if not logged:
        log = replace(log, gnss=replace(log.gnss, sigma_pos=None))
    config = Config(method="filter", gps=gps)
    search = search_stops(log, config)
    s = search.samples
    drive = Drive(s.t, s.omega, s.f, s.increments, search.stops, WGS84)
    return run_aided(drive, s.t_ns, log, config, given_start(config)).result.fix_sigma


@pytest.mark.parametrize("noise", [1.0, 3.0, 9.0])
@pytest.mark.parametrize("gps", ["aid", "start"])
def test_white_noise_is_found(noise, gps):
    """Some 120 to 300 innovations: their median gives sigma to a tenth (one sigma)."""
    assert found_sigma(noise, gps=gps) == pytest.approx(noise, rel=0.3)


def test_a_floor_stays_under_fixes_without_noise():
    assert found_sigma(0.01) == FLOOR


def test_logged_sigmas_are_believed():
    assert found_sigma(3.0, logged=True) is None


def test_fixes_of_a_bad_receiver_veto_no_stop():
    """9 m at 1 Hz are 4 m/s over the 3 s of a difference, four times the veto's speed."""
    made = simulate(
        TOWN, sensor="mems-industrial", seed=3, rate_hz=50.0, gnss=GnssModel(noise=9.0, drift=0.0)
    )
    found = run(made.log(), Config(method="filter", gps="aid"))
    assert len(found.stops) == 2
    k = np.searchsorted(made.truth.t_ns, found.trajectory.t_ns)
    d = position_difference(
        found.trajectory.lat, found.trajectory.lon, made.truth.lat[k], made.truth.lon[k]
    )
    assert np.hypot(*d.T).max() < 9.0  # the filter is better than a fix


@pytest.mark.parametrize("noise", [0.1, 1.0, 2.5])
def test_noise_is_no_motion_and_even_circling_is(noise):
    """Velocities of white noise; and the same with 3 m/s around a circle of a minute."""
    rng = np.random.default_rng(1)
    angle = 2.0 * np.pi * np.arange(120) / 60.0
    white = noise * rng.standard_normal((120, 2))
    assert not _moves(white)
    assert _moves(3.0 * np.column_stack([np.cos(angle), np.sin(angle)]) + white)


def test_a_height_that_wanders_makes_no_climb():
    """Heights of a receiver without sigmas that rise by 12 m in the minute that aids.

    That is some 5 m over a minute at the start, and 3 sigma where a normal error would be: the
    height at the end is within 4 of its sigmas (15 with the height believed to 2 m).
    """
    made = simulate(TOWN, sensor="mems-industrial", seed=3, rate_hz=50.0, gnss=GnssModel())
    log = made.log()
    t = (log.gnss.t_ns - log.gnss.t_ns[0]) * 1e-9
    gnss = replace(log.gnss, sigma_pos=None, height=log.gnss.height + 0.2 * np.maximum(t - 30, 0))
    found = run(replace(log, gnss=gnss), Config(method="filter"))
    truth = np.interp(found.trajectory.t_ns, made.truth.t_ns, made.truth.height)
    assert abs(found.trajectory.height[-1] - truth[-1]) < 4.0 * found.trajectory.sigma_pos[-1, 2]
