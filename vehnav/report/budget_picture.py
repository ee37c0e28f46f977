"""What the pictures of an error budget show, as plain data.

Error against time per grade, up to where the linear equations hold; error against the interval of
stops.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.budget.forward import Budget
from vehnav.budget.study import Interval, Study
from vehnav.report.summary import metres

Array = npt.NDArray[np.float64]


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
    log_x : bool
        Whether the x axis is logarithmic too.
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
    log_x: bool = False


METRIC_TEXT: Final = {
    "drms": "DRMS", "cep50": "radius of the 50 % circle", "cep95": "radius of the 95 % circle",
    "east": "east, one sigma", "north": "north, one sigma",
}  # fmt: skip


def growth_picture(study: Study, budgets: Sequence[Budget], metric: str) -> Picture:
    """Error against time of one or several sensors, the best first."""
    time = study.time
    lines = [_growth(budget, metric) for budget in budgets]
    rows = []
    bias = len(budgets) < 2 or study.procedure.gyro_from_stops or not study.procedure.stops
    other = None if bias else study.with_gyro_from_stops()
    for budget in budgets:
        cells = [_cell(budget, t, metric) for t in study.times]
        if other is not None:
            cells.append(_cell(other.budget(budget.sensor), time, metric))
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
        head=(
            "sensor",
            *(f"{t:g} s" for t in study.times),
            *(() if other is None else (f"gyro bias from stops, {time:g} s",)),
            "linear",
            "largest source",
        ),
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
    label = (
        f"{budget.sensor.name}, to {end:.0f} s"
        if until > 1
        else f"{budget.sensor.name}: not linear"
    )
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
        log_x=True,
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
