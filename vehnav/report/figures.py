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

from vehnav.evaluation import Errors
from vehnav.evaluation.reference import (
    COURSE_WINDOW,
    mean_motion,
    seconds,
    tracks,
    trusted_velocity,
)
from vehnav.logs.log import Gnss
from vehnav.pipeline import METHODS, Run, corrections_of
from vehnav.report.circle import radius_95
from vehnav.report.scale import between_gaps, envelope, number
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
READABLE: Final = 3.0
"""Times the own error that other curves may stretch the axis of the errors."""
EXPECTED: Final = 6.0
"""Times the own error that the expected one may stretch it."""


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
    """

    name: str
    role: str
    parts: tuple[tuple[Array, Array], ...]

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
    clock : (t (n,), x (n,)) or None
        Where x is no time: the x at each time, for the linked cursor.
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
    clock: tuple[Array, Array] | None = None


def panels(run: Run) -> list[Panel]:
    """The plots over time of a run, those that its log supports."""
    return [error_panel(run), east_velocity_panel(run), speed_panel(run)]


# ---- curves ------------------------------------------------------------------------------------


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
    return mean_motion(seconds(gnss), tracks(gnss), COURSE_WINDOW)


def inside(run: Run, gnss: Gnss) -> npt.NDArray[np.bool_]:
    """(m,) the fixes within the time of the solution."""
    t = run.trajectory.t_ns
    return np.asarray((gnss.t_ns >= t[0]) & (gnss.t_ns <= t[-1]))


# ---- panels ------------------------------------------------------------------------------------


def error_panel(run: Run) -> Panel:
    """Horizontal error against GPS over time, with the circle that was expected."""
    curves = []
    judged = [errors for errors in (run.errors_before, run.errors) if errors is not None]
    own = [p for errors in judged for p in _error_curve(run, errors, "", "").parts]
    if own:
        curves.append(Curve(own_name(run), "ours", tuple(own)))
    for name, role in others(run, ("as_published", "free")):
        if name in run.method_errors:
            curves.append(_error_curve(run, run.method_errors[name], LEGEND[name], role))
    band = expected_band(run)
    high = _error_axis(curves, band)
    title = "Horizontal error against GPS" if judged else "Expected horizontal error"
    return Panel(
        "error", title, "m", "s", time_range(run), (0.0, high), tuple(curves),
        () if band is None else (band,), spans(run), _off_axis(curves, (0.0, high), "m"),
    )  # fmt: skip


def _error_curve(run: Run, errors: Errors, name: str, role: str) -> Curve:
    return curve(name, role, log_seconds(run, errors.t_ns), errors.horizontal)


def expected_band(run: Run) -> Band | None:
    """What the error stays under with 95 % probability, as a user without GPS knows it."""
    track = run.trajectory
    if track.sigma_pos is None:
        return None
    t, high = log_seconds(run, track.t_ns), radius_95(track.sigma_pos[:, :2])
    keep = envelope(t, high, BINS)
    return Band("expected, 95 %", t[keep], np.zeros(keep.size), high[keep])


def _error_axis(curves: list[Curve], band: Band | None) -> float:
    """Top of the error axis: the own error whole, the others as far as it stays readable."""
    expected = 0.0 if band is None else float(band.high.max())
    own = max((c.largest for c in curves if c.role == "ours"), default=expected)
    rest = [min(c.largest, READABLE * own) for c in curves if c.role == "published"]
    return ROOM * max([own, min(expected, EXPECTED * own), *rest, 1e-3])


def _off_axis(curves: list[Curve], y_range: tuple[float, float], unit: str) -> str:
    """Says of each curve that leaves the picture when it does and how far it goes."""
    notes = []
    for item in curves:
        for x, y in item.parts:
            out = (y < y_range[0]) | (y > y_range[1])
            if np.any(out):
                far = number(float(f"{item.largest:.3g}"), 0.1 if item.largest < 100.0 else 1.0)
                notes.append(
                    f"{item.name} leaves the picture at {x[np.argmax(out)]:.0f} s and reaches "
                    f"{far} {unit}"
                )
                break
    return "; ".join(notes)


def east_velocity_panel(run: Run) -> Panel:
    """East velocity against GPS with and without the procedures: figure 1 of paper 002."""
    return _velocity_panel(run, "east-velocity", "East velocity", 0)


def _velocity_panel(run: Run, key: str, title: str, axis: int) -> Panel:
    track = run.trajectory
    curves = []
    if run.log.gnss is not None:
        within = inside(run, run.log.gnss)
        t = log_seconds(run, run.log.gnss.t_ns[within])
        curves.append(curve("GPS", "gps", t, gps_velocity(run.log.gnss)[within, axis]))
    for name, role in others(run, ("free", "as_published")):
        other = run.variants[name]
        curves.append(curve(LEGEND[name], role, log_seconds(run, other.t_ns), other.v_n[:, axis]))
    own = curve(own_name(run), "ours", log_seconds(run, track.t_ns), track.v_n[:, axis])
    curves.append(own)
    y_range = _readable_range([c for c in curves if c.role in ("gps", "ours")])
    note = _off_axis(curves, y_range, "m/s")
    return Panel(
        key, title, "m/s", "s", time_range(run), y_range, tuple(curves), (), spans(run), note
    )


def _readable_range(curves: list[Curve]) -> tuple[float, float]:
    """Of the curves that must be seen whole, with some room around."""
    low = min(c.bounds[0] for c in curves)
    high = max(c.bounds[1] for c in curves)
    room = 0.15 * max(high - low, 0.5)
    return low - room, high + room


def speed_panel(run: Run) -> Panel:
    """Horizontal speed, own and GPS."""
    track = run.trajectory
    curves = []
    if run.log.gnss is not None:
        within = inside(run, run.log.gnss)
        speed = np.hypot(*gps_velocity(run.log.gnss)[within].T)
        curves.append(curve("GPS", "gps", log_seconds(run, run.log.gnss.t_ns[within]), speed))
    own = np.hypot(track.v_n[:, 0], track.v_n[:, 1])
    curves.append(curve(own_name(run), "ours", log_seconds(run, track.t_ns), own))
    high = ROOM * max(max(c.largest for c in curves), 0.5)
    return Panel(
        "speed", "Speed", "m/s", "s", time_range(run), (0.0, high), tuple(curves), (), spans(run)
    )


def track_enu(track: Trajectory, origin: tuple[float, float, float]) -> Array:
    """(n, 2) m: east and north from the origin."""
    return track.enu(origin)[:, :2]
