"""The suites of the project itself: they load, and fit their baseline; what they once found."""

from __future__ import annotations

from pathlib import Path

import pytest

from vehnav.batch.baseline import read_baseline
from vehnav.batch.simulation import Simulation
from vehnav.batch.suite import load_suite
from vehnav.config import Config
from vehnav.library import read_log
from vehnav.pipeline import run

SUITES = Path(__file__).resolve().parent.parent / "suites"


def test_the_baseline_has_every_simulated_drive() -> None:
    suite = load_suite(SUITES / "simulated.toml")
    assert suite.baseline.file is not None
    kept = {item.name for item in read_baseline(suite.baseline.file).kept}
    assert kept == {f"{log.name}/{config.name}" for log, config in suite.matrix()}
    assert suite.baseline.max_regression == 0.05


def test_real_drives_are_optional_and_each_has_its_bars(monkeypatch, tmp_path, shared_data) -> None:
    monkeypatch.setenv("VEHNAV_DATA", str(tmp_path))
    absent = load_suite(SUITES / "real.toml")
    assert absent.logs == ()
    assert len(absent.skipped) == 4
    monkeypatch.setenv("VEHNAV_DATA", str(shared_data))
    there = load_suite(SUITES / "real.toml")
    for log, config in there.matrix():
        assert any(bar.applies(log.group, log.name, config.name) for bar in there.bars), log.name


@pytest.mark.parametrize("seed", [2, 5])
def test_a_stretch_of_gps_without_turns_takes_no_accelerometer_for_inverted(seed, tmp_path) -> None:
    """What the suite found first: axes BLD for FLU, 655 m instead of 13, from 30 s of GPS."""
    suite = load_suite(SUITES / "simulated.toml")
    simulation = next(log.simulation for log in suite.logs if log.name == f"city-{seed}")
    assert isinstance(simulation, Simulation)
    simulation.write(tmp_path / "city.mcap")
    found = run(read_log(tmp_path / "city.mcap"), Config(gps_start_seconds=30.0))
    assert found.axes == "FLU"
    assert found.orientation.accel_axes in (None, "FLU")
