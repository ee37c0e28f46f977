"""A driving program: speed, yaw rate and grade that change by smooth steps.

A program is a row of pieces. Within a piece of length T each quantity goes from its old value to
its new one as y = y0 + (y1 - y0) S(s), s = (t - t0) / T, with the step polynomial

    S(s) = 35 s^4 - 84 s^5 + 70 s^6 - 20 s^7,

whose first three derivatives vanish at both ends: acceleration, jerk and the derivative of jerk
are continuous, and the heading, the integral of the yaw rate, is known in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

STEP_PEAK: Final = 35.0 / 16.0
"""Largest slope of S: a change of dy within T has the peak rate 2.1875 dy / T."""


@dataclass(frozen=True)
class ProgramState:
    """Quantities of a program at n instants: SI and radians, dots are time derivatives."""

    speed: Array
    speed_dot: Array
    speed_ddot: Array
    heading: Array
    yaw_rate: Array
    yaw_rate_dot: Array
    grade: Array
    grade_dot: Array

    def take(self, index: slice | npt.NDArray[np.int64]) -> ProgramState:
        """Some of the instants."""
        return ProgramState(**{name: x[index] for name, x in vars(self).items()})


@dataclass(frozen=True)
class Program:
    """Pieces of a drive.

    Attributes
    ----------
    durations : (m,)
        s, each positive. Before the first and after the last piece speed, yaw rate and grade
        stay as they are there.
    speed, yaw_rate, grade : (m + 1,)
        Values at the joints: m/s; rad/s, clockwise; rad, up.
    heading : float
        At t = 0, rad.
    """

    durations: Array
    speed: Array
    yaw_rate: Array
    grade: Array
    heading: float = 0.0

    def __post_init__(self) -> None:
        m = self.durations.size
        if m == 0 or not np.all(self.durations > 0.0):
            raise ValueError("a program needs pieces of positive duration")
        for name in ("speed", "yaw_rate", "grade"):
            if getattr(self, name).shape != (m + 1,):
                raise ValueError(f"{name}: a program of {m} pieces has {m + 1} joints")

    @property
    def joints(self) -> Array:
        """(m + 1,) s: when the pieces begin, and the end of the last."""
        return np.concatenate([[0.0], np.cumsum(self.durations)])

    @property
    def duration(self) -> float:
        """Length of the program, s."""
        return float(np.sum(self.durations))

    @property
    def distance(self) -> float:
        """Length of the way, m: the mean speed of a smooth step is the mean of its ends."""
        return float(np.sum(0.5 * (self.speed[1:] + self.speed[:-1]) * self.durations))

    def state(self, t: Array) -> ProgramState:
        """Everything at instants ``t`` (n,), s, closed form."""
        joints = self.joints
        k = np.clip(np.searchsorted(joints, t, side="right") - 1, 0, self.durations.size - 1)
        length = self.durations[k]
        s_free = (t - joints[k]) / length
        s = np.clip(s_free, 0.0, 1.0)
        s2 = s * s
        s3 = s2 * s
        step = s2 * s2 * (35.0 + s * (-84.0 + s * (70.0 - 20.0 * s)))
        slope = 140.0 * s3 * (1.0 - s) ** 3 / length
        bend = 420.0 * s2 * (1.0 - s) ** 2 * (1.0 - 2.0 * s) / length**2
        area = s2 * s3 * (7.0 + s * (-14.0 + s * (10.0 - 2.5 * s))) * length
        outside = (s_free - s) * length

        d_speed, d_yaw, d_grade = (np.diff(y)[k] for y in (self.speed, self.yaw_rate, self.grade))
        yaw0 = self.yaw_rate[k]
        turned = 0.5 * (self.yaw_rate[1:] + self.yaw_rate[:-1]) * self.durations
        heading0 = self.heading + np.concatenate([[0.0], np.cumsum(turned)])[k]
        yaw_rate = yaw0 + d_yaw * step
        return ProgramState(
            speed=self.speed[k] + d_speed * step,
            speed_dot=d_speed * slope,
            speed_ddot=d_speed * bend,
            heading=heading0 + yaw0 * s * length + d_yaw * area + yaw_rate * outside,
            yaw_rate=yaw_rate,
            yaw_rate_dot=d_yaw * slope,
            grade=self.grade[k] + d_grade * step,
            grade_dot=d_grade * slope,
        )

    def standing(self, t: Array) -> npt.NDArray[np.bool_]:
        """(n,) bool: inside a piece that begins and ends at rest."""
        joints = self.joints
        k = np.clip(np.searchsorted(joints, t, side="right") - 1, 0, self.durations.size - 1)
        k = np.where(t >= joints[-1], self.durations.size, k)
        at_rest = np.append(
            (self.speed[1:] == 0.0) & (self.speed[:-1] == 0.0), self.speed[-1] == 0.0
        )
        return np.asarray(np.where(t < 0.0, self.speed[0] == 0.0, at_rest[k]), bool)


class ProgramBuilder:
    """Writes a program piece by piece; every method returns the builder."""

    def __init__(self, *, heading: float = 0.0, speed: float = 0.0) -> None:
        self._heading = heading
        self._durations: list[float] = []
        self._elapsed = 0.0
        self._joints: list[tuple[float, float, float]] = [(speed, 0.0, 0.0)]

    @property
    def elapsed(self) -> float:
        """Duration so far, s."""
        return self._elapsed

    @property
    def speed(self) -> float:
        """Speed at the last joint, m/s."""
        return self._joints[-1][0]

    def piece(
        self,
        duration: float,
        *,
        speed: float | None = None,
        yaw_rate: float | None = None,
        grade: float | None = None,
    ) -> ProgramBuilder:
        """One piece; what is not given stays as it is."""
        old = self._joints[-1]
        new = tuple(
            o if n is None else n for o, n in zip(old, (speed, yaw_rate, grade), strict=True)
        )
        self._durations.append(duration)
        self._elapsed += float(duration)
        self._joints.append((new[0], new[1], new[2]))
        return self

    def hold(self, duration: float) -> ProgramBuilder:
        """Keep everything as it is; nothing is written for a duration that rounds to zero."""
        return self.piece(duration) if duration > 1e-9 else self

    def change_speed(
        self, speed: float, *, peak: float, grade: float | None = None
    ) -> ProgramBuilder:
        """To ``speed`` with the peak acceleration ``peak`` (m/s2, positive)."""
        change = abs(speed - self.speed)
        if change < 1e-9 and grade is None:
            return self
        return self.piece(max(STEP_PEAK * change / peak, 1.0), speed=speed, grade=grade)

    def turn(self, angle: float, *, yaw_rate: float, ease: float = 1.0) -> ProgramBuilder:
        """By ``angle`` (rad, clockwise) at constant speed, with the peak ``yaw_rate`` (positive).

        The yaw rate rises and falls within ``ease`` s each; a small angle lowers its peak.
        """
        if angle == 0.0:
            return self
        held = abs(angle) / yaw_rate - ease
        rate = np.sign(angle) * (yaw_rate if held >= 0.0 else abs(angle) / ease)
        self.piece(ease, yaw_rate=float(rate))
        self.hold(max(held, 0.0))
        return self.piece(ease, yaw_rate=0.0)

    def build(self) -> Program:
        """The program."""
        speed, yaw_rate, grade = np.array(self._joints).T
        return Program(
            durations=np.array(self._durations),
            speed=speed,
            yaw_rate=yaw_rate,
            grade=grade,
            heading=self._heading,
        )
