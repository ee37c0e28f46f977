"""``vehnav simulate``: files, one screen, one document, and errors that say what to do."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest
from click.testing import CliRunner

from vehnav.cli.main import cli
from vehnav.logs.log import ReadOptions
from vehnav.logs.read import read_log
from vehnav.simulate import SCENARIOS

SHORT = "straight,first_stop=5,last_stop=5"


def run(*args: object):
    return CliRunner().invoke(cli, ["simulate", *map(str, args)])


def test_writes_a_log_and_its_truth(tmp_path):
    log = tmp_path / "a.mcap"
    result = run(SHORT, "-o", log, "--duration", 60, "--rate", 20, "--truth-rate", 2, "--wheel")
    assert result.exit_code == 0, result.output
    assert "straight: 60 s" in result.stdout
    assert "1201 rates at 20 Hz, 61 fixes, 601 wheel speeds, seed 0" in result.stdout
    read = read_log(str(log), ReadOptions())
    assert read.imu.t_ns.size == 1201
    assert read.speed.t_ns.size == 601
    assert len((tmp_path / "a.truth.csv").read_text().splitlines()) == 122


def test_same_seed_same_log(tmp_path):
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        assert (
            run(SHORT, "-o", tmp_path / f"{name}.csv", "--rate", 2, "--seed", seed).exit_code == 0
        )
    text = {name: (tmp_path / f"{name}.csv").read_text() for name in "abc"}
    assert text["a"] == text["b"] != text["c"]


def test_json_is_one_document_with_the_drawn_errors(tmp_path):
    sensor = tmp_path / "mine.toml"
    sensor.write_text("[sensor]\ngyro_bias = 100\naccel_bias = 3\n")
    args = ["--sensor", sensor, "--runs", 3, "--rate", 5, "--no-gps", "--json"]
    result = run(SHORT, "-o", tmp_path / "a.csv", *args)
    document = json.loads(result.stdout)
    assert document["version"] == 1
    assert document["scenario"] == "straight"
    assert document["fixes"] == 0
    assert document["imu"]["sensor"] == {"name": "mine", "gyro_bias": 100, "accel_bias": 3}
    names = [[path.rsplit("/")[-1] for path in row["files"]] for row in document["runs"]]
    assert names == [["a-001.csv", "a.truth.csv"], ["a-002.csv"], ["a-003.csv"]]
    for row in document["runs"]:
        table = np.loadtxt(row["files"][0], delimiter=",", skiprows=1)
        standing = table[:20, 1:]  # 5 s at rest, no noise: bias, gravity, Earth rate
        dph = np.degrees(standing[:, :3].mean(axis=0)) * 3600.0
        # right and forward see the Earth rate, 15.04 deg/h: heading 60 deg, latitude 55.75
        earth = 15.041 * np.array([-0.56281 * 0.86603, 0.56281 * 0.5, 0.82659])
        np.testing.assert_allclose(dph - earth, row["gyro_bias_dph"], atol=0.01)
        level = standing[:, 3:5].mean(axis=0) / 9.80665e-3
        np.testing.assert_allclose(level, row["accel_bias_mg"][:2], atol=0.01)


def test_gps_options_reach_the_receiver(tmp_path):
    args = ["--gps-rate", 5, "--gps-velocity-noise", 0.1, "--gps-latency", 0.4]
    args += ["--outage", "10:20", "--outage", "every=30,length=5,from=30", "--rate", 10]
    assert run(SHORT, "-o", tmp_path / "a.csv", "--duration", 80, *args).exit_code == 0
    table = np.genfromtxt(tmp_path / "a.gps.csv", delimiter=",", names=True, dtype=None)
    valid = (table["t_ns"] - table["t_ns"][0]) * 1e-9
    gaps = [(a, b) for a, b in itertools.pairwise(valid) if b - a > 0.3]
    np.testing.assert_allclose(gaps, [(9.8, 20.0), (29.8, 35.0), (59.8, 65.0)], atol=1e-6)
    assert "v_north_m_s" in table.dtype.names
    first = np.loadtxt(tmp_path / "a.csv", delimiter=",", skiprows=1, usecols=0, max_rows=1)
    assert table["t_ns"][0] - int(first) == pytest.approx(4e8, abs=256.0)  # float text of an int64


def test_route_file_is_a_scenario(tmp_path):
    (tmp_path / "way.csv").write_text("lat,lon\n48.0,11.0\n48.002,11.0\n48.002,11.004\n")
    result = run(tmp_path / "way.csv", "-o", tmp_path / "a.mcap", "--rate", 20)
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("route: ")


def test_list_names_everything():
    text = run("--list").stdout
    document = json.loads(run("--list", "--json").stdout)
    assert set(document["scenarios"]) == set(SCENARIOS)
    for name in (*SCENARIOS, *document["sensors"]):
        assert f"  {name}:" in text
    assert document["sensors"]["hg1700"]["arw"] == 0.125


@pytest.mark.parametrize(
    ("args", "says"),
    [
        ((), "SCENARIO and -o LOG are needed"),
        (("citty", "-o", "a.mcap"), "did you mean 'city'"),
        (("city", "-o", "a.bag"), "written as .mcap or .csv"),
        (("city", "-o", "none/a.csv"), "there is no folder none"),
        (("city", "-o", "a.csv", "--sensor", "hg170"), "did you mean 'hg1700'"),
        (("city", "-o", "a.csv", "--outage", "9:3"), "expected START:END"),
        (("city", "-o", "a.csv", "--outage", "every=9,length=20,from=0"), "expected START:END"),
        (("city", "-o", "a.csv", "--truth-rate", "33"), "must divide"),
        (("flight", "-o", "a.csv", "--duration", "60"), "no parameter 'duration'"),
        (("city", "-o", "a.csv", "--rate", "nan"), "rate"),
    ],
)
def test_refused_before_anything_is_written(args, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run(*args)
    assert result.exit_code == 2
    assert says in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_strict_counts_saturation(tmp_path):
    (tmp_path / "weak.toml").write_text("[sensor]\naccel_range = 0.5\n")
    args = [SHORT, "-o", tmp_path / "a.csv", "--sensor", tmp_path / "weak.toml", "--rate", 5]
    result = run(*args)
    assert result.exit_code == 0
    assert "[saturated]" in result.stderr
    assert run(*args, "--strict").exit_code == 1
