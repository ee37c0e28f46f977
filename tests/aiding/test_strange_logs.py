"""Logs of other kinds than the real ones that the filter was set on; the truth is known."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from vehnav.aiding.fixes import Fixes
from vehnav.config import Config
from vehnav.earth import WGS84, position_difference
from vehnav.pipeline import run
from vehnav.simulate import GnssModel, Scenario, WheelModel, make_scenario, simulate
from vehnav.simulate.motion import Body, RoadMotion
from vehnav.simulate.program import ProgramBuilder

CITY = "city,duration=300,seed=4,first_stop=30,stop_every=95"
CLEAN = GnssModel(drift=0.0, noise=0.5)


def drive(scenario=CITY, **more):
    return simulate(
        scenario, sensor="mems-industrial", seed=3, rate_hz=50.0, **({"gnss": CLEAN} | more)
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


def test_a_receiver_that_starts_late_does_not_place_the_start():
    """Out of a garage: the first fix, 30 s and 300 m on, is not where the drive began."""
    made = drive(gnss=replace(CLEAN, outages=((0.0, 60.0),)))
    error, ratio = errors(made, run(made.log(), Config(method="smooth", gps="aid")))
    assert error.max() < 5.0
    assert ratio.max() < 3.5


def backward_out_of_the_yard():
    """10 s backward at 3 m/s, then like everybody."""
    way = ProgramBuilder(heading=0.5).hold(30.0).change_speed(-3.0, peak=1.0)
    way.turn(1.5, yaw_rate=0.3).hold(5.0).change_speed(0.0, peak=1.0).hold(5.0)
    for angle in (1.5, -1.4, 1.5, -1.4):
        way.change_speed(13.0, peak=2.0).hold(10.0).turn(angle, yaw_rate=0.4).hold(15.0)
        way.change_speed(0.0, peak=2.0).hold(8.0)
    tones = make_scenario(CITY).motion.tones
    return Scenario("yard", RoadMotion(way.build(), (0.97, 0.65, 150.0), Body(), tones, WGS84))


@pytest.mark.parametrize("gps", ["start", "aid"])
def test_who_leaves_backward_does_not_point_there(gps):
    """The course of the first fixes is that of the back: 3.4 km, and no fix could mend it."""
    made = drive(backward_out_of_the_yard())
    error, ratio = errors(made, run(made.log(), Config(method="filter", gps=gps)))
    assert error.max() < 30.0
    assert ratio.max() < 3.5


def test_no_velocity_across_a_hole():
    """Two fixes 60 s apart say nothing of the speed at either."""
    t = np.concatenate([np.arange(5.0), 65.0 + np.arange(5.0)])
    place = np.where(t < 60.0, 2.0 * t, 2000.0 + 2.0 * t)  # m to the north
    radius = WGS84.a * (1.0 - WGS84.e2)  # of the meridian at the equator
    fixes = Fixes(t, place / radius, np.zeros(10), np.zeros(10))
    assert fixes.velocity(WGS84) == pytest.approx(np.tile([0.0, 2.0], (10, 1)), abs=1e-3)


def codes(found):
    return {finding.code for finding in found.findings if finding.level != "info"}


def test_a_filter_that_is_lost_is_set_on_the_fixes():
    """Half a second of a gyro at its range turns the heading by 125 deg; no fix was taken after."""
    made = drive()
    log = made.log()
    gyro, t = log.imu.gyro.copy(), (log.imu.t_ns - log.start_ns) * 1e-9
    gyro[(t > 120.0) & (t < 120.5), 2] = 4.36
    found = run(replace(log, imu=replace(log.imu, gyro=gyro)), Config(method="filter", gps="aid"))
    error, ratio = errors(made, found)
    assert error[-1] < 1.0
    assert np.median(ratio) < 2.0
    assert {"set-on-fixes", "contradiction"} <= codes(found)


def test_a_short_jump_of_the_fixes_moves_nothing():
    """200 m for 15 s: a reflection, refused to its end."""
    made = drive()
    log = made.log()
    t, lat = (log.gnss.t_ns - log.start_ns) * 1e-9, log.gnss.lat.copy()
    lat[(t >= 100.0) & (t < 115.0)] += 200.0 / WGS84.a
    found = run(replace(log, gnss=replace(log.gnss, lat=lat)), Config(method="filter", gps="aid"))
    assert errors(made, found)[0].max() < 3.0
    assert "set-on-fixes" not in codes(found)


@pytest.mark.parametrize("factor", [3.6, 0.0, -1.0])
def test_a_wrong_wheel_speed_is_told(factor):
    made = drive(wheel=WheelModel())
    log = made.log()
    wrong = replace(log, speed=replace(log.speed, speed=factor * log.speed.speed))
    assert {"odometer-scale", "contradiction"} & codes(run(wrong, Config(method="filter")))


def test_nothing_is_doubted_where_all_is_well():
    found = run(drive(wheel=WheelModel()).log(), Config(method="filter", gps="aid"))
    assert not codes(found)


@pytest.mark.parametrize("start", [70.0, 120.0, 185.0])
def test_rates_at_the_edges_do_not_fill_a_long_gap(start):
    """5 s without IMU: turning rates at its ends, taken for all of it, overturned the car."""
    made = drive()
    imu, log = made.imu, made.log()
    t = (imu.t_ns - imu.t_ns[0]) * 1e-9
    kept = (t < start) | (t > start + 5.0)
    cut = replace(log.imu, t_ns=imu.t_ns[kept], gyro=log.imu.gyro[kept], accel=log.imu.accel[kept])
    error, ratio = errors(made, run(replace(log, imu=cut), Config(method="filter")))
    assert error.max() < 150.0
    assert np.percentile(ratio, 95) < 5.0


def without_imu(log, start, length):
    t = (log.imu.t_ns - log.start_ns) * 1e-9
    kept = (t < start) | (t > start + length)
    imu = replace(
        log.imu, t_ns=log.imu.t_ns[kept], gyro=log.imu.gyro[kept], accel=log.imu.accel[kept]
    )
    return replace(log, imu=imu)


def test_a_gap_says_by_how_much_the_heading_sigma_grew():
    """By the sigmas beside the gap, of a run with it and of one of the whole log."""
    log = drive().log()
    whole = run(log, Config(method="filter")).trajectory
    cut = run(without_imu(log, 70.0, 4.0), Config(method="filter"))
    (gap,) = [f for f in cut.findings if f.code == "gap"]
    assert gap.level == "warning"
    assert "held" not in gap.text
    said = float(re.search(r"heading sigma grew by ([\d.]+) deg", gap.text)[1])
    after = gap.end_ns + 200_000_000
    with_gap, without = (
        np.degrees(x.sigma_heading[np.searchsorted(x.t_ns, after)]) for x in (cut.trajectory, whole)
    )
    assert with_gap - without > 0.5
    assert said == pytest.approx(with_gap - without, rel=0.2)


def test_the_smoother_says_what_a_gap_leaves_open_and_the_stops_that_they_coast():
    log = without_imu(drive().log(), 70.0, 4.0)
    texts = {
        method: [f.text for f in run(log, Config(method=method)).findings if f.code == "gap"]
        for method in ("smooth", "stops")
    }
    assert [len(found) for found in texts.values()] == [1, 1]
    assert "of heading open" in texts["smooth"][0]
    assert "grew" not in texts["smooth"][0]
    assert "speed are held" in texts["stops"][0]
