"""What ``vehnav compare`` prints: one trajectory in full, several as one table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from vehnav.evaluation import Errors

ROWS = (
    ("horizontal", "m", "horizontal_m"),
    ("east", "m", "east_m"),
    ("north", "m", "north_m"),
    ("up", "m", "up_m"),
    ("along", "m", "along_m"),
    ("cross", "m", "cross_m"),
    ("velocity", "m/s", "velocity_m_s"),
    ("heading", "deg", "heading_deg"),
)
FIGURES = ("rms", "mean", "median", "p95", "max", "end")
WIDE = (
    ("rms m", "horizontal_m.rms"),
    ("p95 m", "horizontal_m.p95"),
    ("max m", "horizontal_m.max"),
    ("end m", "horizontal_m.end"),
    ("along rms", "along_m.rms"),
    ("cross rms", "cross_m.rms"),
    ("v rms m/s", "velocity_m_s.rms"),
    ("head rms", "heading_deg.rms"),
    ("end %", "percent_of_distance.end"),
    ("max %", "percent_of_distance.max"),
)
SEVERAL = 6
"""Parts of a line that a screen is wide enough for."""


def screen(
    files: Sequence[str], results: Sequence[Errors], documents: Sequence[dict[str, Any]]
) -> str:
    """One screen for the files (the last is the reference), their errors and documents."""
    if len(results) == 1:
        lines = [f"{files[0]} against {files[-1]}", *_matched(results[0]), ""]
        return "\n".join([*lines, *_table(documents[0]["errors"]), *_more(documents[0]["errors"])])
    lines = [f"{len(results)} trajectories against {files[-1]}"]
    for path, errors in zip(files[:-1], results, strict=True):
        lines += [f"  {path}", *(f"  {line}" for line in _matched(errors))]
    return "\n".join([*lines, "", *_wide_table(documents)])


def _matched(errors: Errors) -> list[str]:
    """What was compared, and what was done to it first."""
    counts = errors.counts
    left_out = {
        "outside the trajectory": counts["outside"],
        "before judging starts": counts["before"],
        "excluded": counts["excluded"],
        "uncertain by their own sigma": counts["uncertain"],
        "in gaps of the trajectory": counts["in_gaps"],
    }
    why = ", ".join(f"{n} {name}" for name, n in left_out.items() if n)
    span = float(errors.t_ns[-1] - errors.t_ns[0]) * 1e-9
    lines = [
        f"  fixes     {counts['judged']} of {counts['total']} judged"
        + (f" ({why})" if why else ""),
        f"  driven    {errors.distance[-1]:.0f} m in {span:.1f} s",
        _offset_line(errors),
    ]
    sigma = errors.reference_sigma_m()
    if sigma is not None:
        lines.append(
            f"  GPS       {number(sigma)} m uncertain by its own sigma: "
            "smaller errors are not claimed"
        )
    if errors.fit is not None:
        moved = math.hypot(*errors.fit.d[:2].tolist()) if errors.fit.align != "yaw" else 0.0
        text = f"turned {math.degrees(errors.fit.turned):+.2f} deg"
        text += f", moved {number(moved)} m" if moved else ""
        lines.append(
            click.style(f"  ALIGNED   {errors.fit.align}: {text}; not dead reckoning", fg="red")
        )
    return lines


def _offset_line(errors: Errors) -> str:
    line = f"  offset    {errors.time_offset:+.3f} s added to the GPS"
    found = errors.found_offset
    if found is None:
        return line
    return f"{line}; the motion says {found.offset:+.3f} +- {found.sigma:.3f} s"


def _table(tree: dict[str, Any]) -> list[str]:
    """The error table of one trajectory."""
    lines = [" " * 18 + "".join(f"{name:>10}" for name in FIGURES)]
    for name, unit, key in ROWS:
        if tree[key] is not None:
            figures = "".join(f"{number(tree[key][f]):>10}" for f in FIGURES)
            lines.append(f"{name + ' ' + unit:<18}{figures}")
    share = tree["percent_of_distance"]
    return [
        *lines,
        "",
        f"of distance  end {number(share['end'])} %   max {number(share['max'])} %   "
        f"CEP50 {number(tree['cep50_m'])} m   CEP95 {number(tree['cep95_m'])} m",
    ]


def _more(tree: dict[str, Any]) -> list[str]:
    """Segments, drift, outages and sigmas, a line each where there are any."""
    lines = []
    if tree["segments"]:
        parts = [f"{s['length_m']:.0f} m {number(s['percent'])} %" for s in tree["segments"]]
        lines.append("segments     " + "   ".join(parts[:SEVERAL]))
    if tree["drift"] and tree["drift"]["by_time"]:
        rows = tree["drift"]["by_time"]
        parts = [f"{r['after_s']:.0f} s {number(r['median_m'])} m" for r in rows]
        least, most = rows[-1]["legs"], rows[0]["legs"]
        legs = (
            f"(medians of {most} legs)" if least == most else f"(medians, {most} to {least} legs)"
        )
        lines.append("drift after  " + "   ".join(parts[:SEVERAL]) + f"   {legs}")
    for row in tree["outages"]:
        lines.append(
            f"outage       {row['start_s']:.0f} s, {row['length_s']:.0f} s long, "
            f"{row['distance_m']:.0f} m: rms {number(row['rms_m'])}  max {number(row['max_m'])}  "
            f"end {number(row['end_m'])} m  {number(row['percent'])} %"
        )
    if tree["calibration"]:
        shares = " / ".join(f"{100.0 * x:.0f}" for x in tree["calibration"]["circle"])
        lines.append(f"in 1,2,3 sigma {shares} % (honest: 39 / 86 / 99)")
    return lines


def _wide_table(documents: Sequence[dict[str, Any]]) -> list[str]:
    """One line a trajectory."""
    from vehnav.evaluation.metrics import metric

    names = [document["file"] for document in documents]
    width = min(max(len(name) for name in names), 40)
    lines = [" " * width + "".join(f"{title:>11}" for title, _ in WIDE)]
    for name, document in zip(names, documents, strict=True):
        shown = name if len(name) <= width else "..." + name[3 - width :]
        figures = "".join(f"{number(metric(document['errors'], key)):>11}" for _, key in WIDE)
        lines.append(f"{shown:<{width}}{figures}")
    return lines


def number(value: float | None) -> str:
    """Three or four digits.

    >>> number(0.12345), number(-0.0001), number(412.34), number(None)
    ('0.123', '0.000', '412.3', '-')
    """
    if value is None:
        return "-"
    size = abs(value)
    if size >= 1e7:
        return f"{value:.2e}"
    decimals = 0 if size >= 1000.0 else 1 if size >= 100.0 else 2 if size >= 1.0 else 3
    return f"{round(value, decimals) + 0.0:.{decimals}f}"  # + 0.0: no minus before a zero
