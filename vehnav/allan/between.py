"""What the means of the pieces say: half squared differences over the time between them.

Within a piece nothing is seen that takes longer than half of it. But a bias that moved while the
vehicle drove shows in the mean rates of the pieces: half the mean squared difference of two of
them, over their distance in time, is to long times what the Allan variance is to short ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.allan.processes import Powers, mean_form

Array = npt.NDArray[np.float64]

FEWEST: Final = 3
"""Pieces below which their means are left alone."""


@dataclass(frozen=True)
class PieceMeans:
    """Mean rates of the pieces.

    Attributes
    ----------
    start, end : (p,)
        s, ascending, not overlapping.
    mean : (p, a)
        Of a axes.
    other : (p, a)
        Variance of each mean that is no work of the sensor and unrelated from piece to piece, such
        as the Earth rate on an axis whose heading is not known.
    """

    start: Array
    end: Array
    mean: Array
    other: Array

    @property
    def span(self) -> float:
        """Time between the middles of the first and the last piece, s."""
        return 0.5 * float(self.start[-1] + self.end[-1] - self.start[0] - self.end[0])


@dataclass(frozen=True)
class Structure:
    """Half mean squared differences by separation.

    Attributes
    ----------
    separation : (b,)
        s, mean of its pairs.
    value : (b, a)
    pairs : (b,)
        Number of pairs.
    forms : (b, p, p)
        Quadratic forms: value = mean^T form mean.
    """

    separation: Array
    value: Array
    pairs: Array
    forms: Array

    def expected(self, covariance: Array) -> Array:
        """(b,) expected values for a covariance (p, p) of the means."""
        return np.asarray(np.einsum("bij,ji->b", self.forms, covariance))

    def spread(self, covariance: Array) -> Array:
        """(b, b) covariance of the values, Gaussian means."""
        turned = self.forms @ covariance
        return np.asarray(2.0 * np.einsum("aij,bji->ab", turned, turned))


def structure(means: PieceMeans) -> Structure:
    """Pairs of pieces sorted by octaves of their separation; longer pieces weigh more."""
    p = means.start.size
    first, second = np.triu_indices(p, 1)
    middle = 0.5 * (means.start + means.end)
    apart = middle[second] - middle[first]
    length = means.end - means.start
    weight = 1.0 / (1.0 / length[first] + 1.0 / length[second])
    octave = np.floor(np.log2(apart / apart.min()) + 1e-9).astype(np.int64)
    forms, separation, pairs = [], [], []
    for k in np.unique(octave):
        inside = octave == k
        w = weight[inside] / weight[inside].sum()
        form = np.zeros((p, p))
        a, b = first[inside], second[inside]
        np.add.at(form, (a, a), 0.5 * w)
        np.add.at(form, (b, b), 0.5 * w)
        np.add.at(form, (a, b), -0.5 * w)
        np.add.at(form, (b, a), -0.5 * w)
        forms.append(form)
        separation.append(float(w @ apart[inside]))
        pairs.append(int(np.count_nonzero(inside)))
    stacked = np.array(forms)
    value = np.einsum("bij,ia,ja->ba", stacked, means.mean, means.mean)
    return Structure(np.array(separation), value, np.array(pairs), stacked)


def mean_covariance(means: PieceMeans, axis: int, powers: Powers) -> Array:
    """(p, p) covariance of the means of one axis, but for a constant common to all."""
    known = np.diag(means.other[:, axis])
    return np.asarray(
        known + powers.weigh(lambda kind: mean_form(kind, means.start, means.end, powers.time))
    )
