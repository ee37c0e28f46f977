"""The baseline of a suite: the figures that a later run is compared with.

The file is a ``results.json`` with less in it: of every log and configuration that was tried the
status and the figures that are compared, to six digits, one on a line, so that its history in a
repository reads log by log. A whole ``results.json`` serves as a baseline, too.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, get_args

from vehnav.batch.model import METRICS, VERSION, Result, Results, Status, read_versioned
from vehnav.batch.rows import figures_of, one_of, rows_of
from vehnav.errors import ConfigError, FormatError
from vehnav.export.atomic import atomic_path

DIGITS: Final = 6
"""Kept of a figure: its noise between machines stays out of the file."""
FIXES: Final = "gps.fixes_judged"
"""Says whether the same part of a drive is judged."""
COMPARED: Final = tuple(name for name in METRICS if name.startswith("errors."))
"""Figures of which less is better; kept beside those that have bars."""


@dataclass(frozen=True, slots=True)
class Kept:
    """What a baseline keeps of one log and configuration."""

    log: str
    group: str
    config: str
    status: Status
    metrics: Mapping[str, float | None]

    @property
    def name(self) -> str:
        """``log/config``: unique in a suite."""
        return f"{self.log}/{self.config}"


@dataclass(frozen=True)
class Baseline:
    """Figures to compare with.

    Attributes
    ----------
    path : str
        Where they were read; for people.
    suite : str
        Name of the suite that made them.
    kept : tuple of Kept
    """

    path: str
    suite: str
    kept: tuple[Kept, ...]


def compared_metrics(results: Iterable[Result]) -> list[str]:
    """Names of the figures that are compared: those with bars, and the errors."""
    names = {bar.metric for result in results for bar in result.bars}
    return sorted(names.union(COMPARED))


def baseline_of(results: Results) -> Baseline:
    """What a baseline keeps of a run."""
    names = [*compared_metrics(results.results), FIXES]
    kept = [
        Kept(
            r.log, r.group, r.config, r.status,
            {n: _rounded(r.metrics[n]) for n in sorted(names) if n in r.metrics},
        )
        for r in results.results
    ]  # fmt: skip
    return Baseline("", results.suite, tuple(kept))


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.{DIGITS}g}")


def write_baseline(results: Results, path: str | Path) -> None:
    """Make the results the baseline; the file is written whole or not at all.

    Raises
    ------
    ConfigError
        The suite was not run to its end: what was not run would be lost from the baseline. Or
        nothing ran: there are no figures to compare with.
    """
    open_ends = [r.name for r in results.results if r.status == "interrupted"]
    if open_ends:
        raise ConfigError(
            f"{path}: not written, the suite was interrupted: {len(open_ends)} of "
            f"{len(results.results)} are not done ({open_ends[0]}); finish it with --resume"
        )
    if not any(r.status == "ok" for r in results.results):
        count = len(results.results)
        failed = "the only run failed" if count == 1 else f"all {count} runs failed"
        why = failed if count else "the suite has no logs here"
        raise ConfigError(f"{path}: not written, {why}: a baseline without figures gates nothing")
    item = baseline_of(results)
    rows = [
        {
            "log": k.log, "group": k.group, "config": k.config, "status": k.status,
            "metrics": k.metrics,
        }
        for k in sorted(item.kept, key=lambda k: (k.group, k.log, k.config))
    ]  # fmt: skip
    lines = ",\n".join(json.dumps(row, ensure_ascii=False, allow_nan=False) for row in rows)
    suite = json.dumps(item.suite, ensure_ascii=False)
    text = f'{{"version": {VERSION}, "suite": {suite}, "results": [\n{lines}\n]}}\n'
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def read_baseline(path: str | Path) -> Baseline:
    """A baseline, or a ``results.json`` as one.

    Raises
    ------
    ConfigError
        There is no such file.
    FormatError
        It is not a baseline of this version.
    """
    found = read_versioned(
        path,
        _baseline,
        what="baseline",
        if_missing="no such baseline; the first one is written by --update-baseline",
        if_other="make it again with --update-baseline",
    )
    _refuse_twins(path, found.kept)
    return replace(found, path=str(path))


def _baseline(content: Mapping[str, Any]) -> Baseline:
    return Baseline("", str(content["suite"]), tuple(rows_of(content, _kept)))


def _kept(row: Mapping[str, Any]) -> Kept:
    status = one_of(row, "status", get_args(Status))
    metrics = figures_of(row, "metrics")
    for name, value in metrics.items():
        if value is not None and not math.isfinite(value):
            raise ValueError(f"field 'metrics: {name}': not finite ({value})")
    return Kept(str(row["log"]), str(row["group"]), str(row["config"]), status, metrics)


def _refuse_twins(path: str | Path, kept: Iterable[Kept]) -> None:
    """A merge of two branches may leave a log twice."""
    seen: set[tuple[str, str]] = set()
    for k in kept:
        if (k.log, k.config) in seen:
            raise FormatError(f"{path}: {k.name} is there twice; remove one of the two lines")
        seen.add((k.log, k.config))
