"""GNSS forms of paper 003 (T13, T25): H by differences, forms equal where they are regular."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from test_error_model import SIZES, State, true_state

from vehnav.aiding.gnss_forms import Computed, gnss_measurement, see_fix
from vehnav.config import Config
from vehnav.earth import WGS84, c_en, ecef_from_geodetic
from vehnav.pipeline import run
from vehnav.rotation import c_nb_from_angles
from vehnav.simulate import simulate
from vehnav.simulate.receivers import GnssModel
from vehnav.strapdown.quasi import quasi_wander
from vehnav.strapdown.wander import c_nw, geodetic_from_c_we, mat3
from vehnav.units import DEG


def at(lat, lon=0.3, wander=0.4):
    return State.of(
        lat, lon, 120.0, wander, np.array([20.0, -11.0, 0.0]), c_nb_from_angles(0.7, 0.05, -0.03)
    )


def seen(form, computed, true):
    return gnss_measurement(form, Computed(computed.c_we, 120.0, computed.v_w), true.r_e, true.v_e)


@pytest.mark.parametrize(
    ("form", "lat", "tolerance"),
    [
        ("normal", 55.0 * DEG, 2e-7),
        ("normal", 85.0 * DEG, 2e-7),
        ("direct", 55.0 * DEG, 2e-7),
        ("direct", 89.9999 * DEG, 2e-7),
        ("quasi", 55.0 * DEG, 2e-7),
        ("quasi", 89.5 * DEG, 2e-7),
        ("quasi", 89.9999 * DEG, 2e-7),
    ],
)
def test_rows_by_differences(form, lat, tolerance):  # T13
    computed = at(lat)
    _, h = seen(form, computed, computed)
    sizes = 0.01 * SIZES[:9]
    for j in range(9):
        x = np.zeros(9)
        x[j] = sizes[j]
        plus = seen(form, computed, true_state(computed, x))[0]
        minus = seen(form, computed, true_state(computed, -x))[0]
        row = (plus - minus) / (2.0 * sizes[j])
        scale = np.array([1.0, 1.0, 1.0, 1.0]) * (1.0 if j < 6 else 22.0)
        assert np.max(np.abs(row - h[:, j]) / scale) < tolerance, j


def test_convergence_of_meridians():
    """1 km of east error 56 km from the pole turns the velocity by 1/56 rad (003 eq. 31)."""
    lat = 89.5 * DEG
    state = State.of(lat, 0.0, 0.0, 0.0, np.array([10.0, 19.6, 0.0]), np.eye(3))
    x = np.zeros(9)
    x[0] = 1000.0
    true = true_state(state, x)
    z, h = gnss_measurement("normal", Computed(state.c_we, 0.0, state.v_w), true.r_e, true.v_e)
    turned = 1000.0 / 55_850.0  # radius of the parallel of 89.5 deg
    expected = [19.6 * turned, -10.0 * turned]
    assert np.allclose(h[2:, 0] * 1000.0, expected, rtol=1e-3)
    assert np.allclose(z[2:], expected, atol=22.0 * turned**2)  # second order


@pytest.mark.parametrize("lat", [55.0 * DEG, 80.0 * DEG])
def test_forms_are_one_measurement(lat):  # T25: the same up to a turn about up
    computed = at(lat)
    true = true_state(computed, np.array([3.0, -2.0, 0.0, 0.1, 0.05, 0.0, 1e-4, 0.0, 1e-3]))
    direct = seen("direct", computed, true)[0]
    normal = seen("normal", computed, true)[0]
    turn = c_nw(float(geodetic_from_c_we(computed.c_we)[2]))[:2, :2]
    assert np.allclose(turn @ direct[:2], normal[:2], atol=1e-4)
    quasi = seen("quasi", computed, true)[0]
    turn = c_nw(float(quasi_wander(computed.c_we)))[:2, :2]
    assert np.allclose(turn @ direct[:2], quasi[:2], atol=0.01)


def test_direct_form_of_a_perfect_state_is_zero():
    computed = at(1.2)
    assert np.allclose(seen("direct", computed, computed)[0], 0.0, atol=1e-8)
    assert np.allclose(computed.c_we.T, c_en(1.2, 0.3) @ c_nw(0.4))


# ---- in the filter of a run (T25) --------------------------------------------------------------


@cache
def estimate(scenario, form):
    """(Earth-fixed positions (n, 3), finding codes) of a filter aided in a form.

    The sigmas told are three times the noise: a fix beyond two of them is weighed down axis by
    axis, and the axes of the forms differ.
    """
    log = simulate(scenario, sensor="hg1700", seed=3, rate_hz=50.0, gnss=RECEIVER).log()
    gnss = replace(log.gnss, sigma_pos=3.0 * log.gnss.sigma_pos, sigma_vel=3.0 * log.gnss.sigma_vel)
    config = Config(method="filter", gps="aid", axes="RFU", gnss_form=form)
    found = run(replace(log, gnss=gnss), config)
    t = found.trajectory
    return ecef_from_geodetic(t.lat, t.lon, t.height), {f.code for f in found.findings}


RECEIVER = GnssModel(noise=1.5, drift=0.0, velocity_noise=0.05)
SETTLED = 2500
"""Rows, 50 s: before, errors of degrees in heading show the second order, which differs."""
CITY = "city,duration=200,first_stop=30,lat=55,lon=37"
EQUATOR = "city,duration=200,first_stop=30,lat=0,lon=0"
POLE = "polar,miss=1,v=30,duration=240"


@pytest.mark.parametrize(
    ("scenario", "form"),
    [(CITY, "normal"), (CITY, "quasi"), (POLE, "quasi"), (EQUATOR, "normal")],
)
def test_forms_give_one_estimate_where_they_are_regular(scenario, form):  # T25
    direct, codes = estimate(scenario, "direct")
    other, other_codes = estimate(scenario, form)
    assert np.max(np.linalg.norm(other - direct, axis=1)[SETTLED:]) < 0.01
    assert "gnss-form" not in codes | other_codes


@pytest.mark.parametrize(("scenario", "form"), [(POLE, "normal"), (EQUATOR, "quasi")])
def test_form_degrades_at_its_poles_and_the_run_says_so(scenario, form):
    direct, _ = estimate(scenario, "direct")
    other, codes = estimate(scenario, form)
    assert np.max(np.linalg.norm(other - direct, axis=1)[SETTLED:]) > 0.3
    assert "gnss-form" in codes


def test_fix_that_is_older_than_the_state():
    """The state is carried back with its velocity: a fix 0.2 s old of a perfect state gives 0."""
    state = at(1.0)
    v_e = state.c_we.T @ state.v_w
    fix = tuple(state.r_e - 0.2 * v_e), tuple(v_e)
    for form in range(3):
        seen = see_fix(form, mat3(state.c_we), 120.0, tuple(state.v_w), fix, 0.2, WGS84)
        assert np.max(np.abs(seen[0][:2])) < 1e-6, form
