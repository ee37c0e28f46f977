"""Four kinds of noise of a rate, and what each does to everything that is measured here.

========  =====================================================  ================
kind      what it is                                             power (squared)
========  =====================================================  ================
angle     white noise of the angle: counts, vibration            Q^2, rad^2
white     white noise of the rate: angle random walk             N^2, rad^2/s
bias      first-order Gauss-Markov bias, time constant T         sigma^2, rad^2/s^2
walk      random walk of the rate                                K^2, rad^2/s^3
========  =====================================================  ================

(For an accelerometer read velocity for angle.) The Allan variance of their sum is::

    sigma^2(tau) = 3 Q^2/tau^2 + N^2/tau + sigma^2 G(tau/T) + K^2 tau/3

(IEEE Std 952-1997, annex C), G(x) = (2/x) [1 - (3 - 4 e^-x + e^-2x) / (2 x)]. A Gauss-Markov bias
peaks at tau = 1.89 T with 0.617 sigma; flicker noise of bias instability B has a floor of
sqrt(2 ln 2 / pi) B = 0.664 B; so sigma and B name the same floor to 7 %.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

KINDS: Final = ("angle", "white", "bias", "walk")
"""Order of the powers everywhere."""
PEAK: Final = 1.89
"""tau / T of the largest Allan deviation of a Gauss-Markov bias."""


@dataclass(frozen=True)
class Powers:
    """A sum of the four kinds.

    Attributes
    ----------
    angle, white, bias, walk : float
        Powers, at least zero.
    time : float
        Time constant of the bias, s.
    """

    angle: float = 0.0
    white: float = 0.0
    bias: float = 0.0
    walk: float = 0.0
    time: float = 300.0

    def weigh(self, forms: Callable[[str], Array]) -> Array:
        """Sum over the kinds of their power times ``forms(kind)``; absent kinds are not asked."""
        present = [kind for kind in KINDS if getattr(self, kind) > 0.0]
        return np.asarray(sum(getattr(self, kind) * forms(kind) for kind in present))


def allan_form(kind: str, tau: Array, time: float) -> Array:
    """Allan variance at ``tau`` (s) of a process of power one."""
    if kind == "angle":
        return np.asarray(3.0 / tau**2)
    if kind == "white":
        return np.asarray(1.0 / tau)
    if kind == "walk":
        return np.asarray(tau / 3.0)
    x = tau / time
    y = np.maximum(x, 1e-3)
    closed = (2.0 / y) * (1.0 - (3.0 - 4.0 * np.exp(-y) + np.exp(-2.0 * y)) / (2.0 * y))
    series = 2.0 * x * (1.0 / 3.0 - x / 4.0 + 7.0 * x**2 / 60.0)
    return np.where(x < 1e-3, series, closed)


def angle_form(kind: str, lag: Array, time: float) -> Array:
    """Generalised covariance of the angle at ``lag`` (s), of a process of power one.

    Any combination of angles whose weights sum to zero, and for ``walk`` have no slope either, has
    the covariance that this function gives; what is missing (a constant, a parabola) cancels.
    """
    x = np.abs(lag)
    if kind == "angle":
        return np.where(x < 1e-9, 1.0, 0.0)
    if kind == "white":
        return np.asarray(-0.5 * x)
    if kind == "walk":
        return np.asarray(x**3 / 12.0)
    return np.asarray(-(time**2) * (x / time + np.expm1(-x / time)))


def mean_form(kind: str, start: Array, end: Array, time: float) -> Array:
    """(p, p) covariance of the means over the stretches [start, end] (p,), of power one.

    The stretches must not overlap. A random walk starts from the first of them.
    """
    length = end - start
    if kind == "angle":
        return np.diag(2.0 / length**2)
    if kind == "white":
        return np.diag(1.0 / length)
    middle = 0.5 * (start + end)
    if kind == "walk":
        out = np.minimum(middle[:, None], middle[None, :]) - start[0]
        np.fill_diagonal(out, start - start[0] + length / 3.0)
        return np.asarray(out)
    half = 0.5 * length / time
    swell = np.where(half > 1e-6, np.sinh(half) / np.maximum(half, 1e-6), 1.0)
    apart = np.abs(middle[:, None] - middle[None, :]) / time
    out = np.exp(-apart) * swell[:, None] * swell[None, :]
    y = np.maximum(length / time, 1e-6)
    np.fill_diagonal(out, (2.0 / y) * (1.0 + np.expm1(-y) / y))
    return np.asarray(out)


def floor_of(sigma: float) -> float:
    """Largest Allan deviation of a Gauss-Markov bias of ``sigma``.

    >>> round(floor_of(1.0), 3)
    0.617
    """
    form = allan_form("bias", np.array([PEAK]), 1.0)
    return sigma * math.sqrt(float(form[0]))
