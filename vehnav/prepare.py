"""From the IMU of a log to what the methods work on: body axes, seconds, increments, findings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.clues import GpsBetween
from vehnav.errors import Finding, LogError
from vehnav.logs.log import MIN_IMU_RATE_HZ, Imu, Log
from vehnav.orientation import Declared, Orientation, in_si, orient
from vehnav.stops import (
    SLOW_MEAN,
    Stop,
    StopRule,
    StopStatistics,
    short_start,
    stop_statistics,
    stops_from_statistics,
)
from vehnav.strapdown.increments import (
    Increments,
    gap_steps,
    increments_from_log,
    increments_from_rates,
)
from vehnav.units import DEG, DEG_PER_HOUR, NS, STANDARD_GRAVITY

Array = npt.NDArray[np.float64]

HOPELESS_GAP: Final = 10.0
"""s without IMU: nothing is known about the motion any more (cli.md, Gaps)."""
MIN_SECONDS: Final = 5.0
"""s of IMU below which there is nothing to find."""


@dataclass(frozen=True)
class Samples:
    """The IMU in body axes.

    Attributes
    ----------
    t_ns : (n,) int64
    t : (n,)
        s from the start of the log.
    omega, f : (n, 3)
        rad/s and m/s2 (mean rates over the step where the log has increments).
    increments : Increments
        Over the n-1 steps.
    orientation : Orientation
        Axes, mounting and units, with the evidence.
    statistics : StopStatistics
    stops : list of Stop
    findings : tuple of Finding
    """

    t_ns: npt.NDArray[np.int64]
    t: Array
    omega: Array
    f: Array
    increments: Increments
    orientation: Orientation
    statistics: StopStatistics
    stops: list[Stop]
    findings: tuple[Finding, ...]


def usable_imu(
    imu: Imu | None,
    *,
    path: str,
    contents: Sequence[Mapping[str, Any]],
    start_ns: int | None,
    end_ns: int | None,
) -> Imu:
    """The IMU between two stamps, or LogError with the reason why it cannot be integrated."""
    if imu is None:
        there = ", ".join(f"{row.get('name')} ({row.get('type')})" for row in contents)
        raise LogError(
            f"{path}: no IMU found; it has {there or 'no messages'}. A topic of another type is "
            "chosen by --imu-topic, columns by --columns"
        )
    inside = np.ones(imu.t_ns.size, bool)
    if start_ns is not None:
        inside &= imu.t_ns >= start_ns
    if end_ns is not None:
        inside &= imu.t_ns <= end_ns
    if not np.all(inside):
        imu = replace(imu, t_ns=imu.t_ns[inside], gyro=imu.gyro[inside], accel=imu.accel[inside])
    span = (imu.t_ns[-1] - imu.t_ns[0]) * NS if imu.t_ns.size else 0.0
    if imu.t_ns.size < 10 or span < MIN_SECONDS:
        raise LogError(
            f"{path}: {imu.t_ns.size} IMU samples over {span:.1f} s on {imu.source or 'the IMU'}; "
            f"at least {MIN_SECONDS:g} s are needed (--start, --end?)"
        )
    if imu.rate_hz < MIN_IMU_RATE_HZ:
        raise LogError(
            f"{path}: the IMU {imu.source} runs at {imu.rate_hz:.2f} Hz; instantaneous samples "
            f"below {MIN_IMU_RATE_HZ:g} Hz cannot be integrated, nor stops be told from driving. "
            "Log it at 50 Hz or more"
        )
    return imu


def prepare_samples(
    imu: Imu,
    *,
    path: str,
    start_ns: int,
    declared: Declared,
    max_gap: float,
    rule: StopRule,
    gps: GpsBetween | None = None,
    gps_seconds: float = 60.0,
    coasts: bool = True,
) -> Samples:
    """Turn the samples into the body in SI, integrate them over their steps, name the gaps.

    The stops are found once, on the sensor axes: the statistics are sizes of vectors, which no
    turn of the axes changes, and the evidence for the axes needs them.

    Parameters
    ----------
    imu : Imu
    path : str
        For messages.
    start_ns : int
        Where seconds count from.
    declared : Declared
        What the user says of axes and mounting; the rest is established from the physics.
    max_gap : float
        s
    rule : StopRule
        Of the stops.
    gps : callable or None
        Velocity by GPS between two instants, for the evidence; None: not to be used.
    gps_seconds : float
        s after the first departure that GPS may show before it is asked for more.
    coasts : bool
        Whether the method holds rate and speed over gaps longer than ``max_gap``; one that does
        not says itself what it did there.

    Raises
    ------
    LogError
        Gravity is missing; it contradicts the axes that the format declares and the drive does not
        show the true ones; or over 10 s of IMU are missing.
    """
    t: Array = np.asarray((imu.t_ns - start_ns) * NS, dtype=np.float64)
    gaps = _gap_findings(imu.t_ns, t, path, max_gap, coasts=coasts)
    imu, units, findings = in_si(imu, t, path=path, gps=gps)
    if declared.accel_scale != 1.0:
        imu = replace(imu, accel=imu.accel * declared.accel_scale)
    dt = np.diff(t, prepend=t[0] - imu.median_dt)[:, None]
    as_rates = imu.sampling == "rates"
    gyro, accel = (imu.gyro, imu.accel) if as_rates else (imu.gyro / dt, imu.accel / dt)
    statistics = stop_statistics(t, gyro, accel, rule)
    stops = stops_from_statistics(t, accel, statistics, rule)
    if not stops and (start := short_start(t, gyro, accel, rule)) is not None:
        stops, findings = [start], [*findings, _short_stop(start, imu)]
    orientation = orient(
        imu, t, gyro, accel, stops, declared,
        path=path, units=units, gps=gps, gps_seconds=gps_seconds,
    )  # fmt: skip
    c_gyro, c_accel = orientation.matrices()
    omega, f = gyro @ c_gyro.T, accel @ c_accel.T
    if as_rates:
        increments = increments_from_rates(t, omega, f, max_gap=max_gap)
    else:
        increments = increments_from_log(
            t, imu.gyro @ c_gyro.T, imu.accel @ c_accel.T, max_gap=max_gap
        )
    everything = (*findings, *orientation.findings, *gaps)
    return Samples(imu.t_ns, t, omega, f, increments, orientation, statistics, stops, everything)


def _short_stop(stop: Stop, imu: Imu) -> Finding:
    """The start was taken for a stop, and what level and gyro bias from it are worth."""
    independent = max(1.0, stop.duration / SLOW_MEAN)
    bias = stop.rate / np.sqrt(3.0 * independent) / DEG_PER_HOUR
    level = stop.force / np.sqrt(3.0 * independent) / STANDARD_GRAVITY / DEG
    text = (
        f"no stop of 3 s was found; the first {stop.duration:.1f} s are quiet (the rate varies by "
        f"{stop.rate / DEG:.2f} deg/s, the force by {stop.force:.3f} m/s2) and were taken for one. "
        f"Gyro bias and level rest on them alone: by their noise to {bias:.0f} deg/h and "
        f"{level:.2f} deg, at best; let the vehicle stand for 10 s before it leaves"
    )
    return Finding("short-stop", "warning", text, int(imu.t_ns[0]), int(imu.t_ns[stop.last]))


def hopeless_gaps(t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Indices of the samples before a hole of over 10 s."""
    return np.flatnonzero(np.diff(t_ns) * NS > HOPELESS_GAP)


