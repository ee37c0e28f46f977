"""``vehnav sensor``: simulated logs of a known sensor file, real logs, bad input, its file."""

from __future__ import annotations

import json
import math
import re
import sys
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from click.testing import CliRunner, Result

from tests.logs_for_tests import straight_log
from vehnav.cli.main import cli
from vehnav.config import Config
from vehnav.errors import ConfigError, LogError
from vehnav.export.recording import write_recording
from vehnav.logs.log import Imu, Log
from vehnav.mounting import c_bs_from_letters, right_handed_axes
from vehnav.noise import RestNoise, estimate, rest_noise
from vehnav.noise.earth import earth_rates
from vehnav.report.allan_plot import picture, write_allan_plot
from vehnav.sensors import CATALOGUE, load_sensor
from vehnav.sensors.likeness import likeness
from vehnav.simulate.generate import Setup, simulate_runs
from vehnav.units import DEG_PER_HOUR, DEG_PER_SQRT_HOUR, M_S_PER_SQRT_HOUR, MILLI_G

KNOWN = """[sensor]
arw = 0.3
gyro_bias = 50
gyro_bias_instability = 20
gyro_bias_time = 100
vrw = 0.06
accel_bias_instability = 0.3
accel_bias_time = 60
"""


def vehnav(*args: object) -> Result:
    return CliRunner().invoke(cli, [str(a) for a in args])


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sensor") / "known.toml"
    path.write_text(KNOWN, encoding="utf-8")
    return path


def runs_of(scenario: str, sensor: Path | str, *, runs: int, rate_hz: float) -> list[RestNoise]:
    setup = Setup(load_sensor(sensor), rate_hz=rate_hz)
    return [
        rest_noise(simulated.log(), Config(axes="RFU"))
        for simulated in simulate_runs(scenario, setup, seed=11, runs=runs)
    ]


# ---- simulated logs of a known sensor ----------------------------------------------------------


def test_an_hour_on_the_bench_gives_the_file_back(known) -> None:
    (noise,) = runs_of("static,duration=3600", known, runs=1, rate_hz=20.0)
    told = estimate(noise).told
    assert told["arw"].value / DEG_PER_SQRT_HOUR == pytest.approx(0.3, rel=0.05)
    assert told["vrw"].value / M_S_PER_SQRT_HOUR == pytest.approx(0.06, rel=0.05)
    assert told["gyro_bias_instability"].value / DEG_PER_HOUR == pytest.approx(20.0, rel=0.3)
    assert told["accel_bias_instability"].value / MILLI_G == pytest.approx(0.3, rel=0.3)
    # 50 deg/h drawn three times: rms between a quarter and twice
    assert 12.0 < told["gyro_bias"].value / DEG_PER_HOUR < 100.0


@pytest.mark.slow
def test_twenty_seeds_on_the_bench(known) -> None:
    """Noise within 10 % and bias instability within 30 % on 57 of 60 axes; the sigmas cover."""
    noises = runs_of("static,duration=3600", known, runs=20, rate_hz=20.0)
    for part, white, bias in (
        ("gyro", 0.3 * DEG_PER_SQRT_HOUR, 20.0 * DEG_PER_HOUR),
        ("accel", 0.06 * M_S_PER_SQRT_HOUR, 0.3 * MILLI_G),
    ):
        fits = [fit for noise in noises for fit in getattr(noise, part).fits]
        assert all(abs(fit.white.value / white - 1.0) < 0.1 for fit in fits)
        told = [fit.bias for fit in fits if fit.bias.value is not None]
        assert len(told) >= 57
        away = np.array([(x.value - bias) / bias for x in told])
        assert np.count_nonzero(np.abs(away) < 0.3) >= 0.9 * len(told)
        scaled = np.abs([(x.value - bias) / x.sigma for x in told])
        assert np.mean(scaled < 1.0) > 0.5
        assert np.mean(scaled < 2.0) > 0.85


