"""How the numbers of an IMU become rad/s and m/s2 on body axes: what is declared, checked against
what the physics shows, or established from it where nothing is declared by the user.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.clues import GpsBetween
from vehnav.errors import Finding, LogError
from vehnav.logs.log import Imu
from vehnav.mounting import gravity_contradiction, sensor_to_body
from vehnav.mounting_auto import AxesEvidence, establish_axes
from vehnav.stops import Stop
from vehnav.units import DEG
from vehnav.units_auto import Units, establish_units

Array = npt.NDArray[np.float64]
USUAL: Final = "FLU"
"""Axes that are tried where a file says nothing and the drive shows no forward."""
Angles = tuple[float, float, float]


@dataclass(frozen=True)
class Declared:
    """What the user says of the sensor.

    Attributes
    ----------
    axes, accel_axes : str or None
        Letters; None: not said.
    mount : (roll, pitch, yaw)
        rad; zeros: not said.
    accel_scale : float
        What the numbers of the accelerometer are multiplied with.
    """

    axes: str | None = None
    accel_axes: str | None = None
    mount: Angles = (0.0, 0.0, 0.0)
    accel_scale: float = 1.0

    @classmethod
    def of_degrees(
        cls, axes: str | None, accel_axes: str | None, mount: Angles, accel_scale: float = 1.0
    ) -> Declared:
        """From the options: ``auto`` says nothing, the mount is in degrees."""
        roll, pitch, yaw = (x * DEG for x in mount)
        letters = None if axes == "auto" else axes
        return cls(letters, accel_axes, (roll, pitch, yaw), accel_scale)


@dataclass(frozen=True)
class Orientation:
    """How the sensor sits, what its numbers are, and why.

    Attributes
    ----------
    axes : str
        Letters of the gyro in force.
    accel_axes : str or None
        Letters of the accelerometer where they differ.
    mount : (roll, pitch, yaw)
        rad, in force.
    evidence : AxesEvidence
        What the log shows.
    units : Units or None
        Of the numbers as read; None for increments.
    findings : tuple of Finding
    """

    axes: str
    accel_axes: str | None
    mount: Angles
    evidence: AxesEvidence
    units: Units | None
    findings: tuple[Finding, ...]

    def matrices(self) -> tuple[Array, Array]:
        """C_bs (3, 3) of the gyro and of the accelerometer."""
        return sensor_to_body(self.axes, accel_axes=self.accel_axes, mount=self.mount)


def in_si(
    imu: Imu, t: Array, *, path: str, gps: GpsBetween | None
) -> tuple[Imu, Units | None, list[Finding]]:
    """The IMU in rad/s and m/s2 whatever its numbers were, with a finding where they were not.

    Parameters
    ----------
    imu : Imu
        Increments are taken as declared.
    t : (n,)
        s

    Raises
    ------
    LogError
        Gravity was removed from the accelerometer, or its numbers are no force at all.
    """
    if imu.sampling == "increments":
        return imu, None, []
    units = establish_units(t, imu.gyro, imu.accel, gps=gps)
    source = imu.source or "the IMU"
    if not units.gravity:
        raise LogError(
            f"{path}: {source}: the accelerometer shows {units.force:.3g} m/s2 at rest: gravity "
            "was removed from it, so neither level nor speed can be had. Record the raw "
            "acceleration (not 'linear' or 'user' acceleration), or choose it by --columns"
        )
    in_range = 0.5 < units.force * units.accel_scale / 9.80665 < 2.0
    if not units.increments and not in_range:
        raise LogError(
            f"{path}: {source}: {units.doubt}: neither m/s2 nor g nor mg. Scale the columns, or "
            "choose others by --columns"
        )
    findings = (
        [] if units.as_read else [Finding("unit-inferred", "warning", _inferred(path, imu, units))]
    )
    if units.doubt:
        text = f"{path}: {source}: {units.doubt}; taken as {units.gyro}, {units.accel}"
        findings.append(Finding("unit-doubt", "warning", text))
    if units.as_read:
        return imu, units, findings
    if units.increments:
        return replace(imu, sampling="increments"), units, findings
    gyro, accel = imu.gyro * units.gyro_scale, imu.accel * units.accel_scale
    return replace(imu, gyro=gyro, accel=accel), units, findings


def _inferred(path: str, imu: Imu, units: Units) -> str:
    """What the numbers are, and how that shows."""
    parts = []
    if units.increments:
        parts.append(
            f"the accelerometer shows {units.force:.4g} at rest, gravity times the step: increments"
        )
    if units.accel != "m/s2":
        parts.append(f"the accelerometer shows {units.force:.4g} at rest: {units.accel}")
    if units.gyro != "rad/s":
        parts.append(f"the gyro shows {units.rate:.3g} in motion (median): {units.gyro}")
    how = "" if units.increments else "; --accel-unit and --gyro-unit say it for sure"
    return f"{path}: {imu.source or 'the IMU'}: {'; '.join(parts)}{how}"


def orient(
    imu: Imu,
    t: Array,
    gyro: Array,
    accel: Array,
    stops: list[Stop],
    declared: Declared,
    *,
    path: str,
    units: Units | None,
    gps: GpsBetween | None,
    gps_seconds: float,
) -> Orientation:
    """Axes and mounting in force: the user's, else those that the log shows.

    Parameters
    ----------
    imu : Imu
        Its ``axes`` are what the format declares, or the habit of its kind.
    t : (n,)
        s
    gyro, accel : (n, 3)
        rad/s and m/s2, sensor axes.
    stops : list of Stop
        That the evidence rests on.
    declared : Declared
    units : Units or None
        Of the numbers as read.
    gps : callable or None
        See :func:`vehnav.mounting_auto.establish_axes`.

    Raises
    ------
    LogError
        Gravity contradicts the axes that the format declares, and nothing shows the true ones.
    """
    evidence = establish_axes(
        t, gyro, accel, stops, declared=imu.axes or USUAL, gps=gps, gps_seconds=gps_seconds
    )
    if declared.axes is not None or declared.accel_axes is not None:
        axes = declared.axes or imu.axes or USUAL
        findings = _against(declared, axes, evidence)
        evidence = replace(evidence, gps_until=None)  # it decided nothing
        return Orientation(
            axes, declared.accel_axes, declared.mount, evidence, units, tuple(findings)
        )
    if not evidence.certain:
        _refuse_against_gravity(path, evidence)
    mount = declared.mount if any(declared.mount) else evidence.mount
    findings = _found(imu, evidence)
    return Orientation(evidence.axes, evidence.accel_axes, mount, evidence, units, tuple(findings))


def _refuse_against_gravity(path: str, evidence: AxesEvidence) -> None:
    sign = 1.0 if evidence.accel_axes is None else -1.0
    contradiction = gravity_contradiction(sign * evidence.rest.force, evidence.axes)
    if contradiction is not None:
        raise LogError(
            f"{path}: {contradiction}. Which of them, the drive does not show "
            f"({_weakness(evidence)}). Set --axes"
        )


def _weakness(evidence: AxesEvidence) -> str:
    """Why forward is not established."""
    events = evidence.events
    if not evidence.rest.stops:
        shown = "no stop, so no departure"
    elif not events.count:
        shown = "no departure or arrival in a straight line"
    else:
        shown = (
            f"{events.count} departures and arrivals of {events.speed:.1f} m/s in all, consistency "
            f"{events.consistency:.2f} of 1"
        )
    return f"{shown}; turns and GPS do not decide it"


def _found(imu: Imu, evidence: AxesEvidence) -> list[Finding]:
    """What was established, and what it contradicts.

    A declaration that the drive contradicts is a warning, a custom that it does not follow is not:
    ROS asks for forward-left-up, and many drivers publish what their sensor has.
    """
    if not evidence.certain:
        source = "as the format declares" if imu.axes_declared else "as usual for such files"
        source = source if imu.axes else "assumed, for the file does not say"
        text = (
            f"axes {evidence.axes} {source}: up agrees with gravity, forward is not shown by the "
            f"drive ({_weakness(evidence)}); --axes says it for sure"
        )
        return [Finding("axes-unverified", "warning", text), *_doubts(evidence)]
    roll, pitch, yaw = (x / DEG for x in evidence.mount)
    what = f"axes {evidence.axes}"
    if evidence.accel_axes is not None:
        what += f", accelerometer {evidence.accel_axes} (inverted)"
    if any(evidence.mount):
        what += f", mount roll {roll:+.1f}, pitch {pitch:+.1f}, yaw {yaw:+.1f} deg"
    because = "; ".join(evidence.reasons)
    findings = [Finding("axes-found", "info", f"{what}, by {evidence.source}: {because}")]
    if evidence.accel_axes is not None:
        text = f"the log shows {what} (by {evidence.source}), which were taken; --axes overrules it"
        findings.append(Finding("axes-contradiction", "warning", text))
    elif imu.axes and evidence.axes != imu.axes:
        text = (
            f"{'the format declares' if imu.axes_declared else 'such files usually have'} axes "
            f"{imu.axes}, the log shows {what} (by {evidence.source}), which were taken; --axes "
            "overrules it"
        )
        code = "axes-contradiction" if imu.axes_declared else "axes-unusual"
        findings.append(Finding(code, "warning" if imu.axes_declared else "info", text))
    return findings + _doubts(evidence)


def _against(declared: Declared, axes: str, evidence: AxesEvidence) -> list[Finding]:
    """The user's letters against what the log shows."""
    contradiction = gravity_contradiction(evidence.rest.force, declared.accel_axes or axes)
    if contradiction is not None:
        return [Finding("axes-contradiction", "warning", contradiction)]
    same = axes == evidence.axes and declared.accel_axes in (evidence.accel_axes, axes)
    if not evidence.certain or same or any(declared.mount):
        return []
    shown = evidence.axes
    if evidence.accel_axes is not None:
        shown += f" with an inverted accelerometer ({evidence.accel_axes})"
    text = (
        f"axes {axes} were given, but the log shows {shown}, by {evidence.source}: "
        f"{'; '.join(evidence.reasons)}"
    )
    return [Finding("axes-contradiction", "warning", text)]


def _doubts(evidence: AxesEvidence) -> list[Finding]:
    return [Finding("axes-doubt", "warning", text) for text in evidence.doubts]
