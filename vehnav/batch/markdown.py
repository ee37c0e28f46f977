"""The job summary: what a reader of a pull request has to know, worst first, as Markdown.

GitHub shows what a step appends to the file named by ``$GITHUB_STEP_SUMMARY`` and drops a summary
over 1 MiB as a whole; so the table ends where the room does, and says how many rows it left out.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final
from urllib.parse import quote

from vehnav.batch import wording
from vehnav.batch.model import Result, Results
from vehnav.batch.regression import GATED, Change, Comparison, Paired
from vehnav.export.atomic import atomic_path
from vehnav.report.markup import esc

VARIABLE: Final = "GITHUB_STEP_SUMMARY"
ROOM: Final = 1024 * 1024 - 4096
"""Bytes that a step may fill, with some left for what others append."""
ROWS: Final = 100
"""Of a table that is read in a browser."""
PASSED: Final = 10
"""Rows of logs that passed: the nearest to failing are of interest, not all."""
LONGEST: Final = 200
"""Characters of a cell."""
_SPECIAL: Final = re.compile(r"([\\`*\[\]~$]|(?<![A-Za-z0-9])_|_(?![A-Za-z0-9]))")
_ENTITIES: Final = (("://", "&#58;//"), ("www.", "www&#46;"), ("@", "&#64;"), ("|", "&#124;"))
"""No links, no mentions of people, no borders of cells."""


def write_markdown(
    results: Results,
    path: Path,
    *,
    comparison: Comparison | None = None,
    folder: Path | None = None,
) -> None:
    """The summary as a file that links the reports; it appears whole or not at all.

    ``folder`` is that of ``results.json``; None: where the summary is.
    """
    base = "" if folder is None else f"{Path(os.path.relpath(folder, path.parent)).as_posix()}/"
    text = markdown(results, comparison=comparison, base=base)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace")


def append_step_summary(
    results: Results,
    *,
    comparison: Comparison | None = None,
    environ: Mapping[str, str] = os.environ,
) -> bool:
    """Append the summary to the file that ``$GITHUB_STEP_SUMMARY`` names; False where none does."""
    if not environ.get(VARIABLE):
        return False
    path = Path(environ[VARIABLE])
    room = ROOM - (path.stat().st_size if path.exists() else 0)
    text = markdown(results, comparison=comparison, room=room)
    with path.open("a", encoding="utf-8", errors="backslashreplace") as file:
        file.write(text)
    return True


def markdown(
    results: Results,
    *,
    comparison: Comparison | None = None,
    base: str | None = None,
    rows: int = ROWS,
    room: int = ROOM,
) -> str:
    """The summary.

    Parameters
    ----------
    results : Results
    comparison : Comparison or None
    base : str or None
        In front of the paths of the reports to make them links; None: no links.
    rows : int
        Most rows of the table of logs.
    room : int
        Most bytes of the whole; "" where not even the first lines fit.
    """
    passed = results.passed and (comparison is None or comparison.passed)
    head = [
        f"### {cell(results.suite)}: {'passed' if passed else 'failed'}",
        "",
        f"{cell(wording.headline(results))}.",
        "",
    ]
    parts = [head, _baseline(comparison) if comparison is not None else []]
    out: list[str] = []
    for part in parts:
        text = "\n".join(part)
        if len(text.encode()) < room // 2:
            out += part
            room -= len(text.encode())
    out += _logs(results, comparison, base, rows, room)
    return "\n".join(out) + "\n" if out else ""


def cell(text: object) -> str:
    """A text that Markdown and its tables show as it is: names may hold anything.

    >>> cell("a|b_c.mcap"), cell("<b>")
    ('a&#124;b_c.mcap', '&lt;b&gt;')
    """
    shown = str(text).strip()
    if len(shown) > LONGEST:
        shown = shown[: LONGEST - 3] + "..."
    shown = _SPECIAL.sub(r"\\\1", esc(shown))
    for plain, entity in _ENTITIES:
        shown = shown.replace(plain, entity)
    return shown


def _table(head: Sequence[str], rows: Iterable[Sequence[str]], right: Sequence[int]) -> list[str]:
    rule = ["---:" if k in right else "---" for k in range(len(head))]
    lines = [head, rule, *rows]
    return [f"| {' | '.join(line)} |" for line in lines]


# ---- the baseline ------------------------------------------------------------------------------


def _baseline(item: Comparison) -> list[str]:
    out = [f"**{cell(wording.gate_text(item))}**", ""]
    for text in wording.regressions(item)[: ROWS // 4]:
        out.append(f"* {cell(text)}")
    left = len(wording.regressions(item)) - ROWS // 4
    out += [f"* and {left} more"] * (left > 0)
    out += [f"* {cell(text)}" for text in wording.remarks(item)[:20]]
    out += [""] * (out[-1] != "")
    rows = [p for p in item.paired if p.gated or (item.max_regression is None and _main(p))]
    shown = [p for p in rows if p.worse or p.better]
    if len(shown) < len(rows):
        out += [f"{len(rows) - len(shown)} of {len(rows)} compared figures did not move.", ""]
    if shown:
        head = ["group", "configuration", "figure", "logs", "baseline", "now", "median change",
                "95 %", "verdict"]  # fmt: skip
        order = sorted(shown, key=lambda p: -p.worsening)[: ROWS // 2]
        out += [*_table(head, (_paired_row(p) for p in order), right=(3, 4, 5)), ""]
    return out


def _main(p: Paired) -> bool:
    return p.metric in GATED


def _paired_row(p: Paired) -> list[str]:
    verdict = wording.VERDICTS[p.verdict]
    texts = [
        "all" if p.group is None else p.group,
        p.config,
        p.metric,
        p.logs,
        wording.with_unit(p.before, p.metric),
        wording.with_unit(p.now, p.metric),
        wording.moved(p.worsening),
        wording.interval_text(p).removeprefix("95 %: "),
        verdict,
    ]
    row = [cell(text) for text in texts]
    return [*row[:-1], f"**{row[-1]}**"] if p.failed else row


# ---- the logs ----------------------------------------------------------------------------------


def _logs(
    results: Results, comparison: Comparison | None, base: str | None, most: int, room: int
) -> list[str]:
    """The worst logs, as many as fit."""
    metric = wording.main_metric(results.results)
    everything = wording.worst_first(results.results, metric)
    if not everything:
        return []
    failed = sum(not r.passed for r in everything)
    order = everything[: min(most, failed + PASSED)]
    changes: dict[tuple[str, str], Change] = {
        (c.log, c.config): c
        for c in (comparison.changes if comparison is not None else ())
        if c.metric == metric
    }
    several = len({r.config for r in everything}) > 1
    head = ["log", "group", *(["configuration"] * several), metric, "bars"]
    head += ["against the baseline"] * (comparison is not None) + ["report"] * (base is not None)
    lines = _table([cell(text) for text in head], (), right=(2 + several,))
    used = len("\n".join(lines).encode()) + LONGEST
    shown = 0
    for r in order:
        texts = [r.log, r.group, *([r.config] * several), _figure(r, metric)]
        row = [*(cell(text) for text in texts), _bars(r)]
        if comparison is not None:
            change = changes.get((r.log, r.config))
            new = r.name in comparison.new
            row.append(_changed(change, new=new) if r.status == "ok" else "")
        if base is not None:
            row.append(_link(r, base))
        line = f"| {' | '.join(row)} |"
        used += len(line.encode(errors="backslashreplace")) + 1
        if used > room:
            break
        lines.append(line)
        shown += 1
    if used > room and not shown:
        return []
    left = len(everything) - shown
    return [*lines, "", f"{left} more are in index.html and results.json."] if left else lines


def _figure(r: Result, metric: str) -> str:
    return wording.with_unit(r.metrics.get(metric), metric) if r.status == "ok" else "-"


def _bars(r: Result) -> str:
    if r.status != "ok":
        reason = f": {cell(r.error)}" if r.error else ""
        return f"**{wording.STATES[r.status]}**{reason}"
    far = [bar for bar in r.bars if not bar.passed]
    if far:
        return "<br>".join(f"**missed**: {cell(wording.bar_text(bar, r))}" for bar in far[:5])
    return f"{len(r.bars)} passed" if r.bars else "none"


def _changed(change: Change | None, *, new: bool) -> str:
    if change is None:
        return "new" if new else ""
    if change.worsening is None:
        return "figure gone" if change.now is None else "figure new"
    text = cell(wording.change_moved(change))
    return f"**{text}**" if change.failed else text


def _link(r: Result, base: str) -> str:
    return f"[report]({quote(base + r.report, safe='/:')})" if r.report else ""
