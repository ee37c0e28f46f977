"""Panels and the map as drawn SVG with labels in HTML, so that text keeps its size on a phone.

A drawing stretches with the page (``preserveAspectRatio="none"``) while its lines keep their width;
ticks and labels stand beside it at percentages. The script of the page reads the values back from
the very lines that are drawn, so the numbers under the cursor are those in the picture.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.report.figures import Band, Curve, Panel, Span
from vehnav.report.mapping import Ellipse, Map, Place, Track
from vehnav.report.markup import esc
from vehnav.report.scale import HEIGHT, WIDTH, nice_step, number, ticks

Array = npt.NDArray[np.float64]

FAR: Final = 50.0
"""Times the height of a panel that a line is drawn beyond it."""
SPAN_TEXT: Final = {"stop": "stops", "gps": "GPS used for the start"}


def panel(item: Panel, *, explained: bool = True) -> str:
    """One plot with its legend; ``explained``: the shades in it, too."""
    x0, x1 = item.x_range
    y0, y1 = item.y_range
    drawn = "".join(
        [
            *(_span(item, span) for span in sorted(item.spans, key=lambda s: s.kind)),
            _grid(item),
            *(_band(item, band) for band in item.bands),
            *(_curve(item, c) for c in item.curves),
        ]
    )
    note = f'<p class="note">{esc(item.note)}</p>' if item.note else ""
    return (
        f'<figure class="panel" id="{esc(item.key)}" data-x0="{x0:.4f}" data-x1="{x1:.4f}" '
        f'data-y0="{y0:.6g}" data-y1="{y1:.6g}" data-step="{_read_step(item):.3g}">'
        f"<figcaption><h3>{esc(item.title)} <small>{esc(item.unit)}</small></h3>"
        f"{_legend(item, explained)}</figcaption>"
        f'<div class="frame"><div class="plot" tabindex="0" role="img" '
        f'aria-label="{esc(_spoken(item))}">'
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" preserveAspectRatio="none" aria-hidden="true">'
        f'{drawn}</svg><i class="cursor"></i></div>{_labels(item)}</div>{note}</figure>'
    )


def _read_step(item: Panel) -> float:
    """Resolution of the numbers under the cursor."""
    return 0.01 * nice_step(item.y_range[1] - item.y_range[0], 5)


def _spoken(item: Panel) -> str:
    parts = [f"{c.name}: {c.bounds[0]:.3g} to {c.bounds[1]:.3g}" for c in item.curves if c.parts]
    return f"{item.title}, {item.unit}. " + "; ".join(parts)


def _x(item: Panel, x: Array | float) -> Array:
    x0, x1 = item.x_range
    return np.asarray((np.asarray(x) - x0) / (x1 - x0) * WIDTH)


def _y(item: Panel, y: Array | float) -> Array:
    y0, y1 = item.y_range
    share = (np.asarray(y) - y0) / (y1 - y0)
    return np.asarray((1.0 - np.clip(share, -FAR, FAR)) * HEIGHT)


def points(x: Array, y: Array) -> str:
    """A path through points on whole units."""
    pairs = zip(np.rint(x).astype(int).tolist(), np.rint(y).astype(int).tolist(), strict=True)
    return "M" + "L".join(f"{a} {b}" for a, b in pairs)


def _curve(item: Panel, c: Curve) -> str:
    d = "".join(points(_x(item, x), _y(item, y)) for x, y in c.parts if x.size)
    clock = ""
    if c.clock:
        clock = f' data-t="{" ".join(_numbers(t, 2) for t in c.clock)}"'
    return f'<path class="curve c-{esc(c.role)}"{clock} d="{d}"/>' if d else ""


def _band(item: Panel, band: Band) -> str:
    x = np.concatenate([band.x, band.x[::-1]])
    y = np.concatenate([band.high, band.low[::-1]])
    edge = points(_x(item, band.x), _y(item, band.high))
    return (
        f'<path class="band" d="{points(_x(item, x), _y(item, y))}Z"/>'
        f'<path class="curve c-expected" d="{edge}"/>'
    )


def _span(item: Panel, span: Span) -> str:
    x0, x1 = item.x_range
    a, b = (float(_x(item, min(max(x, x0), x1))) for x in (span.start, span.end))
    if b <= a:
        return ""
    low, high = (0, HEIGHT) if span.kind != "gps" else (0, HEIGHT // 40)
    return (
        f'<rect class="span-{esc(span.kind)}" x="{a:.0f}" y="{low}" '
        f'width="{max(b - a, 6.0):.0f}" height="{high}"/>'
    )


def _grid(item: Panel) -> str:
    lines = [f"M{float(_x(item, x)):.0f} 0V{HEIGHT}" for x in ticks(*item.x_range, 10)]
    lines += [f"M0 {float(_y(item, y)):.0f}H{WIDTH}" for y in _y_ticks(item)[0]]
    zero = ""
    if item.y_range[0] < 0.0 < item.y_range[1]:
        zero = f'<path class="zero" d="M0 {float(_y(item, 0.0)):.0f}H{WIDTH}"/>'
    return f'<path class="grid" d="{"".join(lines)}"/>{zero}'


def _y_ticks(item: Panel) -> tuple[list[float], float]:
    low, high = item.y_range
    step = item.y_step or nice_step(high - low, 5)
    first, last = int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9))
    return [k * step for k in range(first, last + 1)], step


def _labels(item: Panel) -> str:
    """Ticks beside the drawing; every other one on the x axis leaves a narrow screen."""
    out_x, out_y = [], []
    y_ticks, y_step = _y_ticks(item)
    x_ticks, x_step = ticks(*item.x_range, 10), nice_step(item.x_range[1] - item.x_range[0], 10)
    for y in y_ticks:
        top = float(_y(item, y)) / HEIGHT * 100.0
        out_y.append(f'<span style="top:{top:.2f}%">{number(y, y_step)}</span>')
    for k, x in enumerate(x_ticks):
        left = float(_x(item, x)) / WIDTH * 100.0
        odd = ' class="odd"' if k % 2 else ""
        unit = f" {esc(item.x_title)}" if k == (len(x_ticks) - 1) // 2 * 2 else ""
        out_x.append(f'<span{odd} style="left:{left:.2f}%">{number(x, x_step)}{unit}</span>')
    return f'<div class="ticks-y">{"".join(out_y)}</div><div class="ticks-x">{"".join(out_x)}</div>'


def _legend(item: Panel, explained: bool) -> str:
    rows = [
        f'<li class="k-{esc(c.role)}"><i></i>{esc(c.name)} <output></output></li>'
        for c in item.curves
        if c.parts
    ]
    rows += [
        f'<li class="k-expected"><i></i>{esc(band.name)} <output></output></li>'
        for band in item.bands
    ]
    kinds = sorted({span.kind for span in item.spans}) if explained else []
    rows += [f'<li class="k-span-{kind}"><i></i>{SPAN_TEXT[kind]}</li>' for kind in kinds]
    return f'<ul class="legend">{"".join(rows)}</ul>'


# ---- the map -----------------------------------------------------------------------------------


def map_figure(item: Map) -> str:
    """The map: tracks, stops, ellipses, scale bar and north."""
    west, south, east, top = item.box
    width, height = 10.0 * (east - west), 10.0 * (top - south)
    drawn = [_map_grid(item)]
    drawn += [_ellipse(item, e) for e in item.ellipses]
    drawn += [_line(item, item.used, "used")] if item.used else []
    drawn += [_line(item, track, "curve") for track in item.tracks]
    if item.miss is not None:
        ends = np.array(item.miss)
        drawn.append(f'<path class="miss" d="{points(*_on_map(item, ends))}"/>')
    marks = _marks(item)
    north = NORTH if item.north_known else ""
    dots = "".join(
        f'<i class="dot c-{t.role}"></i>' for t in item.tracks if item.equal or t.role in DOTTED
    )
    equal = " data-equal" if item.equal else ""
    return (
        f'<figure class="map" id="map"{equal}><figcaption>'
        f"<h3>Map <small>{_frame_text(item)}</small></h3>{_map_legend(item)}</figcaption>"
        f'<div class="plot" style="aspect-ratio:{width:.0f}/{height:.0f}" role="img" '
        f'aria-label="Map of the tracks">'
        f'<svg viewBox="0 0 {width:.0f} {height:.0f}" preserveAspectRatio="none" '
        f'aria-hidden="true">{"".join(drawn)}</svg>{"".join(marks)}{dots}'
        f"{_scale_bar(item)}{north}{ZOOM}</div>"
        '<p class="readout" aria-live="off">Point at the map or at a plot: the cursor is the same '
        f"instant everywhere.</p>{_notes(item)}</figure>"
    )


DOTTED: Final = ("ours", "gps")
"""Tracks that the cursor shows on the map."""
NORTH: Final = (
    '<span class="north" title="north is up"><svg viewBox="0 0 20 30" aria-hidden="true">'
    '<path d="M10 1L16 17L10 13L4 17Z"/></svg>N</span>'
)


ZOOM: Final = (
    '<span class="zoom"><button type="button" data-zoom="2" aria-label="zoom in">+</button>'
    '<button type="button" data-zoom="0.5" aria-label="zoom out">−</button></span>'
)


def _notes(item: Map) -> str:
    note = f'<p class="note">{esc(item.note)}</p>' if item.note else ""
    if not item.too_large:
        return note
    what = "expected ellipse is" if item.too_large == 1 else "expected ellipses are"
    return f'{note}<p class="note">{item.too_large} {what} larger than the map and not drawn.</p>'


def _frame_text(item: Map) -> str:
    if not item.local:
        return "grid in metres"
    return "place not known" if item.north_known else "north not known: up is the first heading"


def _on_map(item: Map, place: Array) -> tuple[Array, Array]:
    west, _, _, north = item.box
    return 10.0 * (place[:, 0] - west), 10.0 * (north - place[:, 1])


def _line(item: Map, track: Track, style: str) -> str:
    d = "".join(points(*_on_map(item, p)) for _, p in track.parts if len(p))
    times = " ".join(_numbers(t, 2) for t, _ in track.parts)
    hidden = "" if track.shown else " hidden"
    if style == "used":
        return f'<path class="used" d="{d}"/>'
    return f'<path class="curve c-{esc(track.role)}{hidden}" data-t="{times}" d="{d}"/>'


def _ellipse(item: Map, e: Ellipse) -> str:
    x, y = _on_map(item, np.array([[e.east, e.north]]))
    style = "expected last" if e.last else "expected"
    return (
        f'<ellipse class="{style}" cx="{x[0]:.0f}" cy="{y[0]:.0f}" rx="{10 * e.a_east:.0f}" '
        f'ry="{10 * e.a_north:.0f}"/>'
    )


def _percent(item: Map, east: float, north: float) -> str:
    west, south, right, top = item.box
    x, y = (east - west) / (right - west), (top - north) / (top - south)
    return f"left:{100.0 * x:.2f}%;top:{100.0 * y:.2f}%"


def _marks(item: Map, share: float = 0.035) -> list[str]:
    """Stops and ends; an end that a stop would cover (by ``share`` of the width) colours it."""
    near = share * (item.box[2] - item.box[0])
    stops, ends = merged(item, near), list(item.ends)
    out = []
    for stop in stops:
        covered = [e for e in ends if np.hypot(e.east - stop.east, e.north - stop.north) < near]
        ends = [e for e in ends if e not in covered]
        text = "\n".join([stop.text, *(e.text for e in covered)])
        kind = " ".join(["stop", *(f"at-{e.label}" for e in covered)])
        out.append(_mark(item, replace(stop, text=text), kind))
    ends += [] if item.pole is None else [item.pole]
    return [*out, *(_mark(item, place, place.label) for place in ends)]


def _mark(item: Map, place: Place, kind: str) -> str:
    style = _percent(item, place.east, place.north)
    text = place.label if kind.startswith("stop") else ""
    return (
        f'<b class="mark {kind}" style="{style}" '
        f'data-at="{place.t:.2f}" title="{esc(place.text)}">{esc(text)}</b>'
    )


def merged(item: Map, near: float) -> list[Place]:
    """The stops, those nearer to one another than ``near`` m as one mark."""
    groups: list[list[Place]] = []
    for place in item.stops:
        for group in groups:
            if np.hypot(place.east - group[0].east, place.north - group[0].north) < near:
                group.append(place)
                break
        else:
            groups.append([place])
    return [
        Place(
            group_label([int(p.label) for p in group]),
            "\n".join(p.text for p in group),
            group[0].east,
            group[0].north,
            group[0].t,
        )
        for group in groups
    ]


def group_label(numbers: list[int]) -> str:
    """Numbers of stops at one place, in short.

    >>> group_label([3]), group_label([1, 2, 3, 7]), group_label([4, 6])
    ('3', '1–3,7', '4,6')
    """
    runs: list[list[int]] = []
    for k in sorted(numbers):
        if runs and k == runs[-1][-1] + 1:
            runs[-1].append(k)
        else:
            runs.append([k])
    text = [f"{r[0]}–{r[-1]}" if len(r) > 2 else ",".join(map(str, r)) for r in runs]
    return ",".join(text)


def _map_grid(item: Map) -> str:
    west, south, east, north = item.box
    step = nice_step(east - west, 6)
    x = np.arange(np.ceil(west / step), np.floor(east / step) + 1.0) * step
    y = np.arange(np.ceil(south / step), np.floor(north / step) + 1.0) * step
    lines = [f"M{10 * (a - west):.0f} 0V{10 * (north - south):.0f}" for a in x]
    lines += [f"M0 {10 * (north - b):.0f}H{10 * (east - west):.0f}" for b in y]
    return f'<path class="grid" d="{"".join(lines)}"/>'


def _scale_bar(item: Map) -> str:
    """A square of the grid long."""
    width = item.box[2] - item.box[0]
    step = nice_step(width, 6)
    text = f"{step / 1000.0:g} km" if step >= 1000.0 else f"{step:g} m"
    style = f"width:{100.0 * step / width:.2f}%"
    return f'<span class="scale at-{item.scale_side}" style="{style}">{text}</span>'


def _map_legend(item: Map) -> str:
    rows = []
    for track in reversed(item.tracks):
        checked = " checked" if track.shown else ""
        box = f'<input type="checkbox" data-role="{esc(track.role)}"{checked}>'
        rows.append(
            f'<li class="k-{esc(track.role)}"><label>{box}<i></i>{esc(track.name)}</label></li>'
        )
    if item.used is not None:
        rows.append(f'<li class="k-used"><i></i>{esc(item.used.name)}</li>')
    if item.ellipses:
        rows.append('<li class="k-ellipse"><i></i>expected, 95 %</li>')
    if item.stops:
        rows.append('<li class="k-stops"><i></i>stops</li>')
    return f'<ul class="legend">{"".join(rows)}</ul>'


def _numbers(values: Array, decimals: int) -> str:
    return " ".join(f"{v:.{decimals}f}".rstrip("0").rstrip(".") for v in values.tolist())
