"""What is in a log, as one document and as one screen (``vehnav info``, ``vehnav check``)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.config import Config
from vehnav.earth import WGS84, normal_gravity
from vehnav.errors import ConfigError, Finding, LogError
from vehnav.evaluation.reference import path_distance
from vehnav.evaluation.stop_score import score_stops
from vehnav.export.atomic import atomic_path
from vehnav.logs.log import Imu, Log
from vehnav.orientation import Orientation
from vehnav.pipeline import StopSearch, no_stop_advice, search_stops
from vehnav.report.document import finding_rows
from vehnav.report.summary import axes_text, metres
from vehnav.toml_text import on_one_line
from vehnav.units import DEG, NS

COUNTS: Final = ("declared", "read", "recovered", "unverified", "bad")
GAP: Final = 1.5
"""Median steps from which a step is a gap (cli.md)."""
MOST_ROWS: Final = 12
"""Topics on the screen; ``--json`` has all."""


@dataclass(frozen=True)
class Inspection:
    """A log looked at.

    Attributes
    ----------
    log : Log
    search : StopSearch or None
        Stops, axes and units; None where the log cannot be navigated.
    problem : str
        Why not, or "".
    accel_scale : float
        By which the accelerometer was multiplied.
    """

    log: Log
    search: StopSearch | None
    problem: str
    accel_scale: float = 1.0

    @property
    def orientation(self) -> Orientation | None:
        """How the sensor sits, where that could be looked at."""
        return None if self.search is None else self.search.samples.orientation

    @property
    def navigable(self) -> bool:
        """Whether ``run`` would take the log as it is."""
        return not self.problem

    @property
    def verdict(self) -> str:
        """In a word: damaged or not navigable (or both), usable with warnings, or sound."""
        bad = ["damaged"] if self.log.damaged else []
        bad += [] if self.navigable else ["not navigable"]
        if bad:
            return ", ".join(bad)
        return "sound" if all(f.level == "info" for f in self.findings) else "usable"

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Of reading, of preparing, and that it cannot be navigated."""
        found = [*self.log.findings]
        if self.search is not None:
            found += self.search.samples.findings
        if self.problem:
            found.append(Finding("not-navigable", "warning", self.problem))
        return tuple(found)


def inspect_log(log: Log, config: Config) -> Inspection:
    """Look at a log as ``run`` would, without integrating; what stops ``run`` is only told."""
    try:
        search = search_stops(log, config)
    except LogError as error:
        return Inspection(log, None, str(error))
    problem = ""
    if not search.stops:
        problem = no_stop_advice(log.path, search)
    return Inspection(log, search, problem, config.accel_scale)


def check_document(inspection: Inspection) -> dict[str, Any]:
    """What is wrong with it, as plain data: the same under the same keys as in all of it."""
    keys = ("file", "integrity", "verdict", "navigable", "problem", "findings")
    found = document(inspection)
    return {key: found[key] for key in keys}


def document(inspection: Inspection) -> dict[str, Any]:
    """All of it as plain data; times in seconds from the start of the log."""
    log, search = inspection.log, inspection.search
    return {
        "file": log.path,
        "start_unix_ns": log.start_ns if log.unix_clock else None,
        "integrity": integrity(log),
        "contents": [dict(row) for row in log.contents],
        "imu": _imu(log),
        "gps": _gps(log),
        "speed": None
        if log.speed is None
        else {"source": log.speed.source, **_steps(log.speed.t_ns, log.start_ns)},
        "stops": None
        if search is None
        else [{"start_s": s.start, "end_s": s.end, "margin": s.margin} for s in search.stops],
        "gps_score": _score(inspection),
        "axes": None if inspection.orientation is None else _axes(inspection.orientation),
        "units": None
        if inspection.orientation is None or inspection.orientation.units is None
        else inspection.orientation.units.to_dict(),
        "verdict": inspection.verdict,
        "navigable": inspection.navigable,
        "problem": inspection.problem or None,
        "findings": finding_rows(inspection.findings, log.start_ns),
    }


def integrity(log: Log) -> dict[str, Any]:
    """Counts of messages or rows: declared, read, recovered, unverified, bad; and the verdict."""
    counts = dict(log.integrity)
    rows = counts.pop("rows", 0)
    base = {name: int(counts.pop(name, rows if name in COUNTS[:2] else 0)) for name in COUNTS}
    return {**base, **counts, "damaged": log.damaged}


