"""Gyro and accelerometer kept apart, each on its own stamps: put together on the gyro's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from vehnav.errors import Finding, LogError
from vehnav.logs import clock
from vehnav.logs.log import Array, TimeArray
from vehnav.units import NS

MAX_HOLE_STEPS: Final = 3.0
"""Accelerometer steps, in medians, over which its values are interpolated."""
MIN_HOLE_S: Final = 0.05


@dataclass(frozen=True)
class Stream:
    """Three axes of one sensor.

    Attributes
    ----------
    t_ns : (n,) int64
        As in the file, in any order.
    values : (n, 3)
        SI; may hold NaN.
    source : str
        File it came from.
    """

    t_ns: TimeArray
    values: Array
    source: str


def sorted_stream(stream: Stream, path: str, findings: list[Finding]) -> Stream:
    """Finite, in order and each stamp once (mean of repeats); what was done is counted."""
    where = f"{path}: {stream.source}"
    t_ns, values = stream.t_ns, stream.values
    good = clock.finite_rows(t_ns, values)
    if not good.any():
        raise LogError(f"{where}: none of {t_ns.size} rows holds a stamp and three numbers")
    if not good.all():
        findings.append(clock.non_finite(t_ns, good, where))
        t_ns, values = t_ns[good], values[good]
    order = clock.time_order(t_ns, where, findings)
    if order is not None:
        t_ns, values = t_ns[order], values[order]
    first = clock.first_of_each(t_ns)
    if first.size < t_ns.size:
        findings.append(clock.duplicates(t_ns, first, where, "their means"))
        t_ns, values = t_ns[first], clock.mean_of_each(values, first)
    return Stream(t_ns, values, stream.source)


def join(
    gyro: Stream, accel: Stream, path: str, findings: list[Finding]
) -> tuple[TimeArray, Array, Array]:
    """Stamps, rates and specific forces on the gyro's stamps.

    The accelerometer is interpolated linearly between its neighbours. Samples of the gyro outside
    its span, or in a hole of it, are left out, so that the hole shows as a gap.

    Raises
    ------
    LogError
        The two share no time.
    """
    gyro, accel = sorted_stream(gyro, path, findings), sorted_stream(accel, path, findings)
    if np.array_equal(gyro.t_ns, accel.t_ns):
        return gyro.t_ns, gyro.values, accel.values
    inside = (gyro.t_ns >= accel.t_ns[0]) & (gyro.t_ns <= accel.t_ns[-1])
    if not inside.any():
        raise LogError(f"{path}: {gyro.source} and {accel.source} share no time")
    steps = np.diff(accel.t_ns)
    longest = max(MAX_HOLE_STEPS * float(np.median(steps)), MIN_HOLE_S / NS)
    before = np.clip(np.searchsorted(accel.t_ns, gyro.t_ns, side="right") - 1, 0, steps.size - 1)
    on_sample = gyro.t_ns == accel.t_ns[before]
    hole = inside & ~on_sample & (steps[before] > longest)
    if hole.any():
        text = f"{hole.sum()} samples of the gyro fall into holes of {accel.source}; left out"
        findings.append(clock.finding_at("gap", "warning", path, text, gyro.t_ns[hole]))
    keep = inside & ~hole
    t_ns = gyro.t_ns[keep]
    t = (t_ns - accel.t_ns[0]) * NS
    known = (accel.t_ns - accel.t_ns[0]) * NS
    force = np.column_stack([np.interp(t, known, accel.values[:, j]) for j in range(3)])
    return t_ns, gyro.values[keep], force
