"""Quiet windows of a signal: running means and deviations by time, pure numpy.

Windows are measured in time, by integrals of the piecewise linear signal, not by counting samples:
a gap or a jittering clock does not change their length.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

BLOCK = 8192
"""Windows that are worked on at a time: they stay in the cache of the processor."""


class TimeIntegral:
    """Antiderivative of a piecewise linear signal, evaluated anywhere inside its span.

    Parameters
    ----------
    t : (n,)
        Instants, s, strictly increasing.
    y : (n, m)
        Signal at the instants.
    """

    def __init__(self, t: Array, y: Array) -> None:
        self.t = t
        self._offset = y[0]
        self._y = np.empty((y.shape[1], t.size))
        self._sum = np.zeros_like(self._y)
        dt = np.diff(t)
        for k, (column, sums) in enumerate(zip(self._y, self._sum, strict=True)):
            np.subtract(y[:, k], y[0, k], out=column)  # from 0: sums stay small, digits stay
            np.cumsum(0.5 * (column[1:] + column[:-1]) * dt, out=sums[1:])

    def mean(self, start: Array, end: Array) -> Array:
        """(k, m) means over the windows [start, end] (k,), cut to the span of the signal."""
        start = np.clip(start, self.t[0], self.t[-1])
        end = np.clip(end, self.t[0], self.t[-1])
        means = np.empty((start.size, self._offset.size))
        for at in range(0, start.size, BLOCK):
            block = slice(at, at + BLOCK)
            length = np.maximum(end[block] - start[block], 1e-12)
            first, last = self._place(start[block]), self._place(end[block])
            for k, offset in enumerate(self._offset):
                gained = self._at(k, *last) - self._at(k, *first)
                means[block, k] = gained / length + offset
        return means

    def _place(self, x: Array) -> tuple[IntArray, Array, Array]:
        """(step that x (k,) lies in, s since the start of that step, its length)."""
        step = np.clip(np.searchsorted(self.t, x, side="right") - 1, 0, self.t.size - 2)
        start = self.t[step]
        return step, x - start, self.t[step + 1] - start

    def _at(self, column: int, step: IntArray, s: Array, h: Array) -> Array:
        """(k,) antiderivative of one column."""
        y = self._y[column]
        y0 = y[step]
        slope = (y[step + 1] - y0) / h
        return np.asarray(self._sum[column][step] + s * (y0 + 0.5 * s * slope))


def running_mean(t: Array, y: Array, window: float) -> Array:
    """(n, m): mean of y (n, m) over the centred ``window`` (s); shorter at the ends."""
    half = 0.5 * window
    return TimeIntegral(t, y).mean(t - half, t + half)


def running_deviation(t: Array, y: Array, window: float) -> Array:
    """(n,): vector standard deviation of y (n, m) over the centred ``window`` (s).

    Root of the variances summed over the m components: free of any constant bias.
    """
    half = 0.5 * window
    centred = y - y.mean(axis=0)
    both = TimeIntegral(t, np.concatenate([centred.T, (centred * centred).T]).T)
    means = both.mean(t - half, t + half)
    m = y.shape[1]
    variance = np.sum(means[:, m:] - means[:, :m] ** 2, axis=1)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def samples_in_window(t: Array, window: float) -> IntArray:
    """(n,) number of samples inside the centred ``window`` (s)."""
    half = 0.5 * window
    after = np.searchsorted(t, t + half, side="right")
    before = np.searchsorted(t, t - half, side="left")
    return np.asarray(after - before)


def runs(mask: npt.NDArray[np.bool_]) -> IntArray:
    """(k, 2): first and last index of each run of True, both included.

    >>> runs(np.array([False, True, True, False, True])).tolist()
    [[1, 2], [4, 4]]
    """
    edges = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    return np.stack([np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1], axis=1)


def white_noise(t: Array, y: Array, spans: list[tuple[int, int]], *, block: float = 1.0) -> Array:
    """(m,): white noise density of y (n, m) at rest, per sqrt(Hz).

    Standard deviation of neighbouring ``block`` second means over sqrt(2), times sqrt(block):
    differences take a drifting bias out, means take vibration out. Pooled over the spans
    (first, last index) that hold at least two blocks; nan where none does.
    """
    differences = []
    for first, last in spans:
        count = int((t[last] - t[first]) / block)
        if count >= 2:
            edges = t[first] + block * np.arange(count + 1)
            inside = slice(first, last + 1)
            means = TimeIntegral(t[inside], y[inside]).mean(edges[:-1], edges[1:])
            differences.append(np.diff(means, axis=0))
    if not differences:
        return np.full(y.shape[1], np.nan)
    pooled = np.concatenate(differences)
    return np.asarray(np.sqrt(0.5 * block * np.mean(pooled**2, axis=0)))
