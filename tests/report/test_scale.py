"""Ticks, thinning, and the circle of 95 %."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import i0e

from vehnav.report.circle import radius_95
from vehnav.report.scale import between_gaps, envelope, nice_step, number, ticks


@given(st.floats(-1e3, 1e3), st.floats(1e-6, 1e7), st.integers(2, 12))
def test_ticks_are_round_inside_and_few(spans_away: float, span: float, count: int) -> None:
    low = spans_away * span  # axes from micrometres to a continent
    step = nice_step(span, count)
    mantissa = step / 10.0 ** np.floor(np.log10(step) + 1e-9)
    assert min(abs(mantissa - m) for m in (1.0, 2.0, 5.0)) < 1e-9
    found = ticks(low, low + span, count)
    assert len(found) <= count + 1
    assert all(low - 1e-6 * span <= x <= low + span * (1.0 + 1e-6) for x in found)
    # at least one tick for every two parts: the next smaller step would have been too many
    assert len(found) >= count // 3


def test_numbers_show_what_the_step_needs() -> None:
    assert [number(x, 0.25) for x in (-0.5, 0.0, 1.25)] == ["−0.5", "0", "1.2"]
    assert number(-1e-9, 0.1) == "0"  # not "−0.0"


def test_envelope_keeps_every_extreme_of_every_column() -> None:
    rng = np.random.default_rng(1)
    x = np.sort(rng.uniform(0.0, 3600.0, 50_000))
    y = rng.normal(size=x.size)
    y[12_345] = 80.0  # one sample wide
    keep = envelope(x, y, 300)
    assert keep.size <= 4 * 300
    assert np.all(np.diff(keep) > 0)
    assert 12_345 in keep
    edges = np.linspace(x[0], x[-1], 301)
    for a, b in pairwise(edges):
        column = (x >= a) & (x < b)
        kept = np.isin(np.flatnonzero(column), keep)
        assert y[column][kept].max() == y[column].max()
        assert y[column][kept].min() == y[column].min()


def test_short_curves_are_left_alone() -> None:
    x = np.arange(10.0)
    assert envelope(x, x, 300).tolist() == list(range(10))


def test_a_line_is_cut_at_a_gap_and_only_there() -> None:
    t = np.concatenate([np.arange(0.0, 10.0), np.arange(30.0, 40.0)])
    assert between_gaps(t) == [slice(0, 10), slice(10, 20)]
    assert between_gaps(t[:1]) == [slice(0, 1)]
    assert between_gaps(t[:0]) == []


def _inside(radius: float, large: float, small: float) -> float:
    """P(r < radius) of two independent normal errors: polar integral with the angle done."""

    def density(r: float) -> float:
        a = r * r / 4.0 * (1.0 / small**2 - 1.0 / large**2)
        b = r * r / 4.0 * (1.0 / small**2 + 1.0 / large**2)
        return float(r / (large * small) * np.exp(a - b) * i0e(a))

    return float(quad(density, 0.0, radius, limit=200)[0])


@pytest.mark.parametrize("ratio", [0.05, 0.1, 0.25, 0.35, 0.5, 0.7, 0.85, 1.0])
def test_the_circle_holds_95_percent(ratio: float) -> None:
    radius = float(radius_95([10.0, 10.0 * ratio]))
    # linear interpolation of an eleven-row table: 0.2 % of probability at most
    assert _inside(radius, 10.0, 10.0 * ratio) == pytest.approx(0.95, abs=0.002)
    assert float(radius_95([10.0 * ratio, 10.0])) == radius


def test_no_sigma_no_circle() -> None:
    assert radius_95([[0.0, 0.0], [1.0, 0.0]]).tolist() == pytest.approx([0.0, 1.95996])
