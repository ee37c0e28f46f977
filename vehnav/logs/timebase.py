"""Time columns become int64 nanoseconds, every digit kept; an undeclared unit is inferred."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.errors import Finding, FormatError
from vehnav.logs.clock import NO_TIME
from vehnav.logs.columns import TIME_UNITS, Column
from vehnav.logs.log import Array, TimeArray
from vehnav.logs.table import Table, is_number

if TYPE_CHECKING:
    import pandas as pd

FIRST_UNIX_NS: Final = 631_152_000 * 1_000_000_000
"""1990-01-01: a clock that starts later is a Unix clock."""
EPOCH_RANGE_S: Final = (631_152_000.0, 4_102_444_800.0)
"""1990 to 2100: where the stamps of a Unix clock lie."""
SHORTEST_STEP_S: Final = {"imu": 5e-4, "gps": 5e-3}
"""Units differ by 1000, so a window of that ratio holds the median step in one unit only."""
_FLOAT_DECIMALS: Final = 6
"""Decimals of Unix seconds that float64 keeps (its spacing there is 0.24 us)."""
_MAX_S: Final = 9.2e9


def is_unix(t_ns: TimeArray) -> bool:
    """Whether stamps count from 1970: the first good one lies after 1990."""
    first = int(np.argmax(t_ns != NO_TIME)) if t_ns.size else 0
    return bool(t_ns.size and t_ns[first] >= FIRST_UNIX_NS)


def stamps(table: Table, column: Column, *, kind: str) -> TimeArray:
    """(rows,) int64 ns: a time column, :data:`~vehnav.logs.clock.NO_TIME` where it is empty.

    Parameters
    ----------
    column : Column
        With its unit, or None: inferred from magnitude and step, with a finding.
    kind : {"imu", "gps"}
        What the rows are: an IMU is sampled at over 2 Hz, GPS at up to 200 Hz.

    Raises
    ------
    FormatError
        The column holds neither numbers nor dates.
    """
    sheet = table.sheet
    first = next((row[column.index] for row in sheet.sample if len(row) > column.index), "")
    if first and not is_number(first, sheet.decimal):
        return _dates(table, column)
    whole = table.integers(column.index)
    if whole is not None:
        good = whole != NO_TIME
        unit = _unit(table, column, whole[good].astype(np.float64), kind)
        scale = TIME_UNITS[unit]
        good &= np.abs(whole) < np.iinfo(np.int64).max // scale
        return _masked(np.where(good, whole, 0) * scale, good)
    values = table.numbers(column.index)
    unit = _unit(table, column, values[np.isfinite(values)], kind)
    return _decimals(table, column.index, values, TIME_UNITS[unit])


def _masked(t_ns: TimeArray, good: npt.NDArray[np.bool_]) -> TimeArray:
    return np.asarray(np.where(good, t_ns, NO_TIME), np.int64)


def _decimals(table: Table, index: int, values: Array, scale: int) -> TimeArray:
    """Nanoseconds of a column with decimals; ``scale`` nanoseconds are one of its units."""
    fields = [row[index] for row in table.sheet.sample if len(row) > index]
    lengths = {len(field.partition(table.sheet.decimal)[2]) for field in fields if field} or {0}
    decimals = max(lengths)
    if len(lengths) == 1 and decimals > _FLOAT_DECIMALS and scale == TIME_UNITS["s"]:
        exact = table.fixed_point(index, decimals)
        if exact is not None:
            shift = 10 ** abs(9 - decimals)
            return np.asarray(exact * shift if decimals <= 9 else exact // shift, np.int64)
    good = np.isfinite(values) & (np.abs(values) < _MAX_S * (TIME_UNITS["s"] / scale))
    values = np.where(good, values, 0.0)
    whole = np.floor(values)
    part = values - whole
    rounded = np.rint(part * 10.0**decimals) / 10.0**decimals
    if np.all(np.abs(rounded - part) <= np.spacing(np.abs(values))):
        part = rounded  # the decimals as written; the rest is what float64 made of them
    t_ns = whole.astype(np.int64) * scale + np.rint(part * scale).astype(np.int64)
    return _masked(t_ns, good)


def _unit(table: Table, column: Column, values: Array, kind: str) -> str:
    """The unit of a time column as declared, else the one that makes sense, with a finding."""
    if column.unit in TIME_UNITS:
        return str(column.unit)
    unit, why = infer_time_unit(values, kind=kind)
    if why:
        text = f"{table.sheet.path}: column {column.name!r} taken as time in {unit}: {why}"
        table.findings.append(Finding("unit-inferred", "info", text))
    return unit


def infer_time_unit(values: Array, *, kind: str) -> tuple[str, str]:
    """Unit of stamps without one, and why; "" where Unix times leave no doubt.

    >>> infer_time_unit(np.array([1.7e12, 1.7e12 + 10]), kind="imu")[0]
    'ms'
    >>> infer_time_unit(np.array([0.0, 10e3, 20e3]), kind="imu")[0]
    'us'
    """
    if not values.size:
        return "s", "it is empty"
    middle = float(np.median(values))
    for unit, scale in TIME_UNITS.items():
        seconds = middle * scale / TIME_UNITS["s"]
        if EPOCH_RANGE_S[0] <= seconds <= EPOCH_RANGE_S[1]:
            return unit, ""
    steps = np.diff(values)
    step = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    for unit in ("s", "ms", "us", "ns"):
        seconds = step * TIME_UNITS[unit] / TIME_UNITS["s"]
        if SHORTEST_STEP_S[kind] <= seconds < 1000.0 * SHORTEST_STEP_S[kind]:
            return unit, f"its median step is {step:.6g}"
    return "s", f"no other unit fits its median step of {step:.6g}"


def _dates(table: Table, column: Column) -> TimeArray:
    """Nanoseconds of a column of dates (ISO 8601; without a zone UTC is meant)."""
    import pandas as pd

    text = table.text(column.index)
    times = pd.to_datetime(text, utc=True, errors="coerce", format="ISO8601")
    bad = np.flatnonzero((times.isna() & text.notna()).to_numpy())
    if bad.size > table.rows // 2:
        raise FormatError(
            f"{table.sheet.path}: column {column.name!r} holds neither numbers nor ISO 8601 dates "
            f"(row {bad[0] + 1}: {str(text.iloc[bad[0]])[:40]!r})"
        )
    if bad.size:
        note = f"{table.sheet.path}: {bad.size} dates of column {column.name!r} cannot be read"
        table.findings.append(Finding("bad-rows", "error", note))
    return datetime_ns(times)


def datetime_ns(times: pd.Series[Any]) -> TimeArray:
    """int64 ns of a pandas datetime column of any resolution.

    :data:`~vehnav.logs.clock.NO_TIME` where it is missing, or outside what nanoseconds can count.
    """
    if times.dt.unit == "ns":
        return np.asarray(times.astype("int64"), np.int64)
    micro = np.asarray(times.dt.as_unit("us").astype("int64"), np.int64)
    good = np.abs(micro) < np.iinfo(np.int64).max // 1000
    return _masked(np.where(good, micro, 0) * 1000, good & times.notna().to_numpy())
