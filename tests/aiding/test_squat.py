"""A soft car rises at the nose as it speeds up: that is neither a slope nor lift."""

from __future__ import annotations

import numpy as np
import pytest

from vehnav.config import Config
from vehnav.earth import position_difference
from vehnav.pipeline import run
from vehnav.simulate import GnssModel, simulate


@pytest.mark.parametrize("sensor", ["ideal", "mems-industrial"])
def test_a_soft_car_bends_no_track(sensor):
    """0.4 deg per m/s2: taken for slope it is 100 m in 4 min, four times what sigma says."""
    made = simulate(
        "city,duration=300,seed=4,first_stop=30,stop_every=95",
        sensor=sensor, seed=3, rate_hz=50.0, gnss=GnssModel(drift=0.0, noise=0.05),
    )  # fmt: skip
    track = run(made.log(), Config(method="filter")).trajectory
    truth = made.truth.rows(np.searchsorted(made.truth.t_ns, track.t_ns))
    error = np.hypot(*position_difference(track.lat, track.lon, truth.lat, truth.lon).T)
    sigma = np.sqrt(0.5 * (track.sigma_pos[:, 0] ** 2 + track.sigma_pos[:, 1] ** 2))
    worst = int(np.argmax(error))
    assert error[worst] < 3.0 * sigma[worst]
    assert error[worst] < 50.0  # half