def _steps(t_ns: npt.NDArray[np.int64], start_ns: int) -> dict[str, Any]:
    """Count, rate, span and gaps of a clock."""
    dt = np.diff(t_ns) * NS
    found: dict[str, Any] = {
        "count": int(t_ns.size),
        "start_s": float((t_ns[0] - start_ns) * NS) if t_ns.size else None,
        "end_s": float((t_ns[-1] - start_ns) * NS) if t_ns.size else None,
        "rate_hz": None,
        "gaps": 0,
        "longest_step_s": None,
    }
    if dt.size:
        median = float(np.median(dt))
        found |= {
            "rate_hz": 1.0 / median,
            "gaps": int(np.count_nonzero(dt > GAP * median)),
            "longest_step_s": float(dt.max()),
        }
    return found


def _imu(log: Log) -> dict[str, Any] | None:
    imu = log.imu
    if imu is None:
        return None
    return {
        "source": imu.source,
        "frame_id": imu.frame_id,
        "sampling": imu.sampling,
        "axes_declared": imu.axes if imu.axes_declared else None,
        "axes_usual": imu.axes or None,
        **_steps(imu.t_ns, log.start_ns),
    }


def _gps(log: Log) -> dict[str, Any] | None:
    gnss = log.gnss
    if gnss is None:
        return None
    return {
        "source": gnss.source,
        "velocity": gnss.v_n is not None,
        "distance_m": float(path_distance(gnss)[-1]) if gnss.t_ns.size else 0.0,
        "height_m": [float(gnss.height.min()), float(gnss.height.max())],
        "start_lat_deg": float(gnss.lat[0] / DEG),
        "start_lon_deg": float(gnss.lon[0] / DEG),
        **_steps(gnss.t_ns, log.start_ns),
    }


def _score(inspection: Inspection) -> dict[str, Any] | None:
    gnss, search = inspection.log.gnss, inspection.search
    if search is None or gnss is None or gnss.t_ns.size < 3:
        return None
    return score_stops(search.samples.t_ns, search.stopped, gnss).to_dict()


def _axes(orientation: Orientation) -> dict[str, Any]:
    return {
        "axes": orientation.axes,
        "accel_axes": orientation.accel_axes,
        "mount_deg": [x / DEG for x in orientation.mount],
        "evidence": orientation.evidence.to_dict(),
    }


# ---- the screen --------------------------------------------------------------------------------


def screen(inspection: Inspection) -> str:
    """One screen for a person."""
    found, log = document(inspection), inspection.log
    blocks = [
        [f"log        {found['file']}"],
        _integrity_lines(found["integrity"]),
        _content_lines(found["contents"]),
        _record_lines(found),
        _stop_lines(found),
        _axes_lines(inspection.orientation, log.imu),
    ]
    if found["problem"]:
        blocks.append(["", f"NOT NAVIGABLE: {found['problem']}"])
    return "\n".join(line for block in blocks for line in block)


def _integrity_lines(counts: Mapping[str, Any]) -> list[str]:
    words = ", ".join(f"{counts[name]} {name}" for name in COUNTS)
    return [f"integrity  {words}{'; DAMAGED' if counts['damaged'] else ''}"]


