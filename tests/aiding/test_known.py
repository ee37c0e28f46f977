"""``--sensor`` in the filter: what of a file counts, and that a run reads it once."""

from __future__ import annotations

import pickle

import pytest

import vehnav.sensors
from tests.logs_for_tests import straight_log
from vehnav.aiding.known import with_sensor
from vehnav.aiding.land import Tuning
from vehnav.aiding.vehicle import MEMS
from vehnav.config import Config
from vehnav.pipeline import run
from vehnav.sensors import CATALOGUE, load_sensor

BY_GRADE = Tuning("mems", "as told", MEMS, 1e-3, 0.05, 0.005, 0.02)


def test_figures_of_the_file_replace_those_of_the_grade() -> None:
    tuning = with_sensor(BY_GRADE, name="ours", gyro_noise=1e-4, accel_walk=2e-5)
    # four times the noise at rest, as the stop methods take it; the walk as it is
    assert tuning.noise.gyro == pytest.approx(4e-4)
    assert tuning.noise.accel_walk == 2e-5
    assert tuning.noise._replace(gyro=MEMS.gyro, accel_walk=MEMS.accel_walk) == MEMS
    assert "sensor ours" in tuning.reason
    assert (tuning.gyro_prior, tuning.accel_prior) == (1e-3, 0.05)


def test_a_file_without_noise_changes_nothing() -> None:
    assert with_sensor(BY_GRADE, name="ideal").noise == MEMS


def test_the_run_says_whose_noise_it_took(tmp_path) -> None:
    log = straight_log(rate=50.0)
    told = {}
    for sensor in (None, "hg1700"):
        found = run(log, Config(axes="RFU", method="filter", sensor=sensor))
        told[sensor] = found.aided.tuning.reason
    assert "sensor" not in told[None]
    assert "white noise and bias walk of sensor hg1700" in told["hg1700"]
    codes = [f.code for f in run(log, Config(axes="RFU", sensor="hg1700")).findings]
    assert codes.count("sensor-noise") == 1
    assert "sensor-noise" not in [f.code for f in run(log, Config(axes="RFU")).findings]


@pytest.mark.parametrize("method", ["stops", "filter"])
def test_a_run_reads_the_file_once(method, tmp_path, monkeypatch) -> None:
    path = tmp_path / "ours.toml"
    path.write_text("[sensor]\narw = 0.3\ngyro_walk = 10\nvrw = 0.1\nstop_threshold = 0.3\n")
    calls = []

    def counted(name):
        calls.append(name)
        return load_sensor(name)

    monkeypatch.setattr(vehnav.sensors, "load_sensor", counted)
    run(straight_log(rate=50.0), Config(axes="RFU", method=method, sensor=str(path)))
    assert calls == [str(path)]


def test_a_config_with_a_sensor_goes_to_another_process() -> None:
    config = Config(sensor="hg1700")
    assert config.known_sensor is CATALOGUE["hg1700"]
    there = pickle.loads(pickle.dumps(config))
    assert there == config
    assert there.known_sensor.name == "hg1700"
