"""Stamps of a sensor that samples evenly, as a busy host wrote them down (spec A 5.4).

A driver that stamps on arrival adds the delay of the host to every sample: at 40 Hz by 10 ms and
more, while the sensor itself keeps time by its crystal. The true instants are the sample numbers
on a slowly moving line: a running least-squares line through the stamps. Where samples were lost
the line starts anew; where the stamps keep time already, they are left alone.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.errors import Finding
from vehnav.logs.log import Imu
from vehnav.units import NS

Array = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

JITTER: Final = 0.05
"""of the step: stamps that scatter less are left alone."""
WINDOW: Final = 2.0
"""s of the running line, on both sides together."""
LOST: Final = 0.7
"""of the step by which the stamps are later for good after a loss: below it they catch up."""
APART: Final = 8
"""Samples between two losses at least: nearer ones are one."""
BESIDE: Final = 40
"""Samples on each side of a long step whose medians tell a loss from a delay."""


def even_stamps(imu: Imu) -> tuple[Imu, list[Finding]]:
    """The IMU with its jittered stamps regressed, where it samples evenly; else as it is."""
    t = (imu.t_ns - imu.t_ns[0]) * NS
    regressed = regress_stamps(t)
    jitter = float(np.std(t - regressed))
    step = imu.median_dt
    even = np.round(regressed / NS).astype(np.int64) + imu.t_ns[0]
    if jitter <= JITTER * step or not np.all(np.diff(even) > 0):
        return imu, []
    most = float(np.max(np.abs(t - regressed)))
    text = (
        f"the IMU stamps jitter by {1e3 * jitter:.1f} ms ({1e3 * most:.0f} ms at most) about an "
        f"even clock of {1e3 * step:.2f} ms a step: they were regressed over {WINDOW:g} s "
        "(--stamps raw keeps them)"
    )
    return replace(imu, t_ns=even), [Finding("stamps-regressed", "info", text)]


def regress_stamps(t: Array) -> Array:
    """(n,) s: every stamp on the running line through its neighbours, by sample number.

    Parameters
    ----------
    t : (n,)
        s, strictly increasing.
    """
    out = np.empty_like(t)
    edges = [0, *losses(t), t.size]
    for a, b in pairwise(edges):
        out[a:b] = _running_line(t[a:b])
    return out


def losses(t: Array) -> list[int]:
    """Indices of the first samples after a loss: the stamps are later for good, not caught up."""
    step = np.diff(t)
    dt = float(np.median(step))
    found: list[int] = []
    for k in (int(x) + 1 for x in np.flatnonzero(step > (1.0 + LOST) * dt)):
        last = found[-1] if found else 0
        if k - last < APART:
            continue
        a, b = max(k - BESIDE, last), min(k + BESIDE, t.size)
        late = t[a:b] - np.arange(a - k, b - k) * dt
        if float(np.median(late[k - a :]) - np.median(late[: k - a])) > LOST * dt:
            found.append(k)
    return found


def _running_line(t: Array) -> Array:
    """Least-squares line through the window around each sample, evaluated there."""
    n = t.size
    if n < 8:
        return t.copy()
    rate = (t[-1] - t[0]) / (n - 1)
    half = min(max(4, round(0.5 * WINDOW / rate)), (n - 1) // 2)
    number = np.arange(n, dtype=np.float64)
    late = t - t[0] - number * rate
    lo, hi = np.maximum(np.arange(n) - half, 0), np.minimum(np.arange(n) + half, n - 1) + 1

    def window_sum(x: Array) -> Array:
        total = np.concatenate([[0.0], np.cumsum(x)])
        return np.asarray(total[hi] - total[lo])

    count = (hi - lo).astype(np.float64)
    mean_number = 0.5 * (lo + hi - 1)
    mean_late = window_sum(late) / count
    # slope by the sums about the middle of the window; even sample numbers have a closed variance
    slope = (window_sum(number * late) / count - mean_number * mean_late) / (
        (count**2 - 1.0) / 12.0
    )
    fitted = mean_late + slope * (number - mean_number)
    return np.asarray(t[0] + number * rate + fitted)