@pytest.mark.slow
@pytest.mark.parametrize(("idle", "most"), [(0.0, 0.02), (1.0, 0.3)])
def test_a_city_drive_with_the_engine_off_and_running(idle, most) -> None:
    """mems-industrial at the lights: noise of the data sheet, and nothing slower than it.

    The engine of the simulator shakes at 0.6 to 3.4 Hz too, which is where the noise is read.
    """
    noises = runs_of(f"city,duration=400,idle={idle}", "mems-industrial", runs=8, rate_hz=100.0)
    for key, truth in (
        ("arw", CATALOGUE["mems-industrial"].gyro.noise),
        ("vrw", CATALOGUE["mems-industrial"].accel.noise),
    ):
        for noise in noises:
            assert estimate(noise).told[key].value == pytest.approx(truth, rel=most)
    untold = [estimate(noise).untold for noise in noises]
    assert np.mean(["gyro_bias_instability" in u for u in untold]) > 0.7


# ---- the file ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def city(sample_logs, tmp_path_factory: pytest.TempPathFactory) -> tuple[Result, Path]:
    path = tmp_path_factory.mktemp("city") / "ours.toml"
    return vehnav("sensor", sample_logs / "city.mcap", "-o", path), path


def test_the_screen_and_the_file(city) -> None:
    result, path = city
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert max(map(len, lines)) <= 100
    assert len(lines) < 45
    for part in ("rests, ", "gyro ", "accelerometer ", "deg/sqrt(h)", "m/s/sqrt(h)", "not told",
                 "looks like mems-industrial", "idling engine", f"written    {path}"):  # fmt: skip
        assert part in result.stdout
    # the sample log is of mems-industrial: 0.5 deg/sqrt(h), 0.1 m/s/sqrt(h)
    sensor = load_sensor(path)
    assert sensor.name == "city"
    assert sensor.gyro.noise / DEG_PER_SQRT_HOUR == pytest.approx(0.5, rel=0.1)
    assert sensor.accel.noise / M_S_PER_SQRT_HOUR == pytest.approx(0.1, rel=0.1)
    # what a rest cannot tell is of the grade, and marked
    assert sensor.gyro.scale == CATALOGUE["mems-industrial"].gyro.scale
    text = path.read_text(encoding="utf-8")
    assert re.search(r"^gyro_sf = 3000  # ppm; not measured: of mems-industrial", text, re.M)
    assert re.search(r"^arw = 0\.\d+  # deg/sqrt\(h\); measured, \+- ", text, re.M)
    assert "# Not told: gyro bias instability: under " in text


def test_run_and_simulate_take_the_file(city, sample_logs, tmp_path) -> None:
    _, path = city
    log, out = tmp_path / "again.csv", tmp_path / "out"
    made = vehnav("simulate", "static,duration=60", "--sensor", path, "-o", log)
    assert made.exit_code == 0, made.output
    done = vehnav("sensor", log, "--json")
    assert done.exit_code == 0, done.output
    found, truth = json.loads(done.stdout), load_sensor(path)
    assert found["told"]["arw"]["value"] == pytest.approx(
        truth.gyro.noise / DEG_PER_SQRT_HOUR, rel=0.1
    )
    source = sample_logs / "city.mcap"
    assert vehnav("run", source, "--sensor", path, "--out-dir", out).exit_code == 0


def test_json_is_one_document(known, tmp_path) -> None:
    log = write_recording(straight_log(), tmp_path / "drive.csv")[0]
    plot = tmp_path / "allan.svg"
    result = vehnav("sensor", log, "--json", "--sensor-name", "my unit", "--plot", plot)
    found = json.loads(result.stdout)
    assert found["version"] == 1
    assert found["written"] == [str(plot)]
    assert plot.is_file()
    assert found["rest"]["total_s"] == pytest.approx(60.0, abs=12.0)  # three stops of 20 s
    assert len(found["rest"]["pieces"]) == 3
    assert found["sensor"]["name"] == "my unit"
    assert tomllib.loads(found["sensor"]["toml"])["sensor"]["name"] == "my unit"
    # straight_log: 0.05 deg/s and 0.02 m/s2 a sample at 100 Hz
    for axis in "xyz":
        assert found["gyro"]["axes"][axis]["arw"]["value"] == pytest.approx(
            0.05 * 0.1 * 60.0, rel=0.1
        )
        assert found["accel"]["axes"][axis]["vrw"]["value"] == pytest.approx(
            0.02 * 0.1 * 60.0, rel=0.1
        )
    assert found["grades"][0]["factor"] <= found["grades"][1]["factor"]


