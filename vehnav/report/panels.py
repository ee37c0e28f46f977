"""The plots over time and distance of a run, as data."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.evaluation import Errors
from vehnav.evaluation.reference import course, turned, turning
from vehnav.pipeline import Run
from vehnav.report.circle import radius_95
from vehnav.report.figures import (
    BINS,
    LEGEND,
    ROOM,
    Band,
    Curve,
    Panel,
    curve,
    gps_velocity,
    inside,
    log_seconds,
    near_pole,
    others,
    own_name,
    spans,
    time_range,
    turning_of,
)
from vehnav.report.scale import envelope, number
from vehnav.rotation import angles_from_c_nb
from vehnav.trajectory import Trajectory
from vehnav.units import DEG

Array = npt.NDArray[np.float64]

READABLE: Final = 3.0
"""Times the own error that other curves may stretch the axis of the errors."""
EXPECTED: Final = 6.0
"""Times the own error that the expected one may stretch it."""
COURSE_FROM: Final = 2.0
"""m/s from which the course of GPS is shown: Doppler noise of 0.1 m/s is 3 degrees of it."""
FREE_AXES: Final = "east and north as at the start, carried along without turning: a pole is near"
PARTS: Final = 5
"""Of the axis of the headings, between ticks."""


def panels(run: Run) -> list[Panel]:
    """The plots of a run, those that its log supports."""
    found = [
        error_panel(run),
        distance_panel(run),
        drift_panel(run),
        velocity_panel(run, 0),
        velocity_panel(run, 1),
        speed_panel(run),
        heading_panel(run),
        tilt_panel(run),
    ]
    return [panel for panel in found if panel is not None]


# ---- errors ------------------------------------------------------------------------------------


def error_panel(run: Run) -> Panel:
    """Horizontal error against GPS over time, with the circle that was expected."""
    curves = []
    judged = [errors for errors in (run.errors_before, run.errors) if errors is not None]
    own = [p for errors in judged for p in _over_time(run, errors, "", "").parts]
    if run.agreement is not None:
        name = "from all fixes, used or not"
        curves.append(_over_time(run, run.agreement, name, "gps"))
    if own:
        curves.append(Curve(own_name(run), "ours", tuple(own)))
    for name, role in others(run, ("as_published", "free")):
        if name in run.method_errors:
            curves.append(_over_time(run, run.method_errors[name], LEGEND[name], role))
    band = None
    if run.trajectory.sigma_pos is not None:
        t = log_seconds(run, run.trajectory.t_ns)
        band = expected_band(t, run.trajectory.sigma_pos)
    y_range = (0.0, _error_top(curves, band))
    title = "Horizontal error against GPS" if judged else "Expected horizontal error"
    return Panel(
        "error", title, "m", "s", time_range(run), y_range, tuple(curves),
        () if band is None else (band,), spans(run), off_picture(curves, y_range, "m", "s"),
    )  # fmt: skip


def _over_time(run: Run, errors: Errors, name: str, role: str) -> Curve:
    return curve(name, role, log_seconds(run, errors.t_ns), errors.horizontal)


def expected_band(x: Array, sigma_pos: Array) -> Band:
    """What the error stays under with 95 % probability, as a user without GPS knows it."""
    high = radius_95(sigma_pos[:, :2])
    keep = envelope(x, high, BINS)
    return Band("expected, 95 %", x[keep], np.zeros(keep.size), high[keep])


def _error_top(curves: list[Curve], band: Band | None) -> float:
    """Top of the error axis: the own error whole, the others as far as it stays readable."""
    expected = 0.0 if band is None else float(band.high.max())
    own = max((c.largest for c in curves if c.role in ("ours", "gps")), default=expected)
    rest = [min(c.largest, READABLE * own) for c in curves if c.role == "published"]
    return ROOM * max([own, min(expected, EXPECTED * own), *rest, 1e-3])


def off_picture(curves: list[Curve], y_range: tuple[float, float], unit: str, x_unit: str) -> str:
    """Says of each curve that leaves the picture where it does and how far it goes."""
    notes = []
    for item in curves:
        for x, y in item.parts:
            out = (y < y_range[0]) | (y > y_range[1])
            if np.any(out):
                far = number(float(f"{item.largest:.3g}"), 0.1 if item.largest < 100.0 else 1.0)
                notes.append(
                    f"{item.name} leaves the picture at {x[np.argmax(out)]:.0f} {x_unit} and "
                    f"reaches {far} {unit}"
                )
                break
    return "; ".join(notes)


def distance_panel(run: Run) -> Panel | None:
    """Horizontal error over the distance since GPS was last used."""
    if run.errors is None or run.gps.aids or run.errors.distance[-1] < 1.0:
        return None
    errors = run.errors
    own = over_distance(log_seconds(run, errors.t_ns), errors, own_name(run), "ours")
    curves = [own]
    for name, role in others(run, ("as_published", "free")):
        if name in run.method_errors:
            judged = run.method_errors[name]
            t = log_seconds(run, judged.t_ns)
            curves.append(over_distance(t, judged, LEGEND[name], role))
    sigma = errors.states.sigma_pos
    band = None if sigma is None else expected_band(errors.distance, sigma)
    y_range = (0.0, _error_top(curves, band))
    percent = errors.percent_of_distance()
    note = ""
    if percent["max"] is not None:
        note = f"at most {percent['max']:.1f} % of the distance so far, from 200 m on"
    return Panel(
        "error-distance", "Horizontal error over distance", "m", "m",
        (0.0, float(errors.distance[-1])), y_range, tuple(curves),
        () if band is None else (band,), (), note,
    )  # fmt: skip


def over_distance(t: Array, errors: Errors, name: str, role: str) -> Curve:
    """The horizontal error over the distance; t (n,) s of the judged fixes for the cursor."""
    keep = envelope(t, errors.horizontal, BINS)
    part = errors.distance[keep], errors.horizontal[keep]
    return Curve(name, role, (part,), (t[keep],))


def drift_panel(run: Run) -> Panel | None:
    """Growth of the error since the last correction, a line for each leg."""
    if run.errors is None or run.gps.aids or run.errors.drift is None:
        return None
    errors, found = run.errors, run.errors.drift
    t = log_seconds(run, errors.t_ns)[found.index]
    parts, clock = [], []
    for leg in np.unique(found.leg):
        where = np.flatnonzero(found.leg == leg)
        keep = where[envelope(t[where], found.size[where], max(BINS // 10, 1))]
        parts.append((found.since[keep], found.size[keep]))
        clock.append(t[keep])
    lines = Curve("growth of the error, a line for each leg", "ours", tuple(parts), tuple(clock))
    return Panel(
        "drift", "Drift since the last correction", "m", "s", (0.0, float(found.since.max())),
        (0.0, ROOM * max(lines.largest, 1e-3)), (lines,),
        note="Between two stops nothing corrects; at a stop the error keeps its size.",
    )  # fmt: skip


# ---- velocity ----------------------------------------------------------------------------------


def velocity_panel(run: Run, axis: int) -> Panel:
    """A velocity against GPS with and without the procedures: paper 002's figure 1 is east."""
    track = run.trajectory
    curves = []
    north_known = run.alignment.heading_from != "none"
    if run.log.gnss is not None and north_known:
        within = inside(run, run.log.gnss)
        t = log_seconds(run, run.log.gnss.t_ns[within])
        gps = turned(gps_velocity(run.log.gnss), -turning(run.log.gnss))
        curves.append(curve("GPS", "gps", t, gps[within, axis]))
    for name, role in others(run, ("free", "as_published")):
        other = run.variants[name]
        curves.append(
            curve(LEGEND[name], role, log_seconds(run, other.t_ns), _level(run, other)[:, axis])
        )
    own = _level(run, track)[:, axis]
    curves.append(curve(own_name(run), "ours", log_seconds(run, track.t_ns), own))
    y_range = _readable_range([c for c in curves if c.role in ("gps", "ours")])
    name = ("East", "North")[axis]
    note = off_picture(curves, y_range, "m/s", "s")
    if not north_known:
        note = "north is not known: the first heading stands for it; " + note
    if near_pole(run):
        note = f"{FREE_AXES}; {note}"
    return Panel(
        f"{name.lower()}-velocity", f"{name} velocity", "m/s", "s", time_range(run), y_range,
        tuple(curves), (), spans(run), note.rstrip("; "),
    )  # fmt: skip


