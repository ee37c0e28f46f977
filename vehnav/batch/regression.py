"""A run against a baseline: what changed, log by log and over the suite, and whether it fails.

The gate ``max_regression`` (a share: 0.05 is 5 %) applies to the figures that have bars, in the
direction of their bars; to :data:`GATED` where a group and configuration has no bar. What fails:

1. *the suite*: for a group and configuration the median over its logs of the worsening is larger
   than ``max_regression``, and it is not chance: the bootstrap interval of the median (95 %, over
   the logs) does not reach down to zero. Under six logs there is no such interval and the median
   alone decides. A median over the limit whose interval reaches zero is *undecided*: said, but it
   does not fail;
2. *a log*: it worsened by more than ``max_log_regression``, ten times as much unless given;
3. *a log that ran before* does not now, or a figure that it had is gone.

The worsening of a log is the change of the figure's magnitude, relative to the baseline. A change
of at most the floor of its unit (:data:`vehnav.batch.worsening.FLOORS`) is none, and a baseline
under the floor counts as the floor: figures that are as good as zero may change many times over.
The runs themselves are deterministic, so every change is real; the interval says whether another
choice of logs would show it.

Logs that only one side has are named and do not fail; a baseline that has none of the logs, or none
of their gated figures, does, since it would gate nothing. Where there is no figure to gate (no GPS,
bars on both sides), that is said. Every row is judged by itself: of forty that only scatter, one is
expected to fail.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from vehnav.batch.baseline import FIXES, Baseline, Kept, compared_metrics
from vehnav.batch.model import MAIN_METRIC, Result, Results
from vehnav.batch.paired import median_interval
from vehnav.batch.worsening import Direction, directions, floor_of, worsening

GATED: Final = (MAIN_METRIC, "errors.horizontal_m.rms")
"""What the gate looks at where there are no bars."""
LOG_FACTOR: Final = 10.0
"""A single log may worsen this many times ``max_regression``."""
OTHER_FIXES: Final = 0.01
"""Change of the number of judged fixes from which two figures are not of the same drive."""

Verdict = Literal["regressed", "undecided", "worse", "same", "better", "unclear"]


@dataclass(frozen=True, slots=True)
class Change:
    """A figure of one log and configuration beside its baseline.

    Attributes
    ----------
    log, group, config, metric : str
    before, now : float or None
    worsening : float or None
        Relative, positive is worse; None where one of the two is missing.
    gated, failed : bool
    """

    log: str
    group: str
    config: str
    metric: str
    before: float | None
    now: float | None
    worsening: float | None
    gated: bool
    failed: bool


@dataclass(frozen=True, slots=True)
class Paired:
    """A figure over the logs of a group (None: of the suite) and configuration.

    Attributes
    ----------
    config : str
    group : str or None
    metric : str
    direction : {"less", "more", "none"}
    logs, worse, better : int
        Logs that have the figure on both sides, and those of them that moved.
    before, now : float
        Median of the figure.
    worsening : float
        Median over the logs of the relative worsening.
    interval : tuple of two float, or None
        Bootstrap interval, 95 %, of that median; None of fewer than six logs.
    gated, failed : bool
    verdict : {"regressed", "undecided", "worse", "same", "better", "unclear"}
        ``undecided``: over the limit, but it may be chance; ``worse``: not chance, but within the
        limit; ``unclear``: within the limit, and chance or too few logs to tell.
    """

    config: str
    group: str | None
    metric: str
    direction: Direction
    logs: int
    worse: int
    better: int
    before: float
    now: float
    worsening: float
    interval: tuple[float, float] | None
    gated: bool
    failed: bool
    verdict: Verdict


@dataclass(frozen=True, slots=True)
class Turned:
    """A log and configuration whose status is another than in the baseline."""

    log: str
    group: str
    config: str
    before: str
    now: str
    failed: bool


@dataclass(frozen=True)
class Comparison:
    """A run against a baseline.

    Attributes
    ----------
    path, suite : str
        The baseline's file, and the suite that made it.
    compared : int
        Logs and configurations that are in both.
    max_regression, max_log_regression : float or None
        The gate in force, as shares; None: nothing is gated.
    changes : tuple of Change
        The largest worsening first.
    paired : tuple of Paired
        In the order of configuration, group (the suite first) and metric.
    turned : tuple of Turned
    new, vanished : tuple of str
        ``log/config`` that only the run, only the baseline has.
    other_fixes : tuple of str
        ``log/config`` where another number of fixes judges: not the same stretch of the drive.
    """

    path: str
    suite: str
    compared: int
    max_regression: float | None
    max_log_regression: float | None
    changes: tuple[Change, ...]
    paired: tuple[Paired, ...]
    turned: tuple[Turned, ...]
    new: tuple[str, ...]
    vanished: tuple[str, ...]
    other_fixes: tuple[str, ...]

    @property
    def idle(self) -> bool:
        """Whether there is a gate, but no figure on both sides that it could look at."""
        judged = any(row.gated and row.worsening is not None for row in self.changes)
        return self.max_regression is not None and not judged

    @property
    def empty(self) -> bool:
        """Whether it is idle for what the baseline lacks: the logs, or their gated figures."""
        lacks = any(row.gated and row.before is None for row in self.changes)
        return self.idle and (lacks or self.compared == 0)

    @property
    def passed(self) -> bool:
        """Whether nothing regressed."""
        rows: list[Change | Paired | Turned] = [*self.changes, *self.paired, *self.turned]
        return not self.empty and not any(row.failed for row in rows)

    def to_dict(self) -> dict[str, Any]:
        """As plain data; of the changes those that moved."""
        return {
            "baseline": self.path,
            "suite": self.suite,
            "compared": self.compared,
            "max_regression": self.max_regression,
            "max_log_regression": self.max_log_regression,
            "passed": self.passed,
            "paired": [_plain(row) for row in self.paired],
            "changes": [_plain(row) for row in self.changes if row.worsening or row.failed],
            "status": [_plain(row) for row in self.turned],
            "new": list(self.new),
            "vanished": list(self.vanished),
            "other_fixes": list(self.other_fixes),
        }


def _plain(row: Change | Paired | Turned) -> dict[str, Any]:
    return {name: getattr(row, name) for name in row.__slots__}


# ---- the whole ---------------------------------------------------------------------------------


def compare_with(
    baseline: Baseline,
    results: Results,
    *,
    max_regression: float | None = None,
    max_log_regression: float | None = None,
) -> Comparison:
    """Compare a run with a baseline; the gate is described at the top of this module.

    Parameters
    ----------
    baseline : Baseline
    results : Results
    max_regression : float or None
        Share that the median worsening may reach, 0.05 for 5 %; None: nothing fails.
    max_log_regression : float or None
        The same of a single log; None: ten times ``max_regression``.

    Raises
    ------
    ValueError
        A negative limit.
    """
    limits = (max_regression, max_log_regression)
    if any(limit is not None and not limit >= 0.0 for limit in limits):
        raise ValueError(f"max_regression: shares that are not negative, not {limits}")
    if max_log_regression is None and max_regression is not None:
        max_log_regression = LOG_FACTOR * max_regression
    before = {(k.log, k.config): k for k in baseline.kept}
    pairs = [(before[r.log, r.config], r) for r in results.results if (r.log, r.config) in before]
    sides = directions(results.results)
    gates = _gated_metrics(results.results) if max_regression is not None else {}
    changes: list[Change] = []
    paired: list[Paired] = []
    for metric in compared_metrics(results.results):
        found = _changes(metric, pairs, sides.get(metric, "less"), gates, max_log_regression)
        changes += found
        paired += _paired(metric, found, sides.get(metric, "less"), max_regression)
    there = {(r.log, r.config) for r in results.results}
    return Comparison(
        baseline.path,
        baseline.suite,
        len(pairs),
        max_regression,
        max_log_regression,
        tuple(sorted(changes, key=_worst_first)),
        tuple(sorted(paired, key=lambda p: (p.config, p.group or "", p.metric))),
        tuple(_turned(k, r, max_regression) for k, r in pairs if k.status != r.status),
        tuple(r.name for r in results.results if (r.log, r.config) not in before),
        tuple(k.name for k in baseline.kept if (k.log, k.config) not in there),
        tuple(r.name for k, r in pairs if _other_fixes(k, r)),
    )


def _gated_metrics(results: Iterable[Result]) -> dict[tuple[str, str], set[str]]:
    """(group, config) -> the figures that the gate looks at."""
    gates: dict[tuple[str, str], set[str]] = {}
    for r in results:
        gates.setdefault((r.group, r.config), set()).update(bar.metric for bar in r.bars)
    return {key: names or set(GATED) for key, names in gates.items()}


def _changes(
    metric: str,
    pairs: Sequence[tuple[Kept, Result]],
    direction: Direction,
    gates: dict[tuple[str, str], set[str]],
    log_limit: float | None,
) -> list[Change]:
    """A figure in every log that has it on one side at least."""
    floor = floor_of(metric)
    out = []
    for kept, r in pairs:
        old, new = kept.metrics.get(metric), r.metrics.get(metric)
        if old is None and new is None:
            continue
        gated = direction != "none" and metric in gates.get((r.group, r.config), ())
        if old is None or new is None:
            # without a result the status says it
            lost = gated and new is None and r.status == "ok"
            out.append(Change(r.log, r.group, r.config, metric, old, new, None, gated, lost))
            continue
        w = worsening(old, new, direction=direction, floor=floor)
        failed = gated and log_limit is not None and w > log_limit
        out.append(Change(r.log, r.group, r.config, metric, old, new, w, gated, failed))
    return out


def _paired(
    metric: str, changes: Sequence[Change], direction: Direction, limit: float | None
) -> list[Paired]:
    """The figure over every group of every configuration, and over all groups together."""
    groups: dict[tuple[str, str | None], list[Change]] = {}
    for c in changes:
        if c.worsening is not None:
            groups.setdefault((c.config, c.group), []).append(c)
            groups.setdefault((c.config, None), []).append(c)
    count = Counter(config for config, _ in groups)  # the suite is one of them
    return [
        _paired_row(metric, config, group, rows, direction, limit)
        for (config, group), rows in groups.items()
        if group is not None or count[config] > 2
    ]


def _paired_row(
    metric: str,
    config: str,
    group: str | None,
    rows: Sequence[Change],
    direction: Direction,
    limit: float | None,
) -> Paired:
    shares = np.array([row.worsening for row in rows], float)
    middle = float(np.median(shares))
    interval = median_interval(shares)
    gated = group is not None and rows[0].gated
    verdict = _verdict(middle, interval, limit)
    return Paired(
        config, group, metric, direction,
        shares.size, int(np.count_nonzero(shares > 0.0)), int(np.count_nonzero(shares < 0.0)),
        float(np.median([row.before for row in rows if row.before is not None])),
        float(np.median([row.now for row in rows if row.now is not None])),
        middle, interval, gated, gated and verdict == "regressed",
        "same" if direction == "none" else verdict,
    )  # fmt: skip


def _verdict(middle: float, interval: tuple[float, float] | None, limit: float | None) -> Verdict:
    """Size by the limit, certainty by the interval; without an interval the size alone."""
    chance = interval is not None and interval[0] <= 0.0 <= interval[1]
    if limit is not None and middle > limit:
        return "undecided" if chance else "regressed"
    if middle == 0.0 and interval in (None, (0.0, 0.0)):
        return "same"
    if chance or interval is None:
        return "unclear"
    return "worse" if middle > 0.0 else "better"


def _turned(kept: Kept, r: Result, limit: float | None) -> Turned:
    failed = limit is not None and kept.status == "ok" and r.status != "interrupted"
    return Turned(r.log, r.group, r.config, kept.status, r.status, failed)


def _other_fixes(kept: Kept, r: Result) -> bool:
    old, new = kept.metrics.get(FIXES), r.metrics.get(FIXES)
    return old is not None and new is not None and abs(new - old) > OTHER_FIXES * old


def _worst_first(c: Change) -> tuple[bool, bool, float, str, str, str]:
    lost = c.worsening is None
    return (not c.failed, not lost, -(c.worsening or 0.0), c.log, c.config, c.metric)
