"""``run(log, config) -> Run``: the only place that knows the order of the steps.

Samples in body axes -> stops -> start (level, bias; position and heading from GPS or the user) ->
integration with the corrections -> trajectory -> errors against GPS. Each step is a function of
its own module; here they are put one after the other and their findings collected.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.aided import agreement_with_gps, judge_aided, outage_intervals, run_aided
from vehnav.aiding.land import LandResult
from vehnav.choices import (
    METHODS,
    check_levelling_rate,
    corrections_of,
    given_start,
    leg_noise,
    sensor_findings,
    stop_rule,
)
from vehnav.classic import (
    Corrections,
    Drive,
    Outcome,
    Start,
    StopRecord,
    stop_findings,
)
from vehnav.config import Config
from vehnav.earth import ELLIPSOIDS
from vehnav.errors import Finding, LogError, VehnavError
from vehnav.evaluation import Errors, compare
from vehnav.gps_axes import gps_between, with_axes
from vehnav.legs import LegNoise
from vehnav.logs.log import Gnss, Log
from vehnav.logs.restamp import even_stamps
from vehnav.offline import run_stops
from vehnav.orientation import Declared, Orientation
from vehnav.polar import polar_findings, with_coordinates
from vehnav.prepare import Samples, prepare_samples, usable_imu
from vehnav.start import Alignment, GpsUse, find_start
from vehnav.stops import (
    Stop,
    StopRule,
    StopStatistics,
    stopped_mask,
)
from vehnav.trajectory import Trajectory
from vehnav.units import DEG, NS

Array = npt.NDArray[np.float64]

DEFAULTS: Final = Config()
VARIANT_RATE: Final = 10.0
"""Hz at which the tracks of the other methods are kept."""


@dataclass(frozen=True)
class StopSearch:
    """The stops of a log and what they were found in.

    Attributes
    ----------
    samples : Samples
    rule : StopRule
    statistics : StopStatistics
    stops : list of Stop
    """

    samples: Samples
    rule: StopRule
    statistics: StopStatistics
    stops: list[Stop]

    @property
    def stopped(self) -> npt.NDArray[np.bool_]:
        """(n,) whether each sample lies in a stop."""
        return stopped_mask(self.samples.t.size, self.stops)

    def quietest(self) -> dict[str, float]:
        """When the statistics were lowest, and what they were."""
        k = int(np.argmin(self.statistics.margin(self.rule.threshold)))
        return {
            "time_s": float(self.samples.t[k]),
            "rate_deg_s": float(self.statistics.rate[k]) / DEG,
            "force_m_s2": float(self.statistics.force[k]),
        }


@dataclass(frozen=True)
class Run:
    """What a run found.

    Attributes
    ----------
    log : Log
    config : Config
    orientation : Orientation
        Axes, mounting and units in force, with the evidence.
    trajectory : Trajectory
    stops : list of Stop
    records : list of StopRecord
        What each stop showed, and what was done.
    alignment : Alignment
    gps : GpsUse
    errors : Errors or None
        By the fixes that the solution did not use; None where none is left to judge.
    errors_before : Errors or None
        Of the part before the first stop, which is integrated backward.
    method_errors : mapping of str to Errors
        The same judge over the methods of :data:`METHODS`.
    variants : mapping of str to Trajectory
        Their tracks at 10 Hz at most.
    noise : LegNoise or None
        Noise figures from the log's rest that weighed the stops.
    findings : tuple of Finding
    agreement : Errors or None
        With ``--gps aid``: how far the track is from all fixes. Most of them aided, so this is no
        error of the track.
    aided : LandResult or None
        With a filter method: its noise, innovations and parameters.
    """

    log: Log
    config: Config
    orientation: Orientation
    trajectory: Trajectory
    stops: list[Stop]
    records: list[StopRecord]
    alignment: Alignment
    gps: GpsUse
    errors: Errors | None
    errors_before: Errors | None
    method_errors: Mapping[str, Errors]
    variants: Mapping[str, Trajectory]
    noise: LegNoise | None
    findings: tuple[Finding, ...]
    agreement: Errors | None = None
    aided: LandResult | None = None

    @property
    def axes(self) -> str:
        """Letters of the gyro in force."""
        return self.orientation.axes

    @property
    def start_ns(self) -> int:
        """Where seconds count from."""
        return self.log.start_ns


def run(log: Log, config: Config = DEFAULTS) -> Run:
    """Dead reckoning of a log.

    Raises
    ------
    LogError
        The log cannot be used: no IMU, too slow, a hole of over 10 s, no stop.
    ConfigError
        An option does not fit.
    """
    search = search_stops(log, config)
    samples, stops = search.samples, search.stops
    if not stops and config.start_attitude is None and not config.aided:
        raise LogError(no_stop_advice(log.path, search))
    drive = Drive(
        samples.t,
        samples.omega,
        samples.f,
        samples.increments,
        stops,
        ELLIPSOIDS[config.ellipsoid],
        config.vertical,
        "wander absolute"
        if (config.frame, config.azimuth) == ("wander", "absolute")
        else config.frame,
        config.levelling_rate,
    )
    if config.aided:
        return _run_filter(drive, log, config, samples)
    check_levelling_rate(config, samples)
    gnss = log.gnss if config.gps != "none" else None
    noise = leg_noise(drive, config)

    def solve(part: Drive, start: Start, corrections: Corrections) -> Outcome:
        return run_stops(part, start, corrections, noise=noise)

    corrections = corrections_of(config)
    start, alignment, gps, sigmas, start_findings = find_start(
        drive, samples, gnss, given_start(config), corrections, solve
    )
    gps = with_axes(gps, samples, gnss)
    outcome = _solve(drive, start, corrections, noise, sigmas)
    trajectory = with_coordinates(_trajectory(outcome, samples, stops), config)
    variants = _variants(drive, start, noise, sigmas, samples, config, outcome)
    judged = (
        {}
        if log.gnss is None
        else _judge_all(trajectory, variants, log.gnss, gps, config.lever_arm)
    )
    errors, before = judged.pop("", None), judged.pop("before", None)
    findings = [*log.findings, *samples.findings, *start_findings, *sensor_findings(config)]
    findings += stop_findings(stops, outcome.records, samples.t_ns)
    findings += polar_findings(trajectory, config)
    findings += [] if errors is None else list(errors.findings)
    return Run(
        log, config, samples.orientation, trajectory, stops, outcome.records, alignment, gps,
        errors, before, judged, variants, noise, tuple(findings),
    )  # fmt: skip


def _run_filter(drive: Drive, log: Log, config: Config, samples: Samples) -> Run:
    """The same with ``--method filter`` or ``smooth``."""
    aided = run_aided(drive, samples.t_ns, log, config, given_start(config))
    aided = replace(aided, gps=with_axes(aided.gps, samples, log.gnss))
    trajectory = with_coordinates(_trajectory(aided.outcome, samples, aided.stops), config)
    errors = judge_aided(trajectory, log, aided.gps, config.lever_arm)
    agreement = agreement_with_gps(trajectory, log, aided.gps, config.lever_arm)
    findings = [*log.findings, *samples.findings, *aided.findings]
    findings += stop_findings(aided.stops, aided.outcome.records, samples.t_ns)
    findings += polar_findings(trajectory, config)
    findings += [] if errors is None else list(errors.findings)
    return Run(
        log, config, samples.orientation, trajectory, aided.stops, aided.outcome.records,
        aided.alignment, aided.gps, errors, None, {}, {}, None, tuple(findings), agreement,
        aided.result,
    )  # fmt: skip


def run_at_found_offset(log: Log, config: Config = DEFAULTS) -> Run:
    """As :func:`run`, with the delay of the GPS taken out that the track shows.

    One number is fitted to the fixes that judge, and said so: it is on request only. Where GPS
    aids, a track that it pulls along would hide its delay: then a run without it shows the delay.
    """
    alone = replace(config, gps="start", outage=(), aid=_without_gnss(config.aid))
    first = run(log, alone if config.gps == "aid" else config)
    found = None if first.errors is None else first.errors.found_offset
    if found is None or log.gnss is None:
        text = "the delay of the GPS cannot be told from the motion: its stamps were left alone"
        unknown = Finding("gps-offset-unknown", "warning", text)
        first = run(log, config) if config.gps == "aid" else first
        return replace(first, findings=(*first.findings, unknown))
    shifted = replace(log.gnss, t_ns=log.gnss.t_ns + np.int64(round(found.offset / NS)))
    total = log.gps_time_offset + found.offset
    second = run(replace(log, gnss=shifted, gps_time_offset=total), config)
    text = (
        f"{found.offset:+.2f} +- {found.sigma:.2f} s were added to the stamps of the GPS, as the "
        "motion says; that one number comes from the fixes that judge"
    )
    said = Finding("gps-offset-applied", "info", text)
    use = replace(second.gps, used_for=(*second.gps.used_for, "time offset"))
    return replace(second, gps=use, findings=(*second.findings, said))


def _without_gnss(aid: tuple[str, ...] | None) -> tuple[str, ...] | None:
    return None if aid is None else tuple(name for name in aid if name != "gnss")


def search_stops(log: Log, config: Config = DEFAULTS) -> StopSearch:
    """The stops of a log, with the samples they were found in. LogError as :func:`run`."""
    samples = _samples(log, config)
    return StopSearch(samples, stop_rule(config), samples.statistics, samples.stops)


def no_stop_advice(path: str, search: StopSearch) -> str:
    """Why a log without a stop cannot be run, with its quietest moment."""
    quiet = search.quietest()
    return (
        f"{path}: no stop was found, so neither the level nor the gyro bias is known. The quietest "
        f"moment, at {quiet['time_s']:.1f} s, has {quiet['rate_deg_s']:.3f} deg/s (threshold "
        f"{search.rule.threshold / DEG:.2f}) and {quiet['force_m_s2']:.3f} m/s2 (threshold "
        f"{search.statistics.force_threshold:.2f}). Take --method filter, which can start rolling, "
        "or give --start-attitude HEADING,PITCH,ROLL, or raise --stop-threshold if the vehicle "
        "did stand"
    )


# ---- the steps ---------------------------------------------------------------------------------


def _samples(log: Log, config: Config) -> Samples:
    def stamp(seconds: float | None) -> int | None:
        return None if seconds is None else log.start_ns + round(seconds / NS)

    imu = usable_imu(
        log.imu,
        path=log.path,
        contents=log.contents,
        start_ns=stamp(config.start),
        end_ns=stamp(config.end),
    )
    imu, stamps = even_stamps(imu) if config.stamps == "auto" else (imu, [])
    samples = prepare_samples(
        imu,
        path=log.path,
        start_ns=log.start_ns,
        declared=Declared.of_degrees(
            config.axes, config.accel_axes, config.mount, config.accel_scale
        ),
        gps=gps_between(
            None if config.gps == "none" else log.gnss,
            log.start_ns,
            without=outage_intervals(config, log.start_ns, int(imu.t_ns[-1])),
        ),
        max_gap=config.max_gap, rule=stop_rule(config),
        gps_seconds=config.gps_start_seconds, coasts=not config.aided,
    )  # fmt: skip
    return replace(samples, findings=(*stamps, *samples.findings))


def _solve(
    drive: Drive,
    start: Start,
    corrections: Corrections,
    noise: LegNoise,
    sigmas: tuple[float, float],
) -> Outcome:
    return run_stops(
        drive,
        start,
        corrections,
        noise=noise,
        position_sigma=sigmas[0],
        heading_sigma=sigmas[1],
    )


def _trajectory(outcome: Outcome, samples: Samples, stops: list[Stop]) -> Trajectory:
    span = slice(outcome.first, outcome.first + outcome.position.shape[0])
    return Trajectory(
        t_ns=samples.t_ns[span],
        lat=outcome.position[:, 0],
        lon=outcome.position[:, 1],
        height=outcome.position[:, 2],
        v_n=outcome.v_n,
        c_nb=outcome.c_nb,
        stopped=stopped_mask(samples.t_ns.size, stops)[span],
        sigma_pos=outcome.sigma_pos,
        sigma_heading=outcome.sigma_heading,
    )


def _variants(
    drive: Drive,
    start: Start,
    noise: LegNoise,
    sigmas: tuple[float, float],
    samples: Samples,
    config: Config,
    outcome: Outcome,
) -> dict[str, Trajectory]:
    """The tracks of the methods of the table, thinned; nothing to compare without stops."""
    if not drive.stops:
        return {}
    step = max(1, int(1.0 / (VARIANT_RATE * float(np.median(np.diff(drive.t))))))
    tracks = {}
    for name, corrections in METHODS.items():
        corrections = replace(corrections, causal=config.causal)
        same = corrections == corrections_of(config)
        found = outcome if same else _solve(drive, start, corrections, noise, sigmas)
        full = _trajectory(found, samples, drive.stops)
        index = np.unique(np.append(np.arange(0, full.size, step), full.size - 1))
        tracks[name] = full.rows(index)
    return tracks


def _judge_all(
    trajectory: Trajectory, variants: Mapping[str, Trajectory], gnss: Gnss, gps: GpsUse,
    arm: tuple[float, float, float] | None,
) -> dict[str, Errors]:  # fmt: skip
    """Errors of the trajectory (""), before the first stop ("before"), and of the variants.

    A fix that the solution used judges nothing; what no fix can judge is left out.
    """
    judged: dict[str, Errors] = {}
    judge = partial(compare, lever_arm=arm)
    since = None if gps.until_ns is None else gps.until_ns + 1
    try:
        judged[""] = judge(trajectory, gnss, judge_from_ns=since, estimate_offset=True)
        for name, track in variants.items():
            judged[name] = judge(track, gnss, judge_from_ns=since)
    except VehnavError:
        judged.clear()
    first_stop = int(trajectory.t_ns[np.argmax(trajectory.stopped)])
    asked = "units" in gps.used_for  # by fixes from the start of the log on
    if first_stop > trajectory.t_ns[0] and gps.until_ns is not None and not asked:
        with suppress(VehnavError):
            judged["before"] = judge(trajectory, gnss, exclude=[(first_stop, 2**62)])
    return judged
