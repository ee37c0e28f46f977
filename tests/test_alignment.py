"""Level, bias, heading: against attitudes that are known, and batch least squares."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vehnav.alignment import (
    Rest,
    bias_along_gravity,
    gyro_bias,
    heading_from_tracks,
    mean_over_rest,
    track_random_walk,
)
from vehnav.earth import WGS84
from vehnav.rotation import angles_from_c_nb, c_nb_from_angles

angle = st.floats(-0.6, 0.6)


@given(heading=st.floats(0.0, 6.28), pitch=angle, roll=angle)
def test_level_comes_from_the_reaction_to_gravity(heading, pitch, roll) -> None:
    c_nb = c_nb_from_angles(heading, pitch, roll)
    rest = Rest(np.zeros(3), c_nb.T @ np.array([0.0, 0.0, 9.8]))
    found = angles_from_c_nb(rest.c_nb(heading))
    assert [float(x) for x in found[1:]] == pytest.approx([pitch, roll], abs=1e-12)


def test_gyro_bias_leaves_the_earth_rate_out() -> None:
    lat, c_nb = np.radians(55.0), c_nb_from_angles(1.0, 0.1, -0.2)
    bias = np.array([1e-4, -2e-4, 3e-4])
    earth = WGS84.omega_ie * np.array([0.0, np.cos(lat), np.sin(lat)])
    rest = Rest(c_nb.T @ earth + bias, np.array([0.0, 0.0, 9.8]))
    assert gyro_bias(rest, c_nb, lat) == pytest.approx(bias, abs=1e-18)


def test_bias_along_gravity_brings_rest_to_normal_gravity() -> None:
    rest = Rest(np.zeros(3), np.array([0.6, -0.8, 9.9]))
    left = rest.f - bias_along_gravity(rest, 0.0, 0.0)
    assert np.linalg.norm(left) == pytest.approx(9.7803253359, rel=1e-12)
    assert np.cross(left, rest.f) == pytest.approx(0.0, abs=1e-12)  # the level stays


def test_rocking_at_idle_does_not_look_like_a_bias() -> None:
    """0.1 deg of rocking: a plain mean shows the difference of two angles over the time."""
    t = np.arange(0.0, 60.0, 0.01)
    angle = -np.radians(0.1) * np.cos(2 * np.pi * 18.5 / 60.0 * t)  # from one end to the other
    omega = np.zeros((t.size, 3))
    omega[:, 0] = np.gradient(angle, t)
    dph = np.degrees(mean_over_rest(omega, np.zeros_like(omega), 0, t.size - 1).omega[0]) * 3600
    plain = np.degrees(omega[:, 0].mean()) * 3600
    assert plain == pytest.approx(0.2 / 60.0 * 3600.0, rel=0.01)
    assert abs(dph) < 0.2


@given(turn=st.floats(-3.1, 3.1))
def test_heading_fit_finds_the_rotation_clockwise(turn) -> None:
    rng = np.random.default_rng(0)
    track = np.cumsum(rng.normal(size=(50, 2)), axis=0)
    c, s = np.cos(turn), np.sin(turn)
    clockwise = track @ np.array([[c, -s], [s, c]])  # north (0, 1) goes to (sin, cos): east
    assert np.array([0.0, 1.0]) @ np.array([[c, -s], [s, c]]) == pytest.approx([s, c])
    found, rms = heading_from_tracks(track, clockwise)
    assert found == pytest.approx(turn, abs=1e-9)
    assert rms == pytest.approx(0.0, abs=1e-9)


def test_random_walk_smoother_is_the_batch_solution() -> None:
    """Judge: the normal equations of all readings and steps at once."""
    rng = np.random.default_rng(5)
    t = np.array([0.0, 40.0, 60.0, 200.0, 230.0])
    z = rng.normal(size=(5, 2))
    variance, walk = rng.uniform(0.1, 2.0, 5), 0.07
    information = np.diag(1.0 / variance)
    for k in range(4):
        w = 1.0 / (walk**2 * (t[k + 1] - t[k]))
        information[k, k] += w
        information[k + 1, k + 1] += w
        information[k, k + 1] -= w
        information[k + 1, k] -= w
    covariance = np.linalg.inv(information)
    x, p = track_random_walk(t, z, variance, walk, smooth=True)
    assert x == pytest.approx(covariance @ (z / variance[:, None]), abs=1e-12)
    assert p == pytest.approx(np.diag(covariance), abs=1e-12)
    filtered, _ = track_random_walk(t, z, variance, walk, smooth=False)
    assert filtered[-1] == pytest.approx(x[-1], abs=1e-12)  # at the end nothing is ahead
    changed = z.copy()
    changed[-1] += 10.0
    again, _ = track_random_walk(t, changed, variance, walk, smooth=False)
    assert np.array_equal(again[:-1], filtered[:-1])  # the filter does not look ahead
