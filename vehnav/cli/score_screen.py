"""What ``vehnav score`` prints: the logs by groups, the worst first, then the baseline."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Final

from vehnav.batch import wording
from vehnav.batch.model import Result, Results
from vehnav.batch.regression import Change, Comparison

ROWS: Final = 20
"""Of a group; those that pass and are not among the worst are counted."""
LONGEST: Final = 110
"""Characters of an error where no terminal says how wide it is; results.json has it whole."""
MOST_LINES: Final = 4
"""Of an error on a terminal."""
ROOM: Final = 40
"""Columns that a text needs to stand beside a name; else it begins on a line of its own."""
NAME: Final = 20
"""Columns that every name may have."""
NARROWEST: Final = 72
"""Columns that a terminal is taken to have, at least: two names and the figures."""
FIGURE: Final = 8
"""Columns of a figure."""
SHOWN: Final = (
    ("max m", "errors.horizontal_m.max"),
    ("rms m", "errors.horizontal_m.rms"),
    ("end %", "errors.percent_of_distance.end"),
)
"""Columns of figures."""


def screen(
    results: Results, comparison: Comparison | None = None, *, width: int | None = None
) -> str:
    """The table of a suite, and what it comes to.

    ``width``: columns of the terminal, over which nothing is written; None where the reader is a
    file or a program: a row is a line.
    """
    width = None if width is None else max(width, NARROWEST)
    changes = _main_changes(comparison)
    lines = _wrapped(f"{results.suite}: {wording.headline(results)}", width)
    several = len({result.config for result in results.results}) > 1
    for group in sorted({result.group for result in results.results}):
        rows = wording.worst_first(r for r in results.results if r.group == group)
        lines += ["", *_group(group, rows, changes, width, configs=several)]
    if comparison is not None:
        lines += ["", *_wrapped(wording.gate_text(comparison), width)]
        for text in (*wording.regressions(comparison)[:ROWS], *wording.remarks(comparison)):
            lines += _wrapped(f"  {text}", width)
    return "\n".join(lines)


def _wrapped(text: str, width: int | None, *, indent: int = 4) -> list[str]:
    """The text in lines of ``width``, the first as it is; ``...`` where the last one goes on."""
    if width is None or len(text) <= width:
        return [text]
    lines = textwrap.wrap(
        text.replace(" %", "\u00a0%"), width, subsequent_indent=" " * indent,
        break_on_hyphens=False, max_lines=MOST_LINES, placeholder=" ...",
    )  # fmt: skip
    return [line.replace("\u00a0%", " %") for line in lines]


def _main_changes(comparison: Comparison | None) -> dict[tuple[str, str], Change]:
    """The change of the main figure of each log and configuration."""
    if comparison is None:
        return {}
    metric = SHOWN[0][1]
    return {(c.log, c.config): c for c in comparison.changes if c.metric == metric}


def _group(
    group: str,
    rows: Sequence[Result],
    changes: Mapping[tuple[str, str], Change],
    width: int | None,
    *,
    configs: bool,
) -> list[str]:
    """The title and the rows, those that fail in any case; ``configs``: with the configuration."""
    failed = sum(not row.passed for row in rows)
    shown = rows[: max(ROWS, min(failed, 10 * ROWS))]
    names = [group or "log", *(row.log for row in shown)]
    others = ["configuration", *(row.config for row in shown)] if configs else [""] * len(names)
    other = max(len(text) for text in others)
    first = max(len(text) for text in names)
    if width is not None:
        other = min(other, NAME)
        first = min(first, width - other - 2 * configs - (2 + FIGURE) * len(SHOWN))
    heads = [
        f"{_short(name, first):{first}}" + f"  {_short(config, other):{other}}" * configs
        for name, config in zip(names, others, strict=True)
    ]
    lines = [heads[0] + _figures([name for name, _ in SHOWN])]
    for head, row in zip(heads[1:], shown, strict=True):
        lines += _row(head, row, changes.get((row.log, row.config)), width)
    if len(rows) > len(shown):
        left = len(rows) - len(shown)
        verdict = "" if failed > len(shown) else ", all passed"
        lines.append(f"... and {left} more{verdict}; see results.json")
    return lines


def _short(name: str, room: int) -> str:
    """The name with its middle left out where it is too long.

    >>> _short("2026-11-22_city_run_7", 16)
    '2026-11..._run_7'
    """
    if len(name) <= room:
        return name
    end = (room - 3) // 2
    return f"{name[: room - 3 - end]}...{name[-end:]}"


def _figures(texts: Sequence[str]) -> str:
    return "".join(f"  {text:>{FIGURE}}" for text in texts)


def _row(head: str, row: Result, change: Change | None, width: int | None) -> list[str]:
    """The name, the figures or why there are none, and what else is to say."""
    beside = len(head) + 2
    if row.status != "ok":
        text = wording.state_text(row)
        if width is None:
            return [f"{head}  {text if len(text) <= LONGEST else text[: LONGEST - 3] + '...'}"]
        if width - beside >= ROOM:
            return _wrapped(f"{head}  {text}", width, indent=beside)
        return [head.rstrip(), *_wrapped(f"    {text}", width)]
    line = head + _figures([wording.short(row.metrics.get(metric)) for _, metric in SHOWN])
    remark = _remark(row, change)
    if not remark:
        return [line]
    if width is None or len(line) + 2 + len(remark) <= width:
        return [f"{line}  {remark}"]
    indent = beside if width - beside >= ROOM else 4
    return [line, *_wrapped(f"{' ' * indent}{remark}", width, indent=indent)]


def _remark(row: Result, change: Change | None) -> str:
    """Which bar it missed, and how it moved."""
    texts = [_bar(row)] if not row.passed else []
    if row.damaged:
        texts.append("damaged log")
    if change is not None and change.worsening:
        texts.append(wording.change_moved(change))
    return "; ".join(texts)


def _bar(row: Result) -> str:
    """The first bar that was missed, and how many more."""
    missed = [bar for bar in row.bars if not bar.passed]
    first = missed[0]
    sign = ">" if first.bound == "max" else "<"
    more = f" and {len(missed) - 1} more" if len(missed) > 1 else ""
    if first.value is None:
        return f"MISSED {first.metric}: {wording.undefined(first, row)}{more}"
    value = wording.short(first.value)
    return f"MISSED {first.metric} {value} {sign} {wording.short(first.limit)}{more}"
