"""The best that stops alone can give, offline (beyond paper 002).

Forward in time as published, with the gyro bias followed from stop to stop; then what was found at
each stop is distributed over the leg before it (:mod:`vehnav.legs`), and the residual biases that
the legs show are fed back and integrated again. What comes before the first stop is integrated
backward from it.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from vehnav.alignment import Rest
from vehnav.classic import (
    Corrections,
    Drive,
    Outcome,
    Start,
    bias_per_step,
    biases_at_stops,
    dead_reckon,
    mechanize,
    rest_of,
    stop_records,
)
from vehnav.earth import Ellipsoid, normal_gravity, radii
from vehnav.expected import ExpectedErrors
from vehnav.legs import (
    PSI,
    VELOCITY,
    LegErrors,
    LegNoise,
    Sensitivity,
    fit_legs,
    open_leg,
    sensitivity,
)
from vehnav.rotation import angles_from_c_nb, c_from_rotvec, c_nb_from_angles
from vehnav.stops import Stop
from vehnav.strapdown.enu import Solution

Array = npt.NDArray[np.float64]

GRID = 0.1
"""s: the grid of the error equations along a leg."""
ARRIVAL = 2.0
"""s within which the last of the speed is gone after a stop began."""
PASSES = 3
"""Times the errors of the legs are estimated and fed back: converged to 1 % on real logs."""


def run_stops(
    drive: Drive,
    start: Start,
    corrections: Corrections,
    *,
    noise: LegNoise,
    position_sigma: float = 0.0,
    heading_sigma: float = 0.0,
) -> Outcome:
    """The stop method with the given corrections, from the first instant that it can reach.

    ``position_sigma`` (m, each axis) and ``heading_sigma`` (rad) of the start enter the expected
    errors alone.
    """
    sigmas = {"position_sigma": position_sigma, "heading_sigma": heading_sigma}
    levelling, reset = corrections.levelling, corrections.reset
    published = dead_reckon(drive, start, levelling=levelling, reset=reset)
    seen = biases_at_stops(drive, published, start)
    bias = np.broadcast_to(start.gyro_bias, (drive.t.size - 1, 3))
    solution = published
    if corrections.refine and drive.stops:
        bias = bias_per_step(drive, seen, noise, smooth=not corrections.causal)
        solution = dead_reckon(drive, start, levelling=levelling, reset=reset, bias=bias)
    outcome = Outcome(
        drive.first,
        solution.position,
        solution.v_n,
        solution.c_nb,
        stop_records(solution, seen),
    )
    if corrections.causal:
        return outcome
    if corrections.refine and levelling and reset and drive.stops:
        outcome = distribute(drive, start, bias, noise, ExpectedErrors(**sigmas))
    return with_part_before(drive, start, outcome, bias, noise, ExpectedErrors(**sigmas))


# ---- over the legs -----------------------------------------------------------------------------


def distribute(
    drive: Drive, start: Start, bias: Array, noise: LegNoise, expected: ExpectedErrors
) -> Outcome:
    """Integrate, find at the stops, distribute over the legs; repeat with what the legs show.

    ``bias`` (n-1, 3) rad/s per step: the gyro bias interpolated between the stops.
    """
    legs = leg_spans(drive)
    gyro, accel = np.zeros((len(legs), 3)), np.zeros(3)
    noise = replace(
        noise, gravity=normal_gravity(start.position[0], start.position[2], drive.earth)
    )
    first_found: Solution | None = None
    for _ in range(PASSES if legs else 1):
        per_step = bias.copy()
        for (a, b), extra in zip(legs, gyro, strict=True):
            per_step[drive.first + a : drive.first + b] += extra
        solution = dead_reckon(
            drive, start, levelling=True, reset=True, bias=per_step, accel_bias=accel
        )
        first_found = first_found or solution
        arrivals = [arrival_velocity(drive, solution, stop) for stop in drive.stops[1:]]
        v_found = solution.v_before_reset[1:, :2] - np.array(arrivals).reshape(-1, 2)
        found = np.concatenate([v_found, solution.tilt_correction[1:]], axis=1)
        grids = [_grid(drive, a, b) for a, b in legs]
        parts = [_sensitivity(drive, solution, k, i + 1, noise) for i, k in enumerate(grids)]
        errors, accel_more = fit_legs(parts, found, noise, gyro_applied=gyro, accel_applied=accel)
        gyro = gyro + np.array([e.gyro_bias for e in errors]).reshape(-1, 3)
        accel = accel + accel_more
    seen = biases_at_stops(drive, first_found or solution, start)
    v_n = solution.v_n.copy()
    c_nb = solution.c_nb.copy()
    for (a, b), z, e in zip(legs, found, errors, strict=True):
        _correct_leg(drive.t[drive.first + a : drive.first + b + 1], v_n, c_nb, a, b, z, e)
    _level_in_stops(drive, c_nb, accel)
    position = integrate_position(drive.t[drive.first :], v_n, start.position, drive.earth)
    sigma_pos, sigma_heading = _forward_sigmas(drive, solution, v_n, errors, noise, expected)
    return Outcome(
        drive.first, position, v_n, c_nb, stop_records(first_found or solution, seen),
        sigma_pos, sigma_heading, accel if legs else None,
    )  # fmt: skip


def arrival_velocity(drive: Drive, solution: Solution, stop: Stop) -> Array:
    """(2,) east, north m/s that the vehicle still has on the first instant of a stop.

    A gentle arrival is quiet before it is over. What speed was left is what the accelerometers
    show to vanish within the stop: minus the integral of the specific force less that of the rest.
    """
    t = drive.t[stop.first : stop.last + 1]
    count = int(np.searchsorted(t, t[0] + min(ARRIVAL, 0.5 * stop.duration))) + 1
    f = drive.f[stop.first : stop.first + count]
    rest = drive.f[stop.first + t.size // 2 : stop.last + 1].mean(axis=0)
    gained = np.trapezoid(f - rest, t[:count], axis=0)
    heading, _, _ = angles_from_c_nb(solution.c_nb[stop.first - drive.first])
    level = rest_of(drive, stop).c_nb(float(heading))
    return np.asarray(-(level @ gained)[:2])


def leg_spans(drive: Drive) -> list[tuple[int, int]]:
    """(last index of a stop, first index of the next) for every leg, from ``drive.first``."""
    stops, k0 = drive.stops, drive.first
    return [(s.last - k0, e.first - k0) for s, e in pairwise(stops)]


def _grid(drive: Drive, a: int, b: int) -> npt.NDArray[np.int64]:
    """Indices from a to b about every GRID seconds, at least three."""
    step = max(1, int(GRID / float(np.median(np.diff(drive.t)))))
    grid = np.unique(np.append(np.arange(a, b, step), b))
    return grid if grid.size > 2 else np.unique([a, (a + b) // 2, b])


def _sensitivity(
    drive: Drive,
    solution: Solution,
    grid: npt.NDArray[np.int64],
    number: int,
    noise: LegNoise,
) -> Sensitivity:
    """Of the leg that ends at stop ``number``, with the velocity found there, not the reset one."""
    v_n = solution.v_n[grid]
    v_n = np.concatenate([v_n[:-1], solution.v_before_reset[number : number + 1]])
    return sensitivity(drive.t[drive.first + grid], solution.c_nb[grid], v_n, gravity=noise.gravity)


def _correct_leg(
    t: Array, v_n: Array, c_nb: Array, a: int, b: int, found: Array, errors: LegErrors
) -> None:
    """Take a leg's errors out of velocity and attitude, in place, between instants a and b.

    What the regression leaves of the velocity found at the end goes linearly over the leg, so that
    it is zero there: V -= dV s, s = (t - t0)/(t1 - t0) (spec C 3).
    """
    s = (t - t[0]) / (t[-1] - t[0])
    left = found[:2] - errors.mean[-1, VELOCITY]
    for k in range(2):
        v_n[a:b, k] -= (np.interp(t - t[0], errors.t, errors.mean[:, 3 + k]) + left[k] * s)[:-1]
    psi = np.zeros((t.size, 3))
    for k in range(2):
        psi[:, k] = np.interp(t - t[0], errors.t, errors.mean[:, PSI][:, k])
    c_nb[a : b + 1] = c_from_rotvec(-psi) @ c_nb[a : b + 1]


def _level_in_stops(drive: Drive, c_nb: Array, accel_bias: Array) -> None:
    """Give every stop its mean level over its whole length, in place; the heading stays."""
    for stop in drive.stops:
        inside = slice(stop.first - drive.first, stop.last + 1 - drive.first)
        rest = rest_of(drive, stop)
        level = Rest(rest.omega, rest.f - accel_bias)
        heading, _, _ = angles_from_c_nb(c_nb[inside])
        c_nb[inside] = c_nb_from_angles(heading, level.pitch, level.roll)


def integrate_position(
    t: Array, v_n: Array, position: tuple[float, float, float], earth: Ellipsoid
) -> Array:
    """(m, 3) lat rad, lon rad, h m: trapezoid of the velocity (004 eq. 7, 10)."""
    half = 0.5 * np.diff(t)[:, None]
    step = half * (v_n[1:] + v_n[:-1])
    height = position[2] + np.concatenate([[0.0], np.cumsum(step[:, 2])])
    lat = np.full(t.size, position[0])
    for _ in range(2):  # the radius changes by 1e-6 a kilometre: one repetition is exact
        middle = 0.5 * (lat[1:] + lat[:-1])
        radius_m, radius_n = radii(middle, height[1:], earth=earth)
        lat = position[0] + np.concatenate([[0.0], np.cumsum(step[:, 1] / radius_m)])
    middle = 0.5 * (lat[1:] + lat[:-1])
    d_lon = step[:, 0] / (radius_n * np.cos(middle))
    lon = position[1] + np.concatenate([[0.0], np.cumsum(d_lon)])
    return np.stack([lat, lon, height], axis=1)


# ---- expected errors ---------------------------------------------------------------------------


def _forward_sigmas(
    drive: Drive,
    solution: Solution,
    v_n: Array,
    errors: list[LegErrors],
    noise: LegNoise,
    expected: ExpectedErrors,
) -> tuple[Array, Array]:
    """Sigmas of position and heading from the first stop to the end of the drive."""
    t = drive.t[drive.first :]
    sigma_pos, sigma_heading = np.zeros((t.size, 3)), np.zeros(t.size)
    spans = [*leg_spans(drive), (drive.stops[-1].last - drive.first, t.size - 1)]
    done = 0
    for k, (a, b) in enumerate(spans):
        still = slice(done, a + 1)
        sigma_pos[still], sigma_heading[still] = expected.still(a + 1 - done)
        if b > a:
            grid = _grid(drive, a, b)
            leg = errors[k] if k < len(errors) else _open(drive, solution, grid, noise)
            span = slice(a, b + 1)
            moved = _displacement(t[span], v_n[span])
            sigma_pos[span], sigma_heading[span] = expected.along(t[span] - t[a], moved, leg)
        done = b + 1
    return sigma_pos, sigma_heading


def _open(
    drive: Drive, solution: Solution, grid: npt.NDArray[np.int64], noise: LegNoise
) -> LegErrors:
    leg = sensitivity(
        drive.t[drive.first + grid], solution.c_nb[grid], solution.v_n[grid], gravity=noise.gravity
    )
    return open_leg(leg, noise)


def _displacement(t: Array, v_n: Array) -> Array:
    """(m, 2) east, north, m, from the first instant."""
    step = 0.5 * (v_n[1:, :2] + v_n[:-1, :2]) * np.diff(t)[:, None]
    return np.concatenate([np.zeros((1, 2)), np.cumsum(step, axis=0)])


# ---- what comes before the first stop ----------------------------------------------------------


def with_part_before(
    drive: Drive,
    start: Start,
    outcome: Outcome,
    bias: Array,
    noise: LegNoise,
    expected: ExpectedErrors,
) -> Outcome:
    """Put the part before the first stop in front, integrated backward from it."""
    k0 = drive.first
    if k0 == 0 or not drive.stops:
        return outcome
    extra = np.zeros(3) if outcome.accel_bias is None else outcome.accel_bias
    increments = drive.increments.corrected(bias, start.accel_bias + extra)
    back = mechanize(
        drive,
        increments.part(0, k0).reversed(),
        position=start.position,
        v_n=start.v_n,
        c_nb=outcome.c_nb[0],
    )
    before = slice(None, 0, -1)  # reversed again, without the instant that both have
    sigma_pos, sigma_heading = outcome.sigma_pos, outcome.sigma_heading
    if sigma_pos is not None and sigma_heading is not None:
        t = drive.t[k0] - drive.t[k0::-1]
        grid = np.unique(np.append(np.arange(0, t.size, max(1, t.size // 2000)), t.size - 1))
        if grid.size > 2:  # time runs backward: so does the velocity
            leg = sensitivity(t[grid], back.c_nb[grid], -back.v_n[grid], gravity=noise.gravity)
            pos, heading = expected.along(t, _displacement(t, -back.v_n), open_leg(leg, noise))
        else:
            pos, heading = expected.still(t.size)
        sigma_pos = np.concatenate([pos[before], sigma_pos])
        sigma_heading = np.concatenate([heading[before], sigma_heading])
    return replace(
        outcome,
        first=0,
        position=np.concatenate([back.position[before], outcome.position]),
        v_n=np.concatenate([back.v_n[before], outcome.v_n]),
        c_nb=np.concatenate([back.c_nb[before], outcome.c_nb]),
        sigma_pos=sigma_pos,
        sigma_heading=sigma_heading,
    )
