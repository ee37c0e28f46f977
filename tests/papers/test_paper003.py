"""Rows of paper 003: verdicts as published, and each falsified by one wrong thing."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy import stats

from vehnav.earth import WGS84, c_en, ecef_from_geodetic, geodetic_from_ecef
from vehnav.papers import drawn_runs, paper003
from vehnav.papers.drawn_runs import Way, navigation_errors, true_rows
from vehnav.rotation import c_from_rotvec
from vehnav.strapdown import quasi
from vehnav.strapdown.wander import mechanize_wander


def by_key(rows):
    return {row.key: row for row in rows}


@pytest.fixture(scope="module")
def rows():
    return by_key(paper003.rows(fast=True))


def test_every_claim_is_reproduced(rows):
    assert {row.verdict for row in rows.values()} == {"reproduced"}
    assert len(rows) == 10


def test_figures_of_the_specification(rows):
    """Table 5.5 (229 m after 300 s past the pole, here after 100 s), T4, table 5.6."""
    assert 50.0 < rows["pole-enu"].values["error_m"] < 1000.0
    assert rows["geocentric"].values["error_m"] == pytest.approx(93.1, abs=0.5)
    assert rows["quasi"].values["polar_m"] < 5.5
    # mean over the runs of a chi-square of 13: 20 runs, 1 in 10 000
    low, high = stats.chi2.ppf([1e-4, 1.0 - 1e-4], 13 * 20) / 20
    assert low < rows["filter"].values["nees"] < high
    assert low < rows["filter-quasi"].values["nees"] < high
    assert rows["filter-normal"].values["nees"] > 1e3


def test_mechanization_row_sees_another_law_of_gravity(monkeypatch):
    weaker = WGS84._replace(gamma_p=WGS84.gamma_p * 0.999)
    wrong = partial(mechanize_wander, earth=weaker, vertical="free")
    monkeypatch.setattr(paper003, "mechanize_wander", wrong)
    assert by_key(paper003._crossing(40.0))["pole"].verdict == "not reproduced"


def test_heading_row_sees_the_heading_itself(monkeypatch):
    monkeypatch.setattr(
        paper003, "quasi_heading", lambda c_we, c_wb: np.linspace(0.0, np.pi, len(c_we))
    )
    assert by_key(paper003._crossing(40.0))["heading"].verdict == "not reproduced"


def test_azimuth_row_sees_a_turned_sign(monkeypatch):
    monkeypatch.setattr(paper003, "wander_along", lambda *a, **k: -quasi.wander_along(*a, **k))
    assert paper003._azimuth_law().verdict == "not reproduced"


def test_approximation_rows_see_the_first_order(monkeypatch):
    monkeypatch.setattr(paper003, "geocentric_latitude_approximation", lambda lat: lat * 0.9999)
    monkeypatch.setattr(
        paper003, "quasi_approximation",
        lambda c: (np.arcsin(-c[..., 2, 0]), np.arctan2(c[..., 2, 1], c[..., 2, 2])),
    )  # fmt: skip
    found = by_key(paper003._approximations())
    assert found["geocentric"].verdict == "not reproduced"
    assert found["quasi"].verdict == "not reproduced"


def test_filter_rows_see_a_filter_that_is_told_too_little(monkeypatch):
    monkeypatch.setattr(drawn_runs, "FIX_NOISE", 1.5)
    true = drawn_runs.draw_fixes
    wrong = lambda way, form, rng: _closer(true(way, form, rng))  # noqa: E731
    monkeypatch.setattr(drawn_runs, "draw_fixes", wrong)
    found = by_key(paper003._filter(60.0, 4))
    assert found["filter"].verdict == "not reproduced"
    assert found["filter-quasi"].verdict == "not reproduced"


def _closer(fixes):
    """Told a quarter of the noise."""
    return replace(fixes, sigma_pos=0.25 * fixes.sigma_pos, sigma_vel=0.25 * fixes.sigma_vel)


def test_log_row_sees_the_total_velocity_error(monkeypatch):
    def turn_attitude_only(row, x, earth):
        c = row[13:].reshape(3, 3)
        row[13:] = (c_from_rotvec(np.array(x[6:9])) @ c).ravel()

    monkeypatch.setattr(paper003, "displace", turn_attitude_only)
    assert paper003._log_model().verdict == "not reproduced"


# ---- how the errors of a drawn run are measured ------------------------------------------------


def test_errors_are_measured_by_their_definitions():
    """A known displacement, tilt and azimuth error put on a truth, in Earth-fixed axes."""
    way = Way.of("town,duration=60,first_stop=15")
    truth = way.truth.rows(np.arange(1000, 3000, 250))
    axes = np.swapaxes(c_en(truth.lat, truth.lon), 1, 2)
    true = true_rows(truth, axes.reshape(-1, 9))
    assert np.max(np.abs(navigation_errors(truth, true))) < 2e-9  # a rounding of 6378 km
    rows = true.copy()
    psi = np.array([2e-5, -1e-5, 3e-4])
    turn = c_from_rotvec(-psi)  # (1 - [psi x])
    rows[:, 13:] = (turn @ true[:, 13:].reshape(-1, 3, 3)).reshape(-1, 9)
    rows[:, 10:13] = true[:, 10:13] + [0.1, -0.2, 0.05]
    found = navigation_errors(truth, rows)
    assert np.allclose(found[:, 6:], psi, atol=1e-7)
    # dynamic velocity error: total minus V x beta
    total = np.array([0.1, -0.2, 0.05]) - np.cross(true[:, 10:13], psi)
    assert np.allclose(found[:, 3:6], total, atol=1e-4)
    # 10 m north: the computed place turns about -east, its level sees a true vertical turned back
    e = c_en(truth.lat, truth.lon)
    r_e = np.einsum("kij,j->ki", e, np.array([0.0, 10.0, 0.0]))
    lat, lon, height = geodetic_from_ecef(
        ecef_from_geodetic(truth.lat, truth.lon, truth.height) + r_e
    )
    moved = true.copy()
    moved[:, :9] = np.swapaxes(c_en(lat, lon), 1, 2).reshape(-1, 9)
    moved[:, 9] = height
    found = navigation_errors(truth, moved)
    assert np.allclose(found[:, :3], [0.0, 10.0, 0.0], atol=1e-4)
    assert np.allclose(found[:, 6:8], 0.0, atol=1e-11)  # attitude in computed axes is right
