"""How much of what the sensors read is vibration too fast for their sampling.

What shakes the case faster than half the sampling rate comes back folded to any frequency, and a
share of it integrates into angle and speed like white noise. Where the samples show vibration
near half their rate, there is more of it above; its density is the measure. On one car with a
consumer gyro it was 1.2 deg/s/sqrt(Hz) about one axis and a twentieth of it about another, and the
error of the pitch went with it.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

WINDOW: Final = 1.0
"""s over which the density is averaged."""


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
    y = np.concatenate([omega, f], axis=1)
    if t.size < 4:
        return np.zeros((at.size, 6))
    bend = y[2:] - 2.0 * y[1:-1] + y[:-2]  # variance 6 of white noise of variance 1
    step = float(np.median(np.diff(t)))
    gathered = np.concatenate([np.zeros((1, 6)), np.cumsum(bend * bend, axis=0)])
    first = np.searchsorted(t[1:-1], at - 0.5 * WINDOW)
    last = np.searchsorted(t[1:-1], at + 0.5 * WINDOW)
    first = np.minimum(first, bend.shape[0] - 1)
    last = np.maximum(last, first + 1)
    mean = (gathered[last] - gathered[first]) / (last - first)[:, None]
    return np.asarray(mean / 6.0 * step)