def _level(run: Run, track: Trajectory) -> Array:
    """(n, 2) m/s: east and north, in free axes where a pole is near."""
    v = track.v_n[:, :2]
    return turned(v, -turning_of(track)) if near_pole(run) else v


def _readable_range(curves: list[Curve]) -> tuple[float, float]:
    """Of the curves that must be seen whole, with some room around."""
    low = min(c.bounds[0] for c in curves if c.parts)
    high = max(c.bounds[1] for c in curves if c.parts)
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


# ---- attitude ----------------------------------------------------------------------------------


def heading_panel(run: Run) -> Panel:
    """Heading, with the course of GPS where it drives."""
    track = run.trajectory
    t = log_seconds(run, track.t_ns)
    polar = near_pole(run)
    own = angles_from_c_nb(track.c_nb)[0] + (turning_of(track) if polar else 0.0)
    own = np.unwrap(own) / DEG
    own -= 360.0 * np.floor(own[0] / 360.0)
    curves = []
    gnss = run.log.gnss
    if gnss is not None and run.alignment.heading_from != "none":
        fast = inside(run, gnss) & (np.hypot(*gps_velocity(gnss).T) > COURSE_FROM)
        if fast.any():
            at = log_seconds(run, gnss.t_ns[fast])
            near = np.interp(at, t, own)
            way = (course(gnss) + turning(gnss))[fast] / DEG
            way = near + np.remainder(way - near + 180.0, 360.0) - 180.0
            curves.append(curve("course by GPS", "gps", at, way))
    curves.append(curve(own_name(run), "ours", t, own))
    low, high = _readable_range(curves)
    turns = "360° is one full turn" if high - low > 400.0 else ""
    if polar:
        turns = "; ".join(text for text in (FREE_AXES, turns) if text)
    return Panel(
        "heading", "Heading", "°", "s", time_range(run), (low, high), tuple(curves), (),
        spans(run), turns, y_step=90.0 * max(1.0, np.ceil((high - low) / 90.0 / PARTS)),
    )  # fmt: skip


def tilt_panel(run: Run) -> Panel:
    """Pitch and roll: hills and banks, and what levelling makes of them."""
    track = run.trajectory
    t = log_seconds(run, track.t_ns)
    _, pitch, roll = angles_from_c_nb(track.c_nb)
    curves = [
        curve("pitch, nose up", "ours", t, pitch / DEG),
        curve("roll, right side down", "second", t, roll / DEG),
    ]
    return Panel(
        "tilt", "Pitch and roll", "°", "s", time_range(run), _readable_range(curves),
        tuple(curves), (), spans(run),
    )  # fmt: skip
