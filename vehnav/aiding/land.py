"""The land filter on a drive: epochs, start, forward run, smoother, and what a user sees of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.aiding.blocks import HEIGHT, ROW, C, V
from vehnav.aiding.coarse import CoarseStart
from vehnav.aiding.filter import (
    PARAMETERS,
    Aids,
    Filtered,
    FilterStart,
    Innovations,
    run_filter,
)
from vehnav.aiding.fix_noise import measured_sigma, with_sigma
from vehnav.aiding.fixes import Fixes
from vehnav.aiding.gaps import bridge_gaps
from vehnav.aiding.smoother import Smoothed, smoothed_errors, take_errors_off
from vehnav.aiding.vehicle import MEMS, TACTICAL, Noise, Prior
from vehnav.aiding.vibration import shaken_densities, skewed_rates
from vehnav.classic import Drive, Outcome, StopRecord
from vehnav.rest import TimeIntegral, white_noise
from vehnav.stops import stopped_mask
from vehnav.strapdown.wander import c_nw, c_we_from_geodetic, geodetic_from_c_we
from vehnav.units import DEG, DEG_PER_HOUR

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

EPOCH: Final = 0.1
"""s between epochs: covariance at the IMU rate is no better (speed.md, 2)."""
TACTICAL_NOISE: Final = 0.005 * DEG
"""rad/s/sqrt(Hz) of white noise at rest up to which a gyro may be of tactical grade."""
TACTICAL_BIAS: Final = 30.0 * DEG_PER_HOUR
"""rad/s of bias at rest up to which it may be."""
ZERO_RATE_FACTOR: Final = 1.5
"""On the deviation of 0.1 s means at rest (spec C 4)."""
SPEED_AGE: Final = 0.5
"""s: an odometer reading farther than this from an epoch says nothing about it."""


@dataclass(frozen=True)
class Tuning:
    """Noise and prior in force, and where they are from.

    Attributes
    ----------
    name : str
        ``mems`` or ``tactical``.
    reason : str
        What decided.
    noise : Noise
    gyro_prior, accel_prior, gyro_scale_prior, accel_scale_prior : float
        rad/s, m/s2, 1, 1.
    """

    name: str
    reason: str
    noise: Noise
    gyro_prior: float
    accel_prior: float
    gyro_scale_prior: float
    accel_scale_prior: float


@dataclass(frozen=True)
class Use:
    """Which aids are on.

    Attributes
    ----------
    zupt, zaru, nhc : bool
        Zero velocity and zero rate at stops; no side slip and no lift while driving.
    """

    zupt: bool = True
    zaru: bool = True
    nhc: bool = True


@dataclass(frozen=True)
class LandResult:
    """The solution and what it rests on.

    Attributes
    ----------
    outcome : Outcome
    innovations : dict of str to Innovations
    parameters : (15,)
        Last estimate of the parameter row.
    parameter_sigmas : (15,)
    tuning : Tuning
    fix_sigma : float or None
        m, per horizontal axis, of fixes that came without, where their innovations tell.
    """

    outcome: Outcome
    innovations: dict[str, Innovations]
    parameters: Array
    parameter_sigmas: Array
    tuning: Tuning
    fix_sigma: float | None = None


def tuning_from_log(drive: Drive, *, tactical: bool | None = None) -> Tuning:
    """Noise by grade: as told, else by the gyro's noise and bias at the stops.

    The zero-rate noise is that of the log's own stops.
    """
    noise_at_rest, bias = _gyro_at_rest(drive)
    reason = "as told"
    if tactical is None:
        tactical = noise_at_rest <= TACTICAL_NOISE and bias <= TACTICAL_BIAS
        reason = (
            f"gyro at rest: {noise_at_rest / DEG:.4f} deg/s/sqrt(Hz), bias "
            f"{bias / DEG_PER_HOUR:.0f} deg/h"
            if np.isfinite(noise_at_rest)
            else "no stop shows the gyro at rest"
        )
    zero_rate = _zero_rate_sigma(drive)
    noise = TACTICAL if tactical else MEMS
    if zero_rate is not None:
        noise = noise._replace(zero_rate=zero_rate)
    if tactical:
        return Tuning("tactical", reason, noise, 0.02 * DEG, 0.02, 1e-3, 1e-3)
    stopped = bool(drive.stops)
    return Tuning("mems", reason, noise, (0.05 if stopped else 0.1) * DEG, 0.05, 0.005, 0.02)


def with_steady_gyro(tuning: Tuning, bias: float) -> Tuning:
    """For gyrocompassing: the gyro's bias (sigma, rad/s) and no more walk than that in an hour."""
    walk = min(tuning.noise.gyro_walk, bias / 60.0)
    return replace(tuning, gyro_prior=bias, noise=tuning.noise._replace(gyro_walk=walk))


