"""Units from rest and motion: what the numbers must be, whatever their header says (logs.md 5).

A resting accelerometer reads gravity, 9.81 m/s2, so its size there names its unit. A gyro has no
such constant; vehicles turn slowly, and the force in turns is the speed times the rate of turn.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.clues import GpsBetween, Rest, by_gps, turns
from vehnav.rest import TimeIntegral, running_deviation, running_mean
from vehnav.stops import FORCE_THRESHOLD, SLOW_MEAN
from vehnav.units import ACCEL_UNITS, DEG, GYRO_UNITS, STANDARD_GRAVITY

Array = npt.NDArray[np.float64]

TOLERANCE: Final = 0.15
"""by which a real accelerometer may be off at rest: logs read -3.4 to +6.7 %."""
NO_GRAVITY: Final = 0.5
"""m/s2 at rest, below which gravity was removed."""
HALF_GRAVITY: Final = 5.0
"""m/s2 at rest, below which it was removed too if the size of the force is not steady."""
STEADY: Final = 0.3
"""by which |f| may leave its value at rest ..."""
STEADY_SHARE: Final = 0.8
"""... for the rest of the time, if it is gravity that it shows."""
SURELY_RADIANS: Final = 0.25
"""Median |rate| in motion below which a gyro cannot be in deg/s: no vehicle moves so straight."""
SURELY_DEGREES: Final = 3.0
"""and above which it cannot be in rad/s: nothing turns by 170 deg/s half of the time."""
PROBABLY_DEGREES: Final = 0.6
"""and above which it is not, unless turns or GPS say otherwise (logs.md 5)."""
TURN_SPEEDS: Final = (0.7, 0.9)
"""m/s by the force in turns, read as rad/s: below the first a slow crawl or a drive in deg/s, above
the second a drive in rad/s, for deg/s would mean over 50 m/s in turns."""
GPS_SECONDS: Final = 120.0
"""s of GPS that are asked."""
TURN_SHARE: Final = 0.15
"""of the variance of the force that turns must explain to be asked."""


@dataclass(frozen=True)
class Units:
    """What the numbers of an IMU are.

    Attributes
    ----------
    gyro, accel : str
        Keys of :data:`vehnav.units.GYRO_UNITS` and ``ACCEL_UNITS``: of the numbers as read.
    increments : bool
        Whether they are increments although the format says rates.
    force : float
        |f| at rest, as read.
    rate : float or None
        Median |rate| in motion, as read; None where nothing moves.
    gravity : bool
        Whether gravity is in the force at all.
    doubt : str
        Why a unit is not certain, or "".
    gps_until : float or None
        s: the last fix that decided the unit of the gyro; None where none did.
    """

    gyro: str
    accel: str
    increments: bool
    force: float
    rate: float | None
    gravity: bool
    doubt: str = ""
    gps_until: float | None = None

    @property
    def gyro_scale(self) -> float:
        """Factor to rad/s."""
        return GYRO_UNITS[self.gyro]

    @property
    def accel_scale(self) -> float:
        """Factor to m/s2."""
        return ACCEL_UNITS[self.accel]

    @property
    def as_read(self) -> bool:
        """Whether the numbers are what the reader took them for."""
        return self.gyro == "rad/s" and self.accel == "m/s2" and not self.increments

    def to_dict(self) -> dict[str, Any]:
        """Plain data for reports."""
        return {
            "gyro": self.gyro,
            "accel": self.accel,
            "increments": self.increments,
            "rest_force_as_read": self.force,
            "moving_rate_as_read": self.rate,
            "gps_used_until_s": self.gps_until,
        }


def establish_units(t: Array, gyro: Array, accel: Array, *, gps: GpsBetween | None = None) -> Units:
    """Units of numbers that were read as rad/s and m/s2.

    Parameters
    ----------
    t : (n,)
        s
    gyro, accel : (n, 3)
        As read.
    gps : callable or None
        Velocity by GPS between two instants; asked for the first two minutes, and only where rate
        and turns leave the gyro open.
    """
    rest = quietest(t, gyro, accel)
    force = float(np.linalg.norm(rest.force))
    mean = running_mean(t, accel, SLOW_MEAN)
    size = np.linalg.norm(mean, axis=1)
    steady = float(np.mean(np.abs(size / max(force, 1e-12) - 1.0) < STEADY)) >= STEADY_SHARE
    dt = float(np.median(np.diff(t)))
    accel_unit = next(
        (
            unit
            for unit, factor in ACCEL_UNITS.items()
            if abs(force * factor / STANDARD_GRAVITY - 1.0) <= TOLERANCE
        ),
        None,
    )
    if accel_unit in (None, "m/s2") or not steady:
        accel_unit = "m/s2"
    increments = steady and abs(force / (STANDARD_GRAVITY * dt) - 1.0) <= TOLERANCE
    if increments:
        return Units("rad/s", "m/s2", True, force, None, True)
    gravity = accel_unit != "m/s2" or force >= (NO_GRAVITY if steady else HALF_GRAVITY)
    scale = ACCEL_UNITS[accel_unit]
    rest = replace(rest, force=rest.force * scale)
    moving = running_deviation(t, mean * scale, 2.0) > FORCE_THRESHOLD
    unit, rate, doubt, until = _gyro_unit(t, gyro, accel * scale, rest, moving, gps)
    if accel_unit == "m/s2" and abs(force / STANDARD_GRAVITY - 1.0) > TOLERANCE:
        doubt = f"the accelerometer reads {force:.3g} at rest, which is no unit of gravity"
    return Units(unit, accel_unit, False, force, rate, gravity, doubt, until)


def quietest(t: Array, gyro: Array, accel: Array) -> Rest:
    """Force and rate in the quietest 5 % of 2 s windows: no unit need be known.

    Quiet is where the force varies least; the medians over those windows of their means.
    """
    edges = np.arange(t[0], t[-1] - 2.0, 2.0)
    if edges.size == 0:
        return Rest(np.asarray(accel.mean(axis=0)), np.asarray(gyro.mean(axis=0)), 0, 0.0)
    centred = accel - accel.mean(axis=0)
    square = np.sum(centred**2, axis=1)[:, None]
    columns = np.concatenate([accel, gyro, centred, square], axis=1)
    means = TimeIntegral(t, columns).mean(edges, edges + 2.0)
    variance = means[:, 9] - np.sum(means[:, 6:9] ** 2, axis=1)
    calm = np.argsort(variance, kind="stable")[: max(1, edges.size // 20)]
    force, rate = np.median(means[calm, :3], axis=0), np.median(means[calm, 3:6], axis=0)
    return Rest(np.asarray(force), np.asarray(rate), 0, 0.0)


def _gyro_unit(
    t: Array,
    gyro: Array,
    f: Array,
    rest: Rest,
    moving: npt.NDArray[np.bool_],
    gps: GpsBetween | None,
) -> tuple[str, float | None, str, float | None]:
    """(unit, median rate in motion, doubt, last instant of GPS that decided)."""
    if np.mean(moving) * (t[-1] - t[0]) < 5.0:
        return "rad/s", None, "", None
    slow = running_mean(t, gyro, SLOW_MEAN)
    rate = float(np.median(np.linalg.norm(slow[moving] - rest.rate, axis=1)))
    if rate < SURELY_RADIANS:
        return "rad/s", rate, "", None
    if rate > SURELY_DEGREES:
        return "deg/s", rate, "", None
    turned = turns(t, gyro, f, rest, [])
    if turned is not None and turned.share >= TURN_SHARE:
        if turned.speed > TURN_SPEEDS[1]:
            return "rad/s", rate, "", None
        if turned.speed < TURN_SPEEDS[0]:
            return "deg/s", rate, "", None
    motion = None if gps is None else gps(float(t[0]), float(t[0]) + GPS_SECONDS)
    clue = None if motion is None else by_gps(t, gyro, f, rest, motion)
    if clue is not None and abs(clue.parity) > 0.7:
        slope = float(np.linalg.norm(clue.gyro_slope))
        return ("deg/s" if slope > DEG**-0.5 else "rad/s"), rate, "", clue.until
    doubt = f"the gyro reads {rate:.2f} in motion: too fast for rad/s, too slow for deg/s"
    return ("deg/s" if rate > PROBABLY_DEGREES else "rad/s"), rate, doubt, None
