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

from vehnav.errors import ConfigError
from vehnav.export.atomic import atomic_path
from vehnav.report.budget_picture import Picture
from vehnav.report.markup import esc, table
from vehnav.report.page import page, section
from vehnav.report.scale import log_ticks, number, ticks
from vehnav.report.sections import unbroken

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


def check_output(path: str | os.PathLike[str]) -> None:
    """ConfigError where the suffix names nothing that can be written."""
    if Path(path).suffix.lower() not in (*PICTURES, *TEXTS):
        raise ConfigError(f"{path}: expected one of {', '.join((*TEXTS, *PICTURES))}")


# ---- SVG ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Frame:
    """Ranges of the axes: x as it is or in powers of ten, y in powers of ten."""

    x: tuple[float, float]
    y: tuple[float, float]
    log_x: bool

    def place(self, x: Array | float, y: Array | float) -> tuple[Array, Array]:
        """Where values stand in the drawing."""
        left, top, right, bottom = BOX
        across = np.log10(x) if self.log_x else np.asarray(x)
        u = (across - self.x[0]) / (self.x[1] - self.x[0])
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
    across = (min(0.0, float(x.min())), float(x.max()))
    if item.log_x:
        across = (math.log10(float(x.min())) - 0.1, math.log10(float(x.max())) + 0.1)
    return Frame(across, (math.floor(10.0 * low) / 10.0, high), item.log_x)


def draw(item: Picture, *, titled: bool = True) -> str:
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
        f'<text class="title" x="{left}" y="18">{esc(item.title if titled else "")}</text>',
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
        y = float(frame.place(1.0, value)[1])
        style = "grid" if labelled else "fine"
        out.append(f'<path class="{style}" d="M{left} {y:.1f}H{right}"/>')
        if labelled:
            text = number(value, 1.0) if value >= 1.0 else f"{value:g}"
            out.append(f'<text x="{left - 6}" y="{y + 4:.1f}" text-anchor="end">{text}</text>')
    for value in x_ticks(frame):
        x = float(frame.place(value, 1.0)[0])
        out.append(f'<path class="grid" d="M{x:.1f} {top}V{bottom}"/>')
        out.append(f'<text x="{x:.1f}" y="{bottom + 16}" text-anchor="middle">{value:g}</text>')
    return out


def x_ticks(frame: Frame) -> list[float]:
    """Where the x axis is labelled."""
    if frame.log_x:
        return [value for value, labelled in log_ticks(*frame.x) if labelled]
    return ticks(*frame.x, 8)


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
    style += ".budget{overflow-x:auto}"
    style += ".budget svg{display:block;width:100%;min-width:640px;max-width:980px;height:auto}"
    rows = [[esc(cell) for cell in row] for row in item.rows]
    last = len(item.head) - 1
    left = (0, last - 1, last) if item.spans or item.head[-1] == "largest source" else (0,)
    body = (
        f'<header class="short"><p class="name">{esc(item.title)}</p>'
        f"<h1>{esc(unbroken(item.headline))}.</h1>"
        + "".join(f"<p>{esc(note)}</p>" for note in item.notes)
        + f'</header><main><figure class="budget"><svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        f'aria-label="{esc(item.y_title)} against {esc(item.x_title)}">'
        f"{draw(item, titled=False)}</svg></figure>"
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
        across = (10.0 ** frame.x[0], 10.0 ** frame.x[1]) if frame.log_x else frame.x
        axes.set(xscale="log" if frame.log_x else "linear", yscale="log", xlim=across)
        axes.set(ylim=(10.0 ** frame.y[0], 10.0 ** frame.y[1]))
        axes.set(title=item.title, xlabel=item.x_title, ylabel=item.y_title)
        axes.grid(color="#e6e9ed", lw=0.6)
        if len(item.lines) > 1:
            axes.legend(frameon=False, fontsize=7.5, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        dated: dict[str, Any] = {"CreationDate": None} if suffix == "pdf" else {}
        with atomic_path(path) as temporary:
            figure.savefig(temporary, format=suffix, dpi=160, metadata=dated)
