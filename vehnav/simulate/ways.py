"""The ways of the named scenarios, one function each; its keywords are the parameters.

Angles are degrees, lengths metres, times seconds, as they are typed on the command line. Every
default is frozen: a test holds a digest of the truth of each.
"""

from __future__ import annotations

import math

import numpy as np

from vehnav.earth import ELLIPSOIDS, Ellipsoid
from vehnav.errors import ConfigError
from vehnav.simulate.drives import (
    CityDriver,
    CityHabits,
    fill,
    motorway_program,
    town_program,
)
from vehnav.simulate.motion import AIRCRAFT, RIGID, Body, Motion, PolarMotion, RoadMotion
from vehnav.simulate.program import STEP_PEAK, Program, ProgramBuilder
from vehnav.simulate.vibration import Strength, Tones, shake_tones, vehicle_tones
from vehnav.units import DEG


def _earth(name: str) -> Ellipsoid:
    if name not in ELLIPSOIDS:
        raise ConfigError(f"ellipsoid {name!r}: choose one of {', '.join(ELLIPSOIDS)}")
    return ELLIPSOIDS[name]


def _place(lat: float, lon: float, height: float) -> tuple[float, float, float]:
    if not (abs(lat) <= 89.0 and abs(lon) <= 360.0):
        raise ConfigError("lat must be within 89 and lon within 360 degrees; poles: scenario polar")
    return lat * DEG, lon * DEG, height


def _positive(**values: float) -> None:
    for name, value in values.items():
        if not value > 0.0:
            raise ConfigError(f"{name} must be positive, not {value:g}")


def static(
    *,
    duration: float = 600.0,
    lat: float = 55.75,
    lon: float = 37.62,
    height: float = 150.0,
    heading: float = 0.0,
    pitch: float = 0.0,
    idle: float = 0.0,
    seed: int = 1,
    ellipsoid: str = "wgs84",
) -> Motion:
    """Standing still; ``pitch`` tilts it, ``idle`` scales the vibration of a running engine."""
    _positive(duration=duration)
    rest = np.zeros(2)
    program = Program(np.array([duration]), rest, rest, rest + pitch * DEG, heading * DEG)
    tones = vehicle_tones(np.random.default_rng(seed), Strength(0.0, 0.0, idle, idle))
    return RoadMotion(program, _place(lat, lon, height), RIGID, tones, _earth(ellipsoid))


def straight(
    *,
    duration: float = 600.0,
    v: float = 15.0,
    first_stop: float = 60.0,
    last_stop: float = 30.0,
    lat: float = 55.75,
    lon: float = 37.62,
    height: float = 150.0,
    heading: float = 60.0,
    road: float = 0.0,
    seed: int = 1,
    ellipsoid: str = "wgs84",
) -> Motion:
    """Stand, drive straight on at ``v``, stand; ``road`` scales the vibration."""
    _positive(duration=duration, v=v)
    way = ProgramBuilder(heading=heading * DEG).hold(first_stop).change_speed(v, peak=2.0)
    fill(way, duration - last_stop - STEP_PEAK * v / 2.0)
    way.change_speed(0.0, peak=2.0)
    fill(way, duration)
    tones = _car_tones(seed, road)
    return RoadMotion(way.build(), _place(lat, lon, height), Body(), tones, _earth(ellipsoid))


def circle(
    *,
    duration: float = 900.0,
    radius: float = 50_000.0,
    v: float = 25.0,
    turn: str = "right",
    lat: float = 47.2,
    lon: float = 38.9,
    height: float = 0.0,
    heading: float = 0.0,
    ellipsoid: str = "wgs84",
) -> Motion:
    """Paper 004: level at constant speed and yaw rate; a full turn takes 12566.4 s."""
    return _circle(duration, radius, v, turn, _place(lat, lon, height), heading, (), ellipsoid)


