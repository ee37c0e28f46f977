"""The page of a suite: one self-contained document that links the reports of its logs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib import resources
from pathlib import Path
from typing import Final

import numpy as np

from vehnav.batch import wording
from vehnav.batch.distribution import ROLES, Pairs, Series, pairs_figure, shares_figure
from vehnav.batch.index_table import breakable, logs_table
from vehnav.batch.model import Result, Results
from vehnav.batch.regression import Change, Comparison, Paired
from vehnav.batch.worsening import directions, floor_of
from vehnav.export.atomic import atomic_path
from vehnav.report.markup import esc, table
from vehnav.report.page import page, section

FIGURES: Final = 4
"""Most figures that are drawn; the table of shares has them all."""
SENTENCES: Final = 12
"""Of regressions that are listed one by one; the table of logs marks them all."""
PAIRED_NOTE: Final = (
    "Every log is compared with itself; the change is that of the median log. The interval (95 %, "
    "bootstrap over the logs) says whether another choice of logs would show it: where it reaches "
    "both sides of nothing, the change may be chance."
)


def write_index(
    results: Results,
    path: Path,
    *,
    comparison: Comparison | None = None,
    command: str | None = None,
) -> None:
    """Write :func:`render_index` whole or not at all; ``path`` lies beside ``results.json``."""
    text = render_index(results, comparison=comparison, command=command)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def render_index(
    results: Results, *, comparison: Comparison | None = None, command: str | None = None
) -> str:
    """The page.

    Parameters
    ----------
    results : Results
    comparison : Comparison or None
        With a baseline.
    command : str or None
        What repeats it.
    """
    order = wording.worst_first(results.results, wording.main_metric(results.results))
    metrics = shown_metrics(results.results)
    body = [
        _header(results, comparison),
        "<main>",
        _pictures(results, order, metrics, comparison),
        section("shares", "In figures", _shares_table(results.results, metrics, comparison)),
        _baseline(comparison),
        section("logs", "Logs, the worst first", logs_table(order, metrics, comparison)),
        section("run", "The run", _run(results, command)),
        "</main>",
    ]
    return page(
        results.suite, "".join(body), script=_resource("index.js"), style=_resource("index.css")
    )


def _resource(name: str) -> str:
    return resources.files("vehnav.batch").joinpath(name).read_text("utf-8")


def shown_metrics(results: Sequence[Result]) -> list[str]:
    """The largest error first, then what has bars; at least one."""
    barred = dict.fromkeys(bar.metric for r in results for bar in r.bars)
    return list(dict.fromkeys([wording.main_metric(results), *barred]))


# ---- the answer --------------------------------------------------------------------------------


def _header(results: Results, comparison: Comparison | None) -> str:
    red = []
    if not results.run.complete:
        red.append("The suite did not run to its end: what follows is what there is.")
    told = ""
    if comparison is not None:
        text = _sentence(f"{wording.gate_text(comparison)}.").replace(" %", "\u00a0%")
        told = f'<p class="{"" if comparison.passed else "red"}">{esc(text)}</p>'
    cards = "".join(
        f'<div class="figure"><span>{esc(name)}</span><b class="{kind}">{esc(value)}</b>'
        f"<small>{breakable(remark)}</small></div>"
        for name, value, remark, kind in _cards(results, comparison)
    )
    when = f", {_time(results.run.started)}" if results.run.started else ""
    return (
        f'<header class="short"><p class="name">{esc(results.suite)}{esc(when)}</p>'
        f"<h1>{esc(_sentence(wording.headline(results)))}.</h1>"
        + "".join(f'<p class="red">{esc(line)}</p>' for line in red)
        + f'{told}<div class="figures">{cards}</div></header>'
    )


def _time(iso: str) -> str:
    """``2026-01-02T03:04:05Z`` as a person writes it."""
    return f"{iso[:16].replace('T', ' ')} UTC"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _cards(results: Results, comparison: Comparison | None) -> list[tuple[str, str, str, str]]:
    """Name, figure, remark and whether it is bad."""
    rows = results.results
    bars = [bar for r in rows for bar in r.bars]
    kept = sum(bar.passed for bar in bars)
    ran = sum(r.status == "ok" for r in rows)
    damaged = sum(r.damaged for r in rows)
    told = f", {damaged} from damaged logs" if damaged else ""
    cards = [
        ("passed", f"{sum(r.passed for r in rows)}", f"of {len(rows)}", ""),
        ("ran", f"{ran}", f"of {len(rows)}{told}", _bad(ran < len(rows))),
        ("bars kept", f"{kept}", f"of {len(bars)}", _bad(kept < len(bars))),
    ]
    metric = wording.main_metric(rows)
    values = _values(rows, metric)
    if values.size:
        more = directions(rows).get(metric) == "more"
        tail = ("90 % are over", 10) if more else ("90 % are under", 90)
        for name, share in (("median log", 50), tail):
            value = float(np.percentile(np.abs(values), share))
            cards.append((name, wording.with_unit(value, metric), metric, ""))
    if comparison is not None:
        failed = len(wording.regressions(comparison))
        cards.append(("regressions", str(failed), "against the baseline", _bad(failed > 0)))
    return cards


def _bad(bad: bool) -> str:
    return "red" if bad else ""


def _values(rows: Iterable[Result], metric: str) -> np.ndarray:
    found = (r.metrics.get(metric) for r in rows if r.status == "ok")
    return np.array([x for x in found if x is not None], float)


# ---- pictures ----------------------------------------------------------------------------------


def _configs(results: Sequence[Result]) -> dict[str, str]:
    """Configuration -> its colour."""
    names = dict.fromkeys(r.config for r in results)
    return {name: ROLES[k % len(ROLES)] for k, name in enumerate(names)}


def _pictures(
    results: Results, order: Sequence[Result], metrics: Sequence[str], item: Comparison | None
) -> str:
    """Of every figure its distribution; beside the first one its change."""
    rows = results.results
    figures = []
    for k, metric in enumerate(metrics[:FIGURES]):
        series = _series(rows, metric, item)
        found = np.concatenate([np.empty(0), *(x for s in series for x in (s.values, s.before))])
        if found.size and (k == 0 or np.ptp(found) > 0.0):  # one value for all is no picture
            figures.append(shares_figure(metric, series, least=floor_of(metric), key=f"shares-{k}"))
        pairs = _pairs(rows, order, metric, item) if k == 0 else []
        if pairs:
            less = directions(rows).get(metric, "less") == "less"
            band = item.max_log_regression if item is not None and less else None
            figures.append(
                pairs_figure(metric, pairs, least=floor_of(metric), band=band, key="pairs")
            )
    return f'<div class="blocks pictures">{"".join(figures)}</div>' if figures else ""


def _series(rows: Sequence[Result], metric: str, item: Comparison | None) -> list[Series]:
    before: dict[str, list[float]] = {}
    for c in item.changes if item is not None else ():
        if c.metric == metric and c.before is not None:
            before.setdefault(c.config, []).append(c.before)
    limits: dict[str, set[float]] = {}
    for r in rows:
        limits.setdefault(r.config, set()).update(b.limit for b in r.bars if b.metric == metric)
    return [
        Series(
            name, role, _values((r for r in rows if r.config == name), metric),
            np.array(before.get(name, ()), float), frozenset(limits[name]),
        )
        for name, role in _configs(rows).items()
    ]  # fmt: skip


def _pairs(
    rows: Sequence[Result], order: Sequence[Result], metric: str, item: Comparison | None
) -> list[Pairs]:
    place = {(r.log, r.config): k for k, r in enumerate(order)}
    found: dict[str, list[Change]] = {}
    for c in item.changes if item is not None else ():
        if c.metric == metric and c.worsening is not None:
            found.setdefault(c.config, []).append(c)
    return [
        Pairs(
            role,
            np.array([c.before for c in found[name]], float),
            np.array([c.now for c in found[name]], float),
            [place[c.log, c.config] for c in found[name]],
            [c.failed for c in found[name]],
        )
        for name, role in _configs(rows).items()
        if name in found
    ]


# ---- tables ------------------------------------------------------------------------------------


def _shares_table(rows: Sequence[Result], metrics: Sequence[str], item: Comparison | None) -> str:
    """Quantiles of every figure by configuration, with those of the baseline beside them."""
    sides = directions(rows)
    head = ["figure", "configuration", "logs", "median", "worst tenth", "worst"]
    if item is not None:
        head += ["baseline: median", "worst tenth", "worst"]
    cells = []
    for metric in metrics:
        high, last = (10.0, 0.0) if sides.get(metric) == "more" else (90.0, 100.0)
        for s in _series(rows, metric, item):
            if not s.values.size:
                continue
            name = f'<span class="word"><i class="swatch k-{s.role}"></i>{esc(s.name)}</span>'
            row = [breakable(metric), name]
            row += [str(s.values.size)]
            for values in (s.values, s.before) if item is not None else (s.values,):
                for q in (50.0, high, last):
                    value = float(np.percentile(np.abs(values), q)) if values.size else None
                    row.append("–" if value is None else esc(wording.with_unit(value, metric)))
            cells.append(row)
    return table(head, cells, name="Shares", left=(0, 1)) if cells else ""


def _baseline(item: Comparison | None) -> str:
    if item is None:
        return ""
    failed = wording.regressions(item)
    lines = [f'<li class="red">{esc(text)}</li>' for text in failed[:SENTENCES]]
    if len(failed) > SENTENCES:
        lines.append(f"<li>and {len(failed) - SENTENCES} more: see the logs below</li>")
    lines += [f"<li>{esc(text)}</li>" for text in wording.remarks(item, most=20)]
    listed = f'<ul class="said">{"".join(lines)}</ul>' if lines else ""
    every = not any(p.gated for p in item.paired)
    gated = [p for p in item.paired if p.gated or every]
    moved = [p for p in gated if p.worse or p.better]
    content = listed + _paired_table(moved, "Against the baseline")
    for rows, what in (
        ([p for p in gated if not (p.worse or p.better)], "that did not move"),
        ([p for p in item.paired if not (p.gated or every)], "which the gate does not look at"),
    ):
        if rows:
            content += (
                f"<details><summary>{len(rows)} more, {what}</summary>{_paired_table(rows, what)}"
                "</details>"
            )
    return section("baseline", "Against the baseline", content, PAIRED_NOTE)


def _paired_table(rows: Sequence[Paired], name: str) -> str:
    head = ["group", "configuration", "figure", "logs", "baseline", "now", "change", "95 %",
            "worse", "better", "verdict"]  # fmt: skip
    cells = [
        [
            "<em>all</em>" if p.group is None else esc(p.group),
            esc(p.config),
            esc(p.metric),
            str(p.logs),
            esc(wording.with_unit(p.before, p.metric)),
            esc(wording.with_unit(p.now, p.metric)),
            esc(wording.moved(p.worsening)),
            f'<span class="word">{esc(wording.interval_text(p).removeprefix("95 %: "))}</span>',
            str(p.worse),
            str(p.better),
            f'<span class="word {_bad(p.failed)}">{wording.VERDICTS[p.verdict]}</span>',
        ]
        for p in rows
    ]
    return table(head, cells, name=name, left=(0, 1, 2, 7, 10)) if cells else ""


def _run(results: Results, command: str | None) -> str:
    run = results.run
    seconds = np.array(list(run.seconds.values()) or [0.0])
    memory = max(run.memory_mb.values(), default=0.0)
    pairs = [
        ("Started", _time(run.started) if run.started else ""),
        ("Took", f"{run.elapsed_s:.1f} s, {run.jobs} workers"),
        ("Of a log", f"{np.median(seconds):.2f} s in the median, {seconds.max():.2f} s at most"),
        ("Memory of a worker", f"{memory:.0f} MB at most" if memory else ""),
        ("Taken over", f"{run.resumed} from an earlier run" if run.resumed else ""),
        ("Where", f"{run.host}, {run.platform}, Python {run.python}, vehnav {run.vehnav}"),
    ]
    rows = "".join(f"<dt>{esc(k)}</dt><dd>{esc(v)}</dd>" for k, v in pairs if v)
    repeat = f'<pre tabindex="0"><code>{esc(command)}</code></pre>' if command else ""
    files = '<p class="note">All figures: <a href="results.json">results.json</a>.</p>'
    return f"{repeat}<dl>{rows}</dl>{files}"
