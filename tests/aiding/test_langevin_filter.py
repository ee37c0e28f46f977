"""Paper 004's nonlinear filter: its parts against differences and scipy, its honesty, its equal."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import polar

from vehnav.aiding import langevin_filter as lf
from vehnav.earth import WGS84, ecef_from_geodetic
from vehnav.papers import langevin_rows, langevin_runs
from vehnav.papers.drawn_runs import Way
from vehnav.rotation import c_from_rotvec, c_nb_from_angles
from vehnav.strapdown.langevin import F0, c_nb_of, state_vector
from vehnav.units import DEG

STATE = state_vector((0.9, 0.6, 120.0), (12.0, -7.0, 0.4), c_nb_from_angles(0.7, 0.05, -0.03))


def test_noise_enters_as_in_the_model():
    """P grows by F0 Q F0^T dt, F0 being judged by differences of the drift."""
    p = np.zeros((15, 15))
    lf.add_noise(p, STATE, 2e-3, 3e-4, 0.1, np.zeros((15, 6)))
    q = np.diag([2e-3**2] * 3 + [3e-4**2] * 3)
    assert np.allclose(p, F0(STATE) @ q @ F0(STATE).T * 0.1, rtol=1e-12, atol=1e-20)


def test_position_rows_by_differences():
    fix = np.array([0.9 - 2e-6, 0.6 + 1e-6, 117.0])
    h = np.zeros(15)
    true = ecef_from_geodetic(*STATE[:3]) - ecef_from_geodetic(*fix)
    seen = [lf.position_measurement(h, STATE, fix, j, WGS84) for j in range(3)]
    assert np.linalg.norm(seen) == pytest.approx(np.linalg.norm(true), rel=1e-5)
    for j in range(3):
        lf.position_measurement(h, STATE, fix, j, WGS84)
        for k, step in ((0, 1e-7), (1, 1e-7), (2, 1.0), (3, 1.0), (9, 0.1)):
            plus, minus = STATE.copy(), STATE.copy()
            plus[k] += step
            minus[k] -= step
            other = np.zeros(15)
            slope = (
                lf.position_measurement(other, plus, fix, j, WGS84)
                - lf.position_measurement(other, minus, fix, j, WGS84)
            ) / (2.0 * step)
            assert slope == pytest.approx(h[k], rel=1e-5, abs=20.0), (j, k)  # fix 13 m away


def test_orthonormal_matrix_is_the_polar_factor():
    rng = np.random.default_rng(3)
    y = STATE.copy()
    y[6:] += 0.1 * rng.standard_normal(9)
    wanted, _ = polar(c_nb_of(y))
    lf.orthonormalise(y)
    assert np.allclose(c_nb_of(y), wanted, atol=1e-9)
    assert np.array_equal(y[:6], STATE[:6])


def test_direction_cosines_by_small_turns():
    psi = np.array([1e-6, -2e-6, 3e-6])
    turned = state_vector(STATE[:3], STATE[3:6], c_from_rotvec(-psi) @ c_nb_of(STATE))
    assert np.allclose((turned - STATE)[6:], lf.attitude_rows(STATE) @ psi, atol=1e-11)


def test_covariance_goes_there_and_back():
    rng = np.random.default_rng(4)
    root = rng.standard_normal((9, 9))
    p = lf.start_covariance(STATE, root @ root.T)
    assert np.allclose(lf.navigation_covariance(STATE, p), root @ root.T, rtol=1e-9, atol=1e-9)
    east = np.zeros(9)
    east[0] = 10.0  # m
    moved = STATE + lf.error_rows(STATE) @ east
    apart = ecef_from_geodetic(*moved[:3]) - ecef_from_geodetic(*STATE[:3])
    assert np.linalg.norm(apart) == pytest.approx(10.0, rel=1e-5)
    assert moved[1] > STATE[1]


@pytest.fixture(scope="module")
def way():
    return Way.of("town,duration=100,first_stop=15")


def test_both_filters_are_honest_and_one_where_the_heading_is_known(way):
    runs = [langevin_rows.both(way, 2.0 * DEG, seed) for seed in range(6)]
    ours, errors = (langevin_rows.Figures.of(list(x)) for x in zip(*runs, strict=True))
    # 6 runs of 9 degrees of freedom: 3 standard deviations of the mean
    assert ours.nees == pytest.approx(9.0, abs=3.0 * np.sqrt(18.0 / 6.0))
    assert errors.nees == pytest.approx(9.0, abs=3.0 * np.sqrt(18.0 / 6.0))
    assert ours.position == pytest.approx(errors.position, rel=0.05)
    assert ours.heading == pytest.approx(errors.heading, rel=0.2)


def test_error_states_turn_far_direction_cosines_do_not(way):
    runs = [langevin_rows.both(way, 60.0 * DEG, seed) for seed in range(6)]
    ours, errors = (langevin_rows.Figures.of(list(x)) for x in zip(*runs, strict=True))
    assert ours.nees > 10.0 * errors.nees


def test_direction_cosines_stay_orthonormal(way):
    log = langevin_runs.draw_log(way, 10.0 * DEG, 1)
    looks = langevin_runs.by_direction_cosines(log)
    assert looks.t.size > 90
    assert np.all(looks.nees > 0.0)


def test_rows_and_what_they_rest_on():
    honest = langevin_rows.Figures(1.7, 0.2, 9.1, 1.0)
    same = langevin_rows.Figures(1.72, 0.2, 9.0, 0.5)
    row = langevin_rows._row(2.0, "how", 20, honest, same, fast=False)
    assert row.verdict == "reproduced"
    assert "2.0 times the time" in row.figure
    for wrong in (replace(honest, nees=14.0), replace(honest, position=1.9)):
        assert langevin_rows._row(2.0, "", 20, wrong, same, fast=True).verdict == "not reproduced"
