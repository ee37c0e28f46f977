"""Stamps: put in order, repeats found, and the findings that say so."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.errors import Finding, Level
from vehnav.logs.log import Array, TimeArray
from vehnav.units import NS

BoolArray = npt.NDArray[np.bool_]
IndexArray = npt.NDArray[np.intp]

NO_TIME: Final = int(np.iinfo(np.int64).min)
"""The stamp of a row without one (numpy's not-a-time); such rows are dropped as not finite."""
CLOCK_SET_BACK_S: Final = 1.0
"""A step back of more than this is a clock that was set, not a late message."""


def finite_rows(t_ns: TimeArray, *values: Array) -> BoolArray:
    """(n,): the row has a stamp, and every number in it is finite."""
    good = np.asarray(t_ns != NO_TIME)
    for value in values:
        finite = np.isfinite(value)
        if finite.all():  # the usual case; row by row costs ten times as much
            continue
        good &= finite if finite.ndim == 1 else finite.all(axis=1)
    return good


def time_order(t_ns: TimeArray, where: str, findings: list[Finding]) -> IndexArray | None:
    """The stable order in time, or None where the stamps do not run backward."""
    if t_ns.size < 2 or np.all(t_ns[1:] >= t_ns[:-1]):
        return None
    behind = np.maximum.accumulate(t_ns) - t_ns
    step_s = float(behind.max()) * NS
    late = np.flatnonzero(behind)
    text = (
        f"{late.size} of {t_ns.size} stamps run backward (biggest step {step_s:.6g} s); "
        "sorted by time"
    )
    level: Level = "warning"
    if step_s > CLOCK_SET_BACK_S:
        level = "error"
        text += ": the clock was set back, and samples of different moments may now be mixed"
    findings.append(finding_at("backward-stamps", level, where, text, t_ns[late]))
    return np.argsort(t_ns, kind="stable")


def first_of_each(t_ns: TimeArray) -> IndexArray:
    """Index of the first row of every different stamp of a sorted clock."""
    return np.flatnonzero(np.concatenate(([True], t_ns[1:] != t_ns[:-1]))[: t_ns.size])


def mean_of_each(values: Array, first: IndexArray) -> Array:
    """Mean over the rows of every stamp: (n,) or (n, k) to as many rows as ``first`` has."""
    counts = np.diff(np.append(first, len(values))).astype(np.float64)
    sums = np.add.reduceat(values, first, axis=0)
    return np.asarray((sums.T / counts).T)


def non_finite(t_ns: TimeArray, good: BoolArray, where: str) -> Finding:
    """Finding: rows that are not ``good`` were dropped."""
    bad = np.flatnonzero(~good)
    text = (
        f"{bad.size} of {t_ns.size} rows dropped for numbers or stamps that are missing or not "
        f"finite (the first is row {bad[0] + 1})"
    )
    return finding_at("non-finite", "error", where, text, t_ns[bad])


def duplicates(t_ns: TimeArray, first: IndexArray, where: str, how: str) -> Finding:
    """Finding: of rows with equal stamps one was kept, or they were merged."""
    repeated = np.setdiff1d(np.arange(t_ns.size), first)
    text = f"{repeated.size} of {t_ns.size} rows repeat the stamp before them; kept {how}"
    return finding_at("duplicate-stamps", "warning", where, text, t_ns[repeated])


def finding_at(code: str, level: Level, where: str, text: str, times: TimeArray) -> Finding:
    """A finding over the span of some stamps, which are named only where they exist."""
    times = times[times != NO_TIME]
    if not times.size:
        return Finding(code, level, f"{where}: {text}")
    return Finding(code, level, f"{where}: {text}", int(times.min()), int(times.max()))
