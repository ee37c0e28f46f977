"""The JSON document of a run (``report.json``), as cli.md and the schema beside this file say.

Angles are in degrees and times in seconds from the start of the log, ``start_unix_ns`` anchors
them. A metric is named by its dotted path: ``errors.horizontal_m.max``.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from vehnav._version import __version__
from vehnav.errors import Finding
from vehnav.evaluation import Errors
from vehnav.evaluation.outages import Outage, outage_errors
from vehnav.evaluation.stop_score import gps_speed, speed_inside
from vehnav.export.atomic import atomic_path
from vehnav.logs.log import Gnss, Log
from vehnav.pipeline import Run
from vehnav.report.causes import causes_tree
from vehnav.report.filtered import filter_tree
from vehnav.start import Alignment
from vehnav.units import DEG, DEG_PER_HOUR, NS

VERSION: Final = 1
"""Of the document's form; a change that breaks a reader raises it."""


def document(run: Run) -> dict[str, Any]:
    """The document of a run: plain data, no NaN."""
    start = run.start_ns
    return {
        "version": VERSION,
        "vehnav": __version__,
        "start_unix_ns": start if run.log.unix_clock else None,
        "input": _input(run),
        "config": run.config.to_dict(),
        "alignment": _alignment(run.alignment, start),
        "stops": _stops(run),
        "trajectory": {
            "rows": run.trajectory.size,
            "distance_m": run.trajectory.path_length(),
            "duration_s": float((run.trajectory.t_ns[-1] - run.trajectory.t_ns[0]) * NS),
        },
        "gps": _gps(run, start),
        "noise": _noise(run),
        "filter": filter_tree(run),
        "errors": _errors(run),
        "errors_before_first_stop": _backward(run.errors_before),
    }


