"""A route becomes a driving program: smooth corners, speeds that the curves allow, stops.

The way is built leg after leg from where the vehicle really is, so that the small deviations at
corners do not add up. A corner is driven at constant speed; its path leaves one leg and meets the
next tangentially, at equal distances from the point.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from vehnav.earth import WGS84, Ellipsoid
from vehnav.errors import FormatError
from vehnav.simulate.polyline import (
    SHORTEST_LEG,
    moved,
    offset,
    simplified,
    turn_between,
    without_sharp_turns,
)
from vehnav.simulate.program import STEP_PEAK, Program, ProgramBuilder
from vehnav.simulate.waypoints import Route

_SLOWEST = 1.5
"""m/s at the tightest corners."""
_RAMP = 1.5
"""s over which the slope changes."""


@dataclass(frozen=True)
class RouteHabits:
    """How a vehicle drives along a route.

    Attributes
    ----------
    speed : float
        Limit, m/s.
    accel, brake, across : float
        Peak accelerations forward, backward and to the side, m/s2.
    yaw_rate, ease : float
        Largest yaw rate (rad/s) and the time (s) it takes to rise.
    first_stop, last_stop : float
        s standing at the ends.
    stop_every, stop_length : float
        s from one stop to the next (0: none but those of the route), and how long each is.
    cut : float
        m by which a corner may be cut.
    tolerance : float
        m: points of the route nearer than this to the line of their neighbours are left out.
    """

    speed: float = 13.9
    accel: float = 2.0
    brake: float = 2.5
    across: float = 2.5
    yaw_rate: float = 0.45
    ease: float = 1.2
    first_stop: float = 40.0
    last_stop: float = 20.0
    stop_every: float = 120.0
    stop_length: float = 15.0
    cut: float = 4.0
    tolerance: float = 3.0


@dataclass(frozen=True)
class Corner:
    """How a point of the route is passed.

    Attributes
    ----------
    speed : float
        m/s, constant through the turn.
    stop : float
        s to stand before it; 0: none.
    """

    speed: float
    stop: float


def turn_reach(angle: float, speed: float, yaw_rate: float, ease: float) -> float:
    """Distance, m, from the corner at which a turn of :meth:`ProgramBuilder.turn` begins and ends.

    The path is symmetric, so its chord lies on the bisector: chord = 2 reach cos(angle / 2).
    """
    x, y, _ = turn_path(angle, speed, yaw_rate, ease)
    return math.hypot(x, y) / (2.0 * math.cos(0.5 * angle))


def turn_path(
    angle: float, speed: float, yaw_rate: float, ease: float
) -> tuple[float, float, float]:
    """(right, ahead, duration) of a turn: m, m, s; by quadrature of its closed-form heading."""
    if angle == 0.0:
        return 0.0, 0.0, 0.0
    program = ProgramBuilder(speed=speed).turn(angle, yaw_rate=yaw_rate, ease=ease).build()
    x, w = np.polynomial.legendre.leggauss(24)
    joints = program.joints
    half = 0.5 * np.diff(joints)[:, None]
    t = joints[:-1, None] + half * (x + 1.0)
    heading = program.state(t.ravel()).heading
    weights = speed * (half * w).ravel()
    return float(weights @ np.sin(heading)), float(weights @ np.cos(heading)), program.duration


def corner_room(angle: float, shorter_leg: float, habits: RouteHabits) -> float:
    """How far from a corner, m, a turn may begin.

    An arc that begins at the distance d cuts the corner by d tan(angle / 4).
    """
    cut = habits.cut / max(math.tan(0.25 * abs(angle)), 1e-9)
    return min(0.45 * shorter_leg, cut)


def corner_speed(angle: float, room: float, limit: float, habits: RouteHabits) -> float:
    """Fastest speed, m/s, at which a turn fits into ``room`` m on either side of the corner."""

    def fits(v: float) -> bool:
        return turn_reach(angle, v, corner_rate(v, habits), habits.ease) <= room

    if abs(angle) < 1e-6 or fits(limit):
        return limit
    low, high = _SLOWEST, limit
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low


def corner_rate(speed: float, habits: RouteHabits) -> float:
    """Peak yaw rate, rad/s, that the side acceleration allows."""
    return min(habits.yaw_rate, habits.across / speed)


# ---- plan and drive ----------------------------------------------------------------------------


def plan_corners(route: Route, habits: RouteHabits, *, earth: Ellipsoid = WGS84) -> list[Corner]:
    """Speeds at the inner points, low enough to be reached and braked to, and the stops."""
    n = route.lat.size
    points = [(float(a), float(b)) for a, b in zip(route.lat, route.lon, strict=True)]
    legs = [offset(*a, *b, 0.0, earth) for a, b in itertools.pairwise(points)]
    lengths = [math.hypot(*leg) for leg in legs]
    headings = [math.atan2(*leg) for leg in legs]
    limits = [min(habits.speed, float(s)) for s in route.speed]
    corners: list[Corner] = []
    reaches = [0.0]
    since_stop = 0.0
    for k in range(1, n - 1):
        since_stop += 1.3 * lengths[k - 1] / limits[k - 1]
        stop = float(route.stop[k])
        if not stop and habits.stop_every > 0.0 and since_stop > habits.stop_every:
            stop = habits.stop_length if lengths[k - 1] > 60.0 else 0.0
        if stop:
            since_stop = 0.0
        limit = min(limits[k - 1], limits[k], 4.0 if stop else math.inf)
        angle = turn_between(headings[k - 1], headings[k])
        room = corner_room(angle, min(lengths[k - 1], lengths[k]), habits)
        v = corner_speed(angle, room, limit, habits)
        corners.append(Corner(v, stop))
        reaches.append(turn_reach(angle, v, corner_rate(v, habits), habits.ease))
    reaches.append(0.0)
    free = [length - sum(reaches[k : k + 2]) for k, length in enumerate(lengths)]
    return _reachable(corners, free, habits)


def _reachable(corners: list[Corner], free: list[float], habits: RouteHabits) -> list[Corner]:
    """Speeds lowered until each can be reached from the one before and braked to the next.

    A smooth change of speed takes ``STEP_PEAK`` / 2 of |v1^2 - v0^2| / a; ``free``: the straight
    parts of the legs, m.
    """
    speeds = [0.0, *(c.speed for c in corners), 0.0]
    stands = [True, *(bool(c.stop) for c in corners), True]
    gain = [2.0 / STEP_PEAK * max(length, 0.0) for length in free]
    for k in range(1, len(speeds) - 1):
        if not stands[k]:
            top = math.sqrt(speeds[k - 1] ** 2 + gain[k - 1] * habits.accel)
            speeds[k] = min(speeds[k], top)
    for k in range(len(speeds) - 2, 0, -1):
        end = 0.0 if stands[k + 1] else speeds[k + 1]
        speeds[k] = min(speeds[k], math.sqrt(end**2 + gain[k] * habits.brake))
    return [Corner(max(v, _SLOWEST), c.stop) for v, c in zip(speeds[1:-1], corners, strict=True)]


class RouteDriver:
    """Writes the program of a route, keeping account of where the vehicle is."""

    def __init__(self, route: Route, habits: RouteHabits, *, earth: Ellipsoid = WGS84) -> None:
        self.route, self.habits, self.earth = route, habits, earth
        self.lat, self.lon = float(route.lat[0]), float(route.lon[0])
        self.height = float(route.height[0]) if route.height is not None else 0.0
        self.heading = self._towards(1)[0]
        self.grade = 0.0
        self.way = ProgramBuilder(heading=self.heading)

    def drive(self) -> Program:
        """From the first point to the last."""
        habits, n = self.habits, self.route.lat.size
        self.way.hold(habits.first_stop)
        for k, corner in enumerate(plan_corners(self.route, habits, earth=self.earth), start=1):
            limit = min(habits.speed, float(self.route.speed[k - 1]))
            angle, reach = self._planned_turn(k, corner.speed)
            run_up = ramp_length(0.0, corner.speed, habits.accel) if corner.stop else 0.0
            length = max(self._towards(k)[1] - reach - run_up, 0.0)
            self._straight(length, 0.0 if corner.stop else corner.speed, limit, k)
            if corner.stop:
                self.way.hold(corner.stop)
                self._straight(run_up, corner.speed, corner.speed, k)
            self._turn(angle)
        limit = min(habits.speed, float(self.route.speed[n - 2]))
        self._straight(self._towards(n - 1)[1], 0.0, limit, n - 1)
        self.way.hold(habits.last_stop)
        return self.way.build()

    def _towards(self, k: int) -> tuple[float, float]:
        """(heading, distance) of a point of the route from here."""
        east, north = offset(
            self.lat,
            self.lon,
            float(self.route.lat[k]),
            float(self.route.lon[k]),
            self.height,
            self.earth,
        )
        return math.atan2(east, north), math.hypot(east, north)

    def _planned_turn(self, k: int, speed: float) -> tuple[float, float]:
        """(angle, reach) of the turn at point k that makes for the point after it."""
        lat, lon = float(self.route.lat[k]), float(self.route.lon[k])
        east, north = offset(
            lat,
            lon,
            float(self.route.lat[k + 1]),
            float(self.route.lon[k + 1]),
            self.height,
            self.earth,
        )
        angle = turn_between(self.heading, math.atan2(east, north))
        return angle, turn_reach(angle, speed, corner_rate(speed, self.habits), self.habits.ease)

    def _straight(self, length: float, end: float, limit: float, k: int) -> None:
        """``length`` m ahead, ending at speed ``end``; the slope makes for the height of k."""
        h, v0 = self.habits, self.way.speed
        if length < (0.5 if v0 + end == 0.0 else 1e-6):
            return
        if self.route.height is not None and length > 30.0:
            rise = float(self.route.height[k]) - self.height
            self.grade = max(-0.15, min(0.15, math.atan2(rise, length)))
        top = fastest(length, v0, end, limit, h)
        if top is None:
            self.way.piece(2.0 * length / (v0 + end), speed=end, grade=self.grade)
        else:
            first, last = ramp_length(v0, top, h.accel), ramp_length(top, end, h.brake)
            self.way.piece(ramp_time(v0, top, h.accel), speed=top, grade=self.grade)
            self.way.hold((length - first - last) / top)
            self.way.piece(ramp_time(top, end, h.brake), speed=end)
        self._advance(0.0, length)
        self.height += length * math.sin(self.grade)

    def _turn(self, angle: float) -> None:
        if abs(angle) < 1e-9:
            return
        speed = self.way.speed
        rate = corner_rate(speed, self.habits)
        right, ahead, duration = turn_path(angle, speed, rate, self.habits.ease)
        self.way.turn(angle, yaw_rate=rate, ease=self.habits.ease)
        self._advance(right, ahead)
        self.heading += angle
        self.height += speed * duration * math.sin(self.grade)

    def _advance(self, right: float, ahead: float) -> None:
        s, c = math.sin(self.heading), math.cos(self.heading)
        east, north = s * ahead + c * right, c * ahead - s * right
        slope = math.cos(self.grade)
        self.lat, self.lon = moved(
            self.lat, self.lon, slope * east, slope * north, self.height, self.earth
        )


def ramp_time(v0: float, v1: float, peak: float) -> float:
    """Time of a smooth change of speed, s: by its peak acceleration, at least _RAMP."""
    return max(STEP_PEAK * abs(v1 - v0) / peak, _RAMP)


def ramp_length(v0: float, v1: float, peak: float) -> float:
    """Length of the same, m."""
    return 0.5 * (v0 + v1) * ramp_time(v0, v1, peak)


def fastest(length: float, v0: float, v1: float, limit: float, habits: RouteHabits) -> float | None:
    """Top speed, m/s, of a straight of ``length`` m from v0 to v1; None: too short for ramps."""

    def needed(top: float) -> float:
        return ramp_length(v0, top, habits.accel) + ramp_length(top, v1, habits.brake)

    low, high = max(v0, v1, 0.1), max(v0, v1, limit)
    if needed(low) > length:
        return None
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if needed(middle) <= length else (low, middle)
    return low


def route_program(
    route: Route, habits: RouteHabits, *, earth: Ellipsoid = WGS84
) -> tuple[Program, tuple[float, float, float]]:
    """(program, origin) of a route; FormatError when nothing of it is left to drive."""
    plain = without_sharp_turns(simplified(route, habits.tolerance, earth=earth), earth=earth)
    east, north = offset(
        float(plain.lat[0]),
        float(plain.lon[0]),
        float(plain.lat[1]),
        float(plain.lon[1]),
        0.0,
        earth,
    )
    if plain.lat.size == 2 and math.hypot(east, north) < SHORTEST_LEG:
        raise FormatError(f"the route is shorter than {SHORTEST_LEG:g} m")
    height = 0.0 if plain.height is None else float(plain.height[0])
    program = RouteDriver(plain, habits, earth=earth).drive()
    return program, (float(plain.lat[0]), float(plain.lon[0]), height)
