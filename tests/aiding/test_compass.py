"""Heading from the Earth rate at a long stop: error against the sigma that the run claims."""

from __future__ import annotations

import numpy as np

from vehnav.config import Config
from vehnav.pipeline import run
from vehnav.rotation import angles_from_c_nb
from vehnav.simulate import simulate
from vehnav.units import DEG

HEADINGS = (0.0, 70.0, 155.0, 215.0, 290.0)


def standing(heading, sensor, seed, duration=600):
    """(error, sigma) of the heading after ten minutes of rest at 55 deg, deg."""
    made = simulate(f"static,duration={duration},heading={heading},pitch=2", sensor=sensor,
                    seed=seed, rate_hz=50.0, gnss=None)  # fmt: skip
    config = Config(
        method="filter", gps="none", sensor=sensor, start_position=(55.75, 37.62, 150.0)
    )
    found = run(made.log(), config)
    assert found.alignment.heading_from == "gyrocompass"
    last = float(angles_from_c_nb(found.trajectory.c_nb[-1])[0]) / DEG
    error = (last - heading + 180.0) % 360.0 - 180.0
    return error, float(found.trajectory.sigma_heading[-1]) / DEG


def test_heading_of_a_tactical_gyro():
    """1 deg/h against 8.5 deg/h of level Earth rate: 6.8 deg, and a share of the noise."""
    rows = np.array([standing(h, "hg1700", k) for k, h in enumerate(HEADINGS)])
    assert np.all((rows[:, 1] > 6.0) & (rows[:, 1] < 10.0))
    assert np.all(np.abs(rows[:, 0]) < 3.0 * rows[:, 1])


def test_heading_of_a_better_gyro(tmp_path):
    """A tenth of the bias and of the noise: 0.7 deg."""
    path = tmp_path / "fog.toml"
    text = "gyro_bias = 0.1\narw = 0.01\naccel_bias = 0.1\nvrw = 0.005\n"
    path.write_text("[sensor]\n" + text)
    rows = np.array([standing(h, str(path), 20 + k) for k, h in enumerate(HEADINGS)])
    assert np.all((rows[:, 1] > 0.6) & (rows[:, 1] < 1.2))
    assert np.all(np.abs(rows[:, 0]) < 3.0 * rows[:, 1])
    assert np.max(np.abs(rows[:, 0])) > 0.05  # it is the bias that limits


def test_a_consumer_gyro_shows_no_north():
    made = simulate("static,duration=120,heading=70", sensor="mems-industrial", seed=1, gnss=None)
    config = Config(method="filter", gps="none", sensor="mems-industrial",
                    start_position=(55.75, 37.62, 150.0))  # fmt: skip
    found = run(made.log(), config)
    assert found.alignment.heading_from == "none"
    assert "local-frame" in {f.code for f in found.findings}
    assert float(found.trajectory.sigma_heading[-1]) > 40.0 * DEG


def test_without_a_sensor_file_nobody_knows_the_bias():
    made = simulate("static,duration=120,heading=70", sensor="hg1700", seed=1, gnss=None)
    found = run(made.log(), Config(method="filter", gps="none"))
    assert found.alignment.heading_from == "none"