def _content_lines(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    lines = []
    for k, row in enumerate(rows[:MOST_ROWS]):
        rate = "" if row.get("rate_hz") is None else f"{row['rate_hz']:.1f} Hz"
        used = f"  <- {row['used_as']}" if row.get("used_as") else ""
        label = "contents" if k == 0 else ""
        name = str(row["name"])
        name = name if len(name) <= 28 else f"{name[:25]}..."
        lines.append(
            f"{label:<11}{name:<29}{row['count']:>9}  {rate:>9}  {row['type']}{used}".rstrip()
        )
        clock = row.get("clock")
        if clock:
            lines.append(
                f"{'':<11}  clock: {clock['stamps']} ({clock['reason']}), "
                f"{clock['gaps']} gaps, {clock['backward']} backward, {clock['repeated']} repeated"
            )
    if len(rows) > MOST_ROWS:
        lines.append(f"{'':<11}and {len(rows) - MOST_ROWS} more (--json)")
    return lines


def _record_lines(found: Mapping[str, Any]) -> list[str]:
    lines = []
    for name, label in (("imu", "IMU"), ("gps", "GPS"), ("speed", "speed")):
        record = found[name]
        if record is None:
            lines.append(f"{label:<11}none")
            continue
        rate = "" if record["rate_hz"] is None else f" at {record['rate_hz']:.2f} Hz"
        text = f"{record['count']}{rate}, {record['start_s']:z.1f} to {record['end_s']:z.1f} s"
        if record["longest_step_s"] is not None:
            text += f", {record['gaps']} gaps, longest step {record['longest_step_s']:.3f} s"
        if name == "gps":
            text += f", {metres(record['distance_m'])} driven"
        if name == "imu":
            text += f", {record['sampling']}"
        lines.append(f"{label:<11}{text}")
    return lines


def _stop_lines(found: Mapping[str, Any]) -> list[str]:
    stops = found["stops"]
    if stops is None:
        return []
    total = sum(stop["end_s"] - stop["start_s"] for stop in stops)
    text = f"stops      {len(stops)}, {total:.0f} s in all"
    if stops:
        shown = ", ".join(f"{s['start_s']:z.0f}-{s['end_s']:z.0f}" for s in stops[:6])
        text += f": {shown}{' ...' if len(stops) > 6 else ''} s"
    score = found["gps_score"]
    if score is None or score["found"] is None:
        return [text]
    wrong = "" if score["wrong"] is None else f", {100.0 * score['wrong']:.1f} % of moving taken"
    return [text, f"           by GPS: {100.0 * score['found']:.0f} % of standing found{wrong}"]


def _axes_lines(orientation: Orientation | None, imu: Imu | None) -> list[str]:
    if orientation is None:
        return []
    evidence, units = orientation.evidence, orientation.units
    source = evidence.source if evidence.certain else "declaration, NOT verified"
    if orientation.axes != evidence.axes:
        source = f"given; the log shows {evidence.axes}"
    elif imu is not None and imu.axes not in ("", orientation.axes):
        source += f"; such files {'declare' if imu.axes_declared else 'usually have'} {imu.axes}"
    lines = [f"axes       {axes_text(orientation).removeprefix('axes ')} (by {source})"]
    lines += [f"           {reason}" for reason in evidence.reasons]
    lines += [f"           DOUBT: {doubt}" for doubt in evidence.doubts]
    if units is None:
        return [*lines, "units      increments, rad and m/s as declared"]
    if units.increments:
        text = "increments, rad and m/s"
    else:
        rate = "" if units.rate is None else f", {units.rate:.3g} in motion (median)"
        text = f"gyro {units.gyro}{rate}; accelerometer {units.accel}, {units.force:.4g} at rest"
    lines.append(f"units      {text}")
    return lines


# ---- calibration -------------------------------------------------------------------------------


def write_calibration(inspection: Inspection, path: Path) -> None:
    """Axes, mounting and scale in force as TOML, for other logs of the car (``--calibration``).

    The scale is gravity, at the place that GPS gives, over the force at rest. One attitude cannot
    tell it from a bias along gravity; without a place or a stop it is left as it is.

    Raises
    ------
    ConfigError
        The log does not show how the sensor sits.
    """
    orientation = inspection.orientation
    if orientation is None or not orientation.evidence.certain:
        raise ConfigError(
            f"{inspection.log.path}: does not show how the sensor sits, so there is no calibration "
            f"to save{': ' + inspection.problem if inspection.problem else ''}"
        )
    lines = ["# How the sensor sits in the vehicle, established by `vehnav info` from"]
    lines += [f"# {on_one_line(Path(inspection.log.path).name)}, by {orientation.evidence.source}."]
    lines += [f"# {on_one_line(reason)}" for reason in orientation.evidence.reasons]
    lines += ["[input]", f'axes = "{orientation.axes}"']
    if orientation.accel_axes is not None:
        lines.append(f'accel_axes = "{orientation.accel_axes}"')
    lines += _measured(inspection, orientation)
    with atomic_path(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _measured(inspection: Inspection, orientation: Orientation) -> list[str]:
    """Mounting and scale, where the log shows them; what it does not show is left open."""
    gnss, rest = inspection.log.gnss, orientation.evidence.rest
    angles = ", ".join(repr(float(x / DEG) + 0.0) for x in orientation.mount)
    lines = [f"mount = [{angles}]  # roll, pitch, yaw, deg"]
    if not rest.stops and not any(orientation.mount):
        lines = ["# mount: not known, the log has no stop"]
    if gnss is None or not gnss.t_ns.size or not rest.stops:
        if inspection.accel_scale != 1.0:
            return [*lines, f"accel_scale = {inspection.accel_scale!r}  # as given"]
        return [*lines, "# accel_scale: not known, it takes a stop and the place by GPS"]
    gravity = normal_gravity(float(gnss.lat[0]), float(gnss.height[0]), WGS84)
    scale = float(inspection.accel_scale * gravity / np.linalg.norm(rest.force))
    return [*lines, f"accel_scale = {scale!r}"]