def test_the_bias_is_without_the_earth_rate() -> None:
    """20 deg/h on z, up, latitude 51.6 deg: the Earth turns by 11.8 deg/h about it, 9.3 north."""
    bias = (5.0 * DEG_PER_HOUR, 0.0, 20.0 * DEG_PER_HOUR)
    log = straight_log(gyro_bias=bias, noise=0.02)
    noise = rest_noise(log, Config(axes="RFU"))
    assert noise.headings == 3
    np.testing.assert_allclose(noise.gyro_bias / DEG_PER_HOUR, [5.0, 0.0, 20.0], atol=0.6)
    assert np.all(noise.gyro_bias_sigma / DEG_PER_HOUR < 0.6)
    assert log.imu is not None
    without = rest_noise(Log("no_gps.csv", log.imu), Config(axes="RFU"))
    assert without.headings == 0
    # anywhere on Earth, any heading: a third of the square on each axis, three rests
    expected = 15.041 / math.sqrt(3.0) / math.sqrt(3.0)
    assert without.gyro_bias_sigma[0] / DEG_PER_HOUR == pytest.approx(expected, rel=0.01)


def test_headings_at_the_lights_are_the_true_ones() -> None:
    """A city drive of a tactical sensor: its bias of 1 deg/h is found under 15 of the Earth."""
    setup = Setup(load_sensor("hg1700"), rate_hz=50.0)
    (made,) = simulate_runs("city,duration=500,idle=0", setup, seed=3, runs=1)
    log = made.log()
    noise = rest_noise(log, Config(axes="RFU"))
    samples = noise.searches[0].samples
    c_gyro, _ = samples.orientation.matrices()
    spans = [tuple(np.searchsorted(samples.t, piece)) for piece in noise.pieces]
    spans = [(int(a), int(b) - 1) for a, b in spans]
    found = earth_rates(log, samples, spans, c_gyro)
    c_nb = made.truth.c_nb[[a for a, _ in spans]]
    true = np.arctan2(c_nb[:, 0, 1], c_nb[:, 1, 1])  # of the forward axis, clockwise from north
    known = np.isfinite(found.headings)
    assert np.count_nonzero(known) >= len(spans) - 1
    away = np.degrees(np.angle(np.exp(1j * (found.headings[known] - true[known]))))
    assert np.max(np.abs(away)) < 6.0  # HEADING is 3 deg, one sigma
    error = noise.gyro_bias - made.errors.gyro_bias
    assert np.all(np.abs(error) < 3.0 * noise.gyro_bias_sigma)
    assert np.all(noise.gyro_bias_sigma < 1.2 * DEG_PER_HOUR)


def test_axes_are_the_sensors_own() -> None:
    """Gyro x ten times noisier; the case sits z forward in the car."""
    log = straight_log(axes="RFU")
    assert log.imu is not None
    rng = np.random.default_rng(1)
    gyro = log.imu.gyro.copy()
    gyro[:, 1] += np.radians(0.5) * rng.standard_normal(gyro.shape[0])
    turned = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # s: x = f, y = u, z = r
    imu = Imu(log.imu.t_ns, gyro @ turned.T, log.imu.accel @ turned.T, axes="FUR")
    found = rest_noise(Log("turned.csv", imu, log.gnss), Config(axes="FUR", stop_threshold=1.5))
    white = [fit.white.value for fit in found.gyro.fits]
    assert white[0] > 5.0 * max(white[1:])


