"""The page of ``vehnav compare --html``: one table, one picture, in the look of the run report."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from vehnav._version import __version__
from vehnav.evaluation import Errors
from vehnav.evaluation.metrics import metric
from vehnav.export.atomic import atomic_path
from vehnav.report import sections
from vehnav.report.comparison import Comparison, Entry, comparison_map, comparison_panels
from vehnav.report.markup import esc, table
from vehnav.report.page import page, section
from vehnav.report.scale import number
from vehnav.report.summary import metres
from vehnav.report.svg import map_figure, panel
from vehnav.units import DEG, NS

METRICS: Final = (
    ("horizontal, rms", "m", "horizontal_m.rms"),
    ("median", "m", "horizontal_m.median"),
    ("95 % stay under", "m", "cep95_m"),
    ("largest", "m", "horizontal_m.max"),
    ("at the end", "m", "horizontal_m.end"),
    ("of distance, at the end", "%", "percent_of_distance.end"),
    ("of distance, largest after 200 m", "%", "percent_of_distance.max"),
    ("along the track, rms", "m", "along_m.rms"),
    ("across the track, rms", "m", "cross_m.rms"),
    ("height, rms", "m", "up_m.rms"),
    ("velocity, rms", "m/s", "velocity_m_s.rms"),
    ("heading, rms", "°", "heading_deg.rms"),
)
"""Rows of the table of errors: name, unit, path in the tree of errors."""
LEFT_OUT: Final = {
    "outside": "outside the trajectory",
    "before": "before judging starts",
    "excluded": "excluded",
    "uncertain": "uncertain by their own sigma",
    "in_gaps": "in gaps of the trajectory",
}
ERRORS_NOTE: Final = (
    "Estimate minus reference at the judged fixes. Bold: the smallest of its row; where the "
    "trajectories are not judged by the same fixes nothing is."
)


def write_comparison(
    item: Comparison, path: Path, *, command: str, missed: Sequence[str] = ()
) -> None:
    """Write :func:`render_comparison` whole or not at all."""
    text = render_comparison(item, command=command, missed=missed)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def render_comparison(item: Comparison, *, command: str, missed: Sequence[str] = ()) -> str:
    """The page.

    Parameters
    ----------
    item : Comparison
    command : str
        What repeats it.
    missed : sequence of str
        The bars that were missed, as sentences.
    """
    drawn = "".join(panel(p, explained=k == 0) for k, p in enumerate(comparison_panels(item)))
    note = ERRORS_NOTE if len(item.entries) > 1 else ""
    body = [
        _header(item, missed),
        f'<main><div class="linked"><div class="left">{map_figure(comparison_map(item))}</div>'
        f'<div class="right">{drawn}</div></div><div class="blocks">',
        section("errors", "Errors", _errors_table(item), note),
        section("matched", "What was compared", _matched_table(item)),
        section("segments", "Over lengths of road", _segments_table(item), SEGMENTS_NOTE),
        section("outages", "Outages", _outages_table(item)),
        "</div>",
        section("findings", "Findings", sections.findings_list(_findings(item))),
        section("files", "Files", _files(item)),
        section("repeat", "How to repeat it", _repeat(command)),
        "</main>",
    ]
    return page(f"{' '.join(e.name for e in item.entries)} against {item.path}", "".join(body))


SEGMENTS_NOTE: Final = (
    "Mean error of the displacement over every stretch of that length in percent of it, as in "
    "KITTI."
)


# ---- the answer --------------------------------------------------------------------------------


def _header(item: Comparison, missed: Sequence[str]) -> str:
    count = sum(f.level != "info" for f in item.findings)
    text = "1 finding" if count == 1 else f"{count} findings"
    alarm = f' <a class="alarm" href="#findings">{text} to look at</a>' if count else ""
    when = f", {sections.utc(item.start_ns)}" if item.unix_clock else ""
    names = ", ".join(entry.name for entry in item.entries)
    red = [*_aligned(item), *(f"Missed: {bar}." for bar in missed)]
    return (
        f'<header class="short"><p class="name">{esc(names)} against {esc(item.path)}{when}</p>'
        f"<h1>{esc(sections.unbroken(headline(item)))}</h1>"
        + "".join(f'<p class="red">{esc(line)}</p>' for line in red)
        + f"<p>{esc(remark(item))}{alarm}</p></header>"
    )


def headline(item: Comparison) -> str:
    """The answer in one sentence: who is nearest, and how far the others are."""
    if len(item.entries) == 1:
        return _alone(item, item.entries[0].errors)
    ordered = sorted(item.entries, key=lambda e: e.errors.horizontal_rms)
    best = ordered[0]
    rest = "; ".join(f"{e.name} {metres(e.errors.horizontal_rms)}" for e in ordered[1:])
    return (
        f"{best.name} is nearest to {item.against}: {metres(best.errors.horizontal_rms)} rms over "
        f"{metres(float(best.errors.distance[-1]))}; {rest}."
    )


def _alone(item: Comparison, errors: Errors) -> str:
    percent = errors.percent_of_distance()["end"]
    share = "" if percent is None else f" ({percent:.1f} %)"
    end, most = float(errors.horizontal[-1]), float(errors.horizontal.max())
    text = f"Ended {metres(end)}{share} from {item.against} after "
    text += metres(float(errors.distance[-1]))
    return f"{text}." if most <= 1.005 * end else f"{text}; at most {metres(most)} on the way."


def remark(item: Comparison) -> str:
    """What a reader must know before believing the headline."""
    parts = []
    if not same_fixes(item):
        parts.append(
            "The trajectories are not judged by the same fixes: their figures are not of the same "
            "drive (see what was compared)."
        )
    sigma = max((e.errors.reference_sigma_m() or 0.0 for e in item.entries), default=0.0)
    rms = sorted(e.errors.horizontal_rms for e in item.entries)
    if len(rms) > 1 and rms[1] - rms[0] < sigma:
        parts.append(
            f"The two nearest differ by {metres(rms[1] - rms[0])}, less than {item.against} is "
            f"sure of ({metres(sigma)}): which one is better is not decided."
        )
    if not _aligned(item):
        parts.append("Nothing was aligned: errors are as they came out.")
    return " ".join(parts)


def same_fixes(item: Comparison) -> bool:
    """Whether the same fixes judge all trajectories, whatever was added to their stamps."""
    first = item.entries[0].errors
    return all(
        np.array_equal(first.lat, e.errors.lat) and np.array_equal(first.lon, e.errors.lon)
        for e in item.entries[1:]
    )


def _aligned(item: Comparison) -> list[str]:
    """What was fitted to the reference, as a sentence; nothing where nothing was."""
    fitted = [e for e in item.entries if e.errors.fit is not None]
    how = dict.fromkeys(e.errors.fit.align for e in fitted if e.errors.fit is not None)
    if not fitted:
        return []
    moved = "; ".join(f"{e.name} was {_moved(e.errors)}" for e in fitted)
    return [
        f"Aligned to {item.against} before judging (--align {', '.join(how)}): {moved}. This is no "
        "longer dead reckoning."
    ]


def _moved(errors: Errors) -> str:
    if errors.fit is None:
        return "not moved"
    text = f"turned {number(errors.fit.turned / DEG, 0.01)}°"
    if errors.fit.align == "yaw":
        return text
    return f"{text}, moved {metres(math.hypot(*errors.fit.d[:2].tolist()))}"


# ---- tables: a column for each trajectory ------------------------------------------------------


def _by_entry(item: Comparison, title: str, rows: Sequence[Sequence[str]]) -> str:
    """Rows of a name (text) and a cell (markup) for each trajectory."""
    heads = [
        f'<i class="swatch k-{entry.role}"></i>{_breakable(entry.name)}' for entry in item.entries
    ]
    return table(["", *heads], [[esc(row[0]), *row[1:]] for row in rows], name=title)


def _breakable(name: str) -> str:
    """A name as markup that may break after its separators."""
    return "".join(f"{esc(part)}<wbr>" for part in re.split(r"(?<=[/_.-])", name) if part)


def _row(item: Comparison, title: str, values: Sequence[float | None]) -> list[str]:
    """Figures, the smallest one bold if the trajectories can be compared."""
    texts = [figure(value) for value in values]
    sizes = [abs(v) for v in values if v is not None]
    if len(sizes) > 1 and same_fixes(item):
        best = figure(min(sizes))
        if best == figure(max(sizes)):
            return [title, *texts]
        texts = [
            f"<b>{text}</b>" if v is not None and figure(abs(v)) == best else text
            for v, text in zip(values, texts, strict=True)
        ]
    return [title, *texts]


def figure(value: float | None) -> str:
    """Three digits, and no more than three decimals.

    >>> figure(0.12345), figure(65.37), figure(42773.2), figure(-2.5), figure(None)
    ('0.123', '65.4', '42773', '−2.50', '–')
    """
    if value is None:
        return "–"
    size = float(f"{abs(value):.3g}")
    decimals = 3 if size < 1.0 else max(0, 2 - int(math.log10(size)))
    return number(value, 10.0**-decimals)


def _errors_table(item: Comparison) -> str:
    trees = [entry.errors.to_dict() for entry in item.entries]
    rows = []
    for title, unit, key in METRICS:
        values = [metric(tree, key) for tree in trees]
        if any(value is not None for value in values):
            rows.append(_row(item, f"{title}, {unit}", values))
    return _by_entry(item, "Errors", rows)


def _matched_table(item: Comparison) -> str:
    errors = [entry.errors for entry in item.entries]
    rows: list[tuple[str, Callable[[Errors], str]]] = [
        ("fixes judged", lambda e: f"{e.counts['judged']} of {e.counts['total']}"),
        ("left out", _left_out),
        ("driven", lambda e: metres(float(e.distance[-1]))),
        ("time", lambda e: f"{float(e.t_ns[-1] - e.t_ns[0]) * NS:.0f} s"),
        (f"delay of {item.against} by the motion", _delay),
        ("delay taken out of its stamps", lambda e: f"{number(-e.time_offset, 0.001)} s"),
        ("its own uncertainty", _uncertainty),
        ("aligned", lambda e: _red(_moved(e)) if e.fit is not None else "no"),
    ]
    cells = [[name, *(make(e) for e in errors)] for name, make in rows]
    return _by_entry(item, "What was compared", cells)


def _red(text: str) -> str:
    return f'<span class="red">{esc(text)}</span>'


def _left_out(errors: Errors) -> str:
    parts = [f"{errors.counts[k]} {text}" for k, text in LEFT_OUT.items() if errors.counts[k]]
    return f'<span class="wrap">{esc(", ".join(parts))}</span>' if parts else "none"


def _delay(errors: Errors) -> str:
    found = errors.found_offset
    if found is None:
        return "not told"
    return f"{number(-found.offset, 0.01)} ± {found.sigma:.2f} s"


def _uncertainty(errors: Errors) -> str:
    sigma = errors.reference_sigma_m()
    return "not given" if sigma is None else metres(sigma)


def _segments_table(item: Comparison) -> str:
    found = [{s.length_m: s.percent for s in e.errors.segments} for e in item.entries]
    lengths = sorted({length for row in found for length in row})
    rows = [_row(item, f"{n:g} m, %", [row.get(n) for row in found]) for n in lengths]
    return _by_entry(item, "Over lengths of road", rows) if rows else ""


def _outages_table(item: Comparison) -> str:
    if not any(entry.errors.outages for entry in item.entries):
        return ""
    rows = []
    for entry in item.entries:
        for o in (outage.to_dict() for outage in entry.errors.outages):
            cells = [o[key] for key in ("rms_m", "max_m", "end_m", "percent")]
            times = [
                f"{o['start_s']:.0f} s",
                f"{o['length_s']:.0f} s",
                metres(o["distance_m"] or 0.0),
            ]
            rows.append([_swatched(entry), *times, *(figure(cell) for cell in cells)])
    head = [
        "", "from", "length", "driven", "rms m", "largest m", "at the end m", "of distance %"
    ]  # fmt: skip
    return table(head, rows, name="Outages")


def _swatched(entry: Entry) -> str:
    """The name beside its colour."""
    return f'<span class="word"><i class="swatch k-{entry.role}"></i>{esc(entry.name)}</span>'


# ---- the rest ----------------------------------------------------------------------------------


def _findings(item: Comparison) -> dict[str, Any]:
    """As the document of a run has them, times from the start."""

    def seconds(t_ns: int | None) -> float | None:
        return None if t_ns is None else (t_ns - item.start_ns) * NS

    rows = [
        {"code": f.code, "level": f.level, "text": f.text,
         "start_s": seconds(f.start_ns), "end_s": seconds(f.end_ns)}
        for f in item.findings
    ]  # fmt: skip
    return {"input": {"findings": rows}}


def _files(item: Comparison) -> str:
    pairs = [(entry.name, f"<code>{esc(entry.path)}</code>") for entry in item.entries]
    source = item.reference.source
    topic = f", <code>{esc(source)}</code>" if source and source != item.path else ""
    judge = f"<code>{esc(item.path)}</code>{topic}, {item.reference.t_ns.size} fixes"
    zero = "seconds from the start of the earliest trajectory"
    if item.unix_clock:
        zero += f", {sections.utc(item.start_ns)}"
    return sections.details([*pairs, (item.against, judge), ("Times", zero)])


def _repeat(command: str) -> str:
    return (
        f'<pre tabindex="0"><code>{esc(command)}</code></pre><p>with vehnav {esc(__version__)}.</p>'
    )
