"""Windows by time: against brute force and a known noise."""

from __future__ import annotations

import numpy as np
import pytest

from vehnav.rest import (
    TimeIntegral,
    running_deviation,
    running_mean,
    runs,
    samples_in_window,
    white_noise,
)


def fine_mean(t: np.ndarray, y: np.ndarray, a: float, b: float) -> float:
    """Mean of the piecewise linear signal by a grid far finer than its steps."""
    a, b = max(a, t[0]), min(b, t[-1])
    grid = np.linspace(a, b, 20_001)
    values = np.interp(grid, t, y)
    return float(np.trapezoid(values, grid) / (b - a))


@pytest.fixture
def uneven() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.005, 0.04, 300))
    return t, rng.normal(size=(300, 2)) + 1000.0


def test_running_mean_is_the_integral_over_the_window_on_an_uneven_clock(uneven) -> None:
    t, y = uneven
    means = running_mean(t, y, 0.5)
    for k in (0, 5, 150, 299):
        for axis in (0, 1):
            expected = fine_mean(t, y[:, axis], t[k] - 0.25, t[k] + 0.25)
            assert means[k, axis] == pytest.approx(expected, abs=2e-4)  # the grid's own error


def test_running_deviation_is_free_of_a_constant_bias_and_adds_variances(uneven) -> None:
    t, y = uneven
    one = running_deviation(t, y, 0.5)
    shifted = running_deviation(t, y + np.array([5.0, -300.0]), 0.5)
    assert shifted == pytest.approx(one, rel=1e-6)
    each = [running_deviation(t, y[:, k : k + 1], 0.5) for k in (0, 1)]
    assert one == pytest.approx(np.hypot(*each), rel=1e-9)


def test_deviation_of_a_sine_is_its_amplitude_over_root_two() -> None:
    t = np.arange(0.0, 20.0, 0.001)
    y = 3.0 * np.sin(2 * np.pi * 1.0 * t)[:, None]
    middle = running_deviation(t, y, 2.0)[8000:12000]  # two whole periods in the window
    assert middle == pytest.approx(3.0 / np.sqrt(2.0), rel=1e-4)


def test_integral_keeps_digits_beside_a_large_offset() -> None:
    t = np.arange(0.0, 3600.0, 0.01)
    y = np.full((t.size, 1), 9.81) + 1e-6 * np.sin(t)[:, None]
    mean = TimeIntegral(t, y).mean(np.array([3000.0]), np.array([3000.0 + 2 * np.pi]))
    assert float(mean[0, 0]) == pytest.approx(9.81, abs=1e-11)


def test_a_gap_leaves_few_samples_in_the_window() -> None:
    t = np.concatenate([np.arange(0.0, 5.0, 0.01), np.arange(7.0, 12.0, 0.01)])
    counts = samples_in_window(t, 2.0)
    assert counts[250] == 201
    assert counts[499] == pytest.approx(101, abs=1)  # half of the window is in the gap


def test_runs_of_true() -> None:
    mask = np.array([True, False, True, True, False, False, True])
    assert runs(mask).tolist() == [[0, 0], [2, 3], [6, 6]]
    assert runs(np.zeros(4, bool)).shape == (0, 2)


def test_white_noise_finds_the_density_and_ignores_drift_and_bias() -> None:
    rng = np.random.default_rng(8)
    rate, density = 100.0, 0.02
    t = np.arange(0.0, 900.0, 1.0 / rate)
    y = density * np.sqrt(rate) * rng.normal(size=(t.size, 3)) + 5.0 + 1e-4 * t[:, None]
    found = white_noise(t, y, [(0, t.size // 3), (t.size // 2, t.size - 1)])
    assert found == pytest.approx(density, rel=0.1)  # 5 % sampling error of 750 differences
    assert np.all(np.isnan(white_noise(t, y, [(0, 120)])))