@pytest.mark.parametrize("up", ["+x", "-x", "+y", "-y", "-z"])
def test_on_the_bench_any_side_may_be_up(up) -> None:
    """An MCAP file declares FLU; a case on its side contradicts it, and nobody drives."""
    log = straight_log(seconds=16.0, gps=False)
    assert log.imu is not None
    turn = next(m for m in sides() if np.argmax(np.abs(m[:, 2])) == "xyz".index(up[1])
                and m[:, 2].sum() == float(up[0] + "1"))  # fmt: skip
    imu = Imu(log.imu.t_ns, log.imu.gyro @ turn.T, log.imu.accel @ turn.T, axes="FLU")
    noise = rest_noise(Log("bench.mcap", imu), Config())
    for fit in noise.gyro.fits:
        assert fit.white.value == pytest.approx(np.radians(0.05) * 0.1, rel=0.1)
    assert "axes-unverified" not in [f.code for f in noise.findings]


def test_a_hole_cuts_the_log_and_nothing_more() -> None:
    """30 s without IMU while it drives: the rests on both sides count, on one clock."""
    log = straight_log(gyro_bias=(0.0, 0.0, 30.0 * DEG_PER_HOUR), noise=0.1)
    assert log.imu is not None
    t = (log.imu.t_ns - log.imu.t_ns[0]) * 1e-9
    kept = (t < 95.0) | (t > 125.0)
    imu = Imu(log.imu.t_ns[kept], log.imu.gyro[kept], log.imu.accel[kept], axes="RFU")
    whole = rest_noise(log, Config(axes="RFU"))
    cut = rest_noise(Log("cut.csv", imu, log.gnss), Config(axes="RFU"))
    assert len(cut.searches) == 2
    assert len(cut.pieces) == len(whole.pieces) == 3
    np.testing.assert_allclose(cut.pieces[:, 0], whole.pieces[:, 0], atol=1.0)
    assert cut.gyro_bias[2] / DEG_PER_HOUR == pytest.approx(30.0, abs=2.0)


def sides() -> list[np.ndarray]:
    """Turns of a case onto its sides: the third column is where up goes."""
    return [c_bs_from_letters(letters).T for letters in right_handed_axes()]


# ---- likeness ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [n for n in CATALOGUE if n != "ideal"])
def test_every_grade_is_most_like_itself(name) -> None:
    grade = CATALOGUE[name]
    figures = {"arw": grade.gyro.noise, "vrw": grade.accel.noise, "gyro_bias": grade.gyro.bias}
    found = likeness(figures)
    assert found[0].name == name
    assert found[0].factor == pytest.approx(1.0)
    doubled = likeness({key: 2.0 * value for key, value in figures.items()})
    again = next(row for row in doubled if row.name == name)
    assert again.factor == pytest.approx(2.0)
    assert set(again.ratios.values()) == {2.0}


# ---- trouble -----------------------------------------------------------------------------------


def moving_log() -> Log:
    log = straight_log()
    assert log.imu is not None
    inside = slice(2300, 5700)
    imu = Imu(log.imu.t_ns[inside], log.imu.gyro[inside], log.imu.accel[inside], axes="RFU")
    return Log("moving.csv", imu, log.gnss)


def test_no_rest_says_what_to_do() -> None:
    with pytest.raises(LogError, match=r"never stands.*quietest moment.*stand for half a minute"):
        rest_noise(moving_log(), Config(axes="RFU"))


def test_a_short_rest_says_how_long_it_must_be() -> None:
    """It stands until 20 s; the window of the search needs a second to fill."""
    with pytest.raises(LogError, match=r"longest rest, at 18\.3 s, lasts .* 3 s are needed"):
        rest_noise(straight_log(), Config(axes="RFU", start=17.0, end=50.0))


def test_fifteen_seconds_tell_noise_and_say_so_of_the_rest(tmp_path) -> None:
    log = write_recording(straight_log(seconds=16.0), tmp_path / "short.csv")[0]
    result = vehnav("sensor", log)
    assert result.exit_code == 0, result.output
    said = " ".join(result.stdout.split())
    assert "gyro bias instability: the longest rest, 13 s, is too short" in said


def test_a_dead_axis_is_said(tmp_path) -> None:
    log = straight_log()
    assert log.imu is not None
    gyro = np.round(log.imu.gyro / 0.02) * 0.02  # counts of over a degree a second
    noise = rest_noise(
        Log("coarse.csv", Imu(log.imu.t_ns, gyro, log.imu.accel, axes="RFU"), log.gnss),
        Config(axes="RFU"),
    )
    assert [f.code for f in noise.findings].count("dead-axis") == 1
    found = estimate(noise)
    assert found.untold["arw"] == "the readings do not change at rest"
    assert "arw" not in found.told
    assert found.told["vrw"].value > 0.0


