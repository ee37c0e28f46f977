"""The filter methods of a run: what GPS may do, the start, the filter, and how it is judged.

``--gps start``: fixes up to ``--gps-start-seconds`` after the first motion aid the filter, the
later ones judge it. ``--gps aid``: all fixes aid but those that ``--outage`` cuts out, and only
these judge it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.aiding.coarse import AT_ONCE, CoarseStart, coarse_start
from vehnav.aiding.error_model import NAVIGATION
from vehnav.aiding.fixes import Fixes
from vehnav.aiding.gaps import bridge_gaps
from vehnav.aiding.known import with_sensor
from vehnav.aiding.land import (
    EPOCH,
    LandResult,
    Tuning,
    Use,
    run_land,
    tuning_from_log,
    with_steady_gyro,
)
from vehnav.aiding.lost import SECONDS
from vehnav.aiding.vehicle import ODO_SCALE
from vehnav.classic import Drive, Outcome
from vehnav.config import Config, outage_spans
from vehnav.earth import normal_gravity
from vehnav.errors import Finding, LogError, VehnavError
from vehnav.evaluation import Errors, compare
from vehnav.logs.log import Gnss, Log
from vehnav.start import Alignment, Given, GpsUse
from vehnav.stops import Stop
from vehnav.trajectory import Trajectory
from vehnav.units import DEG, NS

Array = npt.NDArray[np.float64]
Arm = tuple[float, float, float]

VETO_SPEED: Final = 1.0
"""m/s of GPS over a stop that make it none (spec C 1)."""
VETO_SIGMAS: Final = 3.0
"""Of the scatter of what GPS shows in a stop, by which it must stand out of its own noise."""
CONTRADICTED: Final = {
    "zupt": 0.02, "zaru": 0.1, "nhc": 0.02, "odometer": 0.15, "gnss": 0.1, "gnss velocity": 0.15,
}  # fmt: skip
"""Share of updates beyond two sigma or refused, over which the solution is in doubt: at most half
of it on real logs whose solution is good, twice and more where a sensor or an assumption fails."""
CAUSES: Final = {
    "zupt": "a stop is none, or the solution has gone astray before",
    "zaru": "a stop is none, or the gyro bias changes",
    "nhc": "heading or axes are wrong, or the vehicle slides",
    "odometer": "look at unit and delay of the wheel speed, or leave it out with --aid",
    "gnss": "the fixes are late, jump, or are worse than their sigmas say",
    "gnss velocity": "the fixes are late, or worse than their sigmas say",
}
"""What it may be."""
ENOUGH: Final = 50
"""Updates below which a share says nothing."""
WRONG_SCALE: Final = 0.15
"""Error of the wheel speed's scale over which it is no matter of tyres."""
FEW_FIXES: Final = 3
"""Fixes below which GPS gives no start."""


@dataclass(frozen=True)
class Aided:
    """What a filter method found.

    Attributes
    ----------
    outcome : Outcome
    stops : list of Stop
        Those that GPS did not veto.
    alignment : Alignment
    gps : GpsUse
    result : LandResult
        Innovations, parameters, tuning.
    findings : tuple of Finding
    """

    outcome: Outcome
    stops: list[Stop]
    alignment: Alignment
    gps: GpsUse
    result: LandResult
    findings: tuple[Finding, ...]


