"""How much of what the sensors read is vibration too fast for their sampling.

What shakes the case faster than half the sampling rate comes back folded to any frequency, and a
share of it integrates into angle and speed like white noise. Where the samples show vibration
near half their rate, there is more of it above; its density is the measure. On one car with a
consumer gyro it was 1.2 deg/s/sqrt(Hz) about one axis and a twentieth of it about another, and the
error of the pitch went with it.

Vibration is lopsided where hits come from one side. Over 100 stretches of 5 s of the same car the
rate that the gyro missed about the pitch follows the skew of its vibration: it lacks a tenth of the
mean cube over the mean square, on the side to which the peaks go (correlation 0.7; first half of
the drive 0.13 and 0.8, second 0.08 and 0.7), as if sharp peaks were cut short before the gyro's own
filter. The share is a state of the filter, found while anything else shows the attitude.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

WINDOW: Final = 1.0
"""s over which the density and the skew are averaged."""
TREND: Final = 0.1
"""s of the running mean that counts as motion of the vehicle, not as vibration."""
LEAST: Final = 1e-6
"""rad/s: rms of vibration below which its skew says nothing (all samples alike)."""


def shaken_densities(t: Array, omega: Array, f: Array, at: Array) -> Array:
    """(m, 6) densities of the fastest vibration at instants ``at`` (m,).

    From second differences of the samples, which leave a third of the band below half the
    sampling rate; of white noise they are the density itself. rad2/s of the three rates, then
    m2/s3 of the three forces.

    Parameters
    ----------
    t : (n,)
        s
    omega, f : (n, 3)
        rad/s, m/s2, body axes.
    at : (m,)
        s
    """
    out = np.zeros((at.size, 6))
    if t.size < 4:
        return out
    step = float(np.median(np.diff(t)))
    first = np.minimum(np.searchsorted(t[1:-1], at - 0.5 * WINDOW), t.size - 3)
    last = np.maximum(np.searchsorted(t[1:-1], at + 0.5 * WINDOW), first + 1)
    for j in range(6):
        y = omega[:, j] if j < 3 else f[:, j - 3]
        bend = np.diff(y, 2)  # variance 6 of white noise of variance 1
        gathered = np.concatenate([[0.0], np.cumsum(bend * bend)])
        out[:, j] = (gathered[last] - gathered[first]) / (last - first) / 6.0 * step
    return out


def skewed_rates(t: Array, omega: Array, at: Array) -> Array:
    """(m, 3) rad/s: mean cube over mean square of the vibration about instants ``at`` (m,).

    Zero where peaks to both sides are alike, their height where all go to one side.

    Parameters
    ----------
    t : (n,)
        s
    omega : (n, 3)
        rad/s, body axes.
    at : (m,)
        s
    """
    out = np.zeros((at.size, 3))
    if t.size < 4:
        return out
    left, right = (
        np.searchsorted(t, t - 0.5 * TREND),
        np.searchsorted(t, t + 0.5 * TREND, "right"),
    )
    first = np.minimum(np.searchsorted(t, at - 0.5 * WINDOW), t.size - 1)
    last = np.maximum(np.searchsorted(t, at + 0.5 * WINDOW), first + 1)
    for j in range(3):
        sums = np.concatenate([[0.0], np.cumsum(omega[:, j])])
        y = omega[:, j] - (sums[right] - sums[left]) / (right - left)
        square, cube = (np.concatenate([[0.0], np.cumsum(y**p)]) for p in (2, 3))
        size = square[last] - square[first]
        seen = size > LEAST**2 * (last - first)
        out[seen, j] = (cube[last] - cube[first])[seen] / size[seen]
    return out
