"""GPS and wheel speed: statistics, latency, outages; and runs that draw from their own streams."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from vehnav.earth import position_difference
from vehnav.errors import ConfigError
from vehnav.sensors import load_sensor
from vehnav.simulate import GnssModel, Setup, WheelModel, simulate, simulate_runs, stamps
from vehnav.simulate.receivers import repeated_outages, simulate_gnss
from vehnav.trajectory import interpolate_positions

PERFECT = GnssModel(noise=0.0, drift=0.0, velocity_noise=0.0)


def make(scenario="straight,duration=200", **options):
    options.setdefault("rate_hz", 20.0)
    return simulate(scenario, sensor="ideal", **options)


def test_perfect_fixes_lie_on_the_truth():
    run = make(gnss=PERFECT)
    k = np.searchsorted(run.truth.t_ns, run.gnss.t_ns)
    np.testing.assert_allclose(run.gnss.lat, run.truth.lat[k], atol=1e-15)
    np.testing.assert_allclose(run.gnss.height, run.truth.height[k], atol=1e-9)
    np.testing.assert_allclose(run.gnss.v_n, run.truth.v_n[k], atol=1e-12)
    assert run.gnss.t_ns.size == 201


def test_noise_is_white_plus_markov():
    t_ns = stamps(40_000.0, 0.1)
    run = make("static,duration=40000", rate_hz=0.1)
    model = GnssModel(rate_hz=1.0, noise=2.0, drift=3.0, drift_time=20.0, velocity_noise=0.1)
    g = simulate_gnss(run.truth, model, np.random.default_rng(1))
    assert t_ns[-1] == run.truth.t_ns[-1]
    lat, lon, height = interpolate_positions(run.truth, g.t_ns)
    error = np.concatenate(
        [
            position_difference(g.lat, g.lon, lat, lon, height),
            (g.height - height)[:, None] / model.up_factor,
        ],
        axis=1,
    )
    # 2000 correlation times and 3 axes: 3 % is two standard deviations
    assert np.std(error) == pytest.approx(math.hypot(2.0, 3.0), rel=0.03)
    lag = np.mean(error[20:] * error[:-20])
    assert lag == pytest.approx(9.0 * math.exp(-1.0), rel=0.15)
    assert np.std(g.v_n[:, :2]) == pytest.approx(0.1, rel=0.02)
    np.testing.assert_allclose(g.sigma_pos[0], math.hypot(2.0, 3.0) * np.array([1, 1, 1.6]))


def test_latency_stamps_old_positions():
    run = make(gnss=GnssModel(noise=0.0, drift=0.0, latency=0.6))
    lat, _, _ = interpolate_positions(run.truth, run.gnss.t_ns - 600_000_000)
    np.testing.assert_allclose(run.gnss.lat, lat, atol=1e-14)
    assert run.gnss.t_ns[-1] <= run.truth.t_ns[-1]


def test_outages_take_fixes_out_and_change_no_other():
    outages = ((30.0, 50.0), (100.0, 120.5))
    full, cut = make(gnss=GnssModel()), make(gnss=GnssModel(outages=outages))
    second = (full.gnss.t_ns - full.truth.t_ns[0]) * 1e-9
    kept = ~np.any([(second >= a) & (second < b) for a, b in outages], axis=0)
    np.testing.assert_array_equal(cut.gnss.t_ns, full.gnss.t_ns[kept])
    np.testing.assert_array_equal(cut.gnss.lat, full.gnss.lat[kept])
    assert repeated_outages(every=60.0, length=10.0, start=20.0, duration=150.0) == (
        (20.0, 30.0),
        (80.0, 90.0),
        (140.0, 150.0),
    )


def test_wheel_speed():
    model = WheelModel(rate_hz=5.0, noise=0.0, scale=0.02, quantisation=0.0)
    run = make(wheel=model)
    k = np.searchsorted(run.truth.t_ns, run.speed.t_ns)
    true = np.linalg.norm(run.truth.v_n[k], axis=1)
    # the body pitches by up to 0.8 deg while speeding up: cosine 1e-4
    np.testing.assert_allclose(run.speed.speed, 1.02 * true, atol=2e-3)
    counted = make(wheel=WheelModel(noise=0.0, scale=0.0, quantisation=0.5)).speed.speed
    np.testing.assert_allclose(np.remainder(counted, 0.5), 0.0, atol=1e-12)


# ---- runs --------------------------------------------------------------------------------------


def runs(count, **options):
    setup = Setup(sensor=load_sensor("mems-tactical"), rate_hz=20.0, **options)
    return list(simulate_runs("straight,duration=100,last_stop=0", setup, seed=4, runs=count))


def test_runs_share_the_truth_and_differ_in_errors():
    a, b = runs(2)
    assert a.truth is b.truth
    assert not np.array_equal(a.imu.gyro, b.imu.gyro)
    assert not np.array_equal(a.gnss.lat, b.gnss.lat)
    again = runs(3)
    for one, other in zip((a, b), again, strict=False):
        np.testing.assert_array_equal(one.imu.accel, other.imu.accel)


def test_gps_options_do_not_change_the_imu():
    a, b = runs(1)[0], runs(1, gnss=None, wheel=WheelModel())[0]
    np.testing.assert_array_equal(a.imu.gyro, b.imu.gyro)
    assert b.gnss is None
    assert b.log().speed is not None


def test_saturation_is_found():
    run = simulate("city,duration=200", sensor="l3g4200d", rate_hz=50.0, seed=1)
    assert run.findings == ()
    weak = load_sensor("ideal")
    weak = replace(weak, gyro=replace(weak.gyro, full_scale=math.radians(5.0)))
    run = simulate("city,duration=200", sensor=weak, rate_hz=50.0)
    assert [f.code for f in run.findings] == ["saturated"]
    assert (
        str(np.count_nonzero(np.abs(run.ideal.gyro) > weak.gyro.full_scale)) in run.findings[0].text
    )


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"rate_hz": 0.0}, "must be positive"),
        ({"rate_hz": 0.001}, "less than two samples"),
        ({"rate_hz": 1e6}, r"600 million samples, .* at most 20 million .* 20 s at this rate"),
        ({"rate_hz": 1e308}, "samples, of about 1 kB of memory each"),
        ({"sensor": "hg17"}, "catalogue"),
    ],
)
def test_refused(options, says):
    with pytest.raises(ConfigError, match=says):
        simulate("straight", **options)
    with pytest.raises(ConfigError, match="runs must be"):
        runs(0)
