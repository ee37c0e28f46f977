"""Random processes on a clock: white noise, random walk, first-order Markov, low pass.

Along axis -2 of arrays (..., n, 3); exact for uneven steps.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from vehnav.sensors.draw import Rng, normal

Array = npt.NDArray[np.float64]

_MAX_DECAY = 12.0
"""Natural logarithm of the decay within a block: e^12 of rounding, 1e-11 relative, stays."""


def decay_recursion(decay: Array, drive: Array) -> Array:
    """x_k = exp(-decay_k) x_(k-1) + drive_k, from x = 0 before the first sample.

    Parameters
    ----------
    decay : (n,)
        At least zero; the first is of no effect.
    drive : (..., n, 3)

    Notes
    -----
    Within a block, x_k = e^(-c_k) (x_0 + sum of e^(c_j) drive_j), c the cumulative decay: a
    cumulative sum. Blocks end before e^c costs digits.
    """
    total = np.concatenate([[0.0], np.cumsum(decay[1:])])
    x = np.empty_like(drive)
    start, n = 0, decay.size
    state = np.zeros_like(drive[..., 0, :])
    while start < n:
        end = max(start + 1, int(np.searchsorted(total, total[start] + _MAX_DECAY, side="right")))
        c = (total[start:end] - total[start])[:, None]
        carried = state * math.exp(-decay[start]) if start else state
        x[..., start:end, :] = np.exp(-c) * (
            carried[..., None, :] + np.cumsum(np.exp(c) * drive[..., start:end, :], axis=-2)
        )
        state = x[..., end - 1, :]
        start = end
    return x


def steps_of(t: Array) -> Array:
    """(n,) s: the step before each sample; the first as long as the median one."""
    if t.size < 2:
        raise ValueError("a clock needs two samples")
    d = np.diff(t)
    return np.concatenate([[np.median(d)], d])


def markov(t: Array, *, sigma: float, time: float, rng: Rng) -> Array:
    """(..., n, 3): first-order Gauss-Markov process, stationary from the first sample on.

    Standard deviation ``sigma``, correlation exp(-|dt| / ``time``).
    """
    decay = steps_of(t) / time
    drive_sigma = sigma * np.sqrt(-np.expm1(-2.0 * decay))
    drive_sigma[0] = sigma
    return decay_recursion(decay, normal(rng, (t.size, 3)) * drive_sigma[:, None])


def random_walk(t: Array, *, sigma: float, rng: Rng) -> Array:
    """(..., n, 3): sum of independent steps of ``sigma`` sqrt(dt); zero at the first sample."""
    steps = normal(rng, (t.size, 3)) * (sigma * np.sqrt(steps_of(t)))[:, None]
    steps[..., 0, :] = 0.0
    return np.asarray(np.cumsum(steps, axis=-2))


def low_pass(t: Array, x: Array, *, bandwidth: float) -> Array:
    """First-order low pass of -3 dB frequency ``bandwidth`` (Hz); starts settled on x_0."""
    decay = steps_of(t) * (2.0 * math.pi * bandwidth)
    if float(np.median(decay)) > 0.2:  # short memory: taps beyond e^-40 of even steps
        d = float(np.median(decay))
        taps = -math.expm1(-d) * np.exp(-d * np.arange(int(40.0 / d) + 1))
        padded = np.concatenate([np.repeat(x[..., :1, :], taps.size - 1, axis=-2), x], axis=-2)
        lagged = (
            padded[..., taps.size - 1 - k : padded.shape[-2] - k, :] for k in range(taps.size)
        )
        return np.asarray(sum(w * y for w, y in zip(taps, lagged, strict=True)))
    drive = -np.expm1(-decay)[:, None] * x
    drive[..., 0, :] = x[..., 0, :]
    return decay_recursion(decay, drive)
