"""The interval of a median: by its exact distribution, by scipy, and by how often it is right."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from vehnav.batch.paired import FEWEST, RESAMPLES, median_interval


def exact_percentiles(x: np.ndarray, level: float) -> tuple[float, float]:
    """Of the resampled median of an odd sample: it is at most x_(k) when at least (n + 1) / 2 of n
    draws are among the k smallest, each with probability k / n."""
    n = x.size
    k = np.arange(1, n + 1)
    at_most = stats.binom.sf((n + 1) // 2 - 1, n, k / n)
    rest = 0.5 * (1.0 - level)
    ordered = np.sort(x)
    return tuple(float(ordered[np.searchsorted(at_most, q)]) for q in (rest, 1.0 - rest))


@pytest.mark.parametrize("n", [7, 21, 101])
def test_odd_samples_against_the_exact_distribution(n: int) -> None:
    x = np.random.default_rng(n).standard_normal(n)
    ours, exact = np.array(median_interval(x)), np.array(exact_percentiles(x, 0.95))
    # the noise of the resampling may move an end to the next value of the sample
    places = np.searchsorted(np.sort(x), [ours, exact])
    assert np.abs(places[0] - places[1]).max() <= 1
    if n < 50:  # its values are too far apart for that
        assert ours == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize("n", [6, 10, 40, 41])
def test_distribution_against_plain_resampling(n: int) -> None:
    """Quantiles of the resampled medians as scipy finds them by drawing whole samples."""
    x = np.random.default_rng(3).exponential(size=n)
    for level in (0.5, 0.8, 0.95):
        found = stats.bootstrap(
            (x,), np.median, confidence_level=level, n_resamples=RESAMPLES, method="percentile",
            rng=np.random.default_rng(5), vectorized=True, batch=1000,
        ).confidence_interval  # fmt: skip
        # both are quantiles of 20000 draws; the medians of a small sample lie on a grid
        grid = np.sort(x)
        widest = np.diff(grid)[: max(1, (3 * n) // 4)].max()
        ours = median_interval(x, level=level)
        assert ours == pytest.approx((found.low, found.high), abs=0.5 * widest)


def test_holds_the_median_as_often_as_it_says() -> None:
    """Of 400 samples of 25 changes the interval misses the true median in 5 %, within 3 sigma."""
    rng = np.random.default_rng(11)
    missed = 0
    for _ in range(400):
        low, high = median_interval(rng.standard_normal(25), resamples=2000)
        missed += not low <= 0.0 <= high
    assert 400 * 0.05 - 3 * np.sqrt(400 * 0.05 * 0.95) < missed < 400 * 0.05 + 13.1


def test_few_values_have_no_interval() -> None:
    assert median_interval(np.arange(FEWEST - 1)) is None
    # the widest interval, from the smallest to the largest, holds 1 - 2 / 2**n
    assert 1 - 2 / 2 ** (FEWEST - 1) < 0.95 < 1 - 2 / 2**FEWEST


def test_the_same_sample_has_the_same_interval_in_any_order() -> None:
    x = np.random.default_rng(2).standard_normal(50)
    assert median_interval(x) == median_interval(x[::-1]) == median_interval(list(x))


def test_a_hundred_thousand_logs_cost_what_ten_do() -> None:
    x = np.random.default_rng(4).standard_normal(100_000)
    low, high = median_interval(x)
    # asymptotic: sd of the median is sqrt(pi / 2 / n)
    assert high - low == pytest.approx(2 * 1.96 * np.sqrt(np.pi / 2 / x.size), rel=0.1)
