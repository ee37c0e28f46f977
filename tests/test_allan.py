"""Allan deviation of pieces of rest and the figures of a sensor from it.

Judges: allantools, scipy quadrature of the power spectra, closed forms, and records that the
processes of the simulator make with known figures.
"""

from __future__ import annotations

import math
from itertools import pairwise

import allantools
import numpy as np
import pytest
from allantools import ci
from scipy.integrate import dblquad, quad
from scipy.stats import chi2

from vehnav.allan import (
    AxisFit,
    PieceMeans,
    Powers,
    allan_curve,
    allan_form,
    fit_axes,
    octaves,
)
from vehnav.allan.between import mean_covariance, structure
from vehnav.allan.processes import floor_of, mean_form
from vehnav.allan.spread import Spread, edf
from vehnav.sensors.processes import markov, random_walk

RATE = 20.0


def record(
    rng: np.random.Generator,
    seconds: float,
    *,
    white: float = 0.0,
    bias: float = 0.0,
    time: float = 100.0,
    walk: float = 0.0,
    angle: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Clock and three independent axes of a rate at 20 Hz."""
    t = np.arange(round(seconds * RATE)) / RATE
    y = rng.standard_normal((t.size, 3)) * white * math.sqrt(RATE)
    if bias:
        y += markov(t, sigma=bias, time=time, rng=rng)
    if walk:
        y += random_walk(t, sigma=walk, rng=rng)
    if angle:
        y += np.diff(rng.standard_normal((t.size + 1, 3)) * angle, axis=0) * RATE
    return t, y


def fitted(seed: int, stops: list[tuple[float, float]], **noise: float) -> list[AxisFit]:
    """Fits of the three axes of a drive that stands during ``stops``."""
    t, y = record(np.random.default_rng(seed), stops[-1][1], **noise)
    spans = [(np.searchsorted(t, a - 1e-9), np.searchsorted(t, b - 1e-9)) for a, b in stops]
    pieces = [y[a:b] for a, b in spans]
    start, end = np.array(stops).T
    means = PieceMeans(
        start, end, np.array([p.mean(axis=0) for p in pieces]), np.zeros((len(stops), 3))
    )
    return fit_axes(allan_curve(pieces, 1.0 / RATE), means)


# ---- the deviation -----------------------------------------------------------------------------


def test_one_piece_is_allantools():
    y = np.random.default_rng(1).standard_normal((3000, 2)).cumsum(axis=0) + 1e3
    curve = allan_curve([y], 0.01)
    for k in range(2):
        tau, deviation, _, _ = allantools.oadev(
            y[:, k] - 1e3, rate=100.0, data_type="freq", taus=curve.tau
        )
        np.testing.assert_allclose(tau, curve.tau, rtol=1e-12)
        np.testing.assert_allclose(curve.deviation[:, k], deviation, rtol=1e-9)  # offset 1e3
    y = np.random.default_rng(2).standard_normal((3000, 1))
    _, deviation, _, _ = allantools.oadev(y[:, 0], rate=100.0, data_type="freq", taus=curve.tau)
    np.testing.assert_allclose(allan_curve([y], 0.01).deviation[:, 0], deviation, rtol=1e-12)


def test_pieces_are_pooled_and_never_joined():
    rng = np.random.default_rng(3)
    pieces = [rng.standard_normal((n, 1)) for n in (40, 400, 1000)]
    curve = allan_curve(pieces, 0.1)
    moved = [p + offset for p, offset in zip(pieces, (5.0, -70.0, 300.0), strict=True)]
    np.testing.assert_allclose(allan_curve(moved, 0.1).variance, curve.variance, rtol=1e-8)
    for k, m in enumerate(curve.clusters):
        own, freedom = [], []
        for piece in pieces:
            if 2 * m <= len(piece):
                tau = [m * 0.1]
                found = allantools.oadev(piece[:, 0], rate=10.0, data_type="freq", taus=tau)
                own.append(found[1][0] ** 2)
                freedom.append(ci.edf_simple(len(piece) + 1, int(m), 0))
        assert curve.pieces[k] == len(own)
        assert np.count_nonzero(curve.weights[k]) == len(own)
        assert curve.variance[k, 0] == pytest.approx(curve.weights[k, -len(own) :] @ own, rel=1e-10)
        # longer pieces weigh as their degrees of freedom do (Stein's formula, good to some percent)
        expected = np.array(freedom) / sum(freedom)
        np.testing.assert_allclose(curve.weights[k, -len(own) :], expected, atol=0.05)


def test_degrees_of_freedom_are_those_of_the_handbook():
    for m in (1, 2, 4, 8, 16, 64, 256):
        # Stein's formula as allantools has it, good to 2 % where the record is long
        expected = ci.edf_simple(5001, m, 0)
        assert edf(np.array([5000]), m)[0] == pytest.approx(expected, rel=0.035)
    assert edf(np.array([99, 100]), 50).tolist() == [0.0, pytest.approx(1.0)]


def test_too_short_to_have_a_difference():
    with pytest.raises(ValueError, match="two clusters"):
        allan_curve([np.zeros((1, 3))], 0.01)
    assert octaves(1).size == 0


# ---- the processes -----------------------------------------------------------------------------


@pytest.mark.parametrize("tau", [1e-4, 0.3, 3.0, 50.0, 4000.0])
def test_allan_forms_are_the_integral_of_the_spectrum(tau):
    """sigma^2 = 4 int S(f) sin^4(pi f tau) / (pi f tau)^2 df, S two-sided (IEEE 952, C.1)."""
    time = 10.0

    def bias(x: float) -> float:  # x = f tau
        spectrum = 2.0 * time / (1.0 + (2.0 * math.pi * x / tau * time) ** 2)
        return 4.0 * spectrum * math.sin(math.pi * x) ** 4 / (math.pi * x) ** 2 / tau

    edges = [0.0, *(np.geomspace(1e-6, 1.0, 13)), *np.arange(2.0, 200.0)]
    total = sum(quad(bias, a, b, epsabs=0.0, epsrel=1e-8)[0] for a, b in pairwise(edges))
    found = float(allan_form("bias", np.array([tau]), time)[0])
    assert found == pytest.approx(total, rel=0.003)  # cut off at x = 199


def test_a_markov_bias_peaks_where_the_standard_says():
    tau = np.linspace(1.0, 4.0, 3001)
    form = np.sqrt(allan_form("bias", tau, 1.0))
    assert tau[np.argmax(form)] == pytest.approx(1.89, abs=0.01)
    # IEEE 952 writes 0.437 q_c sqrt(T) with q_c = sigma sqrt(2 / T)
    assert floor_of(2.0) == pytest.approx(2.0 * 0.437 * math.sqrt(2.0), rel=0.002)


@pytest.mark.parametrize(
    ("kind", "noise", "power"),
    [
        ("white", {"white": 0.7}, 0.49),
        ("walk", {"walk": 0.3}, 0.09),
        ("bias", {"bias": 2.0, "time": 6.0}, 4.0),
        ("angle", {"angle": 0.5}, 0.25),
    ],
)
def test_records_follow_their_form_and_scatter_as_said(kind, noise, power):
    """Mean of 40 records of three axes within its stated covariance; so is their scatter."""
    clusters = np.array([8, 16, 32, 64, 128])
    runs = []
    for seed in range(40):
        _, y = record(np.random.default_rng(seed), 130.0, **noise)
        curve = allan_curve([y[:1000], y[1200:1500], y[1600:]], 1.0 / RATE, clusters=clusters)
        runs.append(curve.variance)
    found = np.concatenate(runs, axis=1)  # (k, 120)
    powers = Powers(**{kind: power}, time=noise.get("time", 1.0))
    expected = power * allan_form(kind, curve.tau, powers.time)
    spread = Spread(curve.lengths, clusters, curve.weights, curve.dt).covariance(powers)
    away = found.mean(axis=1) - expected
    chi_square = away @ np.linalg.solve(spread / found.shape[1], away)
    assert chi_square < chi2.ppf(0.9999, clusters.size)
    # sd of a variance of 120 skew numbers: 20 %; three of them
    np.testing.assert_allclose(np.var(found, axis=1), np.diagonal(spread), rtol=0.6)
    ratio = np.cov(found) / np.sqrt(np.outer(np.diagonal(spread), np.diagonal(spread)))
    scale = spread / np.sqrt(np.outer(np.diagonal(spread), np.diagonal(spread)))
    np.testing.assert_allclose(ratio, scale, atol=0.45)


def test_means_of_pieces_covary_as_the_integral_of_the_correlation():
    start, end = np.array([0.0, 4.0, 30.0]), np.array([3.0, 9.0, 31.0])

    def mean(function, k: int, j: int) -> float:
        area = dblquad(function, start[k], end[k], start[j], end[j])[0]
        return area / ((end[k] - start[k]) * (end[j] - start[j]))

    bias, walk = (mean_form(kind, start, end, 5.0) for kind in ("bias", "walk"))
    white = mean_form("white", start, end, 5.0)
    for k, j in [(0, 0), (0, 1), (1, 1), (1, 2), (2, 2)]:
        assert bias[k, j] == pytest.approx(
            mean(lambda y, x: math.exp(-abs(x - y) / 5.0), k, j), rel=1e-4
        )
        assert walk[k, j] == pytest.approx(mean(lambda y, x: min(x, y), k, j), rel=1e-4)
    np.testing.assert_allclose(np.diagonal(white), [1 / 3, 1 / 5, 1.0])


def test_structure_of_means():
    """Half mean squared differences, by hand; expected values and scatter by Monte Carlo."""
    start = np.array([0.0, 100.0, 250.0, 1000.0])
    means = PieceMeans(
        start, start + 10.0, np.array([[1.0], [3.0], [2.0], [7.0]]), np.zeros((4, 1))
    )
    found = structure(means)
    # octaves from the smallest separation: 100 and 150; 250; 750; 900 and 1000 s
    assert found.separation == pytest.approx([125.0, 250.0, 750.0, 950.0])
    assert found.pairs.tolist() == [2, 1, 1, 2]
    expected = [(4 + 1) / 4, 1 / 2, 25 / 2, (16 + 36) / 4]
    np.testing.assert_allclose(found.value[:, 0], expected)
    powers = Powers(white=3.0, bias=2.0, time=200.0, walk=0.01)
    covariance = mean_covariance(means, 0, powers)
    draws = np.random.default_rng(4).multivariate_normal(np.zeros(4), covariance, 40_000)
    values = np.einsum("bij,ni,nj->nb", found.forms, draws, draws)
    np.testing.assert_allclose(found.expected(covariance), values.mean(axis=0), rtol=0.03)
    # 40 000 products: half a percent of the sizes
    size = np.sqrt(np.diagonal(found.spread(covariance)))
    away = (found.spread(covariance) - np.cov(values.T)) / np.outer(size, size)
    assert np.max(np.abs(away)) < 0.06


# ---- the figures -------------------------------------------------------------------------------

CITY = [(0.0, 30.0), (90.0, 110.0), (170.0, 230.0), (430.0, 445.0), (550.0, 590.0), (640.0, 665.0)]


def inside(fits: list[AxisFit], kind: str, truth: float, sigmas: float) -> float:
    """Share of the told figures within that many of their own sigmas."""
    told = [getattr(fit, kind) for fit in fits if getattr(fit, kind).value is not None]
    return float(np.mean([abs(x.value - truth) < sigmas * x.sigma for x in told]))


def test_noise_of_a_city_drive_is_found_and_nothing_else():
    fits = [fit for seed in range(8) for fit in fitted(seed, CITY, white=0.02)]
    for fit in fits:
        assert fit.white.value == pytest.approx(0.02, rel=0.05)
    more = [f for f in fits if f.bias.value or f.walk.value or f.angle.value]
    assert len(more) <= 1  # three tests at 2.8 sigma each on 24 axes
    assert inside(fits, "white", 0.02, 1.0) > 0.45  # 68 % of 24; binomial 2.4 sigma
    assert inside(fits, "white", 0.02, 2.0) > 0.8


def test_a_bias_of_a_long_rest_is_found():
    fits = [f for seed in range(3) for f in fitted(seed, [(0.0, 3600.0)], white=1.0, bias=1.0)]
    for fit in fits:
        assert fit.white.value == pytest.approx(1.0, rel=0.1)
        assert fit.bias.value == pytest.approx(1.0, rel=0.3)
        assert fit.time == pytest.approx(100.0, rel=0.8)
        assert fit.walk.value is None


def test_a_bias_that_moves_between_stops_is_found():
    """No stop is longer than a minute: the bias of 300 s shows in the means alone."""
    stops = [(180.0 * k, 180.0 * k + 60.0) for k in range(40)]
    noise = {"white": 1.0, "bias": 0.5, "time": 300.0}
    fits = [f for seed in range(3) for f in fitted(seed, stops, **noise)]
    told = [f.bias.value for f in fits if f.bias.value is not None]
    assert len(told) >= 8
    assert np.median(told) == pytest.approx(0.5, rel=0.2)
    assert inside(fits, "bias", 0.5, 3.0) > 0.85


def test_a_walk_is_found_and_said_to_look_like_a_bias():
    fits = [f for seed in range(3) for f in fitted(seed, [(0.0, 900.0)], white=0.5, walk=0.05)]
    growing = [f for f in fits if f.still_growing]
    assert len(growing) >= 7
    for fit in growing:
        assert fit.bias.value is None
        assert fit.walk.value == pytest.approx(0.05, rel=0.6)
    assert inside(growing, "walk", 0.05, 2.0) > 0.7


def test_a_short_rest_says_that_it_cannot_tell():
    for fit in fitted(5, [(0.0, 15.0)], white=0.02, bias=0.001, time=300.0):
        assert fit.white.value == pytest.approx(0.02, rel=0.1)
        assert (fit.bias.value, fit.bias.limit) == (None, None)  # 7.5 s show no bias
        assert (fit.walk.value, fit.walk.limit) == (None, None)


def test_engine_vibration_is_left_out_and_does_not_move_the_noise():
    """An engine about 7.3 Hz, its phase wandering, ten times the noise of a sample."""
    rng = np.random.default_rng(6)
    t, y = record(rng, 300.0, white=0.02)
    phase = 2.0 * math.pi * 7.3 * t[:, None] + rng.standard_normal((t.size, 3)).cumsum(axis=0) * 0.1
    shaken = y + math.sqrt(2.0) * np.sin(phase)
    # the wandering phase is itself white noise at long times: power A^2 / 2 times twice its
    # diffusion over the square of 2 pi 7.3 rad/s
    own = 1.0 * 0.1**2 * RATE / (2.0 * math.pi * 7.3) ** 2
    truth = math.sqrt(0.02**2 + own)
    quiet, loud = (fit_axes(allan_curve([x], 1.0 / RATE)) for x in (y, shaken))
    assert all(fit.first_tau == 1.0 / RATE for fit in quiet)
    assert all(fit.first_tau >= 0.2 for fit in loud)
    assert all(abs(fit.white.value - truth) < 3.0 * fit.white.sigma for fit in loud)
    assert np.median([fit.white.value for fit in loud]) == pytest.approx(truth, rel=0.2)


def test_counts_of_the_angle_do_not_move_the_noise():
    for fit in fitted(7, [(0.0, 600.0)], white=0.02, angle=0.01):
        assert fit.angle.value == pytest.approx(0.01, rel=0.1)
        assert fit.white.value == pytest.approx(0.02, rel=0.1)


def test_noise_of_the_angle_alone_bounds_the_white_noise():
    """As of a unit whose own filter corrects its rates: the deviation falls with 1/tau."""
    _, y = record(np.random.default_rng(8), 30.0, angle=0.01)
    for fit in fit_axes(allan_curve([y], 1.0 / RATE)):
        assert fit.angle.value == pytest.approx(0.01, rel=0.1)
        assert fit.white.value is None
        assert 0.0 < fit.white.limit < 0.01
        assert not fit.dead


def test_a_reading_that_does_not_change_is_dead():
    (fit,) = fit_axes(allan_curve([np.zeros((500, 1))], 0.01))
    assert fit.dead
    assert fit.white.value is None


def test_limits_hold():
    """A bias too small to be seen lies under its limit in 95 % of the cases; 42 of them here."""
    noise = {"white": 0.2, "bias": 0.02, "time": 20.0}
    fits = [f for seed in range(14) for f in fitted(seed, [(0.0, 240.0)], **noise)]
    limits = [f.bias.limit for f in fits if f.bias.limit is not None]
    assert len(limits) > 30
    assert np.mean(np.array(limits) > 0.02) > 0.85


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stops", "noise"),
    [
        ([(0.0, 3600.0)], {"white": 1.0, "bias": 1.0, "time": 100.0}),
        ([(180.0 * k, 180.0 * k + 60.0) for k in range(40)],
         {"white": 1.0, "bias": 0.5, "time": 300.0}),
        ([(0.0, 7200.0)], {"white": 1.0, "bias": 0.5, "time": 50.0, "walk": 0.02}),
    ],
)  # fmt: skip
def test_twenty_seeds(stops, noise):
    """Noise within 10 %, bias within 30 % for nine of ten, and the sigmas cover."""
    fits = [f for seed in range(20) for f in fitted(seed, stops, **noise)]
    assert all(abs(f.white.value / noise["white"] - 1.0) < 0.1 for f in fits)
    told = np.array([f.bias.value for f in fits if f.bias.value is not None])
    assert told.size >= 57
    assert np.mean(abs(told / noise["bias"] - 1.0) < 0.3) > 0.85
    for kind in ("white", "bias"):
        assert inside(fits, kind, noise[kind], 1.0) > 0.5
        assert inside(fits, kind, noise[kind], 2.0) > 0.8
