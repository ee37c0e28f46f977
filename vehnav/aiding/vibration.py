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
