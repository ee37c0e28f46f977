"""Axes for people: the units of a drawing, round steps, ticks, and numbers as one reads them."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

WIDTH: Final = 10000
HEIGHT: Final = 4000
"""Units of a panel's drawing: a hundred thousandth of an hour is of no interest."""


def nice_step(span: float, count: int) -> float:
    """The smallest of 1, 2, 5 times a power of ten that cuts ``span`` in at most ``count`` parts.

    >>> [nice_step(s, 5) for s in (1.0, 7.0, 42.0, 3600.0)]
    [0.2, 2.0, 10.0, 1000.0]
    """
    if not span > 0.0 or not math.isfinite(span):
        return 1.0
    power = 10.0 ** math.floor(math.log10(span / count))
    for factor in (1.0, 2.0, 5.0, 10.0):
        if factor * power * count >= span * (1.0 - 1e-9):
            break
    return float(f"{factor * power:.3g}")


def ticks(low: float, high: float, count: int) -> list[float]:
    """Multiples of a round step from ``low`` to ``high``.

    >>> ticks(-3.0, 12.0, 4)
    [0.0, 5.0, 10.0]
    """
    step = nice_step(high - low, count)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [float(f"{k * step:.12g}") for k in range(first, last + 1)]


def log_ticks(low: float, high: float) -> list[tuple[float, bool]]:
    """Ticks 1 to 9 of every decade between powers of ten ``low`` and ``high``; whether labelled.

    Labelled are the decades, or 1, 2 and 5 where there are few.

    >>> [value for value, labelled in log_ticks(0.0, 1.0) if labelled]
    [1.0, 2.0, 5.0, 10.0]
    """
    marked = (1,) if high - low > 2.2 else (1, 2, 5)
    out = []
    for decade in range(math.floor(low), math.ceil(high) + 1):
        for digit in range(1, 10):
            value = float(f"{digit}e{decade}")
            if low - 1e-9 <= math.log10(value) <= high + 1e-9:
                out.append((value, digit in marked))
    return out


def number(value: float, step: float = 0.0) -> str:
    """A number with the decimals that ``step`` needs and a true minus sign.

    >>> number(-2.5, 0.5), number(1500.0, 500.0), number(0.0, 0.2)
    ('−2.5', '1500', '0')
    """
    decimals = max(0, -math.floor(math.log10(step) + 1e-9)) if step > 0.0 else 0
    text = f"{value:.{decimals}f}"
    if float(text) == 0.0:
        return "0"
    return text.replace("-", "−")


def envelope(x: Array, y: Array, bins: int) -> Index:
    """Indices of a curve thinned to what ``bins`` columns of pixels can show.

    Of every column the first, last, lowest and highest point are kept, so no extreme is lost and
    the line looks the same. ``x`` must not decrease.
    """
    if x.size <= 4 * bins:
        return np.arange(x.size)
    column = np.minimum((x - x[0]) / (x[-1] - x[0]) * bins, bins - 1).astype(np.int64)
    order = np.lexsort((y, column))
    edge = np.flatnonzero(np.diff(column)) + 1
    starts, ends = np.append(0, edge), np.append(edge, x.size) - 1
    return np.unique(np.concatenate([starts, ends, order[starts], order[ends]]))


def between_gaps(x: Array, *, factor: float = 5.0, least: float = 2.0) -> list[slice]:
    """Slices of a series between its gaps: steps over ``factor`` medians and over ``least``."""
    if x.size < 2:
        return [slice(0, 1)] if x.size else []
    step = np.diff(x)
    cuts = np.flatnonzero(step > max(factor * float(np.median(step)), least)) + 1
    edges = [0, *cuts.tolist(), x.size]
    return [slice(a, b) for a, b in pairwise(edges)]
