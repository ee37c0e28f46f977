"""The table of logs on the page of a suite: rows that a script sorts and filters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final
from urllib.parse import quote

from vehnav.batch import wording
from vehnav.batch.model import Result
from vehnav.batch.regression import Change, Comparison
from vehnav.report.markup import esc

ROWS: Final = 10_000
"""Of the page: more make it slow; they are in the table that is written as a file."""
COLUMNS: Final = 5
"""Most columns of figures."""


def logs_table(
    order: Sequence[Result],
    metrics: Sequence[str],
    comparison: Comparison | None,
) -> str:
    """The rows in the order given, with the controls that filter them (markup)."""
    if not order:
        return ""
    changes: dict[tuple[str, str], list[Change]] = {}
    turned, new = set(), set()
    if comparison is not None:
        for c in comparison.changes:
            if c.metric == metrics[0] or c.failed:
                changes.setdefault((c.log, c.config), []).append(c)
        turned = {f"{t.log}/{t.config}" for t in comparison.turned if t.failed}
        new = set(comparison.new)
    columns = _columns(order, metrics[:COLUMNS], compared=comparison is not None)
    rows = []
    for r in order[:ROWS]:
        mine = changes.get((r.log, r.config), ())
        rows.append(_row(r, columns, mine, turned=r.name in turned, new=r.name in new))
    left = len(order) - len(rows)
    note = f'<p class="note">{left} more, which are not worse, are in results.json.</p>'
    return (
        f"{_controls(order, comparison)}"
        '<div class="scroll" tabindex="0" role="region" aria-label="Logs"><table id="list">'
        f"<thead><tr>{_head(columns)}</tr></thead><tbody>{''.join(rows)}</tbody></table></div>"
        '<p class="more"><button type="button" id="more" hidden></button></p>'
        f"{note if left else ''}"
    )


@dataclass(frozen=True)
class Column:
    """``key``: state, log, config, change, group, remarks, or figure with its ``metric``."""

    key: str
    title: str
    metric: str = ""


def _columns(order: Sequence[Result], metrics: Sequence[str], *, compared: bool) -> list[Column]:
    """Those that tell rows apart."""
    configs, groups = ({getattr(r, key) for r in order} for key in ("config", "group"))
    out = [Column("state", "state"), Column("log", "log")]
    out += [Column("figure", breakable(m), m) for m in metrics]
    out += [Column("change", "against the baseline")] * compared
    out += [Column("config", "configuration")] * (len(configs) > 1)
    out += [Column("group", "group")] * (len(groups) > 1)
    return [*out, Column("remarks", "remarks")]


def breakable(metric: str) -> str:
    """The name of a figure as markup that may break after its points."""
    return esc(metric).replace(".", ".<wbr>")


def _controls(order: Sequence[Result], comparison: Comparison | None) -> str:
    """Search, state, group and configuration; hidden where no script runs."""
    states = [
        ("", "all"),
        ("failed", "failed"),
        ("missed", "missed a bar"),
        ("broken", "did not run"),
    ]
    if comparison is not None:
        states.append(("regressed", "regressed"))
    boxes = [
        '<label>find <input type="search" id="find" autocomplete="off" '
        'placeholder="part of a name"></label>',
        f'<label>show <select id="state">{_choices(states)}</select></label>',
    ]
    for key, names in (
        ("group", sorted({r.group for r in order})),
        ("config", list(dict.fromkeys(r.config for r in order))),
    ):
        if len(names) > 1:
            label = "configuration" if key == "config" else key
            options = _choices([("", "all"), *((f"={name}", name or "none") for name in names)])
            boxes.append(f'<label>{label} <select id="{key}">{options}</select></label>')
    return f'<form class="controls" hidden>{"".join(boxes)}<output id="count"></output></form>'


def _choices(pairs: Sequence[tuple[str, str]]) -> str:
    return "".join(f'<option value="{esc(key)}">{esc(text)}</option>' for key, text in pairs)


def _head(columns: Sequence[Column]) -> str:
    """Heads that sort: a button in each."""
    cells = []
    for k, column in enumerate(columns):
        unit = wording.unit_of(column.metric)
        unit = f" <small>{esc(unit)}</small>" if unit else ""
        side = "r" if column.metric else "l"
        cells.append(
            f'<th scope="col" class="{side}" data-key="{column.key}">'
            f'<button type="button" data-column="{k}">{column.title}{unit}</button></th>'
        )
    return "".join(cells)


def _row(
    r: Result, columns: Sequence[Column], changes: Sequence[Change], *, turned: bool, new: bool
) -> str:
    """One log and configuration; the class of the row is what the filter reads."""
    regressed = turned or any(c.failed for c in changes)
    far = {bar.metric for bar in r.bars if not bar.passed} if r.status == "ok" else set()
    kind = "broken" if r.status != "ok" else "missed" if far else "fine"
    link = f'<a href="{esc(quote(r.report))}">{esc(r.log)}</a>' if r.report else esc(r.log)
    first = next(c.metric for c in columns if c.metric)
    texts = {
        "state": lambda: f"<td>{_state(r, kind)}</td>",
        "log": lambda: f'<td class="log">{link}</td>',
        "config": lambda: f"<td>{esc(r.config)}</td>",
        "group": lambda: f"<td>{esc(r.group)}</td>",
        "change": lambda: _change_cell(r, changes, first, regressed=regressed, new=new),
        "remarks": lambda: f'<td class="why">{esc(_remark(r))}</td>',
    }
    cells = [
        _figure_cell(r, c.metric, bad=c.metric in far) if c.metric else texts[c.key]()
        for c in columns
    ]
    classes = f"{kind} regressed" if regressed else kind
    return f'<tr class="{classes}">{"".join(cells)}</tr>'


def _figure_cell(r: Result, metric: str, *, bad: bool) -> str:
    value = r.metrics.get(metric) if r.status == "ok" else None
    text = "–" if value is None else wording.short(value)
    return f'<td class="r{" red" if bad else ""}">{text}</td>'


def _state(r: Result, kind: str) -> str:
    if kind == "fine":
        return '<span class="state">passed</span>'
    text = "missed" if kind == "missed" else r.status
    return f'<span class="state bad">{text}</span>'


def _change_cell(
    r: Result, changes: Sequence[Change], metric: str, *, regressed: bool, new: bool
) -> str:
    """How the first figure moved, in words; the number that sorts stands in an attribute."""
    mine = next((c for c in changes if c.metric == metric), None)
    if r.status != "ok":
        return '<td data-v="1e9" class="red">it ran</td>' if regressed else "<td></td>"
    if mine is None:
        return f'<td data-v="-">{"new" if new else ""}</td>'
    if mine.worsening is None:
        text = "figure new" if mine.before is None else "figure gone"
        return f'<td data-v="-">{text}</td>'
    red = ' class="red"' if regressed else ""
    return f'<td data-v="{mine.worsening:.4g}"{red}>{esc(wording.change_moved(mine))}</td>'


def _remark(r: Result) -> str:
    if r.status != "ok":
        return wording.state_text(r)
    texts = [wording.bar_text(bar, r) for bar in r.bars if not bar.passed]
    texts += ["damaged log"] * r.damaged
    return "; ".join(texts)