def split_log(log: Log) -> list[Log]:
    """The parts of a log between holes of over 10 s in the IMU, as logs (``--split``)."""
    if log.imu is None:
        return [log]
    edges = [0, *(hopeless_gaps(log.imu.t_ns) + 1), log.imu.t_ns.size]
    parts = []
    for a, b in pairwise(edges):
        inside = slice(int(a), int(b))
        imu = replace(
            log.imu,
            t_ns=log.imu.t_ns[inside],
            gyro=log.imu.gyro[inside],
            accel=log.imu.accel[inside],
        )
        parts.append(replace(log, imu=imu))
    return parts


def _gap_findings(
    t_ns: npt.NDArray[np.int64], t: Array, path: str, max_gap: float, *, coasts: bool
) -> list[Finding]:
    """One finding per long gap where the method coasts, one for all the short ones."""
    hopeless = hopeless_gaps(t_ns)
    if hopeless.size:
        k = int(hopeless[0])
        raise LogError(
            f"{path}: no IMU between {t[k]:.1f} and {t[k + 1]:.1f} s ({t[k + 1] - t[k]:.1f} s); "
            f"over {HOPELESS_GAP:g} s nothing can be known. --split makes a result of each part, "
            "--start and --end choose one"
        )
    dt = np.diff(t)
    gaps = np.flatnonzero(gap_steps(t))
    long = gaps[dt[gaps] > max_gap]
    short = gaps[dt[gaps] <= max_gap]
    findings = []
    if short.size:
        worst = int(short[np.argmax(dt[short])])
        findings.append(
            Finding(
                "gap",
                "info",
                f"{short.size} short gaps in the IMU, {dt[short].sum():.2f} s in all, the longest "
                f"{dt[worst]:.3f} s at {t[worst]:.1f} s; the values at their edges were held",
                int(t_ns[short[0]]),
                int(t_ns[short[-1] + 1]),
            )
        )
    for k in long if coasts else ():
        findings.append(
            Finding(
                "gap",
                "warning",
                f"no IMU for {dt[k]:.2f} s, over --max-gap {max_gap:g} s: attitude rate and speed "
                "are held",
                int(t_ns[k]),
                int(t_ns[k + 1]),
            )
        )
    return findings
