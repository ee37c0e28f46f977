"""Increments from samples: quadrature weights, orders, gaps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from strapdown_motion import car, exact

from vehnav.strapdown.increments import (
    Increments,
    gap_steps,
    increments_from_log,
    increments_from_rates,
)

step = st.floats(0.4, 1.1)  # neighbours differ by less than a factor of 3, no gap


def integrate(t, y, holding="cubic", max_gap=0.5):
    """(n-1,) integrals of a scalar through the x gyro and the z accelerometer alike."""
    zeros = np.zeros_like(y)
    inc = increments_from_rates(
        t,
        np.stack([y, zeros, zeros], axis=1),
        np.stack([zeros, zeros, y], axis=1),
        max_gap=max_gap,
        holding=holding,
    )
    np.testing.assert_array_equal(inc.dtheta[:, 0], inc.dvel[:, 2])
    assert not inc.dtheta[:, 1:].any()
    assert not inc.dvel[:, :2].any()
    return inc.dtheta[:, 0]


@given(st.lists(step, min_size=5, max_size=12), st.tuples(*[st.floats(-2.0, 2.0)] * 4))
def test_cubics_are_integrated_exactly_on_uneven_steps(steps, coefficients):
    t = np.concatenate([[0.0], np.cumsum(steps)])
    assume(not gap_steps(t).any())  # 1.1 may exceed 1.5 medians
    cubic = Polynomial(coefficients)
    exact_integral = np.diff(cubic.integ()(t))
    scale = 1.0 + np.abs(cubic(t)).max()
    np.testing.assert_allclose(integrate(t, cubic(t)), exact_integral, atol=2e-13 * scale)


def test_even_steps_have_the_known_weights():
    """(-1, 13, 13, -1) / 24 times the step (spec A 5.4); at the ends (9, 19, -5, 1) / 24."""
    t = np.arange(6) * 0.5
    weights = np.array([integrate(t, y) for y in np.eye(6)]).T * 48
    np.testing.assert_allclose(weights[2], [0, -1, 13, 13, -1, 0], atol=1e-13)
    np.testing.assert_allclose(weights[0], [9, 19, -5, 1, 0, 0], atol=1e-13)
    np.testing.assert_allclose(weights[-1], [0, 0, 1, -5, 19, 9], atol=1e-13)


def test_very_uneven_steps_fall_back_to_the_trapezoid():
    t = np.array([0.0, 1.0, 1.2, 2.2, 3.2, 4.2])  # 0.2 beside 1.0: factor 5
    y = t**3
    trapezoid = 0.5 * np.diff(t) * (y[1:] + y[:-1])
    got = integrate(t, y)
    np.testing.assert_allclose(got[:2], trapezoid[:2], rtol=1e-15)
    np.testing.assert_allclose(got[2:], np.diff(t**4 / 4)[2:], rtol=1e-13)  # one-sided beside it


@pytest.mark.parametrize(("holding", "order"), [("left", 1), ("trapezoid", 2), ("cubic", 4)])
def test_order_of_convergence(holding, order):
    """Error of the integral of sin over [1, 3] against halved steps."""
    errors = []
    for n in (64, 128):
        t = np.linspace(1.0, 3.0, 2 * n + 1)
        errors.append(abs(integrate(t, np.sin(t), holding).sum() - (np.cos(1.0) - np.cos(3.0))))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)


def test_left_and_right_hold_the_sample_of_their_side():
    t = np.array([0.0, 0.5, 1.5])
    y = np.array([2.0, 3.0, 5.0])
    assert integrate(t, y, "left").tolist() == [1.0, 3.0]
    assert integrate(t, y, "right").tolist() == [1.5, 5.0]


def test_two_and_three_samples_are_enough():
    t = np.array([0.0, 0.5, 1.0])
    assert integrate(t, np.array([1.0, 3.0, 3.0])).tolist() == [1.0, 1.5]
    assert integrate(t[:2], np.array([1.0, 3.0])).tolist() == [1.0]
    with pytest.raises(ValueError, match="two samples"):
        integrate(t[:1], np.array([1.0]))


def test_gaps_are_bridged_or_coasted_by_their_length():
    t = np.array([0.0, 0.1, 0.2, 0.3, 0.6, 0.7, 0.8, 1.8, 1.9, 2.0])
    rate = np.ones((t.size, 3)) * t[:, None]
    inc = increments_from_rates(t, rate, rate, max_gap=0.5)
    assert gap_steps(t).nonzero()[0].tolist() == [3, 6]
    assert inc.coast.nonzero()[0].tolist() == [6]
    assert inc.dtheta[3, 0] == pytest.approx(0.3 * 0.45)  # mean of the values at its edges
    assert inc.dtheta[6, 0] == pytest.approx(1.0 * 1.3)


def test_nothing_beyond_a_gap_reaches_the_steps_beside_it():
    t = np.array([0.0, 0.1, 0.2, 0.3, 1.3, 1.4, 1.5, 1.6])
    y = np.where(t < 1.0, 1.0, 100.0)
    got = integrate(t, y)
    np.testing.assert_allclose(got[:3], 0.1)
    np.testing.assert_allclose(got[4:], 10.0)


def test_logged_increments_are_stretched_over_a_gap():
    t = np.array([0.0, 0.1, 0.2, 0.5, 0.6, 2.6])
    logged = np.full((6, 3), 0.01)
    inc = increments_from_log(t, logged, 10.0 * logged, max_gap=0.5)
    np.testing.assert_allclose(inc.dtheta[:, 1], [0.01, 0.01, 0.03, 0.01, 0.2])
    np.testing.assert_allclose(inc.dvel, 10.0 * inc.dtheta)
    assert inc.coast.tolist() == [False, False, False, False, True]


def test_logged_increments_drop_the_first_row_only():
    truth = exact(car(), np.arange(0.0, 1.0, 0.01))
    rows = np.vstack([np.full(3, 9.9), truth.dtheta])
    inc = increments_from_log(truth.t, rows, rows, max_gap=0.5)
    np.testing.assert_array_equal(inc.dtheta, truth.dtheta)


def test_correction_removes_the_biases():
    truth = exact(car(), np.array([0.0, 0.01, 0.03, 0.04]))
    inc = truth.increments()
    gyro, accel = np.array([1e-3, -2e-3, 3e-3]), np.array([0.02, 0.03, -0.01])
    dt = inc.dt[:, None]
    biased = Increments(inc.t, inc.dtheta + gyro * dt, inc.dvel + accel * dt, inc.coast)
    back = biased.corrected(gyro, accel)
    np.testing.assert_allclose(back.dtheta, inc.dtheta, atol=1e-17)
    np.testing.assert_allclose(back.dvel, inc.dvel, atol=1e-16)
    per_step = biased.corrected(np.tile(gyro, (3, 1)), np.tile(accel, (3, 1)))
    np.testing.assert_array_equal(per_step.dtheta, back.dtheta)
    np.testing.assert_array_equal(per_step.dvel, back.dvel)


def test_parts_and_reversal_keep_steps_with_their_instants():
    inc = exact(car(), np.array([0.0, 0.01, 0.03, 0.04, 0.06])).increments()
    inc = Increments(inc.t, inc.dtheta, inc.dvel, np.array([False, True, False, False]))
    part = inc.part(1, 3)
    np.testing.assert_array_equal(part.t, inc.t[1:4])
    np.testing.assert_array_equal(part.dtheta, inc.dtheta[1:3])
    np.testing.assert_array_equal(part.dvel, inc.dvel[1:3])
    assert part.coast.tolist() == [True, False]
    back = inc.reversed()
    np.testing.assert_allclose(back.dt, [-0.02, -0.01, -0.02, -0.01])
    np.testing.assert_array_equal(back.dtheta, -inc.dtheta[::-1])
    np.testing.assert_array_equal(back.dvel, -inc.dvel[::-1])
    assert back.coast.tolist() == [False, False, True, False]
    twice = back.reversed()
    for name in ("t", "dtheta", "dvel", "coast"):
        np.testing.assert_array_equal(getattr(twice, name), getattr(inc, name))
