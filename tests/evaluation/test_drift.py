"""Drift since the last correction and the honesty of sigmas, on cases known in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drives import T0_NS, gnss_of, stamps, trajectory_of

from vehnav.evaluation import compare
from vehnav.evaluation.calibration import EXPECTED_1D, EXPECTED_2D, calibration
from vehnav.evaluation.drift import legs_of

S = 1_000_000_000


def stop_every_100_s() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Eastward at 10 m/s, standing in the first 20 s of every 100 s; 500 s: t, position, speed."""
    t = np.arange(0.0, 500.01, 0.1)
    phase = np.remainder(t, 100.0)
    whole = np.floor(t / 100.0)
    east = 800.0 * whole + 10.0 * np.maximum(phase - 20.0, 0.0)
    return t, np.column_stack([east, 0 * t, 0 * t]), 10.0 * (phase > 20.0)


def drifting(growth: float = 0.01, between: float = 7.0):
    """Error north: growth t^2 / 2 since each stop, on top of what earlier legs left."""
    t, enu, speed = stop_every_100_s()
    since = np.maximum(np.remainder(t, 100.0) - 20.0, 0.0)
    error = 0.5 * growth * since**2 + between * np.floor(t / 100.0)
    v = np.column_stack([speed, 0 * t, 0 * t])
    made = trajectory_of(t, enu + np.column_stack([0 * t, error, 0 * t]), v, 0 * t + np.pi / 2)
    return replace(made, stopped=np.remainder(t, 100.0) <= 20.0)


def fixes():
    t, enu, _ = stop_every_100_s()
    return gnss_of(t[::10], enu[::10])


def test_legs() -> None:
    trajectory = drifting()
    legs = [((a - T0_NS) / S, (b - T0_NS) / S) for a, b in legs_of(trajectory, None)]
    assert legs == [(20.0 + 100 * k, 100.0 + 100 * k) for k in range(5)]
    with_gps = [((a - T0_NS) / S, (b - T0_NS) / S) for a, b in legs_of(trajectory, T0_NS + 50 * S)]
    assert with_gps[0] == (50.0, 100.0)  # since GPS was last used
    assert with_gps[1] == (120.0, 200.0)
    standing = [(a - T0_NS) / S for a, _ in legs_of(trajectory, T0_NS + 110 * S)]
    assert standing == [120.0, 220.0, 320.0, 420.0]


def test_drift_is_the_growth_since_the_stop_not_the_error() -> None:
    errors = compare(drifting(), fixes())
    assert errors.drift is not None
    by_time = {row.after: row for row in errors.drift.by_time}
    assert set(by_time) == {10.0, 30.0, 60.0}
    # 1 Hz fixes, linear between them: marks lie on fixes; plane to ellipsoid 1e-3 of metres
    for after, row in by_time.items():
        assert row.legs == 5
        assert row.median_m == pytest.approx(0.005 * after**2, abs=0.02)
        assert row.max_m == pytest.approx(0.005 * after**2, abs=0.02)
    by_distance = {row.after: row for row in errors.drift.by_distance}
    # 500 m after 50 s; the path of positions averaged over a second knows it to some metres
    assert by_distance[500.0].median_m == pytest.approx(12.5, rel=0.05)
    tree = errors.to_dict()["drift"]
    assert tree["by_time"][0]["after_s"] == 10.0
    assert tree["by_distance"][0]["after_m"] == 50.0


def test_without_stops_there_is_no_drift_since_a_stop() -> None:
    trajectory = drifting()
    free = replace(trajectory, stopped=np.zeros(trajectory.size, bool))
    assert compare(free, fixes()).drift is None
    since_gps = compare(free, fixes(), judge_from_ns=T0_NS + 20 * S).drift
    assert since_gps is not None
    assert since_gps.by_time[-1].after == 300.0


