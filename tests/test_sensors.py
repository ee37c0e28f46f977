"""Sensor grades and their errors, judged by scipy filters, closed forms and statistics."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from vehnav.errors import ConfigError
from vehnav.sensors import (
    CATALOGUE,
    FIELDS,
    Sensor,
    Triad,
    corrupt,
    draw_errors,
    load_sensor,
    no_errors,
    run_rngs,
    sensor_toml,
)
from vehnav.sensors.processes import decay_recursion, low_pass, markov, random_walk

ARCSEC_PER_HOUR = math.pi / 648000.0 / 3600.0  # rad/s
FOOT = 0.3048


# ---- catalogue and files -----------------------------------------------------------------------


def test_hg1700_is_the_published_one():
    s = load_sensor("HG1700")
    assert s.gyro.bias == pytest.approx(4.8481e-6, rel=1e-4)  # NavToolkit prints these four in SI
    assert s.gyro.noise == pytest.approx(3.6361e-5, rel=1e-4)
    assert s.accel.bias == pytest.approx(9.81e-3, rel=1e-3)  # with g = 9.81 there
    assert s.accel.noise == pytest.approx(0.065 * FOOT / 60.0, rel=0.01)  # 0.02 is rounded
    assert (s.gyro.scale, s.accel.scale) == (pytest.approx(150e-6), pytest.approx(300e-6))
    assert s.gyro.misalignment == s.accel.misalignment == pytest.approx(1e-4)


def test_l3g4200d_noise_is_that_of_paper_004():
    s = load_sensor("l3g4200d")
    assert s.gyro.noise == pytest.approx(math.radians(0.03))  # rad/s/sqrt(Hz)
    assert s.accel.noise == pytest.approx(218e-6 * 9.80665, rel=1e-4)


@pytest.mark.parametrize("name", [n for n in CATALOGUE if n != "ideal"])
def test_every_figure_has_a_source(name):
    sensor, plain = CATALOGUE[name], Sensor("")
    for key, place in FIELDS.items():
        part, default = (
            s if place.part == "sensor" else getattr(s, place.part) for s in (sensor, plain)
        )
        if getattr(part, place.attribute) != getattr(default, place.attribute):
            assert sensor.sources[key]


@pytest.mark.parametrize("name", list(CATALOGUE))
def test_written_and_read_back(name, tmp_path):
    path = tmp_path / "sensor.toml"
    path.write_text(sensor_toml(CATALOGUE[name]), encoding="utf-8")
    back = load_sensor(path)
    assert back.name == name
    for part in ("gyro", "accel"):
        for attribute, value in vars(getattr(CATALOGUE[name], part)).items():
            assert getattr(getattr(back, part), attribute) == pytest.approx(value, rel=1e-8)


@pytest.mark.parametrize(
    "name",
    [
        '7" rack',
        "C:\\new\\unit",
        "a\nb\tc",
        "\x00\x1b\x7f\x85\u2028",
        "Gerät 日 \U0001f697",
        "#]=",
        "",
    ],
)
def test_any_name_and_source_is_written_and_read_back(name, tmp_path):
    path = tmp_path / "sensor.toml"
    sensor = replace(CATALOGUE["hg1700"], name=name)
    sensor = replace(sensor, sources=dict.fromkeys(sensor.sources, name))
    path.write_text(sensor_toml(sensor), encoding="utf-8", newline="\n")
    back = load_sensor(path)
    assert back.name == name
    assert back.gyro.bias == pytest.approx(sensor.gyro.bias)


def test_a_name_that_is_no_unicode_is_still_written(tmp_path):
    """As a file name may be that is not UTF-8."""
    text = sensor_toml(replace(CATALOGUE["hg1700"], name="drive_\udcff"))
    assert tomllib.loads(text.encode("utf-8").decode())["sensor"]["name"] == "drive_?"


def test_file_on_top_of_a_grade(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('[sensor]\nbase = "hg1700"\ngyro_bias = 2\nstop_threshold = 0.1\n')
    s = load_sensor(path)
    assert s.name == "mine"
    assert s.gyro.bias == pytest.approx(2.0 * math.radians(1.0) / 3600.0)
    assert s.stop_threshold == pytest.approx(math.radians(0.1))
    assert s.accel == CATALOGUE["hg1700"].accel
    assert s.sources["gyro_bias"] == "mine.toml"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[sensor]\ngyro_bais = 1\n", "did you mean 'gyro_bias'"),
        ("[sensor]\ngyro_bias = -1\n", "gyro_bias must be a number >= 0"),
        ("[sensor]\ngyro_bias = true\n", "must be a number"),
        ("[sensor]\ngyro_bias = nan\n", "must be a number"),
        ('[sensor]\nbase = "hg1701"\n', "not in the catalogue"),
        ("[other]\n", r"no table \[sensor\]"),
        ("[sensor\n", "not a readable TOML"),
    ],
)
def test_bad_files(text, says, tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=says) as error:
        load_sensor(path)
    assert "bad.toml" in str(error.value)


def test_bad_names(tmp_path):
    with pytest.raises(ConfigError, match="did you mean 'hg1700'"):
        load_sensor("hg170")
    with pytest.raises(ConfigError, match="no such sensor file"):
        load_sensor(tmp_path / "none.toml")


# ---- draws -------------------------------------------------------------------------------------

ALL = Sensor(
    "all",
    Triad(bias=2.0, scale=0.3, misalignment=0.05),
    Triad(bias=5.0, scale=0.7, misalignment=0.01),
    g_sensitivity=0.2,
)


def test_draws_have_their_sigmas():
    runs = 2000
    e = draw_errors(ALL, run_rngs(3, runs))
    assert e.gyro_matrix.shape == (runs, 3, 3)
    off = ~np.eye(3, dtype=bool)
    diagonal = np.eye(3, dtype=bool)
    # 6000 numbers: the sd of a sample sd is 0.9 %; four of them
    for values, sigma in (
        (e.gyro_bias, 2.0),
        (e.accel_bias, 5.0),
        (e.gyro_matrix[:, diagonal], 0.3),
        (e.gyro_matrix[:, off], 0.05),
        (e.accel_matrix[:, diagonal], 0.7),
        (e.accel_matrix[:, off], 0.01),
        (e.g_sensitivity, 0.2),
    ):
        assert np.std(values) == pytest.approx(sigma, rel=0.04)
        assert abs(np.mean(values)) < 0.055 * sigma


def test_run_k_does_not_hang_on_the_number_of_runs():
    many, one = draw_errors(ALL, run_rngs(5, 4)), draw_errors(ALL, run_rngs(5, 9)[2])
    np.testing.assert_array_equal(many.accel_matrix[2], one.accel_matrix)
    assert not np.array_equal(many.accel_matrix[1], one.accel_matrix)


# ---- processes ---------------------------------------------------------------------------------


@pytest.mark.parametrize("a", [0.999, 0.8, 1e-5])
def test_recursion_is_scipys_filter(a):
    drive = np.random.default_rng(1).standard_normal((5000, 3))
    x = decay_recursion(np.full(5000, -math.log(a)), drive)
    np.testing.assert_allclose(x, lfilter([1.0], [1.0, -a], drive, axis=0), atol=1e-9)


def test_recursion_with_uneven_steps():
    rng = np.random.default_rng(2)
    decay, drive = rng.uniform(0.0, 3.0, 400), rng.standard_normal((2, 400, 3))
    expected = np.empty_like(drive)
    state = np.zeros((2, 3))
    for k in range(400):
        state = math.exp(-decay[k]) * state + drive[:, k]
        expected[:, k] = state
    np.testing.assert_allclose(decay_recursion(decay, drive), expected, atol=1e-9)


@pytest.mark.parametrize("bandwidth", [0.5, 20.0])
def test_low_pass_is_scipys_filter_and_reaches_1_minus_1_over_e(bandwidth):
    t = np.arange(3000) * 0.01
    x = np.random.default_rng(3).standard_normal((3000, 3))
    a = math.exp(-2.0 * math.pi * bandwidth * 0.01)
    start = a * x[:1]  # settled on the first sample
    expected, _ = lfilter([1.0 - a], [1.0, -a], x, axis=0, zi=start)
    np.testing.assert_allclose(low_pass(t, x, bandwidth=bandwidth), expected, atol=1e-9)


def test_markov_correlation_and_sigma():
    t = np.arange(400_000) * 0.1
    x = markov(t, sigma=2.0, time=5.0, rng=np.random.default_rng(4))
    assert np.std(x) == pytest.approx(2.0, rel=0.03)  # 8000 correlation times x 3
    lag = 50  # 5 s: exp(-1)
    assert np.mean(x[lag:] * x[:-lag]) / np.var(x) == pytest.approx(math.exp(-1.0), abs=0.03)
    begin = markov(t[:2], sigma=2.0, time=5.0, rng=run_rngs(1, 3000))[:, 0]
    assert np.std(begin) == pytest.approx(2.0, rel=0.05)  # stationary at once


def test_random_walk_grows_with_the_root_of_time():
    t = np.cumsum(np.random.default_rng(5).uniform(0.5, 1.5, 100))
    x = random_walk(t, sigma=0.3, rng=run_rngs(6, 2000))
    assert np.all(x[:, 0] == 0.0)
    assert np.std(x[:, -1]) == pytest.approx(0.3 * math.sqrt(t[-1] - t[0]), rel=0.05)


# ---- application -------------------------------------------------------------------------------

T = np.arange(1000) * 0.02
OMEGA = np.stack([0.1 * np.sin(T), 0.2 * np.cos(T), 0.0 * T + 0.05], axis=-1)
FORCE = np.stack([np.cos(T), np.sin(2.0 * T), 9.8 + 0.0 * T], axis=-1)


def test_perfect_sensor_changes_nothing():
    m = corrupt(
        OMEGA,
        FORCE,
        t=T,
        sensor=CATALOGUE["ideal"],
        errors=no_errors(),
        rng=np.random.default_rng(0),
        sampling="rates",
    )
    np.testing.assert_array_equal(m.gyro, OMEGA)
    np.testing.assert_array_equal(m.accel, FORCE)
    assert m.saturated == 0


@pytest.mark.parametrize("sampling", ["rates", "increments"])
def test_constant_errors_are_the_linear_model(sampling):
    e = draw_errors(ALL, np.random.default_rng(7))
    scale = 0.02 if sampling == "increments" else 1.0
    m = corrupt(
        OMEGA * scale,
        FORCE * scale,
        t=T,
        sensor=Sensor("quiet"),
        errors=e,
        rng=np.random.default_rng(0),
        sampling=sampling,
    )
    for k in (0, 137, 999):
        omega = OMEGA[k] + e.gyro_matrix @ OMEGA[k] + e.gyro_bias + e.g_sensitivity @ FORCE[k]
        force = FORCE[k] + e.accel_matrix @ FORCE[k] + e.accel_bias
        np.testing.assert_allclose(m.gyro[k], scale * omega, rtol=1e-12)
        np.testing.assert_allclose(m.accel[k], scale * force, rtol=1e-12)


@pytest.mark.parametrize("sampling", ["rates", "increments"])
def test_white_noise_is_the_random_walk_of_the_integral(sampling):
    sensor = Sensor("noisy", Triad(noise=0.01), Triad(noise=0.2))
    zero = np.zeros((1000, 3))
    m = corrupt(
        zero,
        zero,
        t=T,
        sensor=sensor,
        errors=no_errors(),
        rng=run_rngs(8, 1000),
        sampling=sampling,
    )
    step = 0.02 if sampling == "rates" else 1.0
    for x, sigma in ((m.gyro, 0.01), (m.accel, 0.2)):
        total = x.sum(axis=1) * step  # over 20 s; 3000 numbers: 1.3 % sd
        assert np.std(total) == pytest.approx(sigma * math.sqrt(20.0), rel=0.05)


def test_counts_range_and_carried_rounding():
    sensor = Sensor("coarse", Triad(quantisation=0.01, full_scale=0.15), Triad(quantisation=0.5))
    kw = {"t": T, "sensor": sensor, "errors": no_errors(), "rng": np.random.default_rng(0)}
    m = corrupt(OMEGA, FORCE, sampling="rates", **kw)
    counts = m.gyro / 0.01
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-9)
    assert np.max(np.abs(m.gyro)) <= 0.15 + 1e-12
    assert m.saturated == np.count_nonzero(np.abs(OMEGA) > 0.15)
    inside = np.abs(OMEGA) <= 0.15
    assert np.max(np.abs(m.gyro - OMEGA)[inside]) <= 0.005 + 1e-12
    small = corrupt(OMEGA * 0.02 * 0.7, FORCE * 0.02, sampling="increments", **kw)
    drift = np.cumsum(small.gyro, axis=0) - np.cumsum(OMEGA * 0.02 * 0.7, axis=0)
    assert np.max(np.abs(drift)) <= 0.5 * 0.01 * 0.02 + 1e-12  # half a count for ever


def test_bandwidth_is_minus_3_db_and_45_degrees():
    t = np.arange(20_000) * 0.0005
    wave = np.sin(2.0 * math.pi * 5.0 * t)[:, None] * np.ones(3)
    sensor = Sensor("slow", Triad(bandwidth=5.0), Triad())
    m = corrupt(
        wave,
        wave,
        t=t,
        sensor=sensor,
        errors=no_errors(),
        rng=np.random.default_rng(0),
        sampling="rates",
    )
    late = slice(4000, None)  # 2 s: the start has died away; whole periods
    phasor = 2.0 * np.mean(m.gyro[late, 0] * np.exp(-2j * math.pi * 5.0 * t[late]))
    assert abs(phasor) == pytest.approx(math.sqrt(0.5), rel=0.01)  # samples every 0.9 deg
    assert np.angle(phasor) == pytest.approx(-0.75 * math.pi, abs=0.02)  # sine: -90, lag: 45
    np.testing.assert_array_equal(m.accel, wave)


def test_slow_processes_reach_the_output():
    sensor = Sensor("drifting", Triad(bias_instability=3.0, bias_time=1e9), Triad(walk=0.5))
    zero = np.zeros((1000, 3))
    m = corrupt(
        zero,
        zero,
        t=T,
        sensor=sensor,
        errors=no_errors(),
        rng=run_rngs(9, 1500),
        sampling="rates",
    )
    assert np.std(m.gyro[:, 500]) == pytest.approx(3.0, rel=0.05)
    np.testing.assert_allclose(m.gyro[:, 0], m.gyro[:, -1], atol=0.01)  # frozen for 1e9 s
    assert np.std(m.accel[:, -1]) == pytest.approx(0.5 * math.sqrt(T[-1]), rel=0.05)
