"""Density of the fastest vibration: white noise, slow motion, a shaken stretch."""

from __future__ import annotations

import numpy as np
import pytest

from vehnav.aiding.vibration import shaken_densities, skewed_rates

RATE = 100.0
T = np.arange(0.0, 200.0, 1.0 / RATE)


def test_white_noise_shows_its_own_density():
    rng = np.random.default_rng(3)
    omega, f = 0.02 * rng.normal(size=(T.size, 3)), 0.3 * rng.normal(size=(T.size, 3))
    found = shaken_densities(T, omega, f, np.arange(1.0, 199.0))
    assert found[:, :3].mean() == pytest.approx(0.02**2 / RATE, rel=0.03)
    assert found[:, 3:].mean() == pytest.approx(0.3**2 / RATE, rel=0.03)


def test_driving_is_not_vibration():
    """A turn of 0.5 rad/s within 4 s and a bend of the force: far below half the rate."""
    omega = np.outer(0.25 * (1.0 - np.cos(0.5 * np.pi * T)), [0.0, 0.0, 1.0])
    f = np.outer(3.0 * np.sin(np.pi * T), [1.0, 0.0, 0.0]) + [0.0, 0.0, 9.8]
    found = np.sqrt(shaken_densities(T, omega, f, T[::50]))
    assert np.max(found[:, :3]) < 1e-5  # a thousandth of a deg/s/sqrt(Hz)
    assert np.max(found[:, 3:]) < 2e-4


def test_a_shaken_stretch_is_seen_where_it_is_and_on_its_axis():
    rng = np.random.default_rng(4)
    omega = 1e-4 * rng.normal(size=(T.size, 3))
    shaken = (T > 80.0) & (T < 120.0)
    omega[shaken, 0] += 0.2 * rng.normal(size=int(shaken.sum()))
    found = shaken_densities(T, omega, np.zeros_like(omega), np.array([40.0, 100.0, 160.0]))
    assert found[1, 0] > 1e5 * found[0, 0]
    assert found[1, 0] > 1e5 * found[2, 0]
    assert found[1, 0] > 1e5 * found[1, 1]


def test_few_samples_show_nothing():
    nothing = np.zeros((3, 3))
    assert not np.any(shaken_densities(T[:3], nothing, nothing, T[:2]))
    assert not np.any(skewed_rates(T[:3], nothing, T[:2]))


def test_skew_of_peaks_to_one_side_is_their_height():
    """Mean cube over mean square of rare peaks: their height, with its sign; the mean is motion."""
    omega = np.zeros((T.size, 3)) + [0.3, -0.2, 0.1]
    omega[::50, 0] += 0.2
    omega[::50, 1] -= 0.1
    found = skewed_rates(T, omega, np.arange(5.0, 195.0))
    # less its mean of n samples, 1 - 1/n and n - 1 times -1/n: 1 - 2/n, n 10 or 11
    assert found[:, 0] == pytest.approx(0.2 * (1.0 - 2.0 / 10.5), rel=0.02)
    assert found[:, 1] == pytest.approx(-0.1 * (1.0 - 2.0 / 10.5), rel=0.02)
    assert np.max(np.abs(found[:, 2])) < 1e-9


def test_skew_of_even_vibration_and_of_driving_is_nothing():
    rng = np.random.default_rng(5)
    even = 0.1 * rng.normal(size=(T.size, 3))
    found = skewed_rates(T, even, np.arange(5.0, 195.0))
    # third moment of 100 independent samples: sqrt(15 / 100) of the deviation, less the trend
    assert np.sqrt(np.mean(found**2)) == pytest.approx(0.1 * np.sqrt(0.06), rel=0.5)
    assert np.abs(found.mean()) < 0.1 * np.sqrt(0.15 / 570) * 3.0
    turn = np.outer(0.25 * (1.0 - np.cos(0.5 * np.pi * T)), [0.0, 0.0, 1.0])
    assert np.max(np.abs(skewed_rates(T, turn, T[100:-100:50]))) < 2e-3
