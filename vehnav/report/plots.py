"""The pictures of a run as files for papers: PNG or PDF, by matplotlib (extra ``plots``)."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from vehnav.errors import ConfigError
from vehnav.export.atomic import atomic_path
from vehnav.pipeline import Run
from vehnav.report.comparison import Comparison, comparison_map, comparison_panels
from vehnav.report.figures import Panel
from vehnav.report.mapping import Map, Track, map_of
from vehnav.report.panels import panels
from vehnav.report.scale import nice_step

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS: Final = {
    "ours": "#0b62d6", "gps": "#1c2128", "published": "#0d8a63", "free": "#d4620a",
    "second": "#9a3fc0", "levelling": "#8a6d00", "sixth": "#c23b84", "seventh": "#00808c",
    "eighth": "#7a4a32", "used": "#e3b400",
}  # fmt: skip
"""By role, as on the page in daylight."""
BAND: Final = "#cfe0f7"
STANDING: Final = "#e4e6ea"
WIDTH: Final = 6.3
"""inch: the text width of A4."""
DPI: Final = 160
LONG: Final = 20
"""Characters of a name from which a legend has only as many columns as fit."""
PER_INCH: Final = 18.0
"""Characters of a legend."""
STYLE: Final = {
    "font.size": 8.5, "axes.linewidth": 0.6, "lines.linewidth": 1.1, "legend.frameon": False,
    "legend.fontsize": 7.5, "pdf.fonttype": 42, "svg.fonttype": "none", "axes.axisbelow": True,
}  # fmt: skip


def write_plots(
    run: Run,
    folder: Path,
    *,
    formats: Sequence[str] = ("png", "pdf"),
    names: Sequence[str] | None = None,
) -> list[Path]:
    """Write the map, every plot of the page, and an overview of the three that matter most.

    Parameters
    ----------
    run : Run
    folder : Path
        Made if it is not there.
    formats : sequence of str
        ``png``, ``pdf``, ``svg``.
    names : sequence of str or None
        Only these; None: all that the log supports.

    Returns
    -------
    list of Path
        ``map.png``, ``error.png``, ..., ``overview.png``.

    Raises
    ------
    ConfigError
        matplotlib is not installed.
    """
    return _write(_drawings(run), folder, formats, names)


def write_comparison_plots(
    item: Comparison,
    folder: Path,
    *,
    formats: Sequence[str] = ("png", "pdf"),
    names: Sequence[str] | None = None,
) -> list[Path]:
    """Write the map, every plot, and an overview of a comparison, as :func:`write_plots` does."""
    place, found = comparison_map(item), comparison_panels(item)
    drawings: dict[str, Callable[[], Figure]] = {"map": partial(_map_figure, place)}
    drawings |= {p.key: partial(_panel_figure, p) for p in found}
    chosen = [p for p in found if p.key in ("error", "error-along", "error-cross")]
    return _write(
        drawings | {"overview": partial(_overview, place, chosen)}, folder, formats, names
    )


def _write(
    drawings: dict[str, Callable[[], Figure]],
    folder: Path,
    formats: Sequence[str],
    names: Sequence[str] | None,
) -> list[Path]:
    """Draw and write those of ``names``; ConfigError without matplotlib."""
    try:
        from matplotlib import rc_context
    except ImportError as error:
        raise ConfigError(
            "--plots needs matplotlib: pip install 'vehnav[plots]'; report.html needs nothing"
        ) from error
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    with rc_context(STYLE):  # type: ignore[arg-type]
        for name, draw in drawings.items():
            if names is not None and name not in names:
                continue
            figure = draw()
            for suffix in formats:
                path = folder / f"{name}.{suffix}"
                _save(figure, path, suffix)
                written.append(path)
    return written


def _drawings(run: Run) -> dict[str, Callable[[], Figure]]:
    """What can be drawn of a run, by name."""
    place = map_of(run)
    items = {item.key: item for item in panels(run)}
    found: dict[str, Callable[[], Figure]] = {"map": partial(_map_figure, place)}
    found |= {key: partial(_panel_figure, item) for key, item in items.items()}
    chosen = [items[key] for key in ("error", "east-velocity", "speed")]
    return found | {"overview": partial(_overview, place, chosen)}


def _map_figure(place: Map) -> Figure:
    from matplotlib.figure import Figure

    west, south, east, north = place.box
    shape = (north - south) / (east - west)
    figure = Figure(figsize=(WIDTH, WIDTH * shape), layout="constrained")
    _draw_map(figure.subplots(), place)
    return figure


def _panel_figure(item: Panel) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 2.4), layout="constrained")
    _draw_panel(figure.subplots(), item)
    return figure


def _overview(place: Map, items: list[Panel]) -> Figure:
    """The map beside the plots, which share their time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.6), layout="constrained")
    grid = figure.add_gridspec(len(items), 2, width_ratios=(4.3, 5.7))
    _draw_map(figure.add_subplot(grid[:, 0]), place)
    for row, item in enumerate(items):
        axes = figure.add_subplot(grid[row, 1])
        _draw_panel(axes, item, explained=row == 0)
        if row < len(items) - 1:
            axes.set_xlabel("")
            axes.set_xticklabels([])
        if row > 0 and (legend := axes.get_legend()) is not None:
            legend.remove()
    return figure


