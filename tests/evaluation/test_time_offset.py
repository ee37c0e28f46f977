"""The delay of a receiver found from the motion, on drives where it is known."""

from __future__ import annotations

import numpy as np
import pytest
from drives import gnss_of, trajectory_of

from vehnav.config import Config
from vehnav.evaluation import compare
from vehnav.evaluation.time_offset import TimeOffset, estimate_time_offset
from vehnav.logs.log import Gnss
from vehnav.pipeline import run
from vehnav.simulate import simulate
from vehnav.trajectory import Trajectory

DURATION = 600.0


def path(t: np.ndarray, speed: np.ndarray, heading: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    v = np.column_stack([speed * np.sin(heading), speed * np.cos(heading), 0.0 * t])
    return np.cumsum(v, axis=0) * (t[1] - t[0]), v


def city(seed: int, lag: float, noise: float = 1.0) -> tuple[Trajectory, Gnss]:
    """Ten minutes of stop and go with bends; the estimate drifts, the receiver is late and noisy.

    Heading 2 deg off and walking 0.02 deg/sqrt(s), velocity error growing at 0.01 m/s2 (1 sigma)
    between stops; GPS noise with a correlation time of 30 s, 0.1 m white on top, 1 Hz.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, DURATION, 0.05)
    knots = np.arange(0.0, DURATION + 20.0, 10.0)
    speed = np.interp(t, knots, np.clip(rng.uniform(-4.0, 14.0, knots.size), 0.0, None))
    bends = rng.choice([0.0, 0.0, 0.0, 1.0, -1.0], knots.size) * rng.uniform(0.03, 0.12, knots.size)
    heading = np.cumsum(np.interp(t, knots, bends)) * 0.05
    truth, _ = path(t, speed, heading)
    walk = np.cumsum(rng.normal(0.0, np.radians(0.02) * np.sqrt(0.05), t.size))
    estimate, v = path(t, speed, heading + np.radians(2.0) + walk)
    bias = np.append(rng.normal(0.0, 0.01, 2), 0.0)
    last_stop = np.maximum.accumulate(np.where(speed < 0.05, t, 0.0))
    v_error = np.outer(t - last_stop, bias)
    estimate = estimate + np.cumsum(v_error, axis=0) * 0.05
    at = np.arange(0.0, DURATION - 1.0)
    fixes = np.column_stack([np.interp(at, t, truth[:, k]) for k in range(3)])
    share = np.exp(-1.0 / 30.0)
    slow = np.zeros_like(fixes)
    for k in range(1, at.size):
        slow[k] = share * slow[k - 1] + np.sqrt(1.0 - share**2) * rng.normal(0.0, noise, 3)
    fixes += slow + rng.normal(0.0, 0.1, fixes.shape)
    return trajectory_of(t, estimate, v + v_error, heading + walk), gnss_of(at + lag, fixes)


@pytest.mark.parametrize(
    ("lag", "drives", "least", "most"),
    [
        (-0.2, 2, 0.01, 10.6),  # chi-square of 2 degrees: 99 % between
        pytest.param(0.6, 24, 10.0, 46.0, marks=pytest.mark.slow),  # of 24 degrees
    ],
)
def test_delay_is_found_with_an_honest_sigma(
    lag: float, drives: int, least: float, most: float
) -> None:
    """0.1 s rms, which is 1 m at 10 m/s, the noise of the fixes; and as good as its sigmas say."""
    found = [estimate_time_offset(*city(seed, lag)) for seed in range(drives)]
    assert all(isinstance(f, TimeOffset) for f in found)
    error = np.array([f.offset + lag for f in found if f])
    normalised = np.array([(f.offset + lag) / f.sigma for f in found if f])
    assert np.abs(error).max() < 0.3
    assert np.sqrt(np.mean(error**2)) < 0.1
    assert least < np.sum(normalised**2) < most


def test_it_is_reported_but_applied_only_on_request() -> None:
    trajectory, gnss = city(1, 0.6)
    plain = compare(trajectory, gnss)
    assert plain.time_offset == 0.0
    assert plain.found_offset is None
    told = compare(trajectory, gnss, estimate_offset=True)
    assert told.time_offset == 0.0
    assert told.found_offset is not None
    (finding,) = told.findings
    assert finding.code == "gps-delay"
    assert "late" in finding.text
    applied = compare(trajectory, gnss, time_offset="auto")
    assert applied.time_offset == pytest.approx(-0.6, abs=0.15)
    assert applied.findings == ()
    assert applied.horizontal[0] < 1.0 < plain.horizontal[0]  # before drift: 0.6 s of driving


def test_steady_motion_tells_nothing() -> None:
    t = np.arange(0.0, 600.0, 0.1)
    east = np.column_stack([20.0 * t, 0 * t, 0 * t])
    v = np.column_stack([20.0 + 0 * t, 0 * t, 0 * t])
    trajectory = trajectory_of(t, east, v, 0 * t + np.pi / 2)
    rng = np.random.default_rng(5)
    gnss = gnss_of(t[::10] + 0.5, east[::10] + rng.normal(0.0, 1.0, east[::10].shape))
    assert estimate_time_offset(trajectory, gnss) is None
    errors = compare(trajectory, gnss, time_offset="auto")
    assert errors.time_offset == 0.0
    assert [f.code for f in errors.findings] == ["gps-delay"]


def drifting(bend: float = 0.0) -> tuple[Trajectory, Gnss]:
    """A straight drive at 30 m/s whose estimate bends away faster and faster, e-fold in 150 s.

    ``bend``, rad, is the amplitude of what the vehicle steers itself, each 15 s; GPS is 0.5 s late.
    """
    t = np.arange(0.0, DURATION, 0.05)
    heading = 1.0 + bend * np.sin(2.0 * np.pi * t / 15.0)
    truth, _ = path(t, 30.0 + 0.0 * t, heading)
    wrong = heading + 0.02 * np.exp(t / 150.0)
    estimate, v = path(t, 30.0 + 0.0 * t, wrong)
    at = np.arange(0.0, DURATION - 1.0)
    fixes = np.column_stack([np.interp(at, t, truth[:, k]) for k in range(3)])
    fixes += np.random.default_rng(7).normal(0.0, 0.1, fixes.shape)
    return trajectory_of(t, estimate, v, wrong), gnss_of(at + 0.5, fixes)


def test_drift_is_no_motion() -> None:
    """The track bends, GPS shows none of it."""
    trajectory, gnss = drifting()
    assert estimate_time_offset(trajectory, gnss) is None


def test_corrections_of_a_filter_are_no_motion() -> None:
    """A filter without stops on a straight way over the pole: the drift of its track by kilometres
    and its corrections at the epochs were taken for motion (0.7 to 1.2 s of delay, sigma 0.01 s).
    """
    made = simulate("polar", sensor="hg1700", rate_hz=50.0)
    found = run(made.log(), Config(method="filter"))
    assert found.errors is not None
    assert found.errors.horizontal.max() > 1000.0
    assert found.errors.found_offset is None
    assert "gps-delay" not in {finding.code for finding in found.findings}


def test_the_delay_is_found_beside_drift_where_gps_shows_the_motion() -> None:
    found = estimate_time_offset(*drifting(bend=0.1))
    assert found is not None
    assert found.offset == pytest.approx(-0.5, abs=3.0 * found.sigma)
    assert found.sigma < 0.1


def test_too_short_tells_nothing() -> None:
    trajectory, gnss = city(1, 0.6)
    short = Gnss(gnss.t_ns[:60], gnss.lat[:60], gnss.lon[:60], gnss.height[:60])
    assert estimate_time_offset(trajectory, short) is None