def shake(
    *,
    duration: float = 900.0,
    amplitude: float = 0.1,
    frequency: float = 1.0,
    pitch_phase: float = 90.0,
    roll_phase: float = 90.0,
    radius: float = 50_000.0,
    v: float = 25.0,
    turn: str = "right",
    lat: float = 47.2,
    lon: float = 38.9,
    height: float = 0.0,
    heading: float = 0.0,
    ellipsoid: str = "wgs84",
) -> Motion:
    """Paper 004: the circle with pitch and roll = amplitude sin(2 pi frequency t + phase)."""
    _positive(frequency=frequency)
    tones = shake_tones(
        amplitude=amplitude * DEG,
        frequency=frequency,
        pitch_phase=pitch_phase * DEG,
        roll_phase=roll_phase * DEG,
    )
    place = _place(lat, lon, height)
    return _circle(duration, radius, v, turn, place, heading, (tones,), ellipsoid)


def _circle(
    duration: float,
    radius: float,
    v: float,
    turn: str,
    place: tuple[float, float, float],
    heading: float,
    tones: tuple[Tones, ...],
    ellipsoid: str,
) -> Motion:
    _positive(duration=duration, radius=radius)
    if turn not in ("left", "right"):
        raise ConfigError(f"turn must be left or right, not {turn!r}")
    one = np.ones(2)
    rate = v / radius * (1.0 if turn == "right" else -1.0)
    program = Program(np.array([duration]), v * one, rate * one, 0.0 * one, heading * DEG)
    return RoadMotion(program, place, RIGID, tones, _earth(ellipsoid))


def city(
    *,
    duration: float = 600.0,
    seed: int = 1,
    first_stop: float = 60.0,
    last_stop: float = 25.0,
    stop_every: float = 95.0,
    road: float = 1.0,
    idle: float = 1.0,
    half_size: float = 2200.0,
    lat: float = 55.75,
    lon: float = 37.62,
    height: float = 150.0,
    heading: float = 30.0,
    ellipsoid: str = "wgs84",
) -> Motion:
    """A car in a town: blocks, turns, bends, slopes, lights, vibration of road and engine."""
    _positive(duration=duration, stop_every=stop_every, half_size=half_size)
    rng = np.random.default_rng([seed, 2])
    habits = CityHabits(stop_every=stop_every, half_size=half_size)
    driver = CityDriver(rng, habits, heading=heading * DEG)
    program = driver.drive(duration=duration, first_stop=first_stop, last_stop=last_stop)
    tones = _car_tones(seed, road, idle)
    return RoadMotion(program, _place(lat, lon, height), Body(), tones, _earth(ellipsoid))


def paper002(*, seed: int = 1, road: float = 1.0, idle: float = 1.0) -> Motion:
    """The city drive that stands for paper 002's: 1 h 15 min 38 s, about 33 km and 47 stops."""
    return city(
        duration=4538.0,
        seed=seed,
        first_stop=100.0,
        last_stop=30.0,
        stop_every=63.0,
        half_size=2600.0,
        road=road,
        idle=idle,
    )


def town(
    *,
    duration: float = 600.0,
    v: float = 15.0,
    leg: float = 60.0,
    stop: float = 15.0,
    first_stop: float = 0.0,
    seed: int = 1,
    road: float = 0.0,
    idle: float = 0.0,
    lat: float = 55.0,
    lon: float = 37.62,
    height: float = 150.0,
    heading: float = 0.0,
    ellipsoid: str = "wgs84",
) -> Motion:
    """Legs with two turns of 45-120 degrees, slopes to 2 degrees, a stop after each leg."""
    _positive(duration=duration, v=v, leg=leg, stop=stop)
    rng = np.random.default_rng([seed, 3])
    program = town_program(
        rng,
        duration=duration,
        speed=v,
        leg=leg,
        stop=stop,
        first_stop=first_stop,
        heading=heading * DEG,
    )
    tones = _car_tones(seed, road, idle)
    return RoadMotion(program, _place(lat, lon, height), Body(), tones, _earth(ellipsoid))


def motorway(
    *,
    duration: float = 900.0,
    v: float = 30.0,
    first_stop: float = 60.0,
    stop_every: float = 0.0,
    seed: int = 1,
    road: float = 0.8,
    idle: float = 0.5,
    lat: float = 48.9,
    lon: float = 9.2,
    height: float = 300.0,
    heading: float = 80.0,
    ellipsoid: str = "wgs84",
) -> Motion:
    """A smooth motorway: long bends; with ``stop_every`` stops between the first and the last."""
    _positive(duration=duration, v=v)
    rng = np.random.default_rng([seed, 4])
    program = motorway_program(
        rng,
        duration=duration,
        speed=v,
        first_stop=first_stop,
        stop_every=stop_every,
        heading=heading * DEG,
    )
    tones = _car_tones(seed, road, idle)
    return RoadMotion(program, _place(lat, lon, height), Body(), tones, _earth(ellipsoid))


