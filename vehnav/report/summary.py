"""What a run prints: one screen for a person."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from vehnav.evaluation import Errors
from vehnav.evaluation.matching import MIN_FIXES, in_intervals
from vehnav.logs.log import Gnss
from vehnav.orientation import Orientation
from vehnav.pipeline import Run
from vehnav.report.causes import causes_lines
from vehnav.report.circle import radius_95
from vehnav.report.document import errors_after_gaps, log_sources
from vehnav.report.filtered import filter_lines
from vehnav.units import DEG, DEG_PER_HOUR, NS

METHOD_NAMES: Final = {
    "free": "free (no correction)",
    "levelling": "levelling only",
    "reset": "velocity reset only",
    "as_published": "both, as published",
    "default": "default",
}


def summary(run: Run) -> str:
    """The screen of ``vehnav run``."""
    blocks = [_input(run), _start(run), _stops(run), filter_lines(run)]
    blocks += [_methods(run), _answer(run), causes_lines(run)]
    return "\n".join(line for block in blocks for line in block)


def answer(run: Run) -> str:
    """One sentence: how far off, after how long, and what GPS was used for."""
    if run.errors is None:
        return _no_judge(run)
    errors = run.errors
    if run.gps.aids:
        return in_outages(errors)
    horizontal = errors.horizontal
    seconds = (errors.t_ns[-1] - errors.t_ns[0]) * NS
    percent = errors.percent_of_distance()["end"]
    share = "" if percent is None else f" ({percent:.1f} % of the distance)"
    return (
        f"{metres(float(horizontal[-1]))} off at the end{share}, {metres(float(horizontal.max()))} "
        f"at most, over {metres(float(errors.distance[-1]))} and {seconds:.0f} s without GPS"
    )


def in_outages(errors: Errors) -> str:
    """How far off where GPS was cut out.

    The fixes that judge an aided run are those of its outages.
    """
    longest = max(outage.length_s for outage in errors.outages)
    many = "1 outage" if len(errors.outages) == 1 else f"{len(errors.outages)} outages"
    most = metres(float(errors.horizontal.max()))
    return f"at most {most} from GPS in {many} of up to {longest:.0f} s"


def rms_and_most(errors: Errors) -> str:
    """Of the horizontal errors, in words."""
    most = float(errors.horizontal.max())
    return f"{metres(errors.horizontal_rms)} rms, {metres(most)} at most"


def metres(value: float) -> str:
    """A length with three digits and its unit.

    >>> [metres(x) for x in (0.034, 5.2, 196.4, 2345.0, 47944.0)]
    ['0.03 m', '5.2 m', '196 m', '2.35 km', '47.9 km']
    """
    if abs(value) >= 999.5:
        return f"{value / 1000.0:.{max(0, 2 - int(math.log10(abs(value) / 1000.0)))}f} km"
    return (
        f"{value:.0f} m"
        if abs(value) >= 99.5
        else f"{value:.1f} m"
        if abs(value) >= 0.95
        else f"{value:.2f} m"
    )


def _no_judge(run: Run) -> str:
    if run.log.gnss is None:
        return "no GPS in the log: nothing to judge the track by"
    if run.errors_before is None:
        return _why_no_judge(run, run.log.gnss)
    before = run.errors_before.horizontal
    return (
        "no GPS fix is left after the start; the part before the first stop, integrated backward, "
        f"is {metres(float(before[0]))} off at the start of the log, {metres(float(before.max()))} "
        "at most"
    )


def _why_no_judge(run: Run, gnss: Gnss) -> str:
    """Why the GPS that there is judges nothing."""
    use, t_ns = run.gps, run.trajectory.t_ns
    if use.aids and not use.cut:
        return "no GPS fix is left to judge the track: all aid it; --outage cuts some out"
    if run.alignment.position_from == "none":
        because = "" if use.used_for else "GPS was not used, and "
        return f"{because}the frame is only local: GPS cannot judge the track"
    since = t_ns[0] if use.until_ns is None else max(t_ns[0], use.until_ns + 1)
    inside = (gnss.t_ns >= since) & (gnss.t_ns <= t_ns[-1])
    if use.cut:
        inside &= in_intervals(gnss.t_ns, use.cut)
    left = int(np.count_nonzero(inside))
    if not left and use.until_ns is not None:
        return "no GPS fix is left to judge the track: all were used for the start"
    if left < MIN_FIXES:
        where = "during the track" if use.until_ns is None else "after the start"
        where = "in the outages" if use.cut else where
        there = "1 GPS fix lies" if left == 1 else f"{left or 'no'} GPS fixes lie"
        return f"{there} {where}: too few to judge the track, which takes {MIN_FIXES}"
    return (
        f"none of {left} GPS fixes can judge the track: it is not where they are, or they are "
        "uncertain or lie in its gaps; vehnav compare says which"
    )


def _input(run: Run) -> list[str]:
    t = run.trajectory
    duration = (t.t_ns[-1] - t.t_ns[0]) * NS
    return [
        f"log        {run.log.path}",
        f"           {log_sources(run.log)}; {axes_text(run.orientation)}",
        f"track      {duration:.1f} s, {metres(t.path_length())}",
    ]


def axes_text(orientation: Orientation) -> str:
    """Letters and mount in force, and what gave them."""
    text = f"axes {orientation.axes}"
    if orientation.accel_axes not in (None, orientation.axes):
        text += f", accelerometer {orientation.accel_axes}"
    if any(orientation.mount):
        roll, pitch, yaw = (x / DEG for x in orientation.mount)
        text += f", mount {roll:+.1f},{pitch:+.1f},{yaw:+.1f} deg"
    return text


def _start(run: Run) -> list[str]:
    a = run.alignment
    bias = " ".join(f"{x / DEG_PER_HOUR:+.0f}" for x in a.gyro_bias)
    place = f"{a.position[0] / DEG:.6f}, {a.position[1] / DEG:.6f} ({a.position_from})"
    heading = f"heading {a.heading / DEG:.1f} deg ({a.heading_from}"
    heading += ")" if a.heading_rms is None else f", {metres(a.heading_rms)} rms)"
    lines = [
        f"start      {place}, {heading}",
        f"           pitch {a.pitch / DEG:+.1f}, roll {a.roll / DEG:+.1f} deg; gyro bias {bias} "
        "deg/h (right forward up)",
    ]
    if a.rest_force is not None:
        lines.append(
            f"           |f| at rest {a.rest_force:.3f} m/s2, gravity {a.gravity:.3f}: bias "
            f"{a.rest_force - a.gravity:+.3f} m/s2 taken out (or scale "
            f"{100.0 * (a.rest_force / a.gravity - 1.0):+.2f} %)"
        )
    if a.local:
        lines.append("           LOCAL FRAME: position or heading are not known")
    use = run.gps
    if use.used_for and use.until_ns is not None:
        until = (use.until_ns - run.start_ns) * NS
        lines.append(
            f"GPS        used for the start {' and '.join(use.used_for)}: {use.fixes_used} fixes "
            f"up to {until:.1f} s; none of them judges"
        )
    elif use.used_for:
        cut = ", none in the outages" if use.cut else ""
        lines.append(
            f"GPS        aids all the way: {use.fixes_used} fixes{cut}; none of them judges"
        )
    elif run.log.gnss is not None:
        lines.append("GPS        not used")
    return lines


def _stops(run: Run) -> list[str]:
    standing = sum(stop.duration for stop in run.stops)
    if not run.stops:
        return ["stops      none"]
    tilts = [record.tilt_corrected / DEG for record in run.records]
    speeds = [record.speed_before_reset for record in run.records]
    return [
        f"stops      {len(run.stops)}, {standing:.0f} s in all; found at them: up to "
        f"{max(speeds):.1f} m/s and {max(tilts):.2f} deg of tilt"
    ]


def _methods(run: Run) -> list[str]:
    if not run.method_errors:
        return []
    lines = ["", f"{'horizontal error':<24}{'rms':>10}{'max':>10}{'end':>10}{'end %':>9}"]
    for name, errors in run.method_errors.items():
        h = errors.statistics()["horizontal_m"]
        if h is None:
            continue
        percent = errors.percent_of_distance()["end"]
        share = "" if percent is None else f"{percent:.1f}"
        figures = "".join(f"{metres(x):>10}" for x in (h.rms, h.max, h.end))
        lines.append(f"{METHOD_NAMES.get(name, name):<24}{figures}{share:>9}")
    return lines


def _answer(run: Run) -> list[str]:
    lines = ["", f"result     {answer(run)}"]
    for gap in errors_after_gaps(run):
        if gap.max_m is not None:
            lines.append(
                f"           from the gap at {gap.start_s:.1f} s to the next stop: "
                f"{metres(gap.max_m)} at most"
            )
    if run.errors is not None and run.errors.states.sigma_pos is not None:
        sigma = run.errors.states.sigma_pos[-1, :2]
        expected = float(radius_95(sigma))
        where = "at the end of the last outage" if run.gps.aids else "without GPS"
        at_the_end = "" if run.gps.aids else " at the end"
        lines.append(f"           expected {where}: {metres(expected)} (95 %){at_the_end}")
    elif run.trajectory.sigma_pos is not None:
        sigma = run.trajectory.sigma_pos[-1, :2]
        expected = float(radius_95(sigma))
        lines.append(f"           expected error at the end: {metres(expected)} (95 %)")
    for row in () if run.errors is None else run.errors.outages:
        if row.max_m is not None and row.end_m is not None:
            lines.append(
                f"outage     {row.start_s:.0f} s, {row.length_s:.0f} s long, "
                f"{metres(row.distance_m)}: {metres(row.max_m)} at most, {metres(row.end_m)} at "
                "the end"
            )
    if run.agreement is not None:
        words = rms_and_most(run.agreement)
        lines.append(f"agreement  {words} from all fixes, used or not; no error figure")
    return lines