def run_aided(
    drive: Drive, t_ns: npt.NDArray[np.int64], log: Log, config: Config, given: Given
) -> Aided:
    """Start, filter and smooth a drive.

    Parameters
    ----------
    drive : Drive
    t_ns : (n,) int64
        Stamps of its instants.
    log : Log
        For GPS and speed.
    config : Config
    given : Given
        What the options say of the start.

    Raises
    ------
    LogError
        Neither a stop nor GPS nor a given attitude says how the vehicle starts.
    """
    origin = log.start_ns
    gnss = log.gnss if config.gps != "none" and log.gnss is not None else None
    cut = outage_intervals(config, origin, int(t_ns[-1])) if config.gps == "aid" else ()
    fixes, until = None, None
    vetoed: list[Finding] = []
    if gnss is not None:
        # even motion from the first sample on is no stop, and GPS does not wait for its end
        early, _ = _usable(gnss, replace(drive, stops=[]), config, origin, cut)
        drive, vetoed = _veto_stops(drive, early)
        fixes, until = _usable(gnss, drive, config, origin, cut)
        drive, more = _veto_stops(drive, fixes)
        vetoed += more
    if fixes is None and not drive.stops and given.attitude is None:
        raise LogError(
            f"{log.path}: no stop was found and no GPS may be used, so nothing says how the "
            "vehicle starts; give --gps-file, or --start-attitude HEADING,PITCH,ROLL"
        )
    known = config.known_sensor
    start = coarse_start(
        drive, fixes, position=given.position, heading=given.heading, attitude=given.attitude,
        gyro_bias=None if known is None else known.gyro.bias or None,
    )  # fmt: skip
    tuning = _tuning(drive, config)
    if start.compassed and known is not None:
        tuning = with_steady_gyro(tuning, known.gyro.bias)
    result = run_land(
        drive, start, tuning,
        fixes=fixes if config.uses("gnss") or config.gps == "start" else None,
        speed=_speed(log, config, origin),
        use=Use(config.uses("zupt"), config.uses("zaru"), config.uses("nhc")),
        smooth=config.method == "smooth",
        absolute=config.azimuth == "absolute",
    )  # fmt: skip
    return Aided(
        result.outcome,
        drive.stops,
        _alignment(drive, t_ns, start, given, fixes),
        _gps_use(fixes, until, cut, config),
        result,
        tuple(
            _gap_findings(drive, t_ns, result, smoothed=config.method == "smooth")
            + vetoed
            + _findings(start, result, fixes, given)
        ),
    )


def judge_aided(
    trajectory: Trajectory, log: Log, use: GpsUse, arm: Arm | None = None
) -> Errors | None:
    """Errors against GPS by the fixes that aided nothing; None where too few are left."""
    if log.gnss is None:
        return None
    try:
        return compare(
            trajectory,
            log.gnss,
            judge_from_ns=None if use.until_ns is None else use.until_ns + 1,
            only=use.cut,
            estimate_offset=not use.aids,
            outages=use.cut or (),
            start_ns=log.start_ns,
            lever_arm=arm,
        )
    except VehnavError:
        return None


def agreement_with_gps(
    trajectory: Trajectory, log: Log, use: GpsUse, arm: Arm | None = None
) -> Errors | None:
    """How far the track is from all fixes, those that aided among them: no error of the track."""
    if log.gnss is None or not use.aids:
        return None
    try:
        return compare(trajectory, log.gnss, lever_arm=arm)
    except VehnavError:
        return None


def outage_intervals(config: Config, start_ns: int, end_ns: int) -> tuple[tuple[int, int], ...]:
    """The stretches of ``--outage`` in ns; a repeated one ends with the log."""
    end = (end_ns - start_ns) * NS
    spans = [span for text in config.outage for span in outage_spans(text, end)]
    return tuple((start_ns + round(a / NS), start_ns + round(b / NS)) for a, b in spans)


