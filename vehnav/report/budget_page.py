"""Pictures of an error budget: error against time per grade, error against the interval of stops.

Errors of the grades differ by powers of ten: their axis is logarithmic. Stops are shaded.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.budget.forward import Budget
from vehnav.budget.study import Interval, Study
from vehnav.errors import ConfigError
from vehnav.export.atomic import atomic_path
from vehnav.report.markup import esc, table
from vehnav.report.page import page, section
from vehnav.report.scale import log_ticks, number, ticks
from vehnav.report.sections import unbroken
from vehnav.report.summary import metres

Array = npt.NDArray[np.float64]

PICTURES: Final = (".html", ".svg", ".png", ".pdf")
TEXTS: Final = (".json", ".csv", ".txt")
COLOURS: Final = ("#0b62d6", "#0d8a63", "#d4620a", "#9a3fc0", "#c23b84", "#00808c", "#7a4a32")
DARK: Final = ("#5aa7ff", "#3fd09c", "#ff9d4d", "#d08bf0", "#f27db5", "#3cc4d0", "#c99a80")
WIDTH: Final = 810
HEIGHT: Final = 440
BOX: Final = (58.0, 42.0, 616.0, 396.0)
"""Left, top, right, bottom of the axes; the names of the lines stand to the right."""
LABEL_STEP: Final = 14.0
"""Between names, at least."""
DECADES: Final = 4.0
"""Of the vertical axis, at most."""


@dataclass(frozen=True)
class Line:
    """One line: label, x and y (n,); ``ended``: it ends where the linear equations do."""

    label: str
    x: Array
    y: Array
    ended: bool = False
    marked: bool = False


@dataclass(frozen=True)
class Picture:
    """Error against something.

    Attributes
    ----------
    title, headline : str
    x_title, y_title : str
    lines : tuple of Line
    spans : tuple of (start, end)
        Stops, on the x axis.
    head, rows
        The table below the picture.
    notes : tuple of str
    """

    title: str
    headline: str
    x_title: str
    y_title: str
    lines: tuple[Line, ...]
    spans: tuple[tuple[float, float], ...]
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...]


METRIC_TEXT: Final = {
    "drms": "DRMS", "cep50": "radius of the 50 % circle", "cep95": "radius of the 95 % circle",
    "east": "east, one sigma", "north": "north, one sigma",
}  # fmt: skip


def check_output(path: str | os.PathLike[str]) -> None:
    """ConfigError where the suffix names nothing that can be written."""
    if Path(path).suffix.lower() not in (*PICTURES, *TEXTS):
        raise ConfigError(f"{path}: expected one of {', '.join((*TEXTS, *PICTURES))}")


# ---- what is shown -----------------------------------------------------------------------------


def growth_picture(study: Study, budgets: Sequence[Budget], metric: str) -> Picture:
    """Error against time of one or several sensors, the best first."""
    time = study.time
    lines = [_growth(budget, metric) for budget in budgets]
    rows = []
    for budget in budgets:
        cells = [_cell(budget, t, metric) for t in study.times]
        largest = budget.rows(time)[0].source if budget.rows(time) else "none"
        rows.append((budget.sensor.name, *cells, budget.validity(time).verdict, largest))
    told = [b for b in budgets if b.validity(time).verdict != "invalid"] or list(budgets[:1])
    named = [f"{b.sensor.name} {_cell(b, time, metric)}" for b in told]
    headline = f"{METRIC_TEXT[metric].capitalize()} after {time:g} s: {', '.join(named)}"
    return Picture(
        title=title_of(study),
        headline=headline,
        x_title="time from the start, s",
        y_title=f"{METRIC_TEXT[metric]}, m",
        lines=tuple(lines),
        spans=study.procedure.stops,
        head=("sensor", *(f"{t:g} s" for t in study.times), "linear", "largest source"),
        rows=tuple(rows),
        notes=_notes(study, any(line.ended for line in lines)),
    )


def title_of(study: Study) -> str:
    """The drive by its name, without the folder."""
    name = study.drive.name
    return Path(name).name if Path(name).suffix else name


def _growth(budget: Budget, metric: str) -> Line:
    """The line of a sensor, up to where the linear equations hold."""
    end = budget.valid_until()
    until = np.searchsorted(budget.t, end, side="right")
    y = budget.curve(metric)
    if until == budget.t.size:
        return Line(f"{budget.sensor.name} {metres(float(y[-1]))}", budget.t, y)
    label = f"{budget.sensor.name}, to {end:.0f} s" if until > 1 else f"{budget.sensor.name}: no"
    return Line(label, budget.t[:until], y[:until], ended=True)


def _cell(budget: Budget, time: float, metric: str) -> str:
    if budget.validity(time).verdict == "invalid":
        return "–"
    return metres(budget.totals(time)[metric])


def sweep_picture(study: Study, sweep: Sequence[Interval], metric: str) -> Picture:
    """Error against the longest time between two corrections."""
    longest = np.array([item.longest for item in sweep])
    figures = np.array([item.budget.totals(study.time)[metric] for item in sweep])
    order = np.argsort(longest, kind="stable")
    name = sweep[0].budget.sensor.name
    asked = {0.0: "every stop", None: "no stop"}
    rows = tuple(
        (asked.get(s.every, f"{s.every or 0:g} s apart"), str(s.stops), f"{s.longest:.0f} s",
         metres(f))
        for s, f in zip(sweep, figures.tolist(), strict=True)
    )  # fmt: skip
    return Picture(
        title=f"{title_of(study)}, {name}",
        headline=f"{name}: {metres(figures[0])} with every stop, {metres(figures[-1])} without",
        x_title="longest time without a correction, s",
        y_title=f"{METRIC_TEXT[metric]} at {study.time:g} s, m",
        lines=(
            Line(metres(float(figures[order][-1])), longest[order], figures[order], marked=True),
        ),
        spans=(),
        head=("stops at least", "used", "longest time without", METRIC_TEXT[metric]),
        rows=rows,
        notes=_notes(study, False),
    )


def _notes(study: Study, ended: bool) -> tuple[str, ...]:
    drive, count = study.drive, len(study.procedure.stops)
    notes = [
        f"{drive.duration:.0f} s, {drive.path_length() / 1e3:.2f} km; reset and levelling at "
        f"{count} of {len(drive.stops)} stops; linear error equations of paper 001, one sigma each."
    ]
    if ended:
        notes.append(
            "A line ends in a ring where its attitude error passes 0.5 rad: beyond, the linear "
            "equations say nothing but that the sensor is far off (--mc)."
        )
    return tuple(notes)


# ---- SVG ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Frame:
    """Ranges of the axes: x linear, y in powers of ten."""

    x: tuple[float, float]
    y: tuple[float, float]

    def place(self, x: Array | float, y: Array | float) -> tuple[Array, Array]:
        """Where values stand in the drawing."""
        left, top, right, bottom = BOX
        u = (np.asarray(x) - self.x[0]) / (self.x[1] - self.x[0])
        low = 10.0 ** self.y[0]
        v = (np.log10(np.maximum(y, low)) - self.y[0]) / (self.y[1] - self.y[0])
        return left + u * (right - left), bottom - v * (bottom - top)


def frame_of(item: Picture) -> Frame:
    """Axes around all lines."""
    largest = max(float(line.y.max()) for line in item.lines)
    high = math.ceil(10.0 * math.log10(max(largest, 1e-3)) + 0.5) / 10.0
    positive = np.concatenate([line.y[line.y > 0.0] for line in item.lines])
    least = math.log10(float(positive.min())) - 0.1 if positive.size else high - 1.0
    low = min(max(least, high - DECADES), high - 0.5)
    x = np.concatenate([line.x for line in item.lines])
    first = 0.0 if x.min() >= 0.0 else float(x.min())
    return Frame((first, float(x.max())), (math.floor(10.0 * low) / 10.0, high))


def draw(item: Picture) -> str:
    """The picture, ``WIDTH`` by ``HEIGHT``; classes a page or a style colour."""
    left, top, right, bottom = BOX
    frame = frame_of(item)
    parts = []
    for a, b in item.spans:
        x0, x1 = (float(frame.place(t, 1.0)[0]) for t in (a, b))
        parts.append(
            f'<rect class="stop" x="{x0:.1f}" y="{top}" width="{max(x1 - x0, 1.0):.1f}" '
            f'height="{bottom - top}"/>'
        )
    parts += _grid(frame)
    parts += [
        f'<rect class="box" x="{left}" y="{top}" width="{right - left}" height="{bottom - top}"/>',
        f'<text class="title" x="{left}" y="18">{esc(item.title)}</text>',
        f'<text x="{left}" y="{top - 8}">{esc(item.y_title)}</text>',
        f'<text x="{0.5 * (left + right)}" y="{HEIGHT - 10}" text-anchor="middle">'
        f"{esc(item.x_title)}</text>",
    ]
    if item.spans:
        parts.append(
            f'<rect class="stop" x="{right - 44}" y="{top - 18}" width="14" height="11"/>'
            f'<text x="{right}" y="{top - 8}" text-anchor="end">stops</text>'
        )
    return "".join([*parts, *_lines(item, frame)])


def _grid(frame: Frame) -> list[str]:
    left, top, right, bottom = BOX
    out = []
    for value, labelled in log_ticks(*frame.y):
        y = float(frame.place(frame.x[0], value)[1])
        style = "grid" if labelled else "fine"
        out.append(f'<path class="{style}" d="M{left} {y:.1f}H{right}"/>')
        if labelled:
            text = number(value, 1.0) if value >= 1.0 else f"{value:g}"
            out.append(f'<text x="{left - 6}" y="{y + 4:.1f}" text-anchor="end">{text}</text>')
    for value in ticks(*frame.x, 8):
        x = float(frame.place(value, 1.0)[0])
        out.append(f'<path class="grid" d="M{x:.1f} {top}V{bottom}"/>')
        out.append(f'<text x="{x:.1f}" y="{bottom + 16}" text-anchor="middle">{value:g}</text>')
    return out


def _lines(item: Picture, frame: Frame) -> list[str]:
    out = []
    ends = [frame.place(line.x[-1], line.y[-1]) for line in item.lines]
    for n, (line, at) in enumerate(
        zip(item.lines, spread([float(y) for _, y in ends]), strict=True)
    ):
        x, y = frame.place(line.x, line.y)
        d = "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))
        rings = range(x.size) if line.marked else range(x.size - 1, x.size) if line.ended else ()
        marks = "".join(
            f'<circle class="ring" cx="{x[k]:.1f}" cy="{y[k]:.1f}" r="3.5"/>' for k in rings
        )
        out.append(
            f'<g class="b-{n % len(COLOURS)}"><path class="line" d="{d}"/>{marks}'
            f'<path class="lead" d="M{ends[n][0] + 5:.1f} {ends[n][1]:.1f}L{BOX[2] + 8} {at:.1f}"/>'
            f'<text class="name" x="{BOX[2] + 11}" y="{at + 4:.1f}">{esc(line.label)}</text></g>'
        )
    return out


def spread(places: Sequence[float]) -> list[float]:
    """Places moved apart until no two are nearer than a line of text.

    >>> spread([100.0, 101.0, 300.0])
    [93.5, 107.5, 300.0]
    """
    order = sorted(range(len(places)), key=lambda k: places[k])
    groups: list[tuple[list[int], float]] = []
    for k in order:
        members, middle = [k], places[k]
        while groups:
            before, at = groups[-1]
            if middle - at >= 0.5 * LABEL_STEP * (len(before) + len(members)) - 1e-9:
                break
            groups.pop()
            count = len(before) + len(members)
            middle = (at * len(before) + middle * len(members)) / count
            members = before + members
        groups.append((members, middle))
    out = [0.0] * len(places)
    for members, middle in groups:
        for n, k in enumerate(members):
            out[k] = middle + LABEL_STEP * (n - 0.5 * (len(members) - 1))
    return out


def _style(scope: str, ink: str, soft: str, grid: str, stop: str, paper: str) -> str:
    rows = [
        f"{scope} text{{font:11px system-ui,'DejaVu Sans',sans-serif;fill:{soft}}}",
        f"{scope} .title{{font-weight:600;font-size:14px;fill:{ink}}}",
        f"{scope} .box{{fill:none;stroke:{soft};stroke-width:.8}}{scope} .stop{{fill:{stop}}}",
        f"{scope} .grid,{scope} .fine{{stroke:{grid};stroke-width:1}}{scope} .fine{{opacity:.5}}",
        f"{scope} .line,{scope} .lead{{fill:none;stroke-width:1.8}}{scope} .lead{{opacity:.5}}",
        f"{scope} .lead{{stroke-width:1;stroke-dasharray:1 3}}",
        f"{scope} .ring{{fill:{paper};stroke-width:1.6}}",
    ]
    return "".join([*rows, _colours(scope, COLOURS)])


def _colours(scope: str, colours: Sequence[str]) -> str:
    return "".join(
        f"{scope} .b-{n} *{{stroke:{c}}}{scope} .b-{n} text{{stroke:none;fill:{c}}}"
        for n, c in enumerate(colours)
    )


def svg_file(item: Picture) -> str:
    """The picture as a file of its own."""
    style = _style("svg", "#1c2128", "#59636e", "#dfe3e8", "#eceef1", "#ffffff")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" '
        f'height="{HEIGHT}"><style>{style}</style><rect width="{WIDTH}" height="{HEIGHT}" '
        f'fill="#ffffff"/>{draw(item)}</svg>\n'
    )


def html_file(item: Picture) -> str:
    """The picture and its table as one self-contained page."""
    light = _style(".budget", "var(--ink)", "var(--soft)", "var(--grid)", "var(--stop)",
                   "var(--paper)")  # fmt: skip
    style = f"{light}@media (prefers-color-scheme:dark){{{_colours('.budget', DARK)}}}"
    style += ".budget svg{display:block;width:100%;max-width:980px;height:auto}"
    rows = [[esc(cell) for cell in row] for row in item.rows]
    last = len(item.head) - 1
    left = (0, last - 1, last) if item.spans or item.head[-1] == "largest source" else (0,)
    body = (
        f'<header class="short"><p class="name">{esc(item.title)}</p>'
        f"<h1>{esc(unbroken(item.headline))}.</h1>"
        + "".join(f"<p>{esc(note)}</p>" for note in item.notes)
        + f'</header><main><figure class="budget"><svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        f'aria-label="{esc(item.y_title)} against {esc(item.x_title)}">{draw(item)}</svg></figure>'
        + section("figures", "Figures", table(item.head, rows, name="Figures", left=left))
        + "</main>"
    )
    return page(f"{item.title}: error budget", body, script="", style=style)


def write_picture(item: Picture, path: Path) -> None:
    """Write it whole or not at all; the suffix decides. ConfigError without matplotlib."""
    suffix = path.suffix.lower()
    if suffix in (".png", ".pdf"):
        _write_matplotlib(item, path, suffix.removeprefix("."))
        return
    text = svg_file(item) if suffix == ".svg" else html_file(item)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _write_matplotlib(item: Picture, path: Path, suffix: str) -> None:
    try:
        import matplotlib as mpl
        from matplotlib.figure import Figure
    except ImportError:
        raise ConfigError(
            f"{path}: .{suffix} needs matplotlib: pip install 'vehnav[plots]'; .svg does not"
        ) from None
    frame = frame_of(item)
    with mpl.rc_context({"font.size": 8.5, "axes.linewidth": 0.6, "pdf.fonttype": 42}):
        figure = Figure(figsize=(7.2, 3.9), layout="constrained")
        axes = figure.subplots()
        for a, b in item.spans:
            axes.axvspan(a, b, color="#eceef1", lw=0)
        for n, line in enumerate(item.lines):
            colour = COLOURS[n % len(COLOURS)]
            axes.plot(line.x, np.maximum(line.y, 10.0 ** frame.y[0]), lw=1.2, color=colour,
                      marker="o" if line.marked else None, ms=4, label=line.label)  # fmt: skip
            if line.ended:
                axes.plot(line.x[-1:], line.y[-1:], "o", ms=4, mfc="white", mec=colour)
        axes.set(yscale="log", xlim=frame.x, ylim=(10.0 ** frame.y[0], 10.0 ** frame.y[1]))
        axes.set(title=item.title, xlabel=item.x_title, ylabel=item.y_title)
        axes.grid(color="#e6e9ed", lw=0.6)
        axes.legend(frameon=False, fontsize=7.5, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        dated: dict[str, Any] = {"CreationDate": None} if suffix == "pdf" else {}
        with atomic_path(path) as temporary:
            figure.savefig(temporary, format=suffix, dpi=160, metadata=dated)
