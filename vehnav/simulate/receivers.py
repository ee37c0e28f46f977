"""GPS receiver and wheel speed along a truth trajectory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vehnav.earth import (
    POLAR,
    WGS84,
    Ellipsoid,
    c_en,
    ecef_from_geodetic,
    geodetic_from_ecef,
    in_axes_of,
)
from vehnav.logs.log import Gnss, Speed
from vehnav.sensors import processes
from vehnav.trajectory import Trajectory, interpolate_positions
from vehnav.units import NS

Array = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]
Place = tuple[Array, Array, Array]


@dataclass(frozen=True)
class GnssModel:
    """How a receiver errs.

    Attributes
    ----------
    rate_hz : float
        Fixes per second.
    noise : float
        White noise of each fix, m, east and north; ``up_factor`` times that in height.
    drift, drift_time : float
        Standard deviation (m) and time constant (s) of a slow first-order Markov error.
    velocity_noise : float or None
        White noise of the velocity, m/s; None: the receiver gives no velocity.
    up_factor : float
        Height and vertical velocity against horizontal.
    latency : float
        s: a fix stamped t is where the antenna was at t - latency.
    outages : tuple of (float, float)
        Seconds from the start, without fixes.
    """

    rate_hz: float = 1.0
    noise: float = 0.7
    drift: float = 1.2
    drift_time: float = 120.0
    velocity_noise: float | None = None
    up_factor: float = 1.6
    latency: float = 0.0
    outages: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class WheelModel:
    """How a wheel speed errs: speed = (1 + scale) v + noise, in whole counts.

    Attributes
    ----------
    rate_hz : float
        Readings per second.
    noise : float
        m/s.
    scale : float
        Scale factor error.
    quantisation : float
        m/s; 0: none.
    """

    rate_hz: float = 10.0
    noise: float = 0.03
    scale: float = 0.004
    quantisation: float = 0.01


def repeated_outages(
    *, every: float, length: float, start: float, duration: float
) -> tuple[tuple[float, float], ...]:
    """Outages of ``length`` s, one each ``every`` s from ``start`` on, within ``duration`` s."""
    count = max(0, int(np.ceil((duration - start) / every)))
    return tuple((start + k * every, start + k * every + length) for k in range(count))


def epochs(truth: Trajectory, *, rate_hz: float, delay: float = 0.0) -> TimeArray:
    """(m,) int64 ns: evenly from the start of the truth to ``delay`` s before its end."""
    span = (int(truth.t_ns[-1]) - int(truth.t_ns[0])) * NS - delay
    count = max(0, int(np.floor(span * rate_hz + 1e-6)) + 1)
    return np.asarray(truth.t_ns[0] + np.rint(np.arange(count) * (1e9 / rate_hz)).astype(np.int64))


def velocity_at(truth: Trajectory, t_ns: TimeArray) -> Array:
    """(m, 3) m/s: East-North-Up velocity, linear between the states."""
    s = (t_ns - truth.t_ns[0]) * NS
    grid = (truth.t_ns - truth.t_ns[0]) * NS
    return np.stack([np.interp(s, grid, truth.v_n[:, k]) for k in range(3)], axis=-1)


def simulate_gnss(
    truth: Trajectory, model: GnssModel, rng: np.random.Generator, *, earth: Ellipsoid = WGS84
) -> Gnss:
    """Fixes of a receiver; the errors of the fixes do not hang on the outages."""
    valid_ns = epochs(truth, rate_hz=model.rate_hz, delay=model.latency)
    t = (valid_ns - truth.t_ns[0]) * NS
    axes = np.array([1.0, 1.0, model.up_factor])
    error = model.noise * rng.standard_normal((t.size, 3))
    slow = rng.standard_normal((t.size, 3))
    error = axes * (error + model.drift * _markov(t, slow, time=model.drift_time))
    velocity_error = axes * rng.standard_normal((t.size, 3))
    place = interpolate_positions(truth, valid_ns)
    fix = _displaced(place, error, earth)
    seen = np.ones(t.size, bool)
    for start, end in model.outages:
        seen &= ~((t >= start) & (t < end))
    v_n = None
    sigma_v = None
    if model.velocity_noise is not None:
        # a receiver gives it in the axes of the place that it believes in
        v_n = velocity_at(truth, valid_ns)
        v_n = in_axes_of(v_n, place[0], place[1], to_lat=fix[0], to_lon=fix[1])
        v_n = (v_n + model.velocity_noise * velocity_error)[seen]
        sigma_v = np.tile(model.velocity_noise * axes, (v_n.shape[0], 1))
    sigma = float(np.hypot(model.noise, model.drift)) * axes
    return Gnss(
        t_ns=(valid_ns + np.int64(round(model.latency * 1e9)))[seen],
        lat=fix[0][seen],
        lon=fix[1][seen],
        height=fix[2][seen],
        v_n=v_n,
        sigma_pos=np.tile(sigma, (int(np.count_nonzero(seen)), 1)),
        sigma_vel=sigma_v,
        source="/gps/fix",
    )


def _displaced(place: Place, error: Array, earth: Ellipsoid) -> Place:
    """Places (lat, lon, height) off by ``error`` (m, 3), m, east, north and up.

    Near the poles east and north are those of the first place: an error does not turn round
    because the axes do.
    """
    lat, lon, height = place
    w2 = 1.0 - earth.e2 * np.sin(lat) ** 2
    r_n = earth.a / np.sqrt(w2)
    r_m = r_n * (1.0 - earth.e2) / w2
    new_lat = lat + error[:, 1] / (r_m + height)
    new_lon = lon + error[:, 0] / ((r_n + height) * np.cos(lat))
    new_height = height + error[:, 2]
    polar = np.abs(lat) > POLAR
    if np.any(polar):
        r_e = ecef_from_geodetic(lat[polar], lon[polar], height[polar], earth=earth)
        r_e = r_e + error[polar] @ c_en(lat[0], lon[0]).T
        new_lat[polar], new_lon[polar], new_height[polar] = geodetic_from_ecef(r_e, earth=earth)
    return new_lat, new_lon, new_height


def _markov(t: Array, normal: Array, *, time: float) -> Array:
    """(n, 3): stationary Markov process of unit variance driven by given normal numbers."""
    if t.size < 2:
        return normal
    decay = processes.steps_of(t) / time
    sigma = np.sqrt(-np.expm1(-2.0 * decay))
    sigma[0] = 1.0
    return processes.decay_recursion(decay, normal * sigma[:, None])


def simulate_speed(truth: Trajectory, model: WheelModel, rng: np.random.Generator) -> Speed:
    """Wheel speed: the velocity along the forward axis of the body."""
    t_ns = epochs(truth, rate_hz=model.rate_hz)
    k = np.clip(np.searchsorted(truth.t_ns, t_ns), 0, truth.size - 1)
    forward = np.einsum("ni,ni->n", truth.c_nb[k][:, :, 1], velocity_at(truth, t_ns))
    speed = (1.0 + model.scale) * forward + model.noise * rng.standard_normal(t_ns.size)
    if model.quantisation > 0.0:
        speed = np.rint(speed / model.quantisation) * model.quantisation
    return Speed(t_ns=t_ns, speed=speed, source="/vehicle/speed")
