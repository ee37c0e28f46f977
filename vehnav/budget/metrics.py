"""Figures of a horizontal error: DRMS, and the circle that holds a share of it (CEP)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

NODES: Final = 128
"""Nodes of the quadrature over the angle: the integrand is periodic and smooth, so its error is
that of rounding for every ratio of the axes, zero included (6e-12 with half as many)."""
_HALVINGS: Final = 60


def drms(covariance: npt.ArrayLike) -> Array:
    """Root of the trace of covariances (..., 2, 2), m."""
    return np.asarray(np.sqrt(np.trace(np.asarray(covariance, float), axis1=-2, axis2=-1)))


def cep(covariance: npt.ArrayLike, share: float = 0.5) -> Array:
    """Radius, m, of the circle about zero that holds a share of a normal error (..., 2, 2).

    With the principal variances l1, l2 and tan(theta) = sqrt(l2 / l1) tan(psi) in the formula of
    spec B 1.3 the probability of a radius r is the mean over psi of
    ``1 - exp(-r^2 / (2 (l1 cos^2 psi + l2 sin^2 psi)))``, which no ratio of the axes upsets.
    ValueError unless ``share`` lies between 0 and 1.

    >>> float(cep(np.eye(2)).round(4))
    1.1774
    """
    if not 0.0 < share < 1.0:
        raise ValueError("the share must lie between 0 and 1")
    c = np.asarray(covariance, float)
    half = 0.5 * (c[..., 0, 0] + c[..., 1, 1])
    spread = np.hypot(0.5 * (c[..., 0, 0] - c[..., 1, 1]), c[..., 0, 1])
    largest = half + spread
    ratio = np.clip((half - spread) / np.where(largest > 0.0, largest, 1.0), 0.0, 1.0)
    psi = (np.arange(NODES) + 0.5) * (0.5 * np.pi / NODES)
    rho = np.cos(psi) ** 2 + ratio[..., None] * np.sin(psi) ** 2
    low, high = np.zeros_like(ratio), np.full_like(ratio, np.sqrt(-2.0 * np.log1p(-share)))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        reached = np.mean(-np.expm1(-0.5 * middle[..., None] ** 2 / rho), axis=-1) >= share
        low, high = np.where(reached, low, middle), np.where(reached, middle, high)
    return np.asarray(np.sqrt(np.maximum(largest, 0.0)) * 0.5 * (low + high))


METRICS: Final[dict[str, Callable[[Array], Array]]] = {
    "drms": drms,
    "cep50": lambda c: cep(c, 0.5),
    "cep95": lambda c: cep(c, 0.95),
    "east": lambda c: np.asarray(np.sqrt(c[..., 0, 0])),
    "north": lambda c: np.asarray(np.sqrt(c[..., 1, 1])),
}
"""Name -> figure, m, of covariances (..., 2, 2) east, north; all grow in proportion to sigma."""
EMPIRICAL: Final[dict[str, Callable[[Array], float]]] = {
    "drms": lambda e: float(np.sqrt(np.mean(np.sum(e * e, axis=-1)))),
    "cep50": lambda e: float(np.quantile(np.hypot(e[..., 0], e[..., 1]), 0.5)),
    "cep95": lambda e: float(np.quantile(np.hypot(e[..., 0], e[..., 1]), 0.95)),
    "east": lambda e: float(np.sqrt(np.mean(e[..., 0] ** 2))),
    "north": lambda e: float(np.sqrt(np.mean(e[..., 1] ** 2))),
}
"""The same of drawn errors (n, 2), m, about zero."""
