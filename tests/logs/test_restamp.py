"""Jittered stamps: the true instants of a made sensor are found again."""

from __future__ import annotations

import numpy as np
import pytest

from vehnav.logs.log import Imu
from vehnav.logs.restamp import even_stamps, losses, regress_stamps

STEP = 0.025


def instants(n: int = 4000, drift: float = 2e-4) -> np.ndarray:
    """A crystal that is 200 ppm off and warms up."""
    k = np.arange(n)
    return STEP * (1.0 + drift) * k + 1e-4 * np.sin(k / 500.0)


def late(t: np.ndarray, seed: int = 1) -> np.ndarray:
    """Stamps on arrival: USB batches and a host that is busy now and then; order is kept."""
    rng = np.random.default_rng(seed)
    arrived = t + rng.uniform(0.0, 0.012, t.size)
    for k in rng.integers(0, t.size - 6, 20):
        arrived[k : k + 5] = np.maximum(arrived[k : k + 5], arrived[k] + 0.11)
    return np.maximum.accumulate(arrived + 1e-6 * np.arange(t.size))


def imu(t: np.ndarray) -> Imu:
    t_ns = 1_700_000_000_000_000_000 + np.round(t * 1e9).astype(np.int64)
    return Imu(t_ns, np.zeros((t.size, 3)), np.zeros((t.size, 3)))


def test_jitter_becomes_a_constant_delay() -> None:
    true = instants()
    found = regress_stamps(late(true))
    error = found - true
    jitter = np.std(late(true) - true)
    assert jitter > 0.005
    assert np.std(error[40:-40]) < 0.35 * jitter  # a batch of five moves the mean of 80 by 7 ms


def test_an_even_clock_is_left_alone() -> None:
    log = imu(instants())
    same, findings = even_stamps(log)
    assert same is log
    assert findings == []


def test_regressed_stamps_increase_and_are_said() -> None:
    log = imu(late(instants()))
    even, (finding,) = even_stamps(log)
    assert finding.code == "stamps-regressed"
    assert "ms" in finding.text
    assert np.all(np.diff(even.t_ns) > 0)
    assert np.std(np.diff(even.t_ns)) < 0.1 * np.std(np.diff(log.t_ns))


def test_lost_samples_are_not_smeared() -> None:
    """Twenty samples lost: half a second, of which nothing is spread to either side."""
    true = np.delete(instants(), np.arange(2000, 2020))
    stamps = late(true)
    assert losses(stamps) == [2000]
    error = regress_stamps(stamps) - true
    offset = np.median(error)
    assert np.abs(error[1900:2100] - offset).max() < 0.01
    assert regress_stamps(stamps)[2000] - regress_stamps(stamps)[1999] == pytest.approx(
        21 * STEP, abs=0.01
    )


def test_a_delay_that_is_caught_up_is_no_loss() -> None:
    t = instants()
    t = t.copy()
    t[1000:1004] = t[1004] - 1e-5 * np.arange(4, 0, -1)  # four arrive with the fifth
    assert losses(t) == []
