"""What a suite found: the records of ``results.json``, to and from JSON.

Everything under ``results`` is the same, byte for byte, whenever the same suite runs on the same
machine; what may differ (times, host, number of workers) stands under ``run``. The order is that
of group, log and configuration. A metric is named by its dotted path in ``report.json``
(``errors.horizontal_m.max``).
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, TypeVar, get_args

from vehnav.batch.rows import figures_of, number_of, one_of, rows_of
from vehnav.errors import ConfigError, FormatError
from vehnav.export.atomic import atomic_path

T = TypeVar("T")

VERSION: Final = 1
"""Of the form of ``results.json``; a change that breaks a reader raises it."""
RESULTS_NAME: Final = "results.json"

Status = Literal["ok", "error", "timeout", "crash", "interrupted"]
Bound = Literal["max", "min"]

METRICS: Final = (
    "errors.horizontal_m.rms",
    "errors.horizontal_m.median",
    "errors.horizontal_m.p95",
    "errors.horizontal_m.max",
    "errors.horizontal_m.end",
    "errors.along_m.rms",
    "errors.cross_m.rms",
    "errors.velocity_m_s.rms",
    "errors.heading_deg.rms",
    "errors.percent_of_distance.end",
    "errors.percent_of_distance.max",
    "trajectory.distance_m",
    "trajectory.duration_s",
    "stops.count",
    "gps.fixes_judged",
)
"""Kept for every log, beside those that the bars name; None where a log has none."""
MAIN_METRIC: Final = "errors.horizontal_m.max"
"""What logs are sorted by where a page puts the worst first."""


@dataclass(frozen=True)
class BarResult:
    """A bar against one log and configuration.

    Attributes
    ----------
    metric : str
    bound : {"max", "min"}
        Whether the limit is the largest or the smallest value that passes.
    limit : float
    value : float or None
        None: the report has no such figure (no GPS, failed); the bar is missed then.
    passed : bool
    """

    metric: str
    bound: Bound
    limit: float
    value: float | None
    passed: bool

    @classmethod
    def of(cls, metric: str, bound: Bound, limit: float, value: float | None) -> BarResult:
        """The bar judged; a value on the limit passes."""
        if value is None:
            return cls(metric, bound, limit, None, False)
        return cls(
            metric, bound, limit, value, value <= limit if bound == "max" else value >= limit
        )

    def to_dict(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "metric": self.metric,
            "bound": self.bound,
            "limit": self.limit,
            "value": self.value,
            "passed": self.passed,
        }


@dataclass(frozen=True)
class Result:
    """One log with one configuration.

    Attributes
    ----------
    log, group, config : str
        Names; log and config together are unique in a suite.
    status : {"ok", "error", "timeout", "crash", "interrupted"}
        ``error``: refused or a bug, see ``exit_status``; ``timeout``: stopped at the time limit;
        ``crash``: its process died or ran out of memory; ``interrupted``: not finished when the
        suite was stopped.
    exit_status : int or None
        Of ``vehnav run`` on the log: 0, 2, 3 (damaged) or 70; None where there is none.
    error : str or None
        What went wrong, in one line.
    key : str
        SHA-256 of the log's content, the options and the code: equal keys give equal results.
    damaged : bool
    metrics : mapping of str to (float or None)
    bars : tuple of BarResult
    report : str or None
        ``report.html`` relative to the folder of ``results.json``; ``report.json`` lies beside it.
    """

    log: str
    group: str
    config: str
    status: Status
    exit_status: int | None = None
    error: str | None = None
    key: str = ""
    damaged: bool = False
    metrics: Mapping[str, float | None] = field(default_factory=dict)
    bars: tuple[BarResult, ...] = ()
    report: str | None = None

    @property
    def name(self) -> str:
        """``log/config``: unique in a suite."""
        return f"{self.log}/{self.config}"

    @property
    def passed(self) -> bool:
        """Whether it ran and missed no bar."""
        return self.status == "ok" and all(bar.passed for bar in self.bars)

    def to_dict(self) -> dict[str, Any]:
        """As plain data; metrics by name."""
        return {
            "log": self.log,
            "group": self.group,
            "config": self.config,
            "status": self.status,
            "exit_status": self.exit_status,
            "error": self.error,
            "key": self.key,
            "damaged": self.damaged,
            "metrics": {name: self.metrics[name] for name in sorted(self.metrics)},
            "bars": [bar.to_dict() for bar in self.bars],
            "report": self.report,
        }


@dataclass(frozen=True)
class RunBlock:
    """What may differ between two runs of one suite.

    Attributes
    ----------
    started, finished : str
        UTC, ISO 8601; ``finished`` is "" while the suite runs.
    elapsed_s : float
    host, platform, python, vehnav : str
        Where, and versions.
    jobs : int
        Workers; 0: those of a cluster.
    complete : bool
        Whether every log was tried to its end; False while running and after an interruption.
    resumed : int
        How many results were taken over from an earlier run.
    seconds, memory_mb : mapping of str to float
        ``log/config`` -> time taken, and the largest resident memory of its worker so far.
    """

    started: str = ""
    finished: str = ""
    elapsed_s: float = 0.0
    host: str = ""
    platform: str = ""
    python: str = ""
    vehnav: str = ""
    jobs: int = 0
    complete: bool = False
    resumed: int = 0
    seconds: Mapping[str, float] = field(default_factory=dict)
    memory_mb: Mapping[str, float] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """As plain data; mappings by name."""
        plain: dict[str, Any] = dict(vars(self))
        for name in ("seconds", "memory_mb"):
            plain[name] = {key: plain[name][key] for key in sorted(plain[name])}
        return plain


@dataclass(frozen=True)
class Results:
    """A suite that ran.

    Attributes
    ----------
    suite : str
        Its name.
    results : tuple of Result
        In the order of group, log and configuration.
    run : RunBlock
    """

    suite: str
    results: tuple[Result, ...]
    run: RunBlock = RunBlock()

    @classmethod
    def of(cls, suite: str, results: Sequence[Result], run: RunBlock) -> Results:
        """The results put in order."""
        return cls(suite, tuple(sorted(results, key=lambda r: (r.group, r.log, r.config))), run)

    @property
    def passed(self) -> bool:
        """Whether every log ran and missed no bar."""
        return all(result.passed for result in self.results)

    def to_dict(self) -> dict[str, Any]:
        """As plain data, the run block last."""
        return {
            "version": VERSION,
            "suite": self.suite,
            "results": [result.to_dict() for result in self.results],
            "run": self.run.to_dict(),
        }


# ---- files -------------------------------------------------------------------------------------


def write_results(results: Results, path: Path) -> None:
    """Write ``results.json`` whole or not at all: a result on a line, the run block at the end.

    ValueError for a NaN, OSError for the disk.
    """
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        file.write(f'{{"version": {VERSION},\n"suite": {_json(results.suite)},\n"results": [')
        for k, result in enumerate(results.results):
            file.write(f"{',' if k else ''}\n{_json(result.to_dict())}")
        file.write(f'\n],\n"run": {_json(results.run.to_dict())}}}\n')


def _json(content: Any) -> str:
    return json.dumps(content, ensure_ascii=False, allow_nan=False)


def read_results(path: str | Path) -> Results:
    """The content of a ``results.json``.

    Raises
    ------
    FormatError
        Unreadable, of another version, or a field is missing or of the wrong kind.
    """
    return read_versioned(path, results_from_dict, what="results.json")


def read_versioned(
    path: str | Path,
    build: Callable[[Mapping[str, Any]], T],
    *,
    what: str,
    if_missing: str = "",
    if_other: str = "",
) -> T:
    """What ``build`` makes of a JSON document of this version.

    Parameters
    ----------
    path : str or Path
    build : callable
        Makes records of plain data; KeyError, TypeError, ValueError or AttributeError where it does
        not fit.
    what : str
        What the file is taken for; for messages.
    if_missing : str
        What to say where there is no such file, if that is a mistake of the call.
    if_other : str
        What to do about another version or a damaged file.

    Raises
    ------
    ConfigError
        There is no such file, and ``if_missing`` says what to do.
    FormatError
        Unreadable, of another version, or a field is missing or of the wrong kind.
    """
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        if if_missing and isinstance(error, FileNotFoundError):
            raise ConfigError(f"{path}: {if_missing}") from None
        raise FormatError(f"{path}: cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise FormatError(f"{path}: not a {what} of vehnav: {error}") from error
    version = content.get("version") if isinstance(content, dict) else None
    if version != VERSION:
        text = f"{path}: not a {what} of this vehnav: version {version!r}, expected {VERSION}"
        raise FormatError(f"{text}; {if_other}" if if_other else text)
    try:
        return build(content)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        found = f"no field {error}" if isinstance(error, KeyError) else str(error)
        text = f"{path}: not a {what} of vehnav: {found}"
        raise FormatError(f"{text}; {if_other}" if if_other else text) from error


def results_from_dict(content: Mapping[str, Any]) -> Results:
    """The records of plain data; KeyError, TypeError or ValueError where it does not fit."""
    return Results.of(
        str(content["suite"]),
        rows_of(content, result_from_dict),
        RunBlock(**content["run"]),
    )


def result_from_dict(row: Mapping[str, Any]) -> Result:
    """One record of plain data; errors as :func:`results_from_dict`."""
    status = one_of(row, "status", get_args(Status))
    metrics = figures_of(row, "metrics")
    bars = tuple(
        BarResult(
            str(bar["metric"]),
            "max" if bar["bound"] == "max" else "min",
            float(bar["limit"]),
            number_of(bar["value"], "value of a bar"),
            bool(bar["passed"]),
        )
        for bar in row["bars"]
    )
    names = (row["log"], row["group"], row["config"])
    others = {key: row[key] for key in row if key not in ("log", "group", "config", "status")}
    return Result(*names, status, **{**others, "metrics": metrics, "bars": bars})


def metric_value(report: Mapping[str, Any], metric: str) -> float | None:
    """The figure that a dotted path names in a ``report.json``; None where there is none.

    ``count`` after a list is its length; ``findings.CODE`` counts the findings of a code.

    >>> report = {"errors": {"horizontal_m": {"max": 12.5}}, "stops": [{}, {}],
    ...           "input": {"findings": [{"code": "gap"}]}}
    >>> metric_value(report, "errors.horizontal_m.max"), metric_value(report, "stops.count")
    (12.5, 2.0)
    >>> metric_value(report, "findings.gap"), metric_value(report, "errors.up_m.max")
    (1.0, None)
    """
    first, _, rest = metric.partition(".")
    if first == "findings" and rest:
        return float(sum(row["code"] == rest for row in report["input"]["findings"]))
    found: Any = report
    for step in metric.split("."):
        if isinstance(found, Mapping):
            found = found.get(step)
        elif isinstance(found, list) and step == "count":
            found = len(found)
        elif isinstance(found, list) and step.isdigit() and int(step) < len(found):
            found = found[int(step)]
        else:
            return None
    if isinstance(found, bool) or not isinstance(found, int | float) or not math.isfinite(found):
        return None
    return float(found)
