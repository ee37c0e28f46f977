"""The Allan deviation with its fit: as SVG, as a page, or by matplotlib as PNG and PDF."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.allan import AxisFit, Figure, allan_form
from vehnav.errors import ConfigError
from vehnav.export.atomic import atomic_path
from vehnav.noise import Estimate, RestNoise
from vehnav.noise.sensor import KEYS, WORDS, Part
from vehnav.report.markup import esc, table
from vehnav.report.page import page, section
from vehnav.report.scale import log_ticks
from vehnav.report.sensor_text import KINDS, NAMES, figure_text, notes, times_text
from vehnav.sensors import FIELDS
from vehnav.units import DEG_PER_HOUR, MILLI_G

Array = npt.NDArray[np.float64]

SUFFIXES: Final = (".svg", ".html", ".png", ".pdf")
UNITS: Final = {"gyro": ("deg/h", DEG_PER_HOUR), "accel": ("mg", MILLI_G)}
COLOURS: Final = ("#0b62d6", "#d4620a", "#0d8a63")
"""x, y, z, as on the other pages in daylight."""
DARK: Final = ("#5aa7ff", "#ff9d4d", "#3fd09c")
WIDTH: Final = 640
HEIGHT: Final = 420
BOX: Final = (62.0, 40.0, 626.0, 374.0)
"""Left, top, right, bottom of the axes in the drawing."""
PER_DECADE: Final = 24
"""Points of a fitted line."""


@dataclass(frozen=True)
class Line:
    """One axis of an instrument.

    Attributes
    ----------
    name : str
    tau, value, low, high : (k,)
        s; Allan deviation with one sigma to both sides.
    counted : (k,) bool
        Whether the fit saw it.
    fit_tau, fit : (j,)
        The fitted curve; empty where there is none.
    between_tau, between : (b,)
        Root of half the mean squared difference of the means of the rests, by separation.
    """

    name: str
    tau: Array
    value: Array
    low: Array
    high: Array
    counted: npt.NDArray[np.bool_]
    fit_tau: Array
    fit: Array
    between_tau: Array
    between: Array


@dataclass(frozen=True)
class LogLog:
    """A picture with two logarithmic axes: decades from and to."""

    title: str
    unit: str
    x: tuple[float, float]
    y: tuple[float, float]
    lines: tuple[Line, ...]


def check_plot(path: str | os.PathLike[str]) -> None:
    """ConfigError where the suffix names no kind of picture."""
    if Path(path).suffix.lower() not in SUFFIXES:
        raise ConfigError(f"{path}: a plot ends in {', '.join(SUFFIXES)}")


def write_allan_plot(noise: RestNoise, found: Estimate, path: str | os.PathLike[str]) -> None:
    """Write the picture of both instruments; the suffix decides. ConfigError for another one."""
    check_plot(path)
    final = Path(path)
    pictures = [picture(noise, part) for part in KEYS]
    suffix = final.suffix.lower()
    if suffix in (".png", ".pdf"):
        _write_matplotlib(pictures, final, suffix.removeprefix("."))
        return
    text = _stacked(pictures) if suffix == ".svg" else render_page(noise, found)
    with atomic_path(final) as temporary:
        temporary.write_text(text, encoding="utf-8")


def picture(noise: RestNoise, part: Part) -> LogLog:
    """Both axes and all lines of an instrument."""
    item = getattr(noise, part)
    unit, factor = UNITS[part]
    curve, between = item.curve, item.between
    sure = curve.dof >= 1.0
    spread = 1.0 / np.sqrt(2.0 * np.maximum(curve.dof[sure], 1.0))
    lines = []
    for k, fit in enumerate(item.fits):
        if fit.dead:
            continue
        value = curve.deviation[sure, k] / factor
        fit_tau, fitted = _fitted(fit, float(curve.tau[sure][-1]))
        none = np.empty(0)
        lines.append(
            Line(
                "xyz"[k], curve.tau[sure], value, value * np.maximum(1.0 - spread, 0.1),
                value * (1.0 + spread), curve.tau[sure] >= 0.999 * fit.first_tau,
                fit_tau, fitted / factor,
                none if between is None else between.separation,
                none if between is None else np.sqrt(between.value[:, k]) / factor,
            )
        )  # fmt: skip
    x = _decades([x for line in lines for x in (line.tau, line.between_tau)])
    y = _decades([y for line in lines for y in (line.value, line.fit, line.between)])
    return LogLog(f"{NAMES[part].capitalize()} at rest", unit, x, y, tuple(lines))


def _fitted(fit: AxisFit, last: float) -> tuple[Array, Array]:
    count = max(2, int(PER_DECADE * math.log10(last / fit.first_tau)) + 1)
    tau = np.geomspace(fit.first_tau, last, count)
    powers = fit.powers
    return tau, np.sqrt(powers.weigh(lambda kind: allan_form(kind, tau, powers.time)))


def _decades(values: list[Array]) -> tuple[float, float]:
    """Tenths of decades around all values."""
    every = np.concatenate([v[v > 0.0] for v in values]) if values else np.ones(1)
    low, high = (float(np.log10(x)) for x in (every.min(), every.max()))
    return math.floor(10.0 * low - 0.5) / 10.0, math.ceil(10.0 * high + 0.5) / 10.0


# ---- SVG ---------------------------------------------------------------------------------------


def draw(item: LogLog) -> str:
    """The group of one picture, ``WIDTH`` by ``HEIGHT``; classes a page or a style colour."""
    left, top, right, bottom = BOX
    parts = [
        f'<rect class="box" x="{left}" y="{top}" width="{right - left}" height="{bottom - top}"/>',
        *_ticks(item),
        f'<text class="title" x="{left}" y="18">{esc(item.title)}</text>',
        f'<text x="{0.5 * (left + right)}" y="{HEIGHT - 8}" text-anchor="middle">'
        "averaging time, s</text>",
        f'<text x="{left}" y="{top - 7}">Allan deviation, {esc(item.unit)}</text>',
        *_legend(item),
    ]
    for line in item.lines:
        parts.append(_line(item, line))
    return "".join(parts)


def _place(item: LogLog, x: Array | float, y: Array | float) -> tuple[Array, Array]:
    left, top, right, bottom = BOX
    u = (np.log10(np.asarray(x)) - item.x[0]) / (item.x[1] - item.x[0])
    v = (np.log10(np.asarray(y)) - item.y[0]) / (item.y[1] - item.y[0])
    return left + u * (right - left), bottom - v * (bottom - top)


def _ticks(item: LogLog) -> list[str]:
    left, top, right, bottom = BOX
    out = []
    for value, labelled in log_ticks(*item.x):
        x = float(_place(item, value, 1.0)[0])
        style = "grid" if labelled else "fine"
        out.append(f'<path class="{style}" d="M{x:.1f} {top}V{bottom}"/>')
        if labelled:
            text = f'<text x="{x:.1f}" y="{bottom + 15}" text-anchor="middle">{value:g}</text>'
            out.append(text)
    for value, labelled in log_ticks(*item.y):
        y = float(_place(item, 1.0, value)[1])
        style = "grid" if labelled else "fine"
        out.append(f'<path class="{style}" d="M{left} {y:.1f}H{right}"/>')
        if labelled:
            text = f'<text x="{left - 6}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>'
            out.append(text)
    return out


def _legend(item: LogLog) -> list[str]:
    """Axes in their colours, and what the marks are, from the right."""
    right = BOX[2]
    out = []
    marks = "point ± 1 sigma, line: fit; hollow: not in the fit"
    if any(line.between.size for line in item.lines):
        marks += "; square: between rests"
    out.append(f'<text class="small" x="{right}" y="{BOX[1] - 7}" text-anchor="end">{marks}</text>')
    for n, line in enumerate(reversed(item.lines)):
        x = right - 34.0 * n
        out.append(
            f'<g class="a-{line.name}"><circle class="point" cx="{x - 16}" cy="13" r="3.5"/>'
            f'<text x="{x - 8}" y="17">{line.name}</text></g>'
        )
    return out


def _line(item: LogLog, line: Line) -> str:
    x, y = _place(item, line.tau, line.value)
    low, high = _place(item, line.tau, line.low)[1], _place(item, line.tau, line.high)[1]
    floor = BOX[3]
    bars = "".join(
        f"M{a:.1f} {min(b, floor):.1f}V{c:.1f}" for a, b, c in zip(x, low, high, strict=True)
    )
    dots = "".join(
        f'<circle class="{"point" if counted else "hollow"}" cx="{a:.1f}" cy="{b:.1f}" r="2.6"/>'
        for a, b, counted in zip(x, y, line.counted, strict=True)
    )
    squares = "".join(
        f'<rect class="hollow" x="{a - 3:.1f}" y="{b - 3:.1f}" width="6" height="6"/>'
        for a, b in zip(*_place(item, line.between_tau, line.between), strict=True)
    )
    points = zip(*_place(item, line.fit_tau, line.fit), strict=True)
    fit = "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in points)
    return (
        f'<g class="a-{line.name}"><path class="fit" d="{fit}"/><path class="bar" d="{bars}"/>'
        f"{dots}{squares}</g>"
    )


def _style(scope: str, paper: str, ink: str, soft: str, grid: str, colours: tuple[str, ...]) -> str:
    rows = [
        f"{scope} text{{font:11px system-ui,'DejaVu Sans',sans-serif;fill:{soft}}}",
        f"{scope} .title{{font-weight:600;font-size:14px;fill:{ink}}}",
        f"{scope} .small{{font-size:10px}}",
        f"{scope} .box{{fill:none;stroke:{soft};stroke-width:.8}}",
        f"{scope} .grid,{scope} .fine{{stroke:{grid};stroke-width:1}}{scope} .fine{{opacity:.45}}",
        f"{scope} .fit{{fill:none;stroke-width:1.6}}{scope} .bar{{stroke-width:1;opacity:.55}}",
        f"{scope} .hollow{{fill:{paper};stroke-width:1.1}}",
    ]
    return "".join([*rows, _colours(scope, colours)])


def _colours(scope: str, colours: tuple[str, ...]) -> str:
    return "".join(
        f"{scope} .a-{name} *{{stroke:{colour}}}{scope} .a-{name} .point{{fill:{colour}}}"
        f"{scope} .a-{name} text{{stroke:none}}"
        for name, colour in zip("xyz", colours, strict=True)
    )


def _stacked(items: list[LogLog]) -> str:
    """A file of its own, one picture above the other."""
    style = _style("svg", "#ffffff", "#1c2128", "#59636e", "#dfe3e8", COLOURS)
    height = HEIGHT * len(items)
    drawn = "".join(
        f'<g transform="translate(0 {HEIGHT * n})">{draw(item)}</g>' for n, item in enumerate(items)
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" '
        f'height="{height}"><style>{style}</style><rect width="{WIDTH}" height="{height}" '
        f'fill="#ffffff"/>{drawn}</svg>\n'
    )


# ---- the page ----------------------------------------------------------------------------------


def render_page(noise: RestNoise, found: Estimate) -> str:
    """One self-contained page: the pictures, the figures, what cannot be told, the file."""
    light = _style(".allan", "var(--paper)", "var(--ink)", "var(--soft)", "var(--line)", COLOURS)
    dark = _colours(".allan", DARK)
    style = f"<style>{light}@media (prefers-color-scheme:dark){{{dark}}}</style>"
    figures = "".join(
        f'<figure class="allan"><svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        f'aria-label="{esc(item.title)}: Allan deviation">{draw(item)}</svg></figure>'
        for item in (picture(noise, part) for part in KEYS)
    )
    name = Path(noise.log.path).name
    count = len(noise.pieces)
    headline = f"{noise.total:.0f} s of rest"
    if count > 1:
        headline += f" in {count} pieces, the longest {noise.longest:.0f} s"
    untold = "".join(f"<li>{esc(WORDS[k])}: {esc(why)}</li>" for k, why in found.untold.items())
    said = "".join(f"<li>{esc(text)}</li>" for text in notes(noise))
    near = found.grades[0]
    ratios = ", ".join(f"{WORDS[k]} {times_text(r)}" for k, r in near.ratios.items())
    body = (
        f'{style}<header class="short"><p class="name">{esc(name)}</p><h1>{esc(headline)}.</h1>'
        f"<p>Nearest grade of the catalogue: {esc(near.name)} ({esc(ratios)}).</p></header><main>"
        f'<div class="blocks">{figures}</div>'
        + section("figures", "Figures", _figures_table(noise, found), TABLE_NOTE)
        + section("untold", "What this rest does not tell", f"<ul>{untold}</ul>" if untold else "")
        + section("notes", "Notes", f"<ul>{said}</ul>" if said else "")
        + section(
            "file", "Sensor file", f'<pre tabindex="0"><code>{esc_lines(found.text)}</code></pre>'
        )
        + "</main>"
    )
    return page(f"{name}: sensor", body)


TABLE_NOTE: Final = (
    "One sigma beside each figure; &lt; is a 95 % limit; – cannot be told. Noise is the fall of "
    "the Allan deviation with the root of time, bias instability its floor, random walk its rise."
)


def esc_lines(text: str) -> str:
    """Escaped, line by line."""
    return "\n".join(esc(line) for line in text.splitlines())


def _figures_table(noise: RestNoise, found: Estimate) -> str:
    rows = []
    for part, keys in KEYS.items():
        for key, kind in zip(keys, KINDS, strict=True):
            place = FIELDS[key]
            fits = getattr(noise, part).fits
            cells = [figure_text(getattr(fit, kind), place.factor) for fit in fits]
            cells.append(figure_text(found.told.get(key, Figure()), place.factor))
            rows.append([esc(WORDS[key]), *(esc(c).replace("-", "–") for c in cells), place.unit])
    head = ["figure", "x", "y", "z", "all", "unit"]
    return table(head, rows, name="Figures of the sensor", left=(0, 5))


# ---- matplotlib --------------------------------------------------------------------------------


def _write_matplotlib(items: list[LogLog], path: Path, suffix: str) -> None:
    try:
        import matplotlib as mpl
        from matplotlib.figure import Figure as Canvas
    except ImportError:
        raise ConfigError(
            f"{path}: .{suffix} needs matplotlib: pip install 'vehnav[plots]'; .svg does not"
        ) from None
    with mpl.rc_context({"font.size": 8.5, "axes.linewidth": 0.6, "pdf.fonttype": 42}):
        canvas = Canvas(figsize=(6.3, 7.4), layout="constrained")
        for axes, item in zip(canvas.subplots(len(items)), items, strict=True):
            for line, colour in zip(item.lines, COLOURS, strict=False):
                _draw_line(axes, line, colour)
            axes.set(xscale="log", yscale="log", title=item.title, xlabel="averaging time, s")
            axes.set(xlim=_powers(item.x), ylim=_powers(item.y))
            axes.set_ylabel(f"Allan deviation, {item.unit}")
            axes.grid(color="#e6e9ed", lw=0.6, which="both")
            axes.legend(frameon=False, ncols=3)
        dated: dict[str, Any] = {"CreationDate": None} if suffix == "pdf" else {}
        with atomic_path(path) as temporary:
            canvas.savefig(temporary, format=suffix, dpi=160, metadata=dated)


def _powers(span: tuple[float, float]) -> tuple[float, float]:
    return 10.0 ** span[0], 10.0 ** span[1]


def _draw_line(axes: Any, line: Line, colour: str) -> None:
    bars = [line.value - line.low, line.high - line.value]
    axes.errorbar(line.tau, line.value, bars, fmt="none", ecolor=colour, elinewidth=0.6, alpha=0.6)
    for chosen, fill in ((line.counted, colour), (~line.counted, "white")):
        axes.plot(line.tau[chosen], line.value[chosen], "o", ms=3.2, mec=colour, mfc=fill, mew=0.8)
    axes.plot(line.between_tau, line.between, "s", ms=3.8, mec=colour, mfc="white", mew=0.8)
    axes.plot(line.fit_tau, line.fit, color=colour, lw=1.2, label=line.name)
