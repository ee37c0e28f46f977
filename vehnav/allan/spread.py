"""How far an Allan variance scatters: covariances of the overlapping estimator, pieces included.

The estimator is a mean of squares of second differences z of the angle. For Gaussian noise the
covariance of two such means is twice the mean of the squared covariances of their terms; and these
follow from the generalised covariance of the angle by nine shifts of it. Nothing is approximated
but that terms are counted in steps of a fraction of the cluster where clusters are long.
"""

from __future__ import annotations

import itertools
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.allan.processes import KINDS, Powers, angle_form

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

STEPS: Final = 8
"""Steps a cluster is divided in at least: more offsets say nothing more (2 % of the variance)."""
FAR: Final = 16
"""Ratio of cluster lengths beyond which two variances are taken as independent."""


def terms_of(lengths: IntArray, m: int) -> Array:
    """(p,) number of overlapping second differences of clusters of m in pieces of n samples."""
    return np.maximum(lengths - 2 * m + 1, 0).astype(np.float64)


def edf(lengths: IntArray, m: int) -> Array:
    """(p,) equivalent degrees of freedom of each piece's Allan variance, for white noise.

    Zero where the piece has no second difference of clusters of ``m`` samples.
    """
    step = max(1, m // STEPS)
    lags = _lags(m, m, step)
    squares = _terms("white", m, m, lags * step, 1.0, 1.0) ** 2
    out = np.zeros(lengths.size)
    for k, n in enumerate(terms_of(lengths, m)):
        if n > 0:
            mean_square = 2.0 * m  # of a second difference of a random walk
            out[k] = mean_square**2 / float(_counts(lags, n, n, step) @ squares)
    return out


class Spread:
    """Covariance of pooled Allan variances, for any noise.

    Parameters
    ----------
    lengths : (p,)
        Samples of each piece.
    clusters : (k,)
        Samples of a cluster, ascending.
    weights : (k, p)
        Of the pieces, each row of sum one.
    dt : float
        s
    """

    def __init__(self, lengths: IntArray, clusters: IntArray, weights: Array, dt: float) -> None:
        self.clusters, self.dt = clusters, dt
        self._pairs: list[tuple[int, int, int, Array, Array]] = []
        self._forms: dict[tuple[str, float], list[Array]] = {}
        for i, j in itertools.combinations_with_replacement(range(clusters.size), 2):
            m1, m2 = int(clusters[i]), int(clusters[j])
            if m2 > FAR * m1:
                continue
            step = max(1, m1 // STEPS)
            lags = _lags(m1, m2, step)
            share = np.zeros_like(lags)
            n1, n2 = terms_of(lengths, m1), terms_of(lengths, m2)
            for p in np.flatnonzero(weights[j] > 0.0):
                share += weights[i, p] * weights[j, p] * _counts(lags, n1[p], n2[p], step)
            self._pairs.append((i, j, step, lags, share))

    def covariance(self, powers: Powers) -> Array:
        """(k, k) covariance where the noise is that of ``powers``."""
        k = self.clusters.size
        out = np.zeros((k, k))
        present = [kind for kind in KINDS if getattr(powers, kind) > 0.0]
        forms = [(getattr(powers, kind), self._all_terms(kind, powers.time)) for kind in present]
        for n, (i, j, _, _, share) in enumerate(self._pairs):
            terms = sum(power * form[n] for power, form in forms)
            # a variance is the mean square over 2 tau^2
            scale = 4.0 * float(self.clusters[i] * self.clusters[j]) ** 2 * self.dt**4
            out[i, j] = out[j, i] = 2.0 * float(share @ np.square(terms)) / scale
        return out

    def _all_terms(self, kind: str, time: float) -> list[Array]:
        """Covariances of the second differences of every pair of clusters, once computed."""
        key = (kind, time if kind == "bias" else 0.0)
        c = self.clusters
        if key not in self._forms:
            self._forms[key] = [
                _terms(kind, int(c[i]), int(c[j]), lags * step * self.dt, self.dt, time)
                # noise of the angle is new on every sample, not on every step
                / (math.sqrt(step) if kind == "angle" else 1.0)
                for i, j, step, lags, _ in self._pairs
            ]
        return self._forms[key]


def _lags(m1: int, m2: int, step: int) -> Array:
    """Lags, in steps, at which two second differences have to do with each other."""
    first, last = -(2 * m1 + m2) // step, (3 * m2) // step + 1
    return np.arange(first, last + 1, dtype=np.float64)


def _terms(kind: str, m1: int, m2: int, lag: Array, dt: float, time: float) -> Array:
    """Covariance of second differences over m1 and m2 samples, the first ``lag`` (s) later."""
    out = np.zeros_like(lag)
    for a, w1 in enumerate((1.0, -2.0, 1.0)):
        for b, w2 in enumerate((1.0, -2.0, 1.0)):
            out += w1 * w2 * angle_form(kind, lag + (a * m1 - b * m2) * dt, time)
    return out


def _counts(lags: Array, n1: float, n2: float, step: int) -> Array:
    """Share of each lag among all pairs of n1 and n2 terms, counted in steps."""
    a, b = (n1 - 1.0) / step, (n2 - 1.0) / step
    count = np.maximum(np.minimum(a, b + lags) - np.maximum(0.0, lags) + 1.0, 0.0)
    return np.asarray(count / ((a + 1.0) * (b + 1.0)))
