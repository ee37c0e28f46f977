"""What the pictures of a run show, as plain data: the page and the plots for papers draw the same.

Time is in seconds from the start of the log, as everywhere outside. Curves are thinned to what a
wide screen can show, without losing an extreme.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.choices import METHODS, corrections_of
from vehnav.earth import POLAR
from vehnav.evaluation.reference import (
    COURSE_WINDOW,
    mean_motion,
    seconds,
    tracks,
    trusted_velocity,
    turned,
    turning,
)
from vehnav.logs.log import Gnss
from vehnav.pipeline import Run
from vehnav.report.scale import between_gaps, envelope
from vehnav.strapdown.quasi import wander_along
from vehnav.trajectory import Trajectory
from vehnav.units import NS

Array = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

BINS: Final = 800
"""Columns that a curve is thinned to: four points in each."""
ROOM: Final = 1.08
"""Of an axis over the largest value on it."""
LEGEND: Final = {
    "free": "free, no correction",
    "levelling": "levelling only",
    "reset": "velocity reset only",
    "as_published": "as published",
    "default": "vehnav",
}
"""Names of the methods beside their lines."""


@dataclass(frozen=True)
class Curve:
    """One line of a panel.

    Attributes
    ----------
    name : str
        In the legend.
    role : str
        ``ours``, ``gps``, ``published``, ``free``: decides the colour everywhere.
    parts : tuple of (x (n,), y (n,))
        Between gaps.
    clock : tuple of (n,)
        s, of every point of every part, where x is not the time.
    """

    name: str
    role: str
    parts: tuple[tuple[Array, Array], ...]
    clock: tuple[Array, ...] = ()

    @property
    def largest(self) -> float:
        """Largest magnitude on it; 0 of an empty one."""
        return max((float(np.abs(y).max()) for _, y in self.parts), default=0.0)

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest value."""
        if not self.parts:
            return 0.0, 0.0
        return min(float(y.min()) for _, y in self.parts), max(
            float(y.max()) for _, y in self.parts
        )


@dataclass(frozen=True)
class Band:
    """A shaded range from ``low`` to ``high`` over x, all (n,)."""

    name: str
    x: Array
    low: Array
    high: Array


@dataclass(frozen=True)
class Span:
    """A shaded stretch of the x axis: ``stop`` or ``gps``."""

    kind: str
    start: float
    end: float


@dataclass(frozen=True)
class Panel:
    """A plot.

    Attributes
    ----------
    key : str
        Its name in files and anchors.
    title, unit, x_title, note : str
    x_range, y_range : (float, float)
    curves, bands, spans : tuple
    y_step : float
        Between ticks; 0: a round one.
    """

    key: str
    title: str
    unit: str
    x_title: str
    x_range: tuple[float, float]
    y_range: tuple[float, float]
    curves: tuple[Curve, ...]
    bands: tuple[Band, ...] = ()
    spans: tuple[Span, ...] = ()
    note: str = ""
    y_step: float = 0.0


# ---- what a run has ----------------------------------------------------------------------------


def log_seconds(run: Run, t_ns: TimeArray) -> Array:
    """Seconds from the start of the log."""
    return np.asarray((t_ns - run.start_ns) * NS)


def time_range(run: Run) -> tuple[float, float]:
    """First and last instant of the solution, s."""
    t = run.trajectory.t_ns
    first, last = log_seconds(run, t[[0, -1]])
    return float(first), float(last)


def curve(name: str, role: str, x: Array, y: Array) -> Curve:
    """A curve, cut at gaps and thinned."""
    parts = []
    for part in between_gaps(x):
        keep = envelope(x[part], y[part], BINS)
        parts.append((x[part][keep], y[part][keep]))
    return Curve(name, role, tuple(parts))


def own_method(run: Run) -> str | None:
    """The method of the table that is in force, if it is one of them."""
    own = replace(corrections_of(run.config), causal=False)
    return next((name for name, corrections in METHODS.items() if corrections == own), None)


def own_name(run: Run) -> str:
    """What the line of the method in force is called."""
    return LEGEND.get(own_method(run) or "", "vehnav, as configured")


def others(run: Run, names: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """(method, role) of those of ``names`` that were run and are not the one in force."""
    own = own_method(run)
    for name in names:
        if name in run.variants and name != own:
            yield name, {"as_published": "published"}.get(name, name)


def spans(run: Run) -> tuple[Span, ...]:
    """The stops, and where GPS was used."""
    found = [Span("stop", stop.start, stop.end) for stop in run.stops]
    if run.gps.until_ns is not None and run.gps.fixes_used:
        found.append(Span("gps", *gps_window(run)))
    return tuple(found)


def gps_window(run: Run) -> tuple[float, float]:
    """Where GPS was used: from the start of the alignment on, s; empty where it was not."""
    begin = (run.alignment.time_ns - run.start_ns) * NS
    return begin, begin if run.gps.until_ns is None else (run.gps.until_ns - run.start_ns) * NS


def gps_velocity(gnss: Gnss) -> Array:
    """(m, 2) m/s: the receiver's velocity where it is sound, else that of its positions."""
    velocity = trusted_velocity(gnss)
    if velocity is not None:
        return velocity[:, :2]
    return turned(mean_motion(seconds(gnss), tracks(gnss), COURSE_WINDOW), turning(gnss))


def near_pole(run: Run) -> bool:
    """Whether east and north turn so fast on the way that plots are drawn in free axes."""
    return bool(np.any(np.abs(run.trajectory.lat) > POLAR))


def turning_of(track: Trajectory) -> Array:
    """(n,) rad: wander angle of free axes carried along a track, as :func:`turning` of fixes."""
    return wander_along((track.t_ns - track.t_ns[0]) * NS, track.lat, track.lon)


def inside(run: Run, gnss: Gnss) -> npt.NDArray[np.bool_]:
    """(m,) the fixes within the time of the solution."""
    t = run.trajectory.t_ns
    return np.asarray((gnss.t_ns >= t[0]) & (gnss.t_ns <= t[-1]))
