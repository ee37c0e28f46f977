"""The distribution of a figure over the logs, drawn: shares on a logarithmic axis, and now against
the baseline.

Drawings stretch with the page and labels stand beside them, as in :mod:`vehnav.report.svg`, whose
styles they use.
"""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.batch.wording import short, unit_of
from vehnav.report.markup import esc
from vehnav.report.scale import HEIGHT, WIDTH

Array = npt.NDArray[np.float64]

ROLES: Final = (
    "ours", "free", "published", "reset", "levelling", "sixth", "seventh", "eighth",
)  # fmt: skip
"""Colours of the configurations, in their order; a ninth begins again."""
STEPS: Final = 400
"""Of a curve: more are not seen."""
FEW: Final = 40
"""Logs up to which each one is a dot on its curve."""
MOST_LIMITS: Final = 8
"""Bars in a picture; more, for many groups, would hide the curves."""
DASH: Final = 10
"""Pixels of a line that another one shares, before the other one shows."""
APART: Final = 0.004
"""Of the width of a picture: lines that are nearer everywhere look like one."""
MANY: Final = 600
"""Points from which they are drawn smaller."""
ROOM: Final = 1.1
"""Between the outermost value and the end of an axis, at least."""
DECADES: Final = 6
"""Most of an axis, from its upper end: what is smaller stands on its lower end."""


@dataclass(frozen=True)
class Axis:
    """A logarithmic axis.

    Attributes
    ----------
    low, high : float
    """

    low: float
    high: float

    @classmethod
    def of(cls, values: npt.ArrayLike, *, least: float) -> Axis:
        """Round ends around positive values; ``least``: what is smaller is as good as zero.

        >>> Axis.of([0.3, 44.0], least=0.01)
        Axis(low=0.2, high=50.0)
        """
        x = np.asarray(values, float)
        high = float(x.max(initial=least))
        low = max(float(x.min(initial=high)), least, high * 10.0**-DECADES)
        low, high = _round(low, down=True), _round(high, down=False)
        return cls(low, high if high > low else 10.0 * low)

    def share(self, values: npt.ArrayLike) -> Array:
        """Places between 0 and 1."""
        x = np.clip(np.asarray(values, float), self.low, self.high)
        return np.asarray(np.log(x / self.low) / math.log(self.high / self.low))

    def ticks(self) -> list[float]:
        """Powers of ten, and where these are few 2 and 5 times them."""
        decades = math.log10(self.high / self.low)
        factors = (1.0,) if decades > 4.0 else (1.0, 3.0) if decades > 2.6 else (1.0, 2.0, 5.0)
        first, last = math.floor(math.log10(self.low)), math.ceil(math.log10(self.high))
        found = [f * 10.0**k for k in range(first, last + 1) for f in factors]
        near = 1e-9
        return [x for x in found if self.low * (1 - near) <= x <= self.high * (1 + near)]


