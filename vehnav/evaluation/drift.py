"""Drift since the last correction: the figure that tells what a stop is worth.

Between two stops nothing corrects the vehicle, so the error that grows there is what dead
reckoning costs. It is the change of the error since the end of the last stop (or since judging
began, where the trajectory was on GPS until then).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.trajectory import Trajectory
from vehnav.units import NS

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

AFTER_TIMES: Final = (10.0, 30.0, 60.0, 120.0, 300.0, 600.0)
"""s since the last correction."""
AFTER_DISTANCES: Final = (50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0)
"""m driven since the last correction."""


@dataclass(frozen=True)
class DriftRow:
    """Drift of all legs that reach so far.

    Attributes
    ----------
    after : float
        s or m since the last correction.
    legs : int
        Stretches between corrections that are at least so long.
    median_m, max_m : float
        Over the legs, of the drift at that moment.
    """

    after: float
    legs: int
    median_m: float
    max_m: float


@dataclass(frozen=True)
class Drift:
    """Change of the horizontal error since the last correction.

    Attributes
    ----------
    index : (k,) int
        The judged fixes that lie in a leg.
    leg : (k,) int
        Number of the leg, from 0.
    since, driven : (k,)
        s and m since its start.
    size : (k,)
        m.
    by_time, by_distance : tuple of DriftRow
    """

    index: Index
    leg: Index
    since: Array
    driven: Array
    size: Array
    by_time: tuple[DriftRow, ...]
    by_distance: tuple[DriftRow, ...]

    def to_dict(self) -> dict[str, Any]:
        """The two tables."""
        return {
            "by_time": [{"after_s": r.after, **_without_after(r)} for r in self.by_time],
            "by_distance": [{"after_m": r.after, **_without_after(r)} for r in self.by_distance],
        }


def _without_after(row: DriftRow) -> dict[str, Any]:
    return {key: value for key, value in asdict(row).items() if key != "after"}


def legs_of(trajectory: Trajectory, start_ns: int | None) -> list[tuple[int, int]]:
    """(start, end) ns of every stretch without a stop that begins with a correction.

    A leg begins at the end of a stop, or at ``start_ns`` (where GPS was last used; None: before
    the first stop nothing is a leg), and ends where the next stop begins or the trajectory ends.
    """
    edge = np.diff(trajectory.stopped.astype(np.int8), prepend=0, append=0)
    stop_start = trajectory.t_ns[np.flatnonzero(edge == 1)].tolist()
    stop_end = trajectory.t_ns[np.flatnonzero(edge == -1) - 1].tolist()
    last = int(trajectory.t_ns[-1])
    legs = list(zip(stop_end, [*stop_start[1:], last], strict=True)) if stop_end else []
    if start_ns is None:
        return [leg for leg in legs if leg[1] > leg[0]]
    first_end = next((s for s in stop_start if s > start_ns), last)
    inside = any(a <= start_ns <= b for a, b in zip(stop_start, stop_end, strict=True))
    legs = [leg for leg in legs if leg[0] >= start_ns]
    if not inside:
        legs = [(start_ns, first_end), *legs]
    return [leg for leg in legs if leg[1] > leg[0]]


def drift(
    trajectory: Trajectory,
    t_ns: npt.NDArray[np.int64],
    error: Array,
    distance: Array,
    *,
    start_ns: int | None,
) -> Drift | None:
    """Drift over every leg, or None where there is none with two judged fixes.

    Parameters
    ----------
    trajectory : Trajectory
        Whose ``stopped`` says when it was corrected.
    t_ns : (n,) int64
        Judged fixes.
    error : (n, 2)
        East, north, m.
    distance : (n,)
        m, of the reference.
    start_ns : int or None
        Where GPS was last used.
    """
    t = (t_ns - t_ns[0]) * NS
    parts: list[tuple[Index, Array, Array, Array]] = []
    for start, end in legs_of(trajectory, start_ns):
        index = np.flatnonzero((t_ns > start) & (t_ns <= end))
        t0 = (start - t_ns[0]) * NS
        if index.size < 2 or t0 < t[0] - 1.5 * float(np.median(np.diff(t))):
            continue
        error0 = np.array([np.interp(t0, t, error[:, k]) for k in range(2)])
        size = np.hypot(*(error[index] - error0).T)
        driven = distance[index] - float(np.interp(t0, t, distance))
        parts.append((index, t[index] - t0, driven, size))
    if not parts:
        return None
    return Drift(
        index=np.concatenate([p[0] for p in parts]),
        leg=np.repeat(np.arange(len(parts)), [p[0].size for p in parts]),
        since=np.concatenate([p[1] for p in parts]),
        driven=np.concatenate([p[2] for p in parts]),
        size=np.concatenate([p[3] for p in parts]),
        by_time=_rows(AFTER_TIMES, [(p[1], p[3]) for p in parts]),
        by_distance=_rows(AFTER_DISTANCES, [(p[2], p[3]) for p in parts]),
    )


def _rows(after: tuple[float, ...], legs: list[tuple[Array, Array]]) -> tuple[DriftRow, ...]:
    """One row for each mark that some leg reaches; the drift there between the fixes around it."""
    rows = []
    for mark in after:
        at = [
            float(np.interp(mark, np.concatenate([[0.0], x]), np.concatenate([[0.0], size])))
            for x, size in legs
            if x[-1] >= mark
        ]
        if at:
            rows.append(DriftRow(mark, len(at), float(np.median(at)), max(at)))
    return tuple(rows)