def _usable(
    gnss: Gnss, drive: Drive, config: Config, origin: int, cut: tuple[tuple[int, int], ...]
) -> tuple[Fixes | None, int | None]:
    """Fixes that may aid, and up to which stamp they do (None: to the end)."""
    inside = (gnss.t_ns >= origin + round(drive.t[0] / NS)) & (
        gnss.t_ns <= origin + round(drive.t[-1] / NS)
    )
    until = None
    if config.gps == "start":
        at_once = bool(drive.stops) and drive.stops[0].start < drive.t[0] + AT_ONCE
        departure = drive.stops[0].end if at_once else float(drive.t[0])
        until = origin + round((departure + config.gps_start_seconds) / NS)
        inside &= gnss.t_ns <= until
    for a, b in cut:
        inside &= (gnss.t_ns < a) | (gnss.t_ns > b)
    if np.count_nonzero(inside) < FEW_FIXES:
        return None, None
    fixes = Fixes(
        np.asarray((gnss.t_ns - origin) * NS, np.float64), gnss.lat, gnss.lon, gnss.height,
        gnss.v_n, gnss.sigma_pos, gnss.sigma_vel, config.gnss_form,
        config.lever_arm or (0.0, 0.0, 0.0),
    )  # fmt: skip
    return fixes.take(inside), until


def _veto_stops(drive: Drive, fixes: Fixes | None) -> tuple[Drive, list[Finding]]:
    """Without the stops in which GPS shows driving: perfectly even motion feels like rest."""
    if fixes is None:
        return drive, []
    v = fixes.velocity(drive.earth)
    inside = [v[(fixes.t >= stop.start) & (fixes.t <= stop.end)] for stop in drive.stops]
    kept = [stop for stop, of_stop in zip(drive.stops, inside, strict=True) if not _moves(of_stop)]
    if len(kept) == len(drive.stops):
        return drive, []
    text = (
        f"{len(drive.stops) - len(kept)} of {len(drive.stops)} stops were none: GPS shows over "
        f"{VETO_SPEED:g} m/s in them"
    )
    return replace(drive, stops=kept), [Finding("stop-vetoed", "warning", text)]


def _moves(v: Array) -> bool:
    """Whether velocities (k, 2) of fixes are those of motion, not of noise.

    Noise differs from fix to fix, motion does not: the mean product of neighbouring velocities is
    the square of the speed without that of the noise.
    """
    if v.shape[0] < FEW_FIXES:
        return bool(v.size) and float(np.median(np.hypot(v[:, 0], v[:, 1]))) > VETO_SPEED
    products = np.sum(v[1:] * v[:-1], axis=1)
    mean, scatter = float(np.mean(products)), float(np.std(products)) / np.sqrt(products.size)
    return bool(mean > max(VETO_SPEED**2, VETO_SIGMAS * scatter))


def _speed(log: Log, config: Config, origin: int) -> tuple[Array, Array] | None:
    if log.speed is None or not config.uses("odometer"):
        return None
    return np.asarray((log.speed.t_ns - origin) * NS, np.float64), log.speed.speed


def _tuning(drive: Drive, config: Config) -> Tuning:
    """By grade, with the noise of a sensor that is named."""
    tuning = tuning_from_log(drive, tactical=config.tactical)
    known = config.known_sensor
    if known is None:
        return tuning
    return with_sensor(
        tuning,
        name=known.name,
        gyro_noise=known.gyro.noise,
        gyro_walk=known.gyro.drift,
        accel_noise=known.accel.noise,
        accel_walk=known.accel.drift,
    )


def _alignment(
    drive: Drive,
    t_ns: npt.NDArray[np.int64],
    start: CoarseStart,
    given: Given,
    fixes: Fixes | None,
) -> Alignment:
    position_from = "option" if given.position is not None else "gps" if fixes else "none"
    heading_from = "gps" if start.fitted else "gyrocompass" if start.compassed else "none"
    if given.heading is not None:
        heading_from = "option"
    elif given.attitude is not None:
        heading_from = "attitude option"
    gravity = float(normal_gravity(start.position[0], start.position[2], drive.earth))
    return Alignment(
        time_ns=int(t_ns[start.first]),
        position=start.position,
        heading=start.heading,
        pitch=start.pitch,
        roll=start.roll,
        position_from=position_from,
        heading_from=heading_from,
        heading_rms=None,
        gyro_bias=start.gyro_bias,
        rest_force=gravity / start.accel_scale if drive.stops else None,
        gravity=gravity,
    )


