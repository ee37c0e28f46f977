"""The tables of the page that judge: methods, drift, segments, sigmas, the sensor at rest."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.evaluation.calibration import EXPECTED_1D, EXPECTED_2D
from vehnav.pipeline import Run
from vehnav.report.circle import radius_95
from vehnav.report.figures import log_seconds, own_method
from vehnav.report.markup import esc, table
from vehnav.report.summary import METHOD_NAMES, metres
from vehnav.rest import white_noise
from vehnav.units import DEG, DEG_PER_HOUR, DEG_PER_SQRT_HOUR, M_S_PER_SQRT_HOUR

Array = npt.NDArray[np.float64]

REST_AFTER: Final = 1.0
"""s into a stop, and before its end, from which the sensor is taken to rest."""


def methods_table(run: Run) -> str:
    """Every method by the same judge."""
    if not run.method_errors:
        return ""
    rows: list[list[str]] = []
    marked = None
    for name, errors in run.method_errors.items():
        found = errors.statistics()["horizontal_m"]
        if found is None:
            continue
        percent = errors.percent_of_distance()["end"]
        marked = len(rows) if name == own_method(run) else marked
        figures = [metres(x) for x in (found.rms, found.p95, found.max, found.end)]
        share = "" if percent is None else f"{percent:.1f}"
        rows.append([esc(METHOD_NAMES.get(name, name)), *figures, share])
    head = ["horizontal error", "rms", "95 %", "largest", "at the end", "% of distance"]
    return table(head, rows, name="Methods", marked=marked)


def drift_table(run: Run) -> str:
    """Growth of the error after a time and after a distance since the last correction."""
    if run.errors is None or run.gps.aids or run.errors.drift is None:
        return ""
    found = run.errors.drift
    rows = [
        [f"{row.after:g} {unit}", str(row.legs), metres(row.median_m), metres(row.max_m)]
        for unit, part in (("s", found.by_time), ("m", found.by_distance))
        for row in part
    ]
    head = ["after", "legs so long", "median", "largest"]
    return table(head, rows, name="Drift since the last correction")


def segments_table(run: Run) -> str:
    """Relative errors over lengths of road, as the KITTI benchmark has them."""
    if run.errors is None or not run.errors.segments:
        return ""
    turned = any(s.deg_per_m is not None for s in run.errors.segments)
    rows = [
        [f"{s.length_m:g} m", str(s.count), f"{s.percent:.2f} %"]
        + ([f"{s.deg_per_m:.4f}" if s.deg_per_m is not None else ""] if turned else [])
        for s in run.errors.segments
    ]
    head = ["length", "segments", "error", *(["°/m"] if turned else [])]
    return table(head, rows, name="Errors over lengths of road")


def outages_table(run: Run) -> str:
    """What was bridged without GPS, one by one."""
    if run.errors is None or not run.errors.outages:
        return ""

    def cell(value: float | None) -> str:
        return "–" if value is None else metres(value)

    rows = [
        [
            f"{o.start_s:.1f} s",
            f"{o.length_s:.1f} s",
            metres(o.distance_m),
            cell(o.rms_m),
            cell(o.max_m),
            cell(o.end_m),
            "–" if o.percent is None else f"{o.percent:.1f} %",
        ]
        for o in run.errors.outages
    ]
    head = ["from", "length", "driven", "rms", "largest", "at the end", "of distance"]
    return table(head, rows, name="Outages")


def calibration_table(run: Run) -> str:
    """Whether the expected errors are honest: shares inside them against those of theory."""
    if run.errors is None or run.errors.calibration is None:
        return ""
    found = run.errors.calibration
    percent = [f"{100.0 * x:.0f} %" for x in found.circle]
    rows = [["horizontal", *percent, ""]]
    for name, shares in found.inside.items():
        if name == "up" and run.config.vertical == "clamp" and run.aided is None:
            continue  # the height is held: the solution claims nothing of it
        rms = f"{found.rms[name]:.2f}"
        rows.append([esc(name), *(f"{100.0 * x:.0f} %" for x in shares), rms])
    rows.append(["normal errors, horizontal", *(f"{100.0 * x:.0f} %" for x in EXPECTED_2D), ""])
    rows.append(["normal errors, one axis", *(f"{100.0 * x:.0f} %" for x in EXPECTED_1D), "1"])
    head = ["inside", "1 sigma", "2 sigma", "3 sigma", "rms of error / sigma"]
    return table(head, rows, name="Are the expected errors honest?")


def inside_share(run: Run) -> float | None:
    """Share of the judged fixes inside the expected 95 % circle."""
    if run.errors is None or run.errors.states.sigma_pos is None:
        return None
    radius = radius_95(run.errors.states.sigma_pos[:, :2])
    return float(np.mean(run.errors.horizontal <= radius))


# ---- the sensor at rest ------------------------------------------------------------------------


def sensor_table(run: Run) -> str:
    """Noise of every sensor axis while the vehicle stood, and what changed between stops."""
    imu = run.log.imu
    if imu is None or not run.stops:
        return ""
    t = log_seconds(run, imu.t_ns)
    step = np.diff(t, prepend=t[0] - imu.median_dt)[:, None]
    scale = 1.0 / step if imu.sampling == "increments" else 1.0
    gyro, accel = imu.gyro * scale, imu.accel * scale
    spans = rest_spans(run, t)
    if not spans:
        return ""
    white_gyro, white_accel = white_noise(t, gyro, spans), white_noise(t, accel, spans)
    mean_gyro = np.array([gyro[a : b + 1].mean(axis=0) for a, b in spans])
    mean_accel = np.array([accel[a : b + 1].mean(axis=0) for a, b in spans])
    rows = []
    for k, axis in enumerate("xyz"):
        rows.append(
            [
                f"sensor {axis}",
                _figure(white_gyro[k] / DEG_PER_SQRT_HOUR, 3),
                _figure(_spread(mean_gyro[:, k]) / DEG_PER_HOUR, 1),
                _figure(white_accel[k] / M_S_PER_SQRT_HOUR, 4),
                f"{mean_accel[:, k].mean():+.3f}".replace("-", "−"),
            ]
        )
    head = [
        "axis", "gyro noise °/√h", "gyro from stop to stop °/h", "accelerometer noise m/s/√h",
        "force at rest m/s²",
    ]  # fmt: skip
    return table(head, rows, name="The sensor at rest")


def rest_spans(run: Run, t: Array) -> list[tuple[int, int]]:
    """First and last sample of the rest inside every stop, its edges left out."""
    spans = []
    for stop in run.stops:
        a = int(np.searchsorted(t, stop.start + REST_AFTER, side="left"))
        b = int(np.searchsorted(t, stop.end - REST_AFTER, side="right")) - 1
        if b > a + 1:
            spans.append((a, b))
    return spans


def _spread(values: Array) -> float:
    """Standard deviation over the stops; nan of a single one."""
    return float(np.std(values, ddof=1)) if values.size > 1 else float("nan")


def _figure(value: float, decimals: int) -> str:
    return f"{value:.{decimals}f}" if np.isfinite(value) else "–"


def fit_note(document: Mapping[str, Any]) -> str:
    """How the noise figures weigh the stops."""
    noise = document["noise"]
    if noise is None:
        return ""
    return (
        f"Taken for the drive: gyro {noise['gyro_white_deg_sqrt_s'] * DEG / DEG_PER_SQRT_HOUR:.2f} "
        f"°/√h, accelerometer {noise['accel_white_m_s_sqrt_s'] / M_S_PER_SQRT_HOUR:.2f} m/s/√h and "
        f"{noise['accel_bias_m_s2']:g} m/s² of bias, level {noise['level_deg']:.2f}°: driving is "
        "noisier than rest."
    )
