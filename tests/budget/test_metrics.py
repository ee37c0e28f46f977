"""Circles of a normal error against scipy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import integrate, stats

from vehnav.budget.metrics import EMPIRICAL, METRICS, cep, drms


def probability(radius: float, ratio: float) -> float:
    """P(x^2 + y^2 < radius^2) for sigmas 1 and ratio, by scipy's quadrature over x = R sin a."""

    def density(a: float) -> float:
        across = 2.0 * stats.norm.cdf(radius * math.cos(a) / ratio) - 1.0
        return radius * math.cos(a) * stats.norm.pdf(radius * math.sin(a)) * across

    return 2.0 * integrate.quad(density, 0.0, math.pi / 2, epsabs=1e-12, limit=300)[0]


@pytest.mark.parametrize("share", [0.5, 0.95])
@pytest.mark.parametrize("ratio", [1.0, 0.7, 0.1, 0.01, 1e-3])
def test_cep_of_any_ratio(ratio, share):
    radius = float(cep(np.diag([1.0, ratio**2]), share))
    assert probability(radius, ratio) == pytest.approx(share, abs=1e-7)


def test_cep_known_values():  # T22
    sigma = 3.7
    assert cep(np.eye(2) * sigma**2, 0.5) == pytest.approx(1.17741 * sigma, rel=1e-5)
    assert cep(np.eye(2) * sigma**2, 0.95) == pytest.approx(2.44775 * sigma, rel=1e-5)
    for thin in (1e-8, 0.0):
        one = np.diag([1.0, thin])
        assert cep(one, 0.5) == pytest.approx(stats.norm.ppf(0.75), rel=1e-6)
        assert cep(one, 0.95) == pytest.approx(stats.norm.ppf(0.975), rel=1e-6)
    assert cep(np.zeros((2, 2)), 0.95) == 0.0


def test_metrics_do_not_depend_on_the_axes():
    turn = stats.special_ortho_group.rvs(2, random_state=3)
    c = np.diag([9.0, 0.5])
    for name in ("drms", "cep50", "cep95"):
        assert METRICS[name](turn @ c @ turn.T) == pytest.approx(float(METRICS[name](c)), rel=1e-12)
    assert drms(c) == pytest.approx(math.sqrt(9.5))


def test_metrics_of_drawn_errors_approach_those_of_the_covariance():
    c = np.array([[4.0, 1.5], [1.5, 2.0]])
    drawn = np.random.default_rng(1).multivariate_normal([0, 0], c, size=200_000)
    for name, metric in METRICS.items():
        assert EMPIRICAL[name](drawn) == pytest.approx(float(metric(c)), rel=0.01)


def test_share_must_be_a_share():
    with pytest.raises(ValueError, match="share"):
        cep(np.eye(2), 1.0)
