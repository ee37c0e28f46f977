"""The circle that an error stays inside with 95 % probability, from its sigmas east and north."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

RATIOS: Final = np.linspace(0.0, 1.0, 11)
FACTORS_95: Final = np.array(
    [1.95996, 1.96253, 1.97041, 1.98420, 2.00514, 2.03586, 2.08130, 2.14598, 2.23029, 2.33180,
     2.44775]
)  # fmt: skip
"""Radius over the larger sigma by the ratio of the smaller to the larger one (Harter 1960)."""
ELLIPSE_95: Final = 2.44775
"""Half axes of the 95 % ellipse over the sigmas: sqrt(-2 ln 0.05)."""


def radius_95(sigma: npt.ArrayLike) -> Array:
    """Radius (...), m, of the circle about the estimate that holds 95 % of the errors.

    Parameters
    ----------
    sigma : (..., 2)
        Standard deviations east and north, m; the two errors are taken as independent and normal.

    >>> float(np.round(radius_95([3.0, 3.0]), 3)), float(np.round(radius_95([3.0, 0.0]), 3))
    (7.343, 5.88)
    """
    sigma = np.asarray(sigma, float)
    large, small = sigma.max(axis=-1), sigma.min(axis=-1)
    ratio = np.divide(small, large, out=np.ones_like(large), where=large > 0.0)
    return np.asarray(large * np.interp(ratio, RATIOS, FACTORS_95))
