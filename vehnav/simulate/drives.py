"""Drives that a seed decides: streets, lights, turns, grades."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vehnav.errors import ConfigError
from vehnav.simulate.program import STEP_PEAK, Program, ProgramBuilder
from vehnav.units import DEG

_ENDS = 16.0
"""s for the speed changes and the corner of a block, at most, and the last braking."""


@dataclass(frozen=True)
class CityHabits:
    """How a car drives in a town.

    Attributes
    ----------
    limits : tuple of float
        Speeds of the streets, m/s.
    accel, brake : float
        Peak accelerations, m/s2.
    turn_speed : float
        m/s, at corners.
    turn_rate : float
        Peak yaw rate at corners, rad/s.
    block : (float, float)
        Shortest and longest block, m.
    stop_every : float
        Mean time from one stop to the next, s.
    stop_length : (float, float)
        Shortest and longest stop, s.
    grade : float
        Steepest slope, rad.
    half_size : float
        The drive keeps within this of the middle, m.
    """

    limits: tuple[float, ...] = (9.7, 12.5, 15.3)
    accel: float = 2.2
    brake: float = 2.8
    turn_speed: float = 5.5
    turn_rate: float = 0.45
    block: tuple[float, float] = (140.0, 420.0)
    stop_every: float = 95.0
    stop_length: tuple[float, float] = (6.0, 30.0)
    grade: float = 2.5 * DEG
    half_size: float = 2200.0


def change_length(v0: float, v1: float, peak: float) -> float:
    """Way, m, of a smooth change of speed with the given peak acceleration."""
    return 0.5 * (v0 + v1) * max(STEP_PEAK * abs(v1 - v0) / peak, 1.0)


class CityDriver:
    """Drives block after block, keeping account of where it is (a plane will do for that)."""

    def __init__(self, rng: np.random.Generator, habits: CityHabits, *, heading: float) -> None:
        self.rng = rng
        self.habits = habits
        self.heading = heading
        self.x = self.y = 0.0
        self.way = ProgramBuilder(heading=heading)
        self.next_stop = 0.0

    def drive(self, *, duration: float, first_stop: float, last_stop: float) -> Program:
        """Stand, drive, stand; the last stop fills what is left of the duration."""
        self.way.hold(first_stop)
        self._plan_stop()
        while True:
            left = duration - last_stop - self.way.elapsed
            longest = (left - _ENDS) * self.habits.limits[0]
            if longest < self.habits.block[0]:
                break
            self._block(min(longest, self.habits.block[1]), left)
        if self.way.speed > 0.0:
            self.way.change_speed(0.0, peak=self.habits.brake, grade=0.0)
        fill(self.way, duration)
        program = self.way.build()
        if program.distance == 0.0:
            raise ConfigError(f"{duration:g} s leave no time to drive; lengthen the scenario")
        return program

    def _plan_stop(self) -> None:
        self.next_stop = self.way.elapsed + self.habits.stop_every * self.rng.uniform(0.55, 1.45)

    def _block(self, longest: float, left: float) -> None:
        """One block: speed up, drive, perhaps bend, slow down; perhaps stop; perhaps turn.

        ``longest`` m, and ``left`` s of the drive.
        """
        rng, h = self.rng, self.habits
        length = rng.uniform(h.block[0], longest)
        turn = self._choose_turn(length)
        needed = length / h.limits[0] + 2.0 * _ENDS + h.stop_length[1]
        stops = self.way.elapsed + length / 9.0 > self.next_stop and needed < left
        end = 0.0 if stops else (h.turn_speed if turn else float(rng.choice(h.limits)) * 0.8)
        self._straight(length, end)
        if stops:
            self.way.hold(rng.uniform(*h.stop_length))
            self._plan_stop()
            self.way.change_speed(h.turn_speed, peak=h.accel)
        if turn:
            if self.way.speed > h.turn_speed:
                self.way.change_speed(h.turn_speed, peak=h.brake)
            self.way.turn(turn, yaw_rate=h.turn_rate * rng.uniform(0.8, 1.1), ease=1.2)
            self.heading += turn

    def _straight(self, length: float, end: float) -> None:
        """``length`` m from the present speed to ``end``, as fast as the street allows."""
        h, v0 = self.habits, self.way.speed
        top = float(self.rng.choice(h.limits)) * self.rng.uniform(0.92, 1.05)
        grade = self.rng.uniform(-1.0, 1.0) * h.grade
        while True:
            needed = change_length(v0, top, h.accel) + change_length(top, end, h.brake)
            if needed <= length or top <= max(v0, end) + 0.5:
                break
            top = max(top - 0.5, max(v0, end) + 0.4)
        self.way.change_speed(top, peak=h.accel if top > v0 else h.brake, grade=grade)
        cruise = max(length - needed, 0.0) / top
        if cruise > 8.0 and self.rng.uniform() < 0.6:
            bend = self.rng.uniform(0.05, 0.25) * self.rng.choice((-1.0, 1.0))
            rest = cruise - (abs(bend) / 0.1 + 2.0)
            self.way.hold(0.5 * max(rest, 0.0))
            self.way.turn(bend, yaw_rate=0.1, ease=2.0)
            self.heading += bend
            self.way.hold(0.5 * max(rest, 0.0))
        else:
            self.way.hold(cruise)
        if end < top:
            self.way.change_speed(end, peak=h.brake, grade=0.0 if end == 0.0 else None)
        self.x += length * math.sin(self.heading)
        self.y += length * math.cos(self.heading)

    def _choose_turn(self, length: float) -> float:
        """Turn after a block, rad: none, left or right; never out of the town."""
        corner = 0.5 * math.pi * self.rng.uniform(0.85, 1.15)
        order = self.rng.permutation(3)
        options = [(0.0, corner, -corner)[int(k)] for k in order]

        def outside(turn: float) -> float:
            ahead = self.heading + turn
            x = self.x + length * math.sin(self.heading) + 700.0 * math.sin(ahead)
            y = self.y + length * math.cos(self.heading) + 700.0 * math.cos(ahead)
            return max(abs(x), abs(y)) - self.habits.half_size

        inside = [turn for turn in options if outside(turn) < 0.0]
        return inside[0] if inside else min(options, key=outside)


def fill(way: ProgramBuilder, until: float) -> None:
    """Go on as it is until a time, s; ConfigError when that has passed."""
    rest = until - way.elapsed
    if rest < -1e-6:
        raise ConfigError(f"the scenario needs {-rest:.1f} s more than it is given; lengthen it")
    way.hold(rest)


def town_program(
    rng: np.random.Generator,
    *,
    duration: float,
    speed: float,
    leg: float,
    stop: float,
    first_stop: float,
    heading: float,
) -> Program:
    """Legs of ``leg`` s at ``speed`` with two turns of 45-120 deg, then a stop (spec B 5)."""
    way = ProgramBuilder(heading=heading).hold(first_stop)
    cycle = leg + stop
    while way.elapsed + cycle <= duration + 1e-6:
        begin = way.elapsed
        grade = rng.uniform(-1.0, 1.0) * 2.0 * DEG
        way.change_speed(speed, peak=2.5, grade=grade)
        free = leg - STEP_PEAK * speed * (1.0 / 2.5 + 1.0 / 3.0)
        for _ in range(2):
            angle = rng.uniform(45.0, 120.0) * DEG * rng.choice((-1.0, 1.0))
            way.hold(0.08 * free)
            way.turn(angle, yaw_rate=0.25, ease=2.0)
        fill(way, begin + leg - STEP_PEAK * speed / 3.0)
        way.change_speed(0.0, peak=3.0, grade=0.0)
        fill(way, begin + cycle)
    fill(way, duration)
    return way.build()


def motorway_program(
    rng: np.random.Generator,
    *,
    duration: float,
    speed: float,
    first_stop: float,
    stop_every: float,
    heading: float,
) -> Program:
    """Long bends and small changes of speed; about each ``stop_every`` s (0: never) a stop.

    It begins and ends standing.
    """
    way = ProgramBuilder(heading=heading).hold(first_stop)
    legs = max(1, round((duration - first_stop) / stop_every)) if stop_every > 0.0 else 1
    slot = (duration - first_stop) / legs
    for k in range(1, legs + 1):
        begin_braking = first_stop + k * slot - rng.uniform(12.0, 25.0) - STEP_PEAK * speed / 1.4
        way.change_speed(speed, peak=1.8)
        while way.elapsed + 50.0 < begin_braking:
            _cruise(way, rng, speed)
        fill(way, begin_braking)
        way.change_speed(0.0, peak=1.5, grade=0.0)
        fill(way, first_stop + k * slot)
    return way.build()


def _cruise(way: ProgramBuilder, rng: np.random.Generator, speed: float) -> None:
    """Straight on, then a bend, another speed or another slope; at most 50 s."""
    way.hold(rng.uniform(4.0, 16.0))
    choice = rng.uniform()
    if choice < 0.5:
        bend = rng.uniform(0.1, 0.5) * rng.choice((-1.0, 1.0))
        way.turn(bend, yaw_rate=0.02, ease=4.0)
    elif choice < 0.8:
        way.change_speed(speed * rng.uniform(0.85, 1.1), peak=0.6)
    else:
        way.piece(rng.uniform(6.0, 12.0), grade=rng.uniform(-1.5, 1.5) * DEG)
