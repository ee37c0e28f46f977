"""How noisy the fixes are where the receiver does not say: from the innovations of first runs.

Over the first minutes with fixes the filter runs with the default sigma; the squares of its
innovations, less the variance of its own prediction, are those of the fixes. That is repeated with
what was found until it settles. What a receiver errs for longer than the filter remembers does not
show there, so a floor stays.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.aiding.filter import Aids, Filtered, FilterStart, run_filter
from vehnav.aiding.fixes import DEFAULT_SIGMA
from vehnav.aiding.gaps import GapSigmas
from vehnav.aiding.vehicle import Noise
from vehnav.earth import Ellipsoid
from vehnav.strapdown.increments import Increments

Array = npt.NDArray[np.float64]

SPAN: Final = 180.0
"""s from the first fix on that the first run takes."""
ENOUGH: Final = 40
"""Innovations (two to a fix) below which the default stays: the median of so many is good to a
quarter."""
RUNS: Final = 5
"""At most, each with the sigma that the one before found: far off, it pulls the filter along."""
SETTLED: Final = 0.1
"""Relative change of sigma at which it is found."""
FLOOR: Final = 0.4
"""m: errors of multipath and of a receiver's own smoothing last longer than the filter's memory."""
CEILING: Final = 30.0
"""m: nothing that is farther off is called a fix."""
MEDIAN_OF_SQUARE: Final = 0.4549
"""Of a normal variable of variance 1; the median, as jumps are no noise."""


def measured_sigma(
    increments: Increments,
    gaps: GapSigmas,
    aids: Aids,
    start: FilterStart,
    *,
    noise: Noise,
    earth: Ellipsoid,
) -> float | None:
    """Sigma of the fixes per horizontal axis, m, or None: too few fixes in motion tell.

    Parameters
    ----------
    increments : Increments
    gaps : GapSigmas
    aids : Aids
        Its fixes have the default sigma.
    start : FilterStart
    noise : Noise
    earth : Ellipsoid
    """
    with_fix = np.flatnonzero(aids.fix >= 0)
    if not with_fix.size:
        return None
    t = increments.t[aids.epochs]
    m = int(np.searchsorted(t, t[with_fix[0]] + SPAN))
    last = int(aids.epochs[m - 1])
    part = increments.part(0, last)
    part_gaps = GapSigmas(gaps.attitude[:last], gaps.velocity[:last])
    begin, sigma = aids.part(m), DEFAULT_SIGMA
    for _ in range(RUNS):
        run = run_filter(part, part_gaps, with_sigma(begin, sigma), start, noise=noise, earth=earth)
        squares, predicted = _innovations(run, begin.stopped)
        if squares.size < ENOUGH:
            return None
        variance = float(np.median(squares)) / MEDIAN_OF_SQUARE - float(np.median(predicted))
        before = sigma
        sigma = float(np.clip(np.sqrt(max(variance, 0.0)), FLOOR, CEILING))
        if abs(sigma - before) < SETTLED * before:
            break
    return sigma


def with_sigma(aids: Aids, sigma: float) -> Aids:
    """The fixes with another horizontal sigma than the default, m."""
    fixes = aids.fixes.copy()
    fixes[:, 6:8] *= (sigma / DEFAULT_SIGMA) ** 2
    return replace(aids, fixes=fixes)


def _innovations(run: Filtered, stopped: npt.NDArray[np.bool_]) -> tuple[Array, Array]:
    """Squares, and variances of the prediction, of the horizontal position innovations in motion.

    A position is what sees nothing but the first three states; a receiver at rest may hold its
    position, which says nothing of its noise.
    """
    rows, gains, numbers = run.measurements
    epoch = np.searchsorted(run.until, np.arange(rows.shape[0]), side="right")
    horizontal = ~np.any(rows[:, 3:], axis=1) & (np.abs(rows[:, 2]) < 0.5) & ~stopped[epoch]
    predicted = np.sum(rows[horizontal] * gains[horizontal], axis=1) * numbers[horizontal, 1]
    return numbers[horizontal, 0] ** 2, predicted