def write_document(content: Mapping[str, Any], path: Path) -> None:
    """Write it whole or not at all; ValueError for a NaN."""
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    with atomic_path(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def file_sha256(path: str) -> str | None:
    """Digest of the recording; None where it is a folder."""
    place = Path(path)
    if not place.is_file():
        return None
    with place.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def finding_rows(findings: Sequence[Finding], start_ns: int) -> list[dict[str, Any]]:
    """Findings with times in seconds from the start of the log."""

    def seconds(t_ns: int | None) -> float | None:
        return None if t_ns is None else (t_ns - start_ns) * NS

    return [
        {
            "code": finding.code,
            "level": finding.level,
            "start_s": seconds(finding.start_ns),
            "end_s": seconds(finding.end_ns),
            "text": finding.text,
        }
        for finding in findings
    ]


def _input(run: Run) -> dict[str, Any]:
    log = run.log
    imu = log.imu
    if imu is None:
        raise ValueError("a run has an IMU")
    return {
        "file": log.path,
        "sha256": file_sha256(log.path),
        "imu": {
            "source": imu.source,
            "frame_id": imu.frame_id,
            "samples": int(imu.t_ns.size),
            "rate_hz": imu.rate_hz,
            "sampling": imu.sampling,
        },
        "gps": _source(log.gnss),
        "speed": None
        if log.speed is None
        else {"source": log.speed.source, "samples": int(log.speed.t_ns.size)},
        "axes": run.orientation.axes,
        "accel_axes": run.orientation.accel_axes,
        "mount_deg": [x / DEG for x in run.orientation.mount],
        "axes_evidence": run.orientation.evidence.to_dict(),
        "units": {"gyro": "rad/s", "accel": "m/s2"},
        "units_evidence": None
        if run.orientation.units is None
        else run.orientation.units.to_dict(),
        "unix_clock": log.unix_clock,
        "integrity": {"damaged": log.damaged, **dict(log.integrity)},
        "findings": finding_rows(run.findings, run.start_ns),
    }


def _source(gnss: Gnss | None) -> dict[str, Any] | None:
    if gnss is None:
        return None
    rate = 1.0 / (float(np.median(np.diff(gnss.t_ns))) * NS) if gnss.t_ns.size > 1 else None
    return {"source": gnss.source, "fixes": int(gnss.t_ns.size), "rate_hz": rate}


def _alignment(alignment: Alignment, start_ns: int) -> dict[str, Any]:
    return {
        "time_s": (alignment.time_ns - start_ns) * NS,
        "lat_deg": alignment.position[0] / DEG,
        "lon_deg": alignment.position[1] / DEG,
        "height_m": alignment.position[2],
        "heading_deg": alignment.heading / DEG,
        "pitch_deg": alignment.pitch / DEG,
        "roll_deg": alignment.roll / DEG,
        "position_from": alignment.position_from,
        "heading_from": alignment.heading_from,
        "heading_rms_m": alignment.heading_rms,
        "local_frame": alignment.local,
        "gyro_bias_dph": (alignment.gyro_bias / DEG_PER_HOUR).tolist(),
        "rest_force_m_s2": alignment.rest_force,
        "gravity_m_s2": alignment.gravity,
        "accel_bias_along_gravity_m_s2": None
        if alignment.rest_force is None
        else alignment.rest_force - alignment.gravity,
        "accel_scale_error_instead": None
        if alignment.rest_force is None
        else alignment.rest_force / alignment.gravity - 1.0,
    }


def _stops(run: Run) -> list[dict[str, Any]]:
    speed = None if run.log.gnss is None else gps_speed(run.log.gnss)
    rows = []
    for stop, record in zip(run.stops, run.records, strict=True):
        first = run.start_ns + round(stop.start / NS)
        last = run.start_ns + round(stop.end / NS)
        rows.append(
            {
                "start_s": stop.start,
                "end_s": stop.end,
                "gps_speed_max_m_s": None
                if speed is None
                else speed_inside(speed[0], speed[1], first, last),
                "speed_before_reset_m_s": record.speed_before_reset,
                "tilt_corrected_deg": record.tilt_corrected / DEG,
                "gyro_bias_dph": (record.gyro_bias / DEG_PER_HOUR).tolist(),
                "rate_deg_s": stop.rate / DEG,
                "force_m_s2": stop.force,
                "margin": stop.margin,
            }
        )
    return rows


def _gps(run: Run, start_ns: int) -> dict[str, Any]:
    use, gnss = run.gps, run.log.gnss
    return {
        "used_for": list(use.used_for),
        "fixes": 0 if gnss is None else int(gnss.t_ns.size),
        "fixes_used": use.fixes_used,
        "fixes_judged": 0 if run.errors is None else int(run.errors.t_ns.size),
        "used_until_s": None if use.until_ns is None else (use.until_ns - start_ns) * NS,
        "heading_window_s": use.window_s,
        "heading_window_path_m": use.window_path_m,
        "offset_s": run.log.gps_time_offset,
        "agreement_m": _horizontal(run.agreement)["horizontal_m"],
    }


def _noise(run: Run) -> dict[str, Any] | None:
    if run.noise is None:
        return None
    return {
        "gyro_white_deg_sqrt_s": run.noise.gyro_white / DEG,
        "accel_white_m_s_sqrt_s": run.noise.accel_white,
        "gyro_bias_walk_deg_s_sqrt_s": run.noise.gyro_bias_walk / DEG,
        "accel_bias_m_s2": run.noise.accel_bias,
        "level_deg": run.noise.level / DEG,
    }


def _errors(run: Run) -> dict[str, Any] | None:
    if run.errors is None:
        return None
    methods = {name: _horizontal(errors) for name, errors in run.method_errors.items()}
    after_gaps = [row.to_dict() for row in errors_after_gaps(run)]
    return {
        **run.errors.to_dict(),
        "methods": methods,
        "after_gaps": after_gaps,
        "causes": causes_tree(run),
    }


def errors_after_gaps(run: Run) -> tuple[Outage, ...]:
    """Errors from every long gap in the IMU to the next stop, given separately (cli.md, Gaps)."""
    if run.errors is None:
        return ()
    gaps = [f for f in run.findings if f.code == "gap" and f.level != "info"]
    stops = [run.start_ns + round(stop.start / NS) for stop in run.stops]
    last = int(run.trajectory.t_ns[-1])
    spans = [
        (f.start_ns, next((s for s in stops if s > f.start_ns), last))
        for f in gaps
        if f.start_ns is not None
    ]
    errors = run.errors
    return outage_errors(
        errors.t_ns, errors.horizontal, errors.distance, spans, start_ns=run.start_ns
    )


def _horizontal(errors: Errors | None) -> dict[str, Any]:
    found = None if errors is None else errors.statistics()["horizontal_m"]
    return {"horizontal_m": None if found is None else found.to_dict()}


def _backward(errors: Errors | None) -> dict[str, Any] | None:
    """Errors of the part before the first stop; it ends at the start of the log."""
    if errors is None:
        return None
    horizontal = errors.horizontal[::-1]
    return {
        "fixes_judged": int(horizontal.size),
        "distance_m": float(errors.distance[-1] - errors.distance[0]),
        "horizontal_m": {
            "rms": float(np.sqrt(np.mean(horizontal**2))),
            "max": float(horizontal.max()),
            "end": float(horizontal[-1]),
        },
    }


def log_sources(log: Log) -> str:
    """One line: which topics or columns were used."""
    parts = []
    if log.imu is not None:
        parts.append(f"IMU {log.imu.source} {log.imu.rate_hz:.1f} Hz")
    if log.gnss is not None:
        parts.append(f"GPS {log.gnss.source} {log.gnss.t_ns.size} fixes")
    if log.speed is not None:
        parts.append(f"speed {log.speed.source}")
    return ", ".join(parts)
