"""Are the sigmas of a solution honest: errors over sigmas, and how many lie inside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

EXPECTED_1D: Final = (0.6827, 0.9545, 0.9973)
"""Shares of a normal variable inside 1, 2, 3 sigma."""
EXPECTED_2D: Final = (0.3935, 0.8647, 0.9889)
"""Shares of two inside the circle of 1, 2, 3: 1 - exp(-k^2 / 2)."""


@dataclass(frozen=True)
class Calibration:
    """Normalised errors; the sigma of the reference is part of it where known.

    Attributes
    ----------
    rms : dict of str to float
        Root mean square of error / sigma for east, north, up and, where judged, heading; an honest
        solution has 1.
    inside : dict of str to tuple of three floats
        Shares inside 1, 2, 3 sigma.
    circle : tuple of three floats
        Shares inside the horizontal circles (ellipses) of 1, 2, 3 sigma; honest: 39, 86, 99 %.
    fixes : int
        That have a sigma above zero.
    """

    rms: dict[str, float]
    inside: dict[str, tuple[float, float, float]]
    circle: tuple[float, float, float]
    fixes: int

    def to_dict(self) -> dict[str, Any]:
        """Plain, with the shares that an honest solution has."""
        return {
            "rms": dict(self.rms),
            "inside": {name: list(shares) for name, shares in self.inside.items()},
            "circle": list(self.circle),
            "fixes": self.fixes,
            "expected_inside": list(EXPECTED_1D),
            "expected_circle": list(EXPECTED_2D),
        }


def _shares(normalised: Array) -> tuple[float, float, float]:
    size = np.abs(normalised)
    one, two, three = (float(np.mean(size <= k)) for k in (1.0, 2.0, 3.0))
    return one, two, three


def calibration(
    error: Array,
    sigma: Array | None,
    *,
    reference_sigma: Array | None = None,
    heading: Array | None = None,
    sigma_heading: Array | None = None,
) -> Calibration | None:
    """Judge the sigmas of a solution; None where it has none.

    Parameters
    ----------
    error, sigma : (n, 3)
        East, north, up: error and the solution's sigma, m.
    reference_sigma : (n, 3) or None
        Of the fixes, m: its variance is added.
    heading, sigma_heading : (n,) or None
        rad.
    """
    if sigma is None:
        return None
    variance = sigma**2 + (0.0 if reference_sigma is None else reference_sigma**2)
    known = np.all(variance[:, :2] > 0.0, axis=1)
    if not known.any():
        return None
    flat = error[known, :2] / np.sqrt(variance[known, :2])
    series = {"east": flat[:, 0], "north": flat[:, 1]}
    high = variance[:, 2] > 0.0
    if high.any():
        series["up"] = error[high, 2] / np.sqrt(variance[high, 2])
    if heading is not None and sigma_heading is not None and np.any(sigma_heading > 0.0):
        turned = sigma_heading > 0.0
        series["heading"] = heading[turned] / sigma_heading[turned]
    return Calibration(
        rms={name: float(np.sqrt(np.mean(x * x))) for name, x in series.items()},
        inside={name: _shares(x) for name, x in series.items()},
        circle=_shares(np.hypot(flat[:, 0], flat[:, 1])),
        fixes=int(known.sum()),
    )