def _gps_use(
    fixes: Fixes | None, until: int | None, cut: tuple[tuple[int, int], ...], config: Config
) -> GpsUse:
    if fixes is None:
        return GpsUse()
    used_for, number = ("position", "heading", "aiding"), int(fixes.t.size)
    if config.gps == "aid":
        return GpsUse(used_for, number, cut=cut)
    return GpsUse(used_for, number, until, window_s=config.gps_start_seconds)


def _findings(
    start: CoarseStart, result: LandResult, fixes: Fixes | None, given: Given
) -> list[Finding]:
    findings: list[Finding] = []
    sigmas = result.outcome.sigma_heading
    if start.compassed and sigmas is not None:
        last = float(sigmas[-1]) / DEG
        text = f"the Earth rate at rest gives the heading; its sigma at the end is {last:.1f} deg"
        findings.append(Finding("gyrocompass", "info", text))
    if given.heading is None and given.attitude is None and not (start.fitted or start.compassed):
        text = "no course of GPS shows the heading at the start: the frame is only local"
        findings.append(Finding("local-frame", "warning", text))
    return findings + _doubts(result)


def _gap_findings(
    drive: Drive, t_ns: npt.NDArray[np.int64], result: LandResult, *, smoothed: bool
) -> list[Finding]:
    """What bridges each long gap, what it leaves open, and the heading sigma for it.

    The smoother's sigma does not grow over a gap: both of its sides tell.
    """
    t, coast = drive.t, np.flatnonzero(drive.increments.coast)
    if not coast.size:
        return []
    _, left = bridge_gaps(drive.increments, drive.omega, drive.f)
    first, sigma = result.outcome.first, result.outcome.sigma_heading
    findings = []
    for k in coast:
        text = (
            f"no IMU for {t[k + 1] - t[k]:.2f} s: bridged by a cubic through the rates at its "
            "edges and by the mean of the forces there; this leaves "
            f"{left.attitude[k, 2] / DEG:.1f} deg of heading open"
        )
        if not smoothed and sigma is not None and k >= first:
            after = min(int(np.searchsorted(t, t[k + 1] + EPOCH)), t.size - 1)
            grown = float(sigma[after - first] - sigma[k - first]) / DEG
            text += f", and the heading sigma grew by {max(grown, 0.0):.1f} deg"
        findings.append(Finding("gap", "warning", text, int(t_ns[k]), int(t_ns[k + 1])))
    return findings


def _doubts(result: LandResult) -> list[Finding]:
    """What contradicts the solution: then its sigmas are too small."""
    doubts = []
    for name, row in result.innovations.items():
        all_of_it = row.used + row.rejected
        share = (row.inflated + row.rejected) / max(all_of_it, 1)
        if all_of_it >= ENOUGH and share > CONTRADICTED[name]:
            text = (
                f"{name}: {100.0 * share:.0f} % of the updates contradict the solution (up to "
                f"{100.0 * CONTRADICTED[name]:g} % where all is well): its sigmas are too small; "
                f"{CAUSES[name]}"
            )
            doubts.append(Finding("contradiction", "warning", text))
        if row.set_on:
            times = "once" if row.set_on == 1 else f"{row.set_on} times"
            text = (
                f"{times} all fixes of {SECONDS:g} s were refused and the solution was "
                "set on them: before that it is far off, and its sigmas do not say so"
            )
            doubts.append(Finding("set-on-fixes", "warning", text))
    scale = float(result.parameters[ODO_SCALE - NAVIGATION])
    if "odometer" in result.innovations and abs(scale) > WRONG_SCALE:
        text = (
            f"the wheel speed reads {100.0 * scale:+.0f} % too much: look at its unit, or leave it "
            "out with --aid"
        )
        doubts.append(Finding("odometer-scale", "warning", text))
    return doubts
