"""Judging a trajectory by GPS or truth: the steps in order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from vehnav.earth import in_axes_of, local_enu, position_difference
from vehnav.errors import Finding
from vehnav.evaluation.align import Align, Fit, aligned
from vehnav.evaluation.ape import Relation, ape, evo_statistics, rpe
from vehnav.evaluation.calibration import calibration
from vehnav.evaluation.diagnosis import check_place, clock_findings
from vehnav.evaluation.drift import drift
from vehnav.evaluation.errors import Errors
from vehnav.evaluation.matching import Interval, match
from vehnav.evaluation.outages import outage_errors
from vehnav.evaluation.reference import course, path_distance
from vehnav.evaluation.segments import segment_errors
from vehnav.evaluation.time_offset import TimeOffset, estimate_time_offset
from vehnav.logs.log import Gnss
from vehnav.rotation import angles_from_c_nb
from vehnav.trajectory import Trajectory, interpolate_positions
from vehnav.units import NS

Array = npt.NDArray[np.float64]

SAID_ABOVE: Final = 0.05
"""s: a smaller delay of the GPS is not worth a warning."""


def compare(
    trajectory: Trajectory,
    gnss: Gnss,
    *,
    judge_from_ns: int | None = None,
    exclude: Sequence[Interval] = (),
    only: Sequence[Interval] | None = None,
    time_offset: float | Literal["auto"] = 0.0,
    estimate_offset: bool = False,
    lever_arm: npt.ArrayLike | None = None,
    align: Align = "none",
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
    only : sequence of (int, int) or None
        Intervals outside which no fix judges, ns, both ends included; None: no such limit.
    time_offset : float or "auto"
        s, added to the stamps of the GPS: minus its delay. ``auto``: what the motion says.
    estimate_offset : bool
        Whether to look for the delay of the GPS without applying it.
    lever_arm : (3,) or None
        Antenna from the vehicle's point, m right-forward-up.
    align : {"none", "yaw", "yaw+translation", "full"}
        Fit the trajectory to the reference first.
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
    found = None
    if estimate_offset or time_offset == "auto":
        found = estimate_time_offset(trajectory, gnss)
    if time_offset == "auto":
        shift = 0.0 if found is None else found.offset
        notes = [_unknown_delay()] if found is None else []
    else:
        shift, notes = time_offset, _unapplied(found, time_offset)
    moved = replace(gnss, t_ns=gnss.t_ns + np.int64(round(shift / NS)))
    errors = _series(
        trajectory,
        moved,
        judge_from_ns=judge_from_ns,
        exclude=exclude,
        only=only,
        lever_arm=lever_arm,
        align=align,
        c_nb_reference=c_nb_reference,
    )
    errors = replace(
        errors,
        time_offset=shift,
        found_offset=found,
        drift=drift(
            trajectory,
            errors.t_ns,
            np.column_stack([errors.east, errors.north]),
            errors.distance,
            start_ns=judge_from_ns,
        ),
        outages=outage_errors(
            errors.t_ns,
            errors.horizontal,
            errors.distance,
            outages,
            start_ns=int(trajectory.t_ns[0]) if start_ns is None else start_ns,
        ),
    )
    clocks = clock_findings(trajectory, moved)
    return replace(errors, findings=(*clocks, *notes, *_below_noise(errors)))


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


def _series(
    trajectory: Trajectory,
    gnss: Gnss,
    *,
    judge_from_ns: int | None,
    exclude: Sequence[Interval],
    only: Sequence[Interval] | None,
    lever_arm: npt.ArrayLike | None,
    align: Align,
    c_nb_reference: Array | None,
) -> Errors:
    """Match, align, subtract; the course and the path are those of the whole reference."""
    matched = match(
        trajectory,
        gnss,
        judge_from_ns=judge_from_ns,
        exclude=exclude,
        only=only,
        lever_arm=lever_arm,
    )
    judged = fixes(gnss, matched.index)
    if align in ("none", "yaw"):
        _same_place(trajectory, gnss)
    states, fit = aligned(matched.states, judged.lat, judged.lon, judged.height, align)
    t, path = (gnss.t_ns - gnss.t_ns[0]) * NS, path_distance(gnss)
    since = int(trajectory.t_ns[0]) if judge_from_ns is None else judge_from_ns
    start = float(np.interp((since - gnss.t_ns[0]) * NS, t, path))
    errors = _subtract(states, judged, course(gnss)[matched.index])
    c_ref = None if c_nb_reference is None else c_nb_reference[matched.index]
    errors = replace(
        errors,
        distance=np.maximum(path[matched.index] - start, 0.0),
        fit=None if align == "none" else fit,
        counts=MappingProxyType(matched.counts),
    )
    return _with_poses(_with_attitude(errors, c_ref), c_ref, fit)


def _same_place(trajectory: Trajectory, gnss: Gnss) -> None:
    """LogError where the tracks never come near, the fixes before judging included.

    Free inertial drift reaches kilometres within minutes, but it starts where GPS was.
    """
    inside = (gnss.t_ns >= trajectory.t_ns[0]) & (gnss.t_ns <= trajectory.t_ns[-1])
    near = fixes(gnss, np.flatnonzero(inside))
    lat, lon, _ = interpolate_positions(trajectory, near.t_ns)
    check_place(lat, lon, near)


def _subtract(states: Trajectory, judged: Gnss, way: Array) -> Errors:
    """Position and velocity errors, in the axes of the reference near the poles."""
    v_n, c_nb = (
        in_axes_of(x, states.lat, states.lon, to_lat=judged.lat, to_lon=judged.lon)
        for x in (states.v_n, states.c_nb)
    )
    east, north = position_difference(
        states.lat, states.lon, judged.lat, judged.lon, judged.height
    ).T
    return Errors(
        t_ns=judged.t_ns,
        lat=judged.lat,
        lon=judged.lon,
        height=judged.height,
        states=replace(states, v_n=v_n, c_nb=c_nb),
        east=east,
        north=north,
        up=states.height - judged.height,
        along=east * np.sin(way) + north * np.cos(way),
        cross=east * np.cos(way) - north * np.sin(way),
        distance=np.zeros(east.size),
        course=way,
        velocity=None if judged.v_n is None else v_n - judged.v_n,
        reference_sigma=judged.sigma_pos,
    )


def _with_attitude(errors: Errors, c_ref: Array | None) -> Errors:
    """Heading, pitch and roll errors, wrapped to +-180 degrees, and the calibration."""
    if c_ref is not None:
        own, ref = angles_from_c_nb(errors.states.c_nb), angles_from_c_nb(c_ref)
        heading, pitch, roll = (
            np.remainder(a - b + np.pi, 2.0 * np.pi) - np.pi for a, b in zip(own, ref, strict=True)
        )
        errors = replace(errors, heading=heading, pitch=pitch, roll=roll)
    honest = calibration(
        np.column_stack([errors.east, errors.north, errors.up]),
        errors.states.sigma_pos,
        reference_sigma=errors.reference_sigma,
        heading=errors.heading,
        sigma_heading=errors.states.sigma_heading,
    )
    return replace(errors, calibration=honest)


def _with_poses(errors: Errors, c_ref: Array | None, fit: Fit) -> Errors:
    """KITTI segments, APE and RPE, in the tangent plane at the first judged fix."""
    estimate = errors.states.enu(fit.origin)
    reference = local_enu(errors.lat, errors.lon, errors.height, origin=fit.origin)
    c_nb = None if c_ref is None else errors.states.c_nb
    segments = segment_errors(
        (errors.t_ns - errors.t_ns[0]) * NS,
        errors.distance,
        estimate,
        reference,
        c_nb=c_nb,
        c_nb_reference=c_ref,
    )
    return replace(errors, segments=segments, poses=_poses(estimate, reference, c_nb, c_ref))


def _poses(
    estimate: Array, reference: Array, c_nb: Array | None, c_ref: Array | None
) -> Mapping[str, Any]:
    """APE and RPE (one frame apart, as evo does by default); None where attitude is missing."""

    def figures(function: Any, relation: Relation, *, turned: bool) -> dict[str, float] | None:
        if turned and c_ref is None:
            return None
        error = function(estimate, reference, c_nb=c_nb, c_nb_reference=c_ref, relation=relation)
        return evo_statistics(error)

    return MappingProxyType(
        {
            "ape": {
                "translation_part": figures(ape, "translation_part", turned=False),
                "rotation_angle_deg": figures(ape, "rotation_angle_deg", turned=True),
            },
            "rpe": {
                "point_distance": figures(rpe, "point_distance", turned=False),
                "translation_part": figures(rpe, "translation_part", turned=True),
                "rotation_angle_deg": figures(rpe, "rotation_angle_deg", turned=True),
            },
        }
    )


# ---- findings ------------------------------------------------------------------------------------


def _unknown_delay() -> Finding:
    text = (
        "the delay of the GPS cannot be told from this motion (too few changes of speed and "
        "direction, or too much drift); nothing was added to its stamps"
    )
    return Finding("gps-delay", "warning", text)


def _unapplied(found: TimeOffset | None, applied: float) -> list[Finding]:
    """A finding where the motion asks for another offset than the one applied."""
    if found is None:
        return []
    rest = found.offset - applied
    if abs(rest) <= max(3.0 * found.sigma, SAID_ABOVE):
        return []
    side = "late" if rest < 0.0 else "early"
    text = (
        f"the GPS stamps look {abs(rest):.2f} +- {found.sigma:.2f} s {side}, which is "
        f"{10.0 * abs(rest):.1f} m at 10 m/s and counted as error; "
        f"--gps-time-offset {found.offset:+.2f} (or auto) takes it out"
    )
    return [Finding("gps-delay", "warning", text)]


def _below_noise(errors: Errors) -> list[Finding]:
    """Errors under the reference's own uncertainty are not errors of the trajectory."""
    sigma = errors.reference_sigma_m()
    rms = errors.horizontal_rms
    if sigma is None or rms > sigma:
        return []
    text = (
        f"the horizontal error ({rms:.2f} m rms) is within the GPS's own uncertainty "
        f"({sigma:.2f} m): the trajectory may be better than this, GPS cannot tell"
    )
    return [Finding("below-gps-noise", "info", text)]
