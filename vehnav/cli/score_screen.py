"""What ``vehnav score`` prints: the logs by groups, the worst first, then the baseline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from vehnav.batch import wording
from vehnav.batch.model import Result, Results
from vehnav.batch.regression import Change, Comparison

ROWS: Final = 20
"""Of a group; those that pass and are not among the worst are counted."""
LONGEST: Final = 110
"""Characters of an error; results.json has it whole."""
SHOWN: Final = (
    ("max m", "errors.horizontal_m.max"),
    ("rms m", "errors.horizontal_m.rms"),
    ("end %", "errors.percent_of_distance.end"),
)
"""Columns of figures."""


def screen(results: Results, comparison: Comparison | None = None) -> str:
    """The table of a suite, and what it comes to."""
    changes = _main_changes(comparison)
    lines = [f"{results.suite}: {wording.headline(results)}"]
    groups = sorted({result.group for result in results.results})
    for group in groups:
        rows = wording.worst_first(r for r in results.results if r.group == group)
        lines += ["", *_group(group, rows, changes)]
    if comparison is not None:
        lines += ["", wording.gate_text(comparison)]
        lines += [f"  {text}" for text in wording.regressions(comparison)[:ROWS]]
        lines += [f"  {text}" for text in wording.remarks(comparison)]
    return "\n".join(lines)


def _main_changes(comparison: Comparison | None) -> dict[tuple[str, str], Change]:
    """The change of the main figure of each log and configuration."""
    if comparison is None:
        return {}
    metric = SHOWN[0][1]
    return {(c.log, c.config): c for c in comparison.changes if c.metric == metric}


def _group(
    group: str, rows: Sequence[Result], changes: Mapping[tuple[str, str], Change]
) -> list[str]:
    """The title and the rows, those that fail in any case."""
    failed = sum(not row.passed for row in rows)
    shown = rows[: max(ROWS, min(failed, 10 * ROWS))]
    table = [_cells(row, changes.get((row.log, row.config))) for row in shown]
    head = [group or "log", "configuration", *(name for name, _ in SHOWN), ""]
    widths = [max(len(row[k]) for row in [head, *table]) for k in range(len(head) - 1)]
    lines = []
    for row in [head, *table]:
        texts = [row[k].ljust(widths[k]) for k in range(2)]
        figures = [row[k].rjust(max(8, widths[k])) for k in range(2, len(head) - 1)]
        lines.append("  ".join([*texts, *figures, row[-1]]).rstrip())
    if len(rows) > len(shown):
        left = len(rows) - len(shown)
        verdict = "" if failed > len(shown) else ", all passed"
        lines.append(f"... and {left} more{verdict}; see results.json")
    return lines


def _cells(row: Result, change: Change | None) -> list[str]:
    figures = [wording.short(row.metrics.get(metric)) for _, metric in SHOWN]
    return [row.log, row.config, *figures, _remark(row, change)]


def _remark(row: Result, change: Change | None) -> str:
    """Why it failed, else how it moved."""
    if row.status != "ok":
        text = wording.state_text(row)
        return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."
    texts = [_bar(row)] if not row.passed else []
    if row.damaged:
        texts.append("damaged log")
    if change is not None and change.worsening:
        texts.append(wording.moved(change.worsening))
    return "; ".join(texts)


def _bar(row: Result) -> str:
    """The first bar that was missed, and how many more."""
    missed = [bar for bar in row.bars if not bar.passed]
    first = missed[0]
    sign = ">" if first.bound == "max" else "<"
    more = f" and {len(missed) - 1} more" if len(missed) > 1 else ""
    value = wording.short(first.value)
    return f"MISSED {first.metric} {value} {sign} {wording.short(first.limit)}{more}"
