"""The filter over the North pole."""

from __future__ import annotations

import numpy as np
import pytest

from vehnav.config import Config
from vehnav.earth import ecef_from_geodetic
from vehnav.pipeline import run
from vehnav.simulate import simulate


def apart(found, simulated):
    """(n,) m between a run and the truth, in Earth-fixed axes: nothing is singular there."""
    t = found.trajectory
    k = np.searchsorted(simulated.truth.t_ns, t.t_ns)
    true = simulated.truth
    d = ecef_from_geodetic(t.lat, t.lon, t.height) - ecef_from_geodetic(
        true.lat[k], true.lon[k], true.height[k]
    )
    return np.linalg.norm(d, axis=1)


@pytest.mark.parametrize("azimuth", ["relative", "absolute"])
def test_minute_without_gps_across_the_pole(azimuth):
    simulated = simulate("polar,miss=1,v=30,duration=240", sensor="hg1700", seed=4, rate_hz=50.0)
    config = Config(method="smooth", gps="aid", outage=("90:150",), azimuth=azimuth)
    found = run(simulated.log(), config)
    assert {f.code for f in found.findings} >= {"near-pole", "stop-vetoed"}
    assert np.max(apart(found, simulated)[1000:-1000]) < 10.0
    assert found.errors.outages[0].max_m < 10.0
