"""The logs in sample_logs/ are what the program makes, to one stored count."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vehnav.earth import position_difference
from vehnav.logs.log import ReadOptions
from vehnav.logs.read import read_log
from vehnav.simulate import samples
from vehnav.simulate.samples import SAMPLES, make_sample

NAMES = [(name, sample) for sample in SAMPLES for name in sample.files]


@pytest.fixture(scope="module")
def made():
    return {sample.files[0]: make_sample(sample) for sample in SAMPLES}


@pytest.mark.parametrize(("name", "sample"), NAMES, ids=[n for n, _ in NAMES])
def test_made_again(name, sample, made, sample_logs):
    run = made[sample.files[0]]
    path = sample_logs / name
    beside = None if path.suffix == ".mcap" else str(path.with_suffix(".gps.csv"))
    log = read_log(str(path), ReadOptions(gps_file=beside))
    np.testing.assert_array_equal(log.imu.t_ns, run.imu.t_ns)
    turn, sign = ([1, 0, 2], [1, -1, 1]) if path.suffix == ".mcap" else ([0, 1, 2], [1, 1, 1])
    for quantity, count in (("gyro", sample.gyro_count), ("accel", sample.accel_count)):
        stored = getattr(log.imu, quantity) / count
        again = getattr(run.imu, quantity)[:, turn] * np.array(sign) / count
        assert np.max(np.abs(stored - np.rint(stored))) < 1e-6
        assert np.max(np.abs(np.rint(stored) - np.rint(again))) <= 1
    moved = position_difference(log.gnss.lat, log.gnss.lon, run.gnss.lat, run.gnss.lon)
    assert np.max(np.abs(moved)) < 1e-3


def test_they_are_small_and_complete(sample_logs):
    for path in sample_logs.iterdir():
        assert path.stat().st_size < 3_000_000, path.name
    for sample in SAMPLES:
        for name in sample.files:
            assert (sample_logs / name).is_file()
        assert (sample_logs / sample.files[0]).with_suffix(".truth.csv").is_file()
    assert (sample_logs / "README.md").is_file()


def test_drives_stop_and_go(made):
    for run in made.values():
        stopped = run.truth.stopped.astype(int)
        assert np.count_nonzero(np.diff(stopped) == -1) >= 3
        assert stopped[0] == stopped[-1] == 1


def test_command_writes_what_it_is_told(tmp_path, monkeypatch, capsys):
    short = replace(
        SAMPLES[0],
        files=("a.mcap", "a.csv"),
        scenario="straight,duration=50,first_stop=5,last_stop=5",
        rate_hz=10.0,
    )
    monkeypatch.setattr(samples, "SAMPLES", (short,))
    monkeypatch.setattr("sys.argv", ["samples", str(tmp_path / "logs")])
    samples.main()
    names = sorted(p.name for p in (tmp_path / "logs").iterdir())
    assert names == ["a.csv", "a.gps.csv", "a.mcap", "a.truth.csv"]
    assert len((tmp_path / "logs" / "a.truth.csv").read_text().splitlines()) == 502
    assert "a.mcap: 0." in capsys.readouterr().err
    monkeypatch.setattr("sys.argv", ["samples"])
    with pytest.raises(SystemExit, match="usage"):
        samples.main()
