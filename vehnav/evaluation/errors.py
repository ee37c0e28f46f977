"""The errors of a trajectory against GPS or truth: series, statistics, the tree of the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.earth import local_enu, position_difference
from vehnav.errors import Finding
from vehnav.evaluation.diagnosis import check_place, clock_findings
from vehnav.evaluation.matching import Interval, Matched, match
from vehnav.evaluation.outages import MIN_DISTANCE, Outage, outage_errors
from vehnav.evaluation.reference import course, path_distance
from vehnav.evaluation.segments import Segment, segment_errors
from vehnav.evaluation.statistics import Statistics, statistics
from vehnav.logs.log import Gnss
from vehnav.rotation import angles_from_c_nb
from vehnav.trajectory import Trajectory
from vehnav.units import NS

Array = npt.NDArray[np.float64]

PERCENT_FROM: Final = 200.0
"""m driven before an error is given in percent of it."""


@dataclass(frozen=True)
class Errors:
    """Estimate minus reference at the n judged fixes, with what they add up to.

    Attributes
    ----------
    t_ns : (n,) int64
        Stamps of the judged fixes, the time offset applied.
    lat, lon, height : (n,)
        The reference, rad, rad, m.
    states : Trajectory
        The estimate at the same instants (at the antenna, and aligned if that was asked for).
    east, north, up, along, cross : (n,)
        Position errors, m. Along and cross (to the right) by the course of the reference.
    distance : (n,)
        m driven by the reference since judging began, standing time removed.
    course : (n,)
        Course of the reference, rad; held while it stands.
    velocity : (n, 3) or None
        East, north, up velocity error, m/s, where the reference has velocity.
    heading, pitch, roll : (n,) or None
        Attitude errors, rad, where the reference has attitude.
    reference_sigma : (n, 3) or None
        Standard deviations of the fixes, m, where the receiver gives them.
    time_offset : float
        s, added to the stamps of the GPS.
    align : str
        ``none``, or the alignment that was fitted to the reference before judging.
    counts : mapping
        Fixes: total, judged, and why the others were not judged.
    segments : tuple of Segment
    outages : tuple of Outage
    findings : tuple of Finding
        What was noticed about the pair of inputs.
    methods : mapping
        Filled by the caller: name of a method -> the same figures.
    """

    t_ns: npt.NDArray[np.int64]
    lat: Array
    lon: Array
    height: Array
    states: Trajectory
    east: Array
    north: Array
    up: Array
    along: Array
    cross: Array
    distance: Array
    course: Array
    velocity: Array | None = None
    heading: Array | None = None
    pitch: Array | None = None
    roll: Array | None = None
    reference_sigma: Array | None = None
    time_offset: float = 0.0
    align: str = "none"
    counts: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    segments: tuple[Segment, ...] = ()
    outages: tuple[Outage, ...] = ()
    findings: tuple[Finding, ...] = ()
    methods: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def horizontal(self) -> Array:
        """(n,) m: size of the horizontal error."""
        return np.asarray(np.hypot(self.east, self.north))

    @property
    def percent(self) -> Array:
        """(n,) horizontal error in percent of the distance so far; nan before 200 m."""
        with np.errstate(divide="ignore", invalid="ignore"):
            share = 100.0 * self.horizontal / self.distance
        return np.where(self.distance >= PERCENT_FROM, share, np.nan)

    def statistics(self) -> dict[str, Statistics | None]:
        """The statistics of every series by its name in the report (``heading_deg`` in degrees)."""
        speed = None if self.velocity is None else np.hypot(*self.velocity[:, :2].T)
        series = {
            "horizontal_m": self.horizontal,
            "east_m": self.east,
            "north_m": self.north,
            "up_m": self.up,
            "along_m": self.along,
            "cross_m": self.cross,
            "velocity_m_s": speed,
            "heading_deg": None if self.heading is None else np.degrees(self.heading),
        }
        return {name: None if x is None else statistics(x) for name, x in series.items()}

    def percent_of_distance(self) -> dict[str, float | None]:
        """Horizontal error in percent of the distance: at the end, and the largest after 200 m."""
        driven = float(self.distance[-1])
        late = self.percent[self.distance >= PERCENT_FROM]
        return {
            "end": 100.0 * float(self.horizontal[-1]) / driven if driven >= MIN_DISTANCE else None,
            "max": float(np.max(late)) if late.size else None,
        }

    def reference_sigma_m(self) -> float | None:
        """Horizontal uncertainty of the reference (rms of the fixes' own sigmas), m, or None."""
        if self.reference_sigma is None:
            return None
        return float(np.sqrt(np.mean(np.sum(self.reference_sigma[:, :2] ** 2, axis=1))))

    def to_dict(self) -> dict[str, Any]:
        """The ``errors`` tree of ``report.json``: plain numbers, None where undefined."""
        horizontal = self.horizontal
        return {
            **{name: None if s is None else s.to_dict() for name, s in self.statistics().items()},
            "percent_of_distance": self.percent_of_distance(),
            "distance_m": float(self.distance[-1]),
            "cep50_m": float(np.percentile(horizontal, 50.0)),
            "cep95_m": float(np.percentile(horizontal, 95.0)),
            "reference_sigma_m": self.reference_sigma_m(),
            "segments": [s.to_dict() for s in self.segments],
            "outages": [o.to_dict() for o in self.outages],
            "align": self.align,
            "methods": dict(self.methods),
        }


def compare(
    trajectory: Trajectory,
    gnss: Gnss,
    *,
    judge_from_ns: int | None = None,
    exclude: Sequence[Interval] = (),
    time_offset: float = 0.0,
    lever_arm: npt.ArrayLike | None = None,
    c_nb_reference: Array | None = None,
    outages: Sequence[Interval] = (),
    start_ns: int | None = None,
) -> Errors:
    """Judge a trajectory by GPS or truth.

    Parameters
    ----------
    trajectory : Trajectory
    gnss : Gnss
        The reference: m fixes.
    judge_from_ns : int or None
        Earlier fixes do not judge (the window that GPS was used in), nor does their distance
        count.
    exclude : sequence of (int, int)
        Intervals whose fixes do not judge, ns, both ends included.
    time_offset : float
        s, added to the stamps of the GPS: minus its delay.
    lever_arm : (3,) or None
        Antenna from the vehicle's point, m right-forward-up.
    c_nb_reference : (m, 3, 3) or None
        Attitude of the reference at its fixes, where it has one.
    outages : sequence of (int, int)
        Intervals without GPS for the trajectory, ns, judged one by one.
    start_ns : int or None
        Where the seconds of the outages count from; None: the start of the trajectory.

    Returns
    -------
    Errors

    Raises
    ------
    LogError
        No overlap in time, never closer than 5 km, fewer than three fixes to judge by.
    """
    gnss = replace(gnss, t_ns=gnss.t_ns + np.int64(round(time_offset * 1e9)))
    matched = match(
        trajectory, gnss, judge_from_ns=judge_from_ns, exclude=exclude, lever_arm=lever_arm
    )
    judged = fixes(gnss, matched.index)
    check_place(matched.states.lat, matched.states.lon, judged)
    since = gnss.t_ns[0] if judge_from_ns is None else judge_from_ns
    since = max(int(since), int(trajectory.t_ns[0]))
    errors = _error_series(matched, judged, gnss, since_ns=since)
    c_ref = None if c_nb_reference is None else c_nb_reference[matched.index]
    errors = _with_attitude(errors, c_ref)
    return replace(
        errors,
        time_offset=time_offset,
        findings=clock_findings(trajectory, gnss),
        segments=_segments(errors, c_ref),
        outages=outage_errors(
            errors.t_ns,
            errors.horizontal,
            errors.distance,
            outages,
            start_ns=int(trajectory.t_ns[0]) if start_ns is None else start_ns,
        ),
    )


def fixes(gnss: Gnss, index: npt.NDArray[np.int64]) -> Gnss:
    """Some of the fixes."""
    return replace(
        gnss,
        t_ns=gnss.t_ns[index],
        lat=gnss.lat[index],
        lon=gnss.lon[index],
        height=gnss.height[index],
        v_n=None if gnss.v_n is None else gnss.v_n[index],
        sigma_pos=None if gnss.sigma_pos is None else gnss.sigma_pos[index],
        sigma_vel=None if gnss.sigma_vel is None else gnss.sigma_vel[index],
    )


def _error_series(matched: Matched, judged: Gnss, gnss: Gnss, *, since_ns: int) -> Errors:
    """Position and velocity errors; along and cross by the course of the whole reference."""
    states = matched.states
    east, north = position_difference(
        states.lat, states.lon, judged.lat, judged.lon, judged.height
    ).T
    way = course(gnss)[matched.index]
    path = path_distance(gnss)
    start = float(np.interp((since_ns - gnss.t_ns[0]) * NS, (gnss.t_ns - gnss.t_ns[0]) * NS, path))
    return Errors(
        t_ns=judged.t_ns,
        lat=judged.lat,
        lon=judged.lon,
        height=judged.height,
        states=states,
        east=east,
        north=north,
        up=states.height - judged.height,
        along=east * np.sin(way) + north * np.cos(way),
        cross=east * np.cos(way) - north * np.sin(way),
        distance=np.maximum(path[matched.index] - start, 0.0),
        course=way,
        velocity=None if judged.v_n is None else states.v_n - judged.v_n,
        reference_sigma=judged.sigma_pos,
        counts=MappingProxyType(matched.counts),
    )


def _with_attitude(errors: Errors, c_ref: Array | None) -> Errors:
    """Heading, pitch and roll errors, wrapped to +-180 degrees."""
    if c_ref is None:
        return errors
    own, ref = angles_from_c_nb(errors.states.c_nb), angles_from_c_nb(c_ref)
    heading, pitch, roll = (
        np.remainder(a - b + np.pi, 2.0 * np.pi) - np.pi for a, b in zip(own, ref, strict=True)
    )
    return replace(errors, heading=heading, pitch=pitch, roll=roll)


def _segments(errors: Errors, c_ref: Array | None) -> tuple[Segment, ...]:
    """KITTI segments in the tangent plane at the first judged fix."""
    origin = (float(errors.lat[0]), float(errors.lon[0]), float(errors.height[0]))
    return segment_errors(
        (errors.t_ns - errors.t_ns[0]) * NS,
        errors.distance,
        errors.states.enu(origin),
        local_enu(errors.lat, errors.lon, errors.height, origin=origin),
        c_nb=None if c_ref is None else errors.states.c_nb,
        c_nb_reference=c_ref,
    )
