"""``trajectory.csv`` and its relatives: CSV, Parquet, JSON, written and read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.errors import FormatError
from vehnav.export.columns import DECIMALS, TIME, document, fixed_columns, from_columns, to_columns
from vehnav.export.decimals import write_rows
from vehnav.trajectory import Trajectory

TimeArray = npt.NDArray[np.int64]

FORMAT_KEY: Final = b"vehnav.trajectory"
YAW: Final = "yaw_enu_deg"
"""0 = east, counter-clockwise; roll and pitch beside it are those of a forward-left-up body."""
ALIASES: Final = {"v_east": "v_east_m_s", "v_north": "v_north_m_s", "v_up": "v_up_m_s"}
READ_NAMES: Final = frozenset({TIME, YAW, *DECIMALS, *ALIASES})


def write_csv(trajectory: Trajectory, path: Path, **_: Any) -> None:
    """``trajectory.csv``: header, one row per state, fixed decimals, time from int ns."""
    columns = fixed_columns(trajectory)
    write_rows(path, columns, header=",".join(c.name for c in columns))


def read_csv(path: Path) -> Trajectory:
    """A CSV with ``time_s, lat_deg, lon_deg`` and any other column of ``trajectory.csv``.

    Instead of the heading it may have ``yaw_enu_deg``, as truth files of ROS-like origin do.
    """
    import pandas as pd

    try:
        frame = pd.read_csv(path, dtype=float, usecols=lambda name: name in READ_NAMES)
    except (ValueError, UnicodeDecodeError) as error:
        raise FormatError(f"{path}: not a table of numbers: {error}") from error
    if TIME not in frame:
        raise FormatError(f"{path}: no column {TIME}; it is not a trajectory of vehnav")
    columns = {ALIASES.get(n, n): frame[n].to_numpy() for n in frame.columns if n != TIME}
    yaw = columns.pop(YAW, None)
    if yaw is not None and "heading_deg" not in columns:  # Euler angles of a forward-left-up body
        columns["heading_deg"] = 90.0 - yaw
        columns["pitch_deg"] = -columns.get("pitch_deg", np.zeros(yaw.size))
    return from_columns(exact_time(path, TIME, separator=","), columns, where=str(path))


def exact_time(path: Path, name: str | int, *, separator: str) -> TimeArray:
    """(n,) int64 ns of a column of decimal seconds, every written digit kept.

    With nine decimals in every row the point is read as a separator of thousands, at the speed of
    integers; otherwise each text is taken apart.
    """
    import pandas as pd

    header: Any = 0 if isinstance(name, str) else None
    common: dict[str, Any] = {"sep": separator, "usecols": [name], "header": header, "comment": "#"}
    text = pd.read_csv(path, dtype=str, nrows=100, **common)[name]
    if text.str.fullmatch(r"\d+\.\d{9}").fillna(False).all():
        try:
            exact = pd.read_csv(path, dtype=np.int64, thousands=".", **common)[name].to_numpy()
            rough = pd.read_csv(path, dtype=float, **common)[name].to_numpy()
        except (ValueError, OverflowError):
            pass
        else:
            if exact.size and np.allclose(exact * 1e-9, rough, rtol=1e-12, atol=1e-6):
                return np.asarray(exact, np.int64)
    return _time_from_text(pd.read_csv(path, dtype=str, **common)[name], path)


def _time_from_text(text: Any, path: Path) -> TimeArray:
    """Integer ns of decimal texts of any length; exponents go through float64."""
    parts = text.str.strip().str.extract(r"^(-?)(\d+)(?:\.(\d*))?$")
    plain = parts[1].notna().to_numpy()
    out = np.zeros(len(text), np.int64)
    whole = parts[1].fillna("0").astype("int64").to_numpy()
    decimals = parts[2].fillna("").str.slice(0, 9).str.ljust(9, "0").replace("", "0" * 9)
    sign = np.where(parts[0].fillna("").to_numpy() == "-", -1, 1)
    out[plain] = (sign * (whole * 1_000_000_000 + decimals.astype("int64").to_numpy()))[plain]
    for row in np.flatnonzero(~plain):
        try:
            value = float(text.iloc[row])
        except (TypeError, ValueError):
            value = float("nan")
        if not np.isfinite(value) or abs(value) > 9e9:
            raise FormatError(f"{path}: row {row + 1}: time {text.iloc[row]!r} is not a number")
        out[row] = round(value * 1e9)
    return out


def write_json(trajectory: Trajectory, path: Path, *, unix_clock: bool = True, **_: Any) -> None:
    """One document of columns."""
    content = document(trajectory, unix_clock=unix_clock)
    path.write_text(json.dumps(content, allow_nan=False), encoding="utf-8")


def read_json(path: Path) -> Trajectory:
    """The document of :func:`write_json`."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise FormatError(f"{path}: not JSON: {error}") from error
    if not isinstance(content, dict) or content.get("format") != FORMAT_KEY.decode():
        raise FormatError(f"{path}: not a trajectory of vehnav (its format key is missing)")
    try:
        columns = {k: np.asarray(v) for k, v in content["columns"].items()}
        t_ns = columns.pop("t_ns").astype(np.int64)
        floats = {k: v.astype(float) for k, v in columns.items()}
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise FormatError(f"{path}: columns of the trajectory are broken: {error}") from error
    return from_columns(t_ns, floats, where=str(path))


def parquet_library(path: Path) -> Any:
    """The modules of pyarrow, or an error that says what to install."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise FormatError(
            f"{path}: Parquet needs pyarrow: pip install 'vehnav[parquet]'"
        ) from error
    return pyarrow


def write_parquet(trajectory: Trajectory, path: Path, *, unix_clock: bool = True, **_: Any) -> None:
    """The columns of the CSV as float64, and ``t_ns`` as int64 instead of ``time_s``."""
    pa = parquet_library(path)
    columns = {"t_ns": trajectory.t_ns, **to_columns(trajectory), "stopped": trajectory.stopped}
    table = pa.table(columns)
    clock = b"unix" if unix_clock else b"log"
    table = table.replace_schema_metadata({FORMAT_KEY: b"1", b"vehnav.clock": clock})
    pa.parquet.write_table(table, path, compression="zstd")


def read_parquet(path: Path) -> Trajectory:
    """The table of :func:`write_parquet`."""
    pa = parquet_library(path)
    try:
        table = pa.parquet.read_table(path)
    except (pa.ArrowException, OSError) as error:
        raise FormatError(f"{path}: not Parquet: {error}") from error
    columns = {n: table[n].to_numpy() for n in table.column_names}
    t_ns = columns.pop("t_ns", None)
    if t_ns is None:
        raise FormatError(f"{path}: no column t_ns; it is not a trajectory of vehnav")
    known = {n: np.asarray(x, float) for n, x in columns.items() if n in DECIMALS}
    return from_columns(np.asarray(t_ns, np.int64), known, where=str(path))