def _save(figure: Figure, path: Path, suffix: str) -> None:
    """Without the date, so that the same run gives the same file."""
    dated: dict[str, Any] = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(suffix, {})
    with atomic_path(path) as temporary:
        figure.savefig(temporary, format=suffix, dpi=DPI, metadata=dated)


def _draw_panel(axes: Axes, item: Panel, *, explained: bool = True) -> None:
    for span in item.spans:
        if span.kind == "stop":
            axes.axvspan(span.start, span.end, color=STANDING, lw=0)
        else:
            axes.axvspan(span.start, span.end, ymin=0.97, color=COLOURS["used"], lw=0)
    for band in item.bands:
        axes.fill_between(band.x, band.low, band.high, color=BAND, lw=0, label=band.name)
    for curve in item.curves:
        style = (0, (4, 2)) if curve.role == "gps" else "-"
        for k, (x, y) in enumerate(curve.parts):
            label = curve.name if k == 0 else None
            axes.plot(x, y, color=COLOURS[curve.role], ls=style, label=label)
    if explained and any(span.kind == "stop" for span in item.spans):
        axes.fill_between([], [], color=STANDING, label="stops")
    if item.y_step:
        low, high = (np.ceil(v / item.y_step) for v in item.y_range)
        axes.set_yticks(np.arange(low, high) * item.y_step)
    axes.set_xlim(*item.x_range)
    axes.set_ylim(*item.y_range)
    axes.set_xlabel(f"{'distance' if item.x_title == 'm' else 'time'}, {item.x_title}")
    axes.set_ylabel(textwrap.fill(f"{item.title}, {item.unit}", 18), fontsize=8.0)
    axes.grid(color="#e6e9ed", lw=0.6)
    _legend(axes)


def _legend(axes: Axes) -> None:
    labels = axes.get_legend_handles_labels()[1]
    longest, columns = max(map(len, labels), default=0), 5
    if longest > LONG:
        inches = axes.bbox.width / axes.figure.dpi
        columns = max(2, int(inches * PER_INCH / (longest + 5)))
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, borderaxespad=0.2,
        borderpad=0.2, columnspacing=1.0, handlelength=1.3, handletextpad=0.5,
    )  # fmt: skip


def _draw_map(axes: Axes, item: Map) -> None:
    from matplotlib.patches import Ellipse

    west, south, east, north = item.box
    for e in item.ellipses:
        axes.add_patch(
            Ellipse(
                (e.east, e.north), 2.0 * e.a_east, 2.0 * e.a_north,
                facecolor=BAND if e.last else "none", edgecolor="#85b0ea", lw=0.7, alpha=0.8,
            )
        )  # fmt: skip
    if item.used is not None:
        _draw_track(axes, item.used, lw=4.0, alpha=0.55)
    for track in item.tracks:
        if track.shown:
            _draw_track(axes, track)
    if item.miss is not None:
        axes.plot(*np.array(item.miss).T, color="#c1121f", ls=":", lw=1.2)
    for stop in item.stops:
        axes.plot(stop.east, stop.north, "o", ms=4.5, mfc="white", mec="#1c2128", mew=0.9)
    for end, colour, mark in zip(item.ends, ("#0d8a63", "#c1121f"), "os", strict=True):
        axes.plot(end.east, end.north, mark, ms=5.5, color=colour, label=end.label)
    if item.pole is not None:
        axes.plot(item.pole.east, item.pole.north, "o", ms=9.0, mfc="none", mec="#1c2128", mew=0.9)
    axes.set(xlim=(west, east), ylim=(south, north), aspect="equal", xticks=[], yticks=[])
    _scale_and_north(axes, item)
    _legend(axes)


def _draw_track(axes: Axes, track: Track, **style: Any) -> None:
    for k, (_, place) in enumerate(track.parts):
        label = track.name if k == 0 else None
        axes.plot(*place.T, color=COLOURS[track.role], label=label, **style)


def _scale_and_north(axes: Axes, item: Map) -> None:
    west, south, east, north = item.box
    width, height = east - west, north - south
    bar = nice_step(width, 6)
    x = west + 0.03 * width if item.scale_side == "left" else east - 0.03 * width - bar
    y = south + 0.035 * height
    axes.plot([x, x + bar], [y, y], color="#1c2128", lw=1.8, solid_capstyle="butt")
    text = f"{bar / 1000.0:g} km" if bar >= 1000.0 else f"{bar:g} m"
    axes.text(x + 0.5 * bar, y + 0.012 * height, text, ha="center", va="bottom")
    if not item.north_known:
        return
    at = (east - 0.05 * width, north - 0.03 * height)
    axes.annotate("N", at, (at[0], at[1] - 0.11 * height), ha="center", va="bottom",
                  arrowprops={"arrowstyle": "-|>", "color": "#1c2128"})  # fmt: skip
