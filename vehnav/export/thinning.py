"""Fewer points for maps, and what they are coloured by."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.evaluation import Errors
from vehnav.export.columns import decimate
from vehnav.trajectory import Trajectory
from vehnav.units import NS

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

TOLERANCE: Final = 0.2
"""m: no place between two kept points is further from the truth of its instant."""
MAP_RATE: Final = 10.0
"""Hz: states looked at for a map."""
RAMP: Final = ("1a9850", "66bd63", "a6d96a", "fee08b", "fdae61", "f46d43", "d73027", "a50026")
"""Colours of errors from none to the largest (RGB)."""
PLAIN: Final = "1f6feb"
"""Colour of a track without errors."""


def keep_points(t: Array, position: Array, tolerance: float) -> Index:
    """Indices of the points that carry the track, ends included.

    Between two kept points the vehicle is taken to move evenly in time; a point is kept where
    that would be off by more than ``tolerance`` m (Douglas and Peucker's recursion with the
    distance at equal times), so that a stop needs two points and a bend as many as it takes.

    >>> t = np.arange(5.0)
    >>> keep_points(t, np.column_stack([np.maximum(t - 2.0, 0.0)]), 0.1).tolist()
    [0, 2, 4]
    """
    keep = np.zeros(t.size, bool)
    keep[[0, -1]] = True
    spans = [(0, t.size - 1)]
    while spans:
        a, b = spans.pop()
        if b - a < 2:
            continue
        share = (t[a + 1 : b] - t[a]) / (t[b] - t[a])
        even = position[a] + share[:, None] * (position[b] - position[a])
        off = np.sum((position[a + 1 : b] - even) ** 2, axis=1)
        worst = int(np.argmax(off))
        if off[worst] > tolerance**2:
            middle = a + 1 + worst
            keep[middle] = True
            spans += [(a, middle), (middle, b)]
    return np.flatnonzero(keep)


def error_levels(track: Trajectory, errors: Errors) -> tuple[Array, npt.NDArray[np.int64]]:
    """(n,) m and colour number: the horizontal error at each state, between the judged fixes.

    States before the first and after the last judged fix have the error of that fix.
    """
    t = (track.t_ns - errors.t_ns[0]) * NS
    error = np.interp(t, (errors.t_ns - errors.t_ns[0]) * NS, errors.horizontal)
    top = max(float(errors.horizontal.max()), 1e-9)
    level = np.minimum(error / top * len(RAMP), len(RAMP) - 1)
    return error, level.astype(np.int64)


def thin(
    trajectory: Trajectory, *, rate_hz: float | None = None, errors: Errors | None = None
) -> Trajectory:
    """The points of a track on a map: within 0.2 m of it; every state of ``rate_hz`` if given.

    With errors a point is also kept wherever their colour changes.
    """
    if rate_hz is not None:
        return decimate(trajectory, rate_hz)
    few = decimate(trajectory, MAP_RATE)
    origin = (float(few.lat[0]), float(few.lon[0]), float(few.height[0]))
    kept = keep_points((few.t_ns - few.t_ns[0]) * NS, few.enu(origin), TOLERANCE)
    if errors is not None:
        change = np.flatnonzero(np.diff(error_levels(few, errors)[1])) + 1
        kept = np.union1d(kept, change)
    return few.rows(kept)


@dataclass(frozen=True)
class Stretch:
    """A run of points of one colour.

    Attributes
    ----------
    start, end : int
        First and last point, both included; the next stretch starts at ``end``.
    colour : str
        RRGGBB.
    error : (float, float) or None
        Smallest and largest horizontal error in it, m.
    """

    start: int
    end: int
    colour: str
    error: tuple[float, float] | None


def stretches(track: Trajectory, errors: Errors | None) -> list[Stretch]:
    """The track cut where the colour of its error changes; one stretch without errors."""
    last = track.size - 1
    if errors is None:
        return [Stretch(0, last, PLAIN, None)]
    error, level = error_levels(track, errors)
    cuts = [0, *(np.flatnonzero(np.diff(level)) + 1).tolist(), last]
    return [
        Stretch(
            a, b, RAMP[level[a]], (float(error[a : b + 1].min()), float(error[a : b + 1].max()))
        )
        for a, b in pairwise(cuts)
        if b > a
    ]


def stops_of(trajectory: Trajectory) -> list[tuple[int, int]]:
    """(first, last) state of every run of stopped states."""
    edge = np.diff(trajectory.stopped.astype(np.int8), prepend=0, append=0)
    first, after = np.flatnonzero(edge == 1), np.flatnonzero(edge == -1)
    return [(int(a), int(b) - 1) for a, b in zip(first, after, strict=True)]
