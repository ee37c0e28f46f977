"""Which fixes judge which states: the trajectory interpolated to the fixes that count."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.earth import c_en, ecef_from_geodetic, geodetic_from_ecef
from vehnav.errors import LogError
from vehnav.evaluation.diagnosis import check_overlap
from vehnav.logs.log import Gnss
from vehnav.trajectory import Trajectory, interpolate

Array = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
Interval = tuple[int, int]

MIN_FIXES: Final = 3
"""Fewer say nothing about a track."""
UNCERTAIN: Final = 10.0
"""m, and times the median: a fix whose own sigma exceeds both does not judge."""
LONG_GAP_NS: Final = 1_000_000_000
"""ns: a step of the trajectory above it, and above 2.5 of its median steps, is not bridged."""


@dataclass(frozen=True)
class Matched:
    """The states of a trajectory at the fixes that judge it.

    Attributes
    ----------
    states : Trajectory
        The trajectory at the judged fixes, n states.
    index : (n,) int64
        Which fixes of the receiver they are.
    counts : dict of str to int
        ``total``, ``judged``, and why the others are not: ``outside`` the trajectory,
        ``before`` judging starts, ``excluded`` by interval, ``uncertain`` by their own sigma,
        ``in_gaps`` of the trajectory.
    """

    states: Trajectory
    index: npt.NDArray[np.int64]
    counts: dict[str, int]


def in_intervals(t_ns: npt.NDArray[np.int64], intervals: Sequence[Interval]) -> BoolArray:
    """(n,) whether each instant lies in one of the closed intervals."""
    inside = np.zeros(t_ns.size, bool)
    for start, end in intervals:
        inside |= (t_ns >= start) & (t_ns <= end)
    return inside


def in_long_gaps(t_ns: npt.NDArray[np.int64], clock: npt.NDArray[np.int64]) -> BoolArray:
    """(n,) whether each instant lies inside a long gap of ``clock``."""
    step = np.diff(clock)
    limit = max(LONG_GAP_NS, int(2.5 * np.median(step)))
    k = np.clip(np.searchsorted(clock, t_ns, side="right") - 1, 0, step.size - 1)
    at_an_end = (t_ns == clock[k]) | (t_ns == clock[k + 1])
    return np.asarray((step[k] > limit) & ~at_an_end)


def uncertain(gnss: Gnss) -> BoolArray:
    """(m,) fixes that the receiver itself calls bad: sigma over 10 m and over 10 medians."""
    if gnss.sigma_pos is None:
        return np.zeros(gnss.t_ns.size, bool)
    sigma = np.hypot(gnss.sigma_pos[:, 0], gnss.sigma_pos[:, 1])
    return np.asarray(sigma > max(UNCERTAIN, UNCERTAIN * float(np.median(sigma))))


def match(
    trajectory: Trajectory,
    gnss: Gnss,
    *,
    judge_from_ns: int | None,
    exclude: Sequence[Interval],
    only: Sequence[Interval] | None,
    lever_arm: npt.ArrayLike | None,
) -> Matched:
    """The judged fixes and the states there; LogError where fewer than three remain."""
    if trajectory.size < 2 or gnss.t_ns.size == 0:
        raise LogError(
            f"nothing to compare: {trajectory.size} states of the trajectory, "
            f"{gnss.t_ns.size} fixes of the GPS"
        )
    check_overlap(trajectory, gnss)
    t = gnss.t_ns
    outside = (t < trajectory.t_ns[0]) | (t > trajectory.t_ns[-1])
    before = ~outside & (t < judge_from_ns if judge_from_ns is not None else np.zeros(t.size, bool))
    barred = in_intervals(t, exclude)
    if only is not None:
        barred |= ~in_intervals(t, only)
    excluded = ~outside & ~before & barred
    doubtful = ~outside & ~before & ~excluded & uncertain(gnss)
    gaps = ~outside & ~before & ~excluded & ~doubtful & in_long_gaps(t, trajectory.t_ns)
    index = np.flatnonzero(~(outside | before | excluded | doubtful | gaps))
    counts = {
        "total": int(t.size),
        "judged": int(index.size),
        "outside": int(outside.sum()),
        "before": int(before.sum()),
        "excluded": int(excluded.sum()),
        "uncertain": int(doubtful.sum()),
        "in_gaps": int(gaps.sum()),
    }
    if index.size < MIN_FIXES:
        raise LogError(
            f"only {index.size} GPS fixes can judge the trajectory, at least {MIN_FIXES} are "
            f"needed: of {counts['total']} lie {counts['outside']} outside its time span, "
            f"{counts['before']} before judging starts, {counts['excluded']} in excluded "
            f"intervals, {counts['uncertain']} are uncertain by their own sigma, "
            f"{counts['in_gaps']} in gaps of the trajectory"
        )
    states = interpolate(trajectory, t[index])
    if lever_arm is not None:
        states = at_antenna(states, np.asarray(lever_arm, float))
    return Matched(states, index, counts)


def at_antenna(states: Trajectory, lever_arm: Array) -> Trajectory:
    """The states moved from the vehicle's point to the antenna, ``lever_arm`` (3,) m in body axes.

    The velocity of the turning arm (0.5 m/s at 1 m and 30 deg/s) is added as the difference
    quotient of the arm where states follow each other within a second.
    """
    arm_n = states.c_nb @ lever_arm
    r_e = ecef_from_geodetic(states.lat, states.lon, states.height)
    arm_e = np.einsum("kij,kj->ki", c_en(states.lat, states.lon), arm_n)
    lat, lon, height = geodetic_from_ecef(r_e + arm_e)
    v_n = states.v_n
    if states.size > 2:
        t = (states.t_ns - states.t_ns[0]) * 1e-9
        turning = np.gradient(arm_n, t, axis=0)
        close = np.gradient(t) <= 1.0 + 1e-6
        v_n = v_n + np.where(close[:, None], turning, 0.0)
    return replace(states, lat=lat, lon=lon, height=height, v_n=v_n)
