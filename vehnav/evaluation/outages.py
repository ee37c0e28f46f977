"""Errors inside each interval that the trajectory had to bridge without GPS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.units import NS

Array = npt.NDArray[np.float64]

MIN_DISTANCE: Final = 10.0
"""m: a shorter drive has no error in percent of its distance."""


@dataclass(frozen=True)
class Outage:
    """One bridged interval.

    Attributes
    ----------
    start_s, length_s : float
        Seconds from the start of the log, and length.
    distance_m : float
        Driven inside it, by the reference.
    fixes : int
        That judge it.
    rms_m, max_m, end_m : float or None
        Horizontal error inside; None where no fix judges it.
    percent : float or None
        Largest error in percent of the distance; None below 10 m.
    """

    start_s: float
    length_s: float
    distance_m: float
    fixes: int
    rms_m: float | None
    max_m: float | None
    end_m: float | None
    percent: float | None

    def to_dict(self) -> dict[str, float | int | None]:
        """The fields by name."""
        return asdict(self)


def outage_errors(
    t_ns: npt.NDArray[np.int64],
    horizontal: Array,
    distance: Array,
    intervals: Sequence[tuple[int, int]],
    *,
    start_ns: int,
) -> tuple[Outage, ...]:
    """One row per interval (start and end, ns, both included), by the judged fixes in it."""
    t = (t_ns - t_ns[0]) * NS
    rows = []
    for start, end in intervals:
        inside = (t_ns >= start) & (t_ns <= end)
        edges = (np.array([start, end]) - t_ns[0]) * NS
        driven = float(np.diff(np.interp(edges, t, distance))[0])
        e = horizontal[inside]
        largest = float(e.max()) if e.size else None
        share = None if largest is None or driven < MIN_DISTANCE else 100.0 * largest / driven
        rows.append(
            Outage(
                start_s=(start - start_ns) * NS,
                length_s=(end - start) * NS,
                distance_m=driven,
                fixes=int(e.size),
                rms_m=float(np.sqrt(np.mean(e * e))) if e.size else None,
                max_m=largest,
                end_m=float(e[-1]) if e.size else None,
                percent=share,
            )
        )
    return tuple(rows)