def polar(
    *,
    duration: float = 600.0,
    v: float = 30.0,
    miss: float = 1.0,
    height: float = 0.0,
    ellipsoid: str = "wgs84",
) -> Motion:
    """Past the North pole at distance ``miss``, closest at half the time; level."""
    _positive(duration=duration, v=v)
    return PolarMotion(v, miss, duration, height, _earth(ellipsoid))


def flight(
    *,
    lat: float = 50.0,
    lon: float = 36.2,
    height: float = 120.0,
    heading: float = 40.0,
    ellipsoid: str = "wgs84",
) -> Motion:
    """Paper 000's 2050 s with turns and climbs, as assumed where the paper is silent.

    Take-off 85 m/s by 70 s, 230 m/s by 400 s; climb 12 m/s 70-740 s, 6 m/s 1000-1230 s, descent
    9 m/s 1500-2000 s; turns of +90, -180, +60, +120 degrees with 20-25 degrees of bank.
    """
    way = ProgramBuilder(heading=heading * DEG)
    way.piece(70.0, speed=85.0)
    way.piece(20.0, grade=math.asin(12.0 / 90.0), speed=90.0)
    way.piece(310.0, speed=230.0, grade=math.asin(12.0 / 230.0))
    _flown_turn(way, 90.0, at=430.0)
    fill(way, 740.0)
    way.piece(20.0, grade=0.0)
    _flown_turn(way, -180.0, at=770.0)
    fill(way, 1000.0)
    way.piece(15.0, grade=math.asin(6.0 / 230.0))
    _flown_turn(way, 60.0, at=1030.0)
    fill(way, 1230.0)
    way.piece(15.0, grade=0.0)
    _flown_turn(way, 120.0, at=1260.0)
    fill(way, 1500.0)
    way.piece(20.0, grade=-math.asin(9.0 / 230.0))
    fill(way, 1980.0)
    way.piece(20.0, grade=0.0)
    fill(way, 2050.0)
    return RoadMotion(way.build(), _place(lat, lon, height), AIRCRAFT, (), _earth(ellipsoid))


def route(
    *,
    file: str = "",
    v: float = 13.9,
    first_stop: float = 40.0,
    last_stop: float = 20.0,
    stop_every: float = 120.0,
    stop_length: float = 15.0,
    tolerance: float = 3.0,
    seed: int = 1,
    road: float = 1.0,
    idle: float = 1.0,
    ellipsoid: str = "wgs84",
) -> Motion:
    """Way-points of a GPX, GeoJSON or CSV ``file``, driven as a car does."""
    from vehnav.simulate.route import RouteHabits, route_program
    from vehnav.simulate.waypoints import read_route

    if not file:
        raise ConfigError("scenario route needs file=FILE (.gpx, .geojson, .csv)")
    _positive(v=v, first_stop=first_stop, stop_length=stop_length)
    habits = RouteHabits(
        speed=v,
        first_stop=first_stop,
        last_stop=last_stop,
        stop_every=stop_every,
        stop_length=stop_length,
        tolerance=tolerance,
    )
    earth = _earth(ellipsoid)
    program, origin = route_program(read_route(file), habits, earth=earth)
    return RoadMotion(program, origin, Body(), _car_tones(seed, road, idle), earth)


def _flown_turn(way: ProgramBuilder, angle: float, *, at: float) -> None:
    """A turn by ``angle`` degrees with 23 degrees of bank at 230 m/s."""
    fill(way, at)
    way.turn(angle * DEG, yaw_rate=9.80665 * math.tan(23.0 * DEG) / 230.0, ease=8.0)


def _car_tones(seed: int, road: float, idle: float | None = None) -> tuple[Tones, ...]:
    """Vibration of a car; without ``idle`` the engine shakes as strongly as the road."""
    engine = road if idle is None else idle
    return vehicle_tones(np.random.default_rng([seed, 1]), Strength(road, road, engine, engine))
