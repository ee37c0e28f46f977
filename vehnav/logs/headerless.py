"""Tables of numbers without a header, recognised by what their first rows can mean."""

from __future__ import annotations

from typing import Final

import numpy as np

from vehnav.logs.log import Array
from vehnav.logs.table import Sheet
from vehnav.units import STANDARD_GRAVITY

WEEK_S: Final = 604_800.0
GRAVITY_TOLERANCE: Final = 0.3
"""A vehicle that drives feels gravity within this share, on the mean of some rows."""


def _first_rows(sheet: Sheet, width: int) -> Array | None:
    """The sampled rows as numbers; None unless all have that many."""
    rows = [row for row in sheet.sample if len(row) == width]
    if len(rows) < 3 or len(rows) < len(sheet.sample) - 1:
        return None
    try:
        return np.array([[float(field) for field in row] for row in rows])
    except ValueError:
        return None


def _seconds_of_week(t: Array, shortest: float, longest: float) -> bool:
    steps = np.diff(t)
    inside = bool(np.all((t >= 0.0) & (t <= WEEK_S)))
    middle = float(np.median(steps))
    return inside and bool(np.all(steps > 0.0)) and shortest <= middle <= longest


def increments(sheet: Sheet) -> bool:
    """Seconds, three angle and three velocity increments: the latter are gravity times the step."""
    rows = _first_rows(sheet, 7)
    if rows is None or not _seconds_of_week(rows[:, 0], 5e-4, 0.1):
        return False
    felt = np.linalg.norm(rows[1:, 4:7], axis=1) / np.diff(rows[:, 0])
    return bool(abs(np.mean(felt) / STANDARD_GRAVITY - 1.0) < GRAVITY_TOLERANCE)


def _positions(lat: Array, lon: Array) -> bool:
    degrees = bool(np.all(np.abs(lat) <= 90.0) and np.all(np.abs(lon) <= 180.0))
    near = float(np.ptp(lat)) < 0.1 and float(np.ptp(lon)) < 0.1
    return degrees and near and bool(np.any(np.abs(lat) > 0.1) or np.any(np.abs(lon) > 0.1))


def fixes(sheet: Sheet) -> bool:
    """Seconds, latitude, longitude (deg), height, and three positive standard deviations."""
    rows = _first_rows(sheet, 7)
    if rows is None or not _seconds_of_week(rows[:, 0], 0.02, 60.0):
        return False
    return _positions(rows[:, 1], rows[:, 2]) and bool(np.all(rows[:, 4:7] > 0.0))


def navigation(sheet: Sheet) -> bool:
    """GPS week, seconds, latitude, longitude, height, three velocities, three angles (deg)."""
    rows = _first_rows(sheet, 11)
    if rows is None or not _seconds_of_week(rows[:, 1], 5e-4, 60.0):
        return False
    week = rows[:, 0]
    weeks = bool(np.all((week == np.floor(week)) & (week >= 0.0) & (week < 10_000.0)))
    return weeks and _positions(rows[:, 2], rows[:, 3])
