"""An antenna away from the IMU: fixes displaced by the true attitude, taken back by all methods."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vehnav.aiding.measurements import add_arm, arms_of
from vehnav.config import Config
from vehnav.earth import ecef_from_geodetic, position_difference
from vehnav.evaluation.matching import at_antenna
from vehnav.pipeline import run
from vehnav.rotation import c_from_rotvec, c_nb_from_angles
from vehnav.simulate import GnssModel, simulate
from vehnav.strapdown.wander import mat3

ARM = (1.0, 2.0, 1.5)
TOWN = "city,duration=240,seed=4,first_stop=30,stop_every=60"


@pytest.fixture(scope="module")
def drive():
    """A receiver of 2 cm whose antenna is 2.2 m from the IMU, and the truth."""
    gnss = GnssModel(rate_hz=5.0, noise=0.02, drift=0.0, velocity_noise=0.02)
    made = simulate(TOWN, sensor="mems-industrial", seed=3, rate_hz=50.0, gnss=gnss)
    log = made.log()
    k = np.searchsorted(made.truth.t_ns, log.gnss.t_ns)
    here = made.truth.rows(k)
    there = at_antenna(here, np.array(ARM))
    # as the noise is that of the place, the displacement is added to the noisy fix
    moved = replace(
        log.gnss,
        lat=log.gnss.lat + there.lat - here.lat,
        lon=log.gnss.lon + there.lon - here.lon,
        height=log.gnss.height + there.height - here.height,
        v_n=log.gnss.v_n + there.v_n - here.v_n,
    )
    return made, log, replace(log, gnss=moved)


def away(found, made):
    """(n, 2) m, horizontal, from the truth of the IMU's place."""
    k = np.searchsorted(made.truth.t_ns, found.trajectory.t_ns)
    return position_difference(
        found.trajectory.lat, found.trajectory.lon, made.truth.lat[k], made.truth.lon[k]
    )


def aided(log, arm):
    config = Config(method="smooth", gps="aid", outage=("170:180",), lever_arm=arm)
    return run(log, config)


def rms(d):
    return float(np.sqrt(np.mean(np.sum(d[:, :2] ** 2, axis=1))))


def test_filter_finds_the_place_of_the_imu(drive):
    """Ignored, the arm stays as a bias of its level part; known, the fixes serve as without one."""
    made, log, moved = drive
    without = rms(away(aided(log, None), made))
    assert rms(away(aided(moved, None), made)) > 1.5
    assert rms(away(aided(moved, ARM), made)) < 1.3 * without
    assert without < 0.1


def test_antenna_is_judged_where_it_is(drive):
    """Errors against fixes of the antenna: those of the track, not the arm."""
    _, _, moved = drive
    found = aided(moved, ARM)
    assert found.errors.horizontal.max() < 1.0
    assert found.agreement.horizontal_rms < 0.15
    assert aided(moved, None).agreement.horizontal_rms > 0.15


@pytest.mark.parametrize("arm", [None, ARM])
def test_stop_method_starts_at_the_imu(drive, arm):
    made, _, moved = drive
    start = away(run(moved, Config(lever_arm=arm)), made)[0, :2]
    assert np.hypot(*start) == pytest.approx(np.hypot(*ARM[:2]) if arm is None else 0.0, abs=0.2)


def test_rows_by_differences():
    """h x for a small attitude error against the arm turned by it."""
    c_wb = c_nb_from_angles(1.0, 0.05, -0.03)
    rate, arm = np.array([0.05, -0.02, 0.4]), np.array(ARM)
    arms = arms_of(mat3(c_wb), tuple(rate), ARM)
    assert np.allclose(arms[0], c_wb @ arm)
    assert np.allclose(arms[1], c_wb @ np.cross(rate, arm))
    for j in range(3):
        axis = np.eye(3)[j]
        for k in range(2):
            h = np.zeros(9)
            add_arm(h, tuple(axis), arms[k])
            for a in range(3):
                alpha = 1e-6 * np.eye(3)[a]
                # the estimate is wrong by alpha: the true attitude is exp(alpha) times it
                wrong = np.array(arms[k]) - c_from_rotvec(alpha) @ np.array(arms[k])
                assert h[6 + a] * 1e-6 == pytest.approx(wrong[j], abs=1e-11)


def test_the_displacement_is_the_arm(drive):
    """The judge of this file: antenna and IMU are as far from each other as the arm is long."""
    _, log, moved = drive
    a, b = (ecef_from_geodetic(g.lat, g.lon, g.height) for g in (log.gnss, moved.gnss))
    assert np.linalg.norm(a - b, axis=1) == pytest.approx(np.linalg.norm(ARM), abs=1e-3)