@pytest.mark.parametrize(
    ("args", "says"),
    [
        (["-o", "ours.csv"], "a sensor file ends in .toml"),
        (["--plot", "allan.gif"], "a plot ends in .svg, .html, .png, .pdf"),
        (["--start", "500"], "at least 5 s are needed"),
    ],
)
def test_bad_options_are_exit_2(args, says, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    log = write_recording(straight_log(seconds=16.0), tmp_path / "short.csv")[0]
    result = vehnav("sensor", log, *args)
    assert result.exit_code == 2
    assert says in result.stderr
    assert list(tmp_path.glob("ours*")) + list(tmp_path.glob("allan*")) == []


def test_a_name_cannot_break_the_file(stood) -> None:
    text = estimate(stood, name='a"b\n[x]\\').text
    assert tomllib.loads(text)["sensor"]["name"] == 'a"b_[x]\\'


def test_one_sample_a_second_is_refused(shared_data) -> None:
    result = vehnav("sensor", next((shared_data / "boston_ramirez_1hz").glob("*imu*.csv")))
    assert result.exit_code == 2
    assert "1.00 Hz" in result.stderr


# ---- plots -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def stood() -> RestNoise:
    return rest_noise(straight_log(), Config(axes="RFU"))


@pytest.mark.parametrize("suffix", ["svg", "html", "png", "pdf"])
def test_plots(suffix, stood, tmp_path) -> None:
    path = tmp_path / f"allan.{suffix}"
    write_allan_plot(stood, estimate(stood), path)
    content = path.read_bytes()
    start = {"svg": b"<svg", "html": b"<!doctype html>", "png": b"\x89PNG", "pdf": b"%PDF"}
    assert content.startswith(start[suffix])
    if suffix in ("svg", "html"):
        text = content.decode()
        assert "nan" not in text.lower().replace("nano", "")
        for name in "xyz":
            assert f'class="a-{name}"' in text
        assert "http:" not in text.replace("http://www.w3.org/2000/svg", "")
        assert "https:" not in text
    if suffix == "svg":
        drawn = ElementTree.fromstring(content)
        assert drawn.tag.endswith("svg")


def test_the_line_of_the_plot_is_the_noise(stood) -> None:
    """0.05 deg/s a sample at 100 Hz: 18 deg/h at 1 s, where the middle of the line must be."""
    item = picture(stood, "gyro")
    for line in item.lines:
        assert np.interp(0.0, np.log(line.fit_tau), line.fit) == pytest.approx(18.0, rel=0.1)
        assert np.all(line.low < line.value)
        assert np.all(line.value < line.high)


def test_plot_without_matplotlib_says_how(stood, tmp_path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ConfigError, match=r"vehnav\[plots\]"):
        write_allan_plot(stood, estimate(stood), tmp_path / "a.png")


# ---- real logs ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("log", "gyro", "accel"),
    [
        # noise of a sample at rest of its README, over the root of the rate, by a factor of three
        (
            "boston_apan/driving.mcap",
            0.045 / math.sqrt(40.0) * 60.0,
            0.017 / math.sqrt(40.0) * 60.0,
        ),
        ("mcap_by_others/rhoque_car_circles.mcap", None, None),
        ("drive_0708/drive_0708.mcap", None, None),
    ],
)
def test_real_logs(log, gyro, accel, shared_data) -> None:
    result = vehnav("sensor", shared_data / log, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    arw, vrw = found["told"]["arw"], found["told"]["vrw"]
    # no MEMS of a car is outside of these
    assert 0.05 < arw["value"] < 6.0
    assert 0.01 < vrw["value"] < 1.0
    if gyro is not None:
        assert arw["value"] == pytest.approx(gyro, rel=0.2)
        assert vrw["value"] == pytest.approx(accel, rel=0.2)
    assert found["grades"][0]["name"].startswith("mems") or found["grades"][0]["factor"] < 4.0