def run_land(
    drive: Drive,
    start: CoarseStart,
    tuning: Tuning,
    *,
    fixes: Fixes | None = None,
    speed: tuple[Array, Array] | None = None,
    use: Use = Use(),
    smooth: bool = False,
    absolute: bool = False,
) -> LandResult:
    """Filter a drive, and smooth it where wanted.

    Parameters
    ----------
    drive : Drive
    start : CoarseStart
    tuning : Tuning
    fixes : Fixes or None
        Those that aid.
    speed : (t (k,), m/s (k,)) or None
        Odometer.
    use : Use
    smooth : bool
        Whether later measurements count too.
    absolute : bool
        Law of the wander axes (paper 003).
    """
    part = drive.increments.part(start.first, drive.t.size - 1)
    part = replace(part, dvel=part.dvel * start.accel_scale)
    rates = drive.f[start.first :] * start.accel_scale
    increments, gaps = bridge_gaps(part, drive.omega[start.first :], rates)
    stopped = stopped_mask(drive.t.size, drive.stops)[start.first :]
    aids = put_to_epochs(increments.t, stopped, fixes, speed, use, drive)
    begin, fix_sigma = _filter_start(start, tuning), None
    if fixes is not None and fixes.sigma_pos is None:
        fix_sigma = measured_sigma(
            increments, gaps, aids, begin, noise=tuning.noise, earth=drive.earth
        )
        aids = aids if fix_sigma is None else with_sigma(aids, fix_sigma)
    forward = run_filter(
        increments, gaps, aids, begin, noise=tuning.noise, absolute=absolute, earth=drive.earth
    )
    innovations, records = forward.innovations, _records(drive, start, aids, forward)
    final: Filtered | Smoothed = forward
    if smooth:
        errors, covariance = smoothed_errors(forward)
        forward = final = forward.light()
        final = take_errors_off(increments, aids, forward, errors, covariance, earth=drive.earth)
    del forward  # rows of an hour twice are too much
    outcome = _outcome(start, increments.t, aids, final, records)
    sigmas = final.parameter_sigmas
    parameters = final.parameters[-1].copy()
    return LandResult(outcome, innovations, parameters, sigmas, tuning, fix_sigma)


def put_to_epochs(
    t: Array,
    stopped: npt.NDArray[np.bool_],
    fixes: Fixes | None,
    speed: tuple[Array, Array] | None,
    use: Use,
    drive: Drive,
) -> Aids:
    """Epochs every 0.1 s and at the first instant after every fix, with their measurements."""
    grid = np.searchsorted(t, np.arange(t[0], t[-1], EPOCH))
    inside = None if fixes is None else fixes.take((fixes.t > t[0]) & (fixes.t <= t[-1]))
    at_fix = np.zeros(0, np.int64) if inside is None else np.searchsorted(t, inside.t)
    if inside is not None and at_fix.size:  # one fix per instant
        at_fix, one = np.unique(at_fix, return_index=True)
        inside = inside.take(np.isin(np.arange(inside.t.size), one))
    epochs = np.unique(np.concatenate([grid, at_fix, [0, t.size - 1]])).astype(np.int64)
    fix = np.full(epochs.size, -1, np.int64)
    fix[np.searchsorted(epochs, at_fix)] = np.arange(at_fix.size)
    before = np.concatenate([[0], epochs[:-1]])
    count = np.concatenate([[0], np.cumsum(stopped)])
    still = count[epochs + 1] - count[before] == epochs - before + 1
    reading = _readings(t[epochs], speed)
    table = np.zeros((0, 13)) if inside is None else inside.table(drive.earth)
    ago = np.zeros(0) if inside is None else t[at_fix] - inside.t
    shaken = shaken_densities(drive.t, drive.omega, drive.f, t[epochs])
    skewed = skewed_rates(drive.t, drive.omega, t[epochs]) * ~still[:, None]
    return Aids(
        epochs, still, use.zupt, use.zaru, use.nhc, reading, fix, table, ago, shaken, skewed,
        (0.0, 0.0, 0.0) if inside is None else inside.arm,
    )  # fmt: skip


def _readings(t: Array, speed: tuple[Array, Array] | None) -> Array:
    """Odometer at instants ``t``, between readings less than a second apart; NaN elsewhere."""
    out = np.full(t.size, np.nan)
    if speed is None or speed[0].size < 2:
        return out
    k = np.searchsorted(speed[0], t, side="right") - 1
    inside = (k >= 0) & (k < speed[0].size - 1)
    a = k[inside]
    near = speed[0][a + 1] - speed[0][a] <= 2.0 * SPEED_AGE
    out[np.flatnonzero(inside)[near]] = np.interp(t[inside][near], *speed)
    return out


