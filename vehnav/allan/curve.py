"""Overlapping Allan deviation of pieces of rest: no difference reaches across the driving."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vehnav.allan.spread import edf, terms_of

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Curve:
    """Allan variances of several axes, pooled over pieces of rest.

    Attributes
    ----------
    dt : float
        s between samples.
    lengths : (p,)
        Samples of each piece.
    clusters : (k,)
        Samples of a cluster, ascending.
    variance : (k, a)
        Unit of the rate, squared; of a axes.
    weights : (k, p)
        Of the pieces: each counts by the degrees of freedom it has.
    dof : (k,)
        Equivalent degrees of freedom of the pooled variance, for white noise.
    """

    dt: float
    lengths: IntArray
    clusters: IntArray
    variance: Array
    weights: Array
    dof: Array

    @property
    def tau(self) -> Array:
        """(k,) s."""
        return np.asarray(self.clusters * self.dt, dtype=np.float64)

    @property
    def deviation(self) -> Array:
        """(k, a) Allan deviation, unit of the rate."""
        return np.asarray(np.sqrt(self.variance), dtype=np.float64)

    @property
    def pieces(self) -> IntArray:
        """(k,) how many pieces a point rests on."""
        return np.asarray(np.count_nonzero(self.weights > 0.0, axis=1), dtype=np.int64)

    def at(self, clusters: IntArray) -> Curve:
        """Only these of its clusters."""
        chosen = np.isin(self.clusters, clusters)
        return Curve(
            self.dt,
            self.lengths,
            self.clusters[chosen],
            self.variance[chosen],
            self.weights[chosen],
            self.dof[chosen],
        )


def octaves(longest: int, *, per_octave: int = 1) -> IntArray:
    """Clusters of 1, 2, 4, ... samples that fit twice into ``longest`` samples.

    >>> octaves(40).tolist(), octaves(10, per_octave=2).tolist()
    ([1, 2, 4, 8, 16], [1, 2, 3, 4])
    """
    count = per_octave * int(np.log2(max(longest, 2)))
    powers = np.rint(2.0 ** (np.arange(count) / per_octave)).astype(np.int64)
    return np.unique(powers[2 * powers <= longest])


def allan_curve(pieces: Sequence[Array], dt: float, *, clusters: IntArray | None = None) -> Curve:
    """Allan variance of rates in pieces.

    Every piece contributes second differences of its own angle only, so neither its mean (bias,
    Earth rate, gravity) nor what happens between the pieces matters. The pieces are weighed by
    their equivalent degrees of freedom.

    Parameters
    ----------
    pieces : sequence of (n, a)
        Evenly sampled rates of a axes.
    dt : float
        s between samples.
    clusters : (k,) or None
        Samples of a cluster; None: two an octave up to half of the longest piece.

    Raises
    ------
    ValueError
        No piece holds two clusters of the shortest length asked for.
    """
    lengths = np.array([len(piece) for piece in pieces], dtype=np.int64)
    longest = int(lengths.max(initial=0))
    chosen = octaves(longest, per_octave=2) if clusters is None else clusters
    chosen = chosen[2 * chosen <= longest]
    if chosen.size == 0:
        raise ValueError("no piece holds two clusters")
    # the mean of a piece has no effect; without it sums stay small and digits stay
    angles = [
        np.concatenate([np.zeros((1, p.shape[1])), np.cumsum(p - p.mean(axis=0), axis=0)]) * dt
        for p in pieces
    ]
    dof = np.array([edf(lengths, int(m)) for m in chosen])
    weights = dof / dof.sum(axis=1, keepdims=True)
    variance = np.array(
        [
            sum(
                w * _variance(angle, int(m), dt)
                for angle, w, n in zip(angles, row, terms_of(lengths, int(m)), strict=True)
                if n > 0
            )
            for m, row in zip(chosen, weights, strict=True)
        ]
    )
    return Curve(dt, lengths, chosen, variance, weights, dof.sum(axis=1))


def _variance(angle: Array, m: int, dt: float) -> Array:
    """(a,) overlapping Allan variance of one piece, from its angle (n + 1, a)."""
    second = angle[2 * m :] - 2.0 * angle[m:-m] + angle[: -2 * m]
    return np.asarray(np.mean(second**2, axis=0) / (2.0 * (m * dt) ** 2))