def test_honest_sigmas_are_called_honest() -> None:
    """Normal errors of the stated size; 20 000 draws know the shares to 0.4 % (1 sigma)."""
    rng = np.random.default_rng(1)
    sigma = rng.uniform(0.5, 20.0, (20_000, 3))
    found = calibration(sigma * rng.normal(size=sigma.shape), sigma)
    assert found is not None
    for shares in found.inside.values():
        assert shares == pytest.approx(EXPECTED_1D, abs=0.015)
    assert found.circle == pytest.approx(EXPECTED_2D, abs=0.015)
    assert list(found.rms.values()) == pytest.approx([1.0] * 3, abs=0.02)


def test_over_confident_sigmas_are_seen() -> None:
    rng = np.random.default_rng(2)
    sigma = np.full((5000, 3), 2.0)
    found = calibration(3.0 * sigma * rng.normal(size=sigma.shape), sigma)
    assert found is not None
    assert found.rms["east"] == pytest.approx(3.0, rel=0.05)
    assert found.circle[0] == pytest.approx(1.0 - np.exp(-0.5 / 9.0), abs=0.02)


def test_the_noise_of_the_reference_is_not_held_against_the_solution() -> None:
    rng = np.random.default_rng(3)
    sigma, noise = np.full((20_000, 3), 1.0), np.full((20_000, 3), 3.0)
    error = sigma * rng.normal(size=sigma.shape) - noise * rng.normal(size=sigma.shape)
    blamed = calibration(error, sigma)
    fair = calibration(error, sigma, reference_sigma=noise)
    assert blamed is not None
    assert fair is not None
    assert blamed.rms["north"] > 3.0
    assert fair.rms["north"] == pytest.approx(1.0, abs=0.02)


def test_calibration_in_the_tree() -> None:
    trajectory = drifting(growth=0.0, between=0.0)
    assert compare(trajectory, fixes()).to_dict()["calibration"] is None
    sure = replace(trajectory, sigma_pos=np.full((trajectory.size, 3), 2.0))
    tree = compare(sure, fixes()).to_dict()["calibration"]
    assert tree["circle"] == [1.0, 1.0, 1.0]
    assert tree["expected_circle"] == pytest.approx([0.39, 0.86, 0.99], abs=0.005)
    unsure = replace(trajectory, sigma_pos=np.zeros((trajectory.size, 3)))
    assert compare(unsure, fixes()).to_dict()["calibration"] is None


def test_errors_below_the_noise_of_gps_are_not_claimed() -> None:
    trajectory = drifting(growth=0.0, between=0.0)
    gnss = fixes()
    rng = np.random.default_rng(4)
    noise = np.column_stack([rng.normal(0.0, 1.5, (gnss.t_ns.size, 2)), np.zeros(gnss.t_ns.size)])
    noisy = gnss_of((gnss.t_ns - T0_NS) * 1e-9, stop_every_100_s()[1][::10] + noise)
    noisy = replace(noisy, sigma_pos=np.full((gnss.t_ns.size, 3), 2.0))
    errors = compare(trajectory, noisy)
    assert [f.code for f in errors.findings] == ["below-gps-noise"]
    assert errors.to_dict()["reference_sigma_m"] == pytest.approx(2.0 * np.sqrt(2.0))
    bad = compare(drifting(), noisy)
    assert "below-gps-noise" not in [f.code for f in bad.findings]


def test_fixes_that_the_receiver_calls_bad_do_not_judge() -> None:
    trajectory, gnss = drifting(growth=0.0, between=0.0), fixes()
    sigma = np.full((gnss.t_ns.size, 3), 2.0)
    sigma[200:210] = 60.0
    lat = gnss.lat.copy()
    lat[200:210] += 1e-5  # 64 m off, as it says
    errors = compare(trajectory, replace(gnss, lat=lat, sigma_pos=sigma))
    assert errors.counts["uncertain"] == 10
    assert errors.horizontal.max() < 0.01
    assert stamps(np.array([200.0]))[0] not in errors.t_ns