def _filter_start(start: CoarseStart, tuning: Tuning) -> FilterStart:
    row, par = np.zeros(ROW), np.zeros(PARAMETERS)
    lat, lon, height = start.position
    row[:HEIGHT] = c_we_from_geodetic(lat, lon).ravel()
    row[HEIGHT] = height
    row[V:C] = start.v_n
    row[C:] = start.c_nb.ravel()
    par[3:6] = start.gyro_bias
    place = start.position_sigma
    prior = Prior(
        tilt=start.tilt_sigma,
        heading=start.heading_sigma,
        velocity=start.velocity_sigma,
        position=(place, place, 2.0 * place),
        gyro=tuning.gyro_prior,
        accel=tuning.accel_prior,
        gyro_scale=tuning.gyro_scale_prior,
        accel_scale=tuning.accel_scale_prior,
    )
    return FilterStart(row, par, prior.covariance())


def _outcome(
    start: CoarseStart,
    t: Array,
    aids: Aids,
    final: Filtered | Smoothed,
    records: list[StopRecord],
) -> Outcome:
    """In East-North-Up, sigmas interpolated to the instants."""
    rows = final.rows
    lat, lon, wander = geodetic_from_c_we(rows[:, :HEIGHT].reshape(-1, 3, 3))
    at = c_nw(wander[aids.epochs])
    place = at @ final.covariance[:, :3, :3] @ np.swapaxes(at, 1, 2)
    variances = np.column_stack([*(place[:, k, k] for k in range(3)), final.covariance[:, 8, 8]])
    epoch_t = t[aids.epochs]
    sigma = np.sqrt(
        np.maximum(np.column_stack([np.interp(t, epoch_t, x) for x in variances.T]), 0.0)
    )
    bias = final.parameters[-1, :3].copy()
    return Outcome(
        first=start.first,
        position=np.column_stack([lat, lon, rows[:, HEIGHT]]),
        v_n=_turned(rows[:, V:C], wander),
        c_nb=_turned(rows[:, C:].reshape(-1, 3, 3), wander),
        records=records,
        sigma_pos=sigma[:, :3],
        sigma_heading=sigma[:, 3],
        accel_bias=bias,
    )


def _turned(x: Array, wander: Array) -> Array:
    """(n, 3, ...) from wander axes to East-North-Up, as ``c_nw(wander) @ x`` in less memory."""
    shape = (-1, *(1 for _ in x.shape[2:]))
    s, c = np.sin(wander).reshape(shape), np.cos(wander).reshape(shape)
    out = x.copy()
    out[:, 0] = c * x[:, 0] - s * x[:, 1]
    out[:, 1] = s * x[:, 0] + c * x[:, 1]
    return out


def _records(drive: Drive, start: CoarseStart, aids: Aids, forward: Filtered) -> list[StopRecord]:
    """What each stop showed: the speed that the filter came with, the tilt that it corrected."""
    records = []
    for stop in drive.stops:
        inside = (aids.epochs >= stop.first - start.first) & (
            aids.epochs <= stop.last - start.first
        )
        where = np.flatnonzero(inside & aids.stopped)
        if not where.size:
            records.append(StopRecord(0.0, 0.0, start.gyro_bias))
            continue
        k = where[0]
        v = forward.rows[aids.epochs[k], V : V + 2] + forward.fed_back[k, 3:5]
        tilt = forward.fed_back[where, 6:8].sum(axis=0)
        bias = forward.parameters[where[-1], 3:6]
        records.append(StopRecord(float(np.hypot(*v)), float(np.hypot(*tilt)), bias))
    return records


def _gyro_at_rest(drive: Drive) -> tuple[float, float]:
    """White noise, rad/s/sqrt(Hz), and size of the bias, rad/s, over the stops; inf: none."""
    spans = [(stop.first, stop.last) for stop in drive.stops]
    white = white_noise(drive.t, drive.omega, spans)
    if not spans or not np.all(np.isfinite(white)):
        return np.inf, np.inf
    bias = np.mean([drive.omega[a : b + 1].mean(axis=0) for a, b in spans], axis=0)
    return float(np.median(white)), float(np.linalg.norm(bias))


def _zero_rate_sigma(drive: Drive) -> float | None:
    """rad/s: 1.5 times the deviation of 0.1 s means of the rate inside the stops."""
    integral = TimeIntegral(drive.t, drive.omega)
    parts = []
    for stop in drive.stops:
        edges = np.arange(stop.start + 0.5, stop.end - 0.5, EPOCH)
        if edges.size > 5:
            mean = integral.mean(edges[:-1], edges[1:])
            parts.append(mean - mean.mean(axis=0))
    if not parts:
        return None
    return ZERO_RATE_FACTOR * float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