def _round(value: float, *, down: bool) -> float:
    """The next 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(value))
    steps = [f * power for f in (1.0, 2.0, 5.0, 10.0)]
    near = 1e-9
    if down:
        return float(f"{max(s for s in steps if s <= value * (1 + near)):.3g}")
    return float(f"{min(s for s in steps if s >= value * (1 - near)):.3g}")


@dataclass(frozen=True)
class Series:
    """A figure of one configuration over its logs.

    Attributes
    ----------
    name, role : str
    values : (n,) float64
        Of now, none of them missing.
    before : (m,) float64
        Of the baseline; empty without one.
    limits : set of float
        Its bars.
    """

    name: str
    role: str
    values: Array
    before: Array
    limits: Set[float] = frozenset()


@dataclass(frozen=True)
class Pairs:
    """A figure of one configuration now and in the baseline.

    Attributes
    ----------
    role : str
    before, now : (n,) float64
    rows : (n,) int
        Rows of the table of logs.
    failed : (n,) bool
    """

    role: str
    before: Array
    now: Array
    rows: Sequence[int]
    failed: Sequence[bool]


def _with_room(values: Array) -> Array:
    """The values and a little beyond both ends of them, so that nothing lies on the frame."""
    return np.concatenate([values, values / ROOM, values * ROOM])


# ---- shares ------------------------------------------------------------------------------------


def shares_figure(metric: str, series: Sequence[Series], *, least: float, key: str) -> str:
    """Which share of the logs stays under what, for every configuration (markup).

    Parameters
    ----------
    metric : str
    series : sequence of Series
        Their bars are drawn where they are near, in the colour of the configuration unless they
        are for all.
    least : float
        What is smaller is as good as zero.
    key : str
        Of the figure in the page.
    """
    everything = np.concatenate([x for s in series for x in (np.abs(s.values), np.abs(s.before))])
    bars = _near_bars(series, 10.0 * everything.max(initial=0.0))
    axis = Axis.of(_with_room(np.append(everything, [limit for limit, _ in bars])), least=least)
    drawn = [_grid(axis, [0.25, 0.5, 0.75])]
    drawn += [
        f'<path class="limit{" k-" + role if role else ""}" d="M{_px(axis, limit)} 0V{HEIGHT}"/>'
        for limit, role in bars
    ]
    drawn += [_staircase(axis, s.before, "before", s.role) for s in series]
    same = _alike(axis, series)
    drawn += [
        _staircase(axis, s.values, "now", s.role, style=_dashes(*place))
        for s, place in zip(series, same, strict=True)
    ]
    drawn += [
        _dots(axis, s.values, s.role)
        for s, (k, _) in zip(series, same, strict=True)
        if k == 0 and s.values.size <= FEW
    ]
    labels = _x_labels(axis, metric) + _y_labels([(q, f"{100 * q:.0f}") for q in _QUARTERS])
    title = f"{esc(metric)} <small>how many % of the logs are under it</small>"
    spoken = "; ".join(f"{s.name}: median {short(_middle(s.values))}" for s in series)
    return _figure(
        key, "shares", title, _legend(series, bars), "".join(drawn), labels,
        spoken=f"{metric}, share of the logs. {spoken}", axis=axis, unit=unit_of(metric),
    )  # fmt: skip


_QUARTERS: Final = (0.0, 0.25, 0.5, 0.75, 1.0)


def _middle(values: Array) -> float | None:
    return float(np.median(values)) if values.size else None


def _alike(axis: Axis, series: Sequence[Series]) -> list[tuple[int, int]]:
    """Of each line, which it is of those that look like one, and of how many."""
    places = [np.sort(axis.share(np.abs(s.values))) for s in series]
    groups: list[list[int]] = []
    for k, x in enumerate(places):
        for group in groups:
            y = places[group[0]]
            if x.size and x.size == y.size and np.abs(x - y).max() < APART:
                group.append(k)
                break
        else:
            groups.append([k])
    found = {k: (n, len(group)) for group in groups for n, k in enumerate(group)}
    return [found[k] for k in range(len(series))]


def _dashes(k: int, count: int) -> str:
    """The style of line ``k`` of ``count`` that look like one: each shows for a dash in turn.

    >>> _dashes(0, 2), _dashes(1, 2), _dashes(1, 3)
    ('', 'stroke-dasharray:10 10', 'stroke-dasharray:20 10')
    """
    return f"stroke-dasharray:{DASH * (count - k)} {DASH * k}" if k else ""


def _staircase(axis: Axis, values: Array, kind: str, role: str, *, style: str = "") -> str:
    """The empirical distribution as steps; of many logs at evenly spaced shares."""
    if not values.size:
        return ""
    x = np.sort(np.abs(values))
    n = x.size
    at = np.unique(np.linspace(0, n - 1, min(n, STEPS)).round().astype(int))
    xs = np.rint(axis.share(x[at]) * WIDTH).astype(int)
    ys = np.rint((1.0 - (at + 1) / n) * HEIGHT).astype(int)
    steps = "".join(f"H{a}V{b}" for a, b in zip(xs.tolist(), ys.tolist(), strict=True))
    more = f' style="{style}"' if style else ""
    return f'<path class="curve {kind} c-{role}"{more} d="M0 {HEIGHT}{steps}H{WIDTH}"/>'


def _dots(axis: Axis, values: Array, role: str) -> str:
    x = np.sort(np.abs(values))
    xs = np.rint(axis.share(x) * WIDTH).astype(int).tolist()
    ys = np.rint((1.0 - np.arange(1, x.size + 1) / max(x.size, 1)) * HEIGHT).astype(int).tolist()
    d = "".join(f"M{a} {b}h0" for a, b in zip(xs, ys, strict=True))
    return f'<path class="points c-{role}" d="{d}"/>' if d else ""


def _near_bars(series: Sequence[Series], most: float) -> list[tuple[float, str]]:
    """Limits under ``most`` and whose they are, "" for all; none where there are too many."""
    common = frozenset.intersection(*(frozenset(s.limits) for s in series))
    found = [(abs(limit), "") for limit in common]
    found += [(abs(limit), s.role) for s in series for limit in s.limits - common]
    found = sorted(row for row in found if row[0] < most)
    return found if len(found) <= MOST_LIMITS else []


def _legend(series: Sequence[Series], bars: Sequence[tuple[float, str]]) -> str:
    rows = [
        f'<li class="k-{s.role}"><i></i>{esc(s.name)} <output></output></li>'
        for s in series
        if s.values.size
    ]
    if any(s.before.size for s in series):
        rows.append('<li class="k-before"><i></i>baseline</li>')
    if bars:
        rows.append('<li class="k-limit"><i></i>bar</li>')
    return f'<ul class="legend">{"".join(rows)}</ul>'


# ---- now against the baseline ------------------------------------------------------------------


def pairs_figure(
    metric: str, pairs: Sequence[Pairs], *, least: float, band: float | None, key: str
) -> str:
    """Every log as a point: the baseline to the right, now upward; above the line is worse.

    ``band``: the share that a log may worsen, drawn as a line above which it fails.
    """
    both = [np.abs(x) for p in pairs for x in (p.before, p.now)]
    axis = Axis.of(_with_room(np.concatenate(both)), least=least)
    drawn = [_grid(axis, []), _rows_grid(axis), f'<path class="equal" d="M0 {HEIGHT}L{WIDTH} 0"/>']
    if band is not None:
        up = float(np.log1p(band) / math.log(axis.high / axis.low))
        if up < 1.0:
            x, y = round((1.0 - up) * WIDTH), round((1.0 - up) * HEIGHT)
            drawn.append(f'<path class="limit" d="M0 {y}L{x} 0"/>')
    for p in pairs:
        drawn.append(_points(axis, p, failed=False))
        drawn.append(_points(axis, p, failed=True))
    ticks = [(float(axis.share(x)), f"{x:g}") for x in axis.ticks()]
    labels = _x_labels(axis, metric, what="baseline, ") + _y_labels(ticks)
    legend = '<ul class="legend"><li class="k-equal"><i></i>as in the baseline</li>'
    if band is not None:
        legend += f'<li class="k-limit"><i></i>{100.0 * band:g} % worse</li>'
    unit = esc(unit_of(metric) or "value")
    title = f"Now against the baseline <small>{unit}, a point for each log</small>"
    return _figure(
        key, "pairs", title, f"{legend}</ul>", "".join(drawn), labels,
        spoken=f"{metric} now and before", axis=axis, unit=unit_of(metric),
    )  # fmt: skip


def _points(axis: Axis, p: Pairs, *, failed: bool) -> str:
    chosen = np.flatnonzero(np.asarray(p.failed, bool) == failed)
    if not chosen.size:
        return ""
    xs = np.rint(axis.share(np.abs(p.before[chosen])) * WIDTH).astype(int).tolist()
    ys = np.rint((1.0 - axis.share(np.abs(p.now[chosen]))) * HEIGHT).astype(int).tolist()
    d = "".join(f"M{a} {b}h0" for a, b in zip(xs, ys, strict=True))
    rows = " ".join(str(p.rows[k]) for k in chosen.tolist())
    kind = "points failed" if failed else "points many" if p.now.size > MANY else "points"
    return f'<path class="{kind} c-{p.role}" data-rows="{rows}" d="{d}"/>'


# ---- the frame ---------------------------------------------------------------------------------


def _figure(
    key: str,
    kind: str,
    title: str,
    legend: str,
    drawn: str,
    labels: str,
    *,
    spoken: str,
    axis: Axis,
    unit: str,
) -> str:
    return (
        f'<figure class="panel {kind}" id="{esc(key)}" data-low="{axis.low!r}" '
        f'data-high="{axis.high!r}" data-unit="{esc(unit)}">'
        f"<figcaption><h3>{title}</h3>{legend}</figcaption>"
        f'<div class="frame"><div class="plot" role="img" aria-label="{esc(spoken)}">'
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" preserveAspectRatio="none" aria-hidden="true">'
        f'{drawn}</svg><i class="cursor"></i></div>{labels}</div>'
        '<p class="readout" aria-live="off"></p></figure>'
    )


def _px(axis: Axis, value: float) -> int:
    return round(float(axis.share(abs(value))) * WIDTH)


def _grid(axis: Axis, shares: Sequence[float]) -> str:
    lines = [f"M{_px(axis, x)} 0V{HEIGHT}" for x in axis.ticks()]
    lines += [f"M0 {round((1.0 - q) * HEIGHT)}H{WIDTH}" for q in shares]
    return f'<path class="grid" d="{"".join(lines)}"/>'


def _rows_grid(axis: Axis) -> str:
    lines = [f"M0 {HEIGHT - round(float(axis.share(x)) * HEIGHT)}H{WIDTH}" for x in axis.ticks()]
    return f'<path class="grid" d="{"".join(lines)}"/>'


def _x_labels(axis: Axis, metric: str, *, what: str = "") -> str:
    """Ticks under the drawing; on a narrow screen every other one."""
    found = axis.ticks()
    unit = f"&nbsp;{esc(unit_of(metric))}"
    spans = []
    for k, x in enumerate(found):
        odd = ' class="odd"' if k % 2 else ""
        middle = k == (len(found) - 1) // 2 // 2 * 2
        text = f"{what}{x:g}{unit}" if middle else f"{x:g}"
        spans.append(f'<span{odd} style="left:{100.0 * float(axis.share(x)):.2f}%">{text}</span>')
    return f'<div class="ticks-x">{"".join(spans)}</div>'


def _y_labels(ticks: Sequence[tuple[float, str]]) -> str:
    spans = [f'<span style="top:{100.0 * (1.0 - q):.2f}%">{text}</span>' for q, text in ticks]
    return f'<div class="ticks-y">{"".join(spans)}</div>'
