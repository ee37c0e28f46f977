"""A flat table of a suite, a row for each log and configuration: CSV and Parquet.

Columns: what was run, how it ended, whether and by which metric it missed bars, then every metric
by its dotted path; with a baseline, beside the figures that are compared, ``METRIC.baseline`` and
``METRIC.worsening`` (relative, positive is worse).
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

from vehnav.batch.model import Result, Results
from vehnav.batch.regression import Change, Comparison
from vehnav.errors import ConfigError
from vehnav.export.atomic import atomic_path
from vehnav.export.text_tables import parquet_library

Row = dict[str, Any]

TEXTS: Final = ("suite", "log", "group", "config", "status", "error", "missed", "key", "report")
"""Columns of text; the others that are not metrics are numbers."""
_Changes = dict[tuple[str, str], list[Change]]


def write_table(results: Results, path: Path, *, comparison: Comparison | None = None) -> None:
    """Write the table in the format of the suffix, whole or not at all; see :func:`check_table`."""
    check_table(path)
    writer = WRITERS[path.suffix.lower()]
    metrics = metric_columns(results, comparison)
    with atomic_path(path) as temporary:
        writer(results, metrics, table_rows(results, comparison), temporary)


def check_table(path: Path) -> None:
    """Whether a table can be written to ``path``; better asked before the suite runs than after.

    Raises
    ------
    ConfigError
        Neither ``.csv`` nor ``.parquet``.
    FormatError
        Parquet without pyarrow.
    """
    suffix = path.suffix.lower()
    if suffix not in WRITERS:
        raise ConfigError(f"{path}: a table is written as {' or '.join(WRITERS)}")
    if suffix == ".parquet":
        parquet_library(path)


def metric_columns(results: Results, comparison: Comparison | None = None) -> list[str]:
    """Names of the columns of figures, sorted."""
    names = {name for r in results.results for name in r.metrics}
    if comparison is not None:
        for metric in {c.metric for c in comparison.changes}:
            names |= {f"{metric}.baseline", f"{metric}.worsening"}
    return sorted(names)


def table_rows(results: Results, comparison: Comparison | None = None) -> Iterator[Row]:
    """The rows in the order of the results; a figure that is not there is left out of its row."""
    changes: _Changes = {}
    for c in comparison.changes if comparison is not None else ():
        changes.setdefault((c.log, c.config), []).append(c)
    for r in results.results:
        yield _row(results.suite, r, changes.get((r.log, r.config), ()))


def _row(suite: str, r: Result, changes: Any) -> Row:
    row: Row = {
        "suite": suite,
        "log": r.log,
        "group": r.group,
        "config": r.config,
        "status": r.status,
        "exit_status": r.exit_status,
        "error": r.error,
        "damaged": r.damaged,
        "passed": r.passed,
        "bars": len(r.bars),
        "missed": " ".join(bar.metric for bar in r.bars if not bar.passed),
        **r.metrics,
    }
    for c in changes:
        row[f"{c.metric}.baseline"] = c.before
        row[f"{c.metric}.worsening"] = c.worsening
    return {**row, "key": r.key, "report": r.report}


def _columns(metrics: list[str]) -> list[str]:
    first = ["suite", "log", "group", "config", "status", "exit_status", "error", "damaged"]
    return [*first, "passed", "bars", "missed", *metrics, "key", "report"]


def _write_csv(results: Results, metrics: list[str], rows: Iterator[Row], path: Path) -> None:
    with path.open("w", encoding="utf-8", errors="backslashreplace", newline="") as file:
        writer = csv.DictWriter(file, _columns(metrics), restval="", lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({name: _text(value) for name, value in row.items()})


def _text(value: Any) -> Any:
    if isinstance(value, bool):
        return "true" if value else "false"
    return value


def _write_parquet(results: Results, metrics: list[str], rows: Iterator[Row], path: Path) -> None:
    pa = parquet_library(path)
    kinds = {"exit_status": pa.int32(), "bars": pa.int32()}
    kinds |= dict.fromkeys(("damaged", "passed"), pa.bool_())
    kinds |= dict.fromkeys(TEXTS, pa.string())
    schema = pa.schema([(name, kinds.get(name, pa.float64())) for name in _columns(metrics)])
    schema = schema.with_metadata({"vehnav.suite": _encodable(results.suite)})
    plain = [{n: _encodable(v) if n in TEXTS and v else v for n, v in r.items()} for r in rows]
    table = pa.Table.from_pylist(plain, schema=schema)
    pa.parquet.write_table(table, path, compression="zstd")


def _encodable(text: str) -> str:
    """Names of files that are not UTF-8 hold lone surrogates, which Parquet cannot."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


WRITERS: Final[dict[str, Callable[[Results, list[str], Iterator[Row], Path], None]]] = {
    ".csv": _write_csv,
    ".parquet": _write_parquet,
}
