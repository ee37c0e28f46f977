"""One epoch of the land filter: covariance to the epoch, then its measurements, as kernels."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.aiding.blocks import attitude_of, place_of, velocity_of
from vehnav.aiding.error_model import fill_error_matrix
from vehnav.aiding.gnss_forms import position_row, see_fix, velocity_row
from vehnav.aiding.kalman import propagate, transition_rows, update
from vehnav.aiding.measurements import (
    add_arm,
    gnss_position,
    gnss_velocity,
    no_lift,
    no_side_slip,
    odometer,
    zero_rate,
    zero_velocity,
)
from vehnav.aiding.vehicle import (
    ACCEL_SCALE,
    CUT,
    GYRO_SCALE,
    Noise,
)
from vehnav.earth import Ellipsoid
from vehnav.kernel import kernel
from vehnav.rotation import Mat3, Vec3, mat_vec
from vehnav.strapdown.wander import earth_axis, relative_rate

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

ZUPT: Final = 0
ZARU: Final = 1
NHC: Final = 2
ODOMETER: Final = 3
GNSS: Final = 4
GNSS_VELOCITY: Final = 5
KINDS: Final = ("zupt", "zaru", "nhc", "odometer", "gnss", "gnss velocity")


@kernel
def predict(
    p: Array,
    row: Array,
    rate: Vec3,
    force: tuple[float, float],
    shaken: Array,
    skewed: Vec3,
    dt: float,
    phi: Array,
    work: Array,
    noise: Noise,
    absolute: bool,
    earth: Ellipsoid,
) -> None:
    """Covariance over an epoch of ``dt`` s around the state ``row``; writes Phi too.

    ``rate`` (rad/s) and ``force`` (right and forward, m/s2): means over the epoch, body axes;
    ``shaken`` (6,) and ``skewed``: those of :mod:`vehnav.aiding.vibration`.
    """
    f = work[:9]
    f[:, :] = 0.0
    place, v, c_wb = place_of(row), velocity_of(row), attitude_of(row)
    axis = earth_axis(place)
    omega_ew = relative_rate(axis, row[9], v, absolute, earth.omega_ie, earth)
    fill_error_matrix(f, axis, row[9], v, c_wb, omega_ew, False, earth)
    for a in range(9):
        f[a, GYRO_SCALE] = -rate[2] * f[a, 14]
        f[a, ACCEL_SCALE] = -force[1] * f[a, 10]
        f[a, CUT] = -(skewed[0] * f[a, 12] + skewed[1] * f[a, 13] + skewed[2] * f[a, 14])
    g = f[:, 9:15].copy()
    transition_rows(f, dt, phi)
    propagate(p, phi, work[:9])
    accel = noise.accel + noise.accel_share * np.hypot(force[0], force[1])
    for j in range(6):
        white = accel if j < 3 else noise.gyro
        share = noise.accel_shaken if j < 3 else noise.gyro_shaken
        q = (white * white + share * share * shaken[(j + 3) % 6]) * dt
        for a in range(3, 9):
            for b in range(3, 9):
                p[a, b] += q * g[a, j] * g[b, j]
    for j in range(3):
        p[9 + j, 9 + j] += noise.accel_walk * noise.accel_walk * dt
        p[12 + j, 12 + j] += noise.gyro_walk * noise.gyro_walk * dt


@kernel
def open_gap(p: Array, c_wb: Mat3, attitude: Vec3, velocity: float, length: float) -> None:
    """Add what a gap leaves open (:mod:`vehnav.aiding.gaps`); ``attitude`` in body axes."""
    for a in range(3):
        for b in range(3):
            for j in range(3):
                p[6 + a, 6 + b] += c_wb[3 * a + j] * c_wb[3 * b + j] * attitude[j] ** 2
        p[3 + a, 3 + a] += velocity * velocity
        p[a, a] += 0.25 * (velocity * length) ** 2


@kernel
def measure(
    kind: int,
    x: Array,
    p: Array,
    h: Array,
    z: float,
    r: float,
    noise: Noise,
    kept: tuple[Array, Array, Array, IntArray],
    counts: Array,
) -> None:
    """Apply a scalar measurement, write it down for the smoother, count it.

    ``kept``: rows h, gains, (innovation, variance), and the number written; ``counts`` (kinds, 5):
    used, inflated, rejected, sum of the normalised innovations squared, and how often set on.
    """
    rows, gains, numbers, written = kept
    k = written[0]
    innovation, s, nis = update(x, p, h, z, r, noise.huber, noise.gate, gains[k])
    counts[kind, 3] += nis
    if s == 0.0:
        counts[kind, 2] += 1.0
        return
    counts[kind, 0] += 1.0
    if nis > noise.huber * noise.huber:
        counts[kind, 1] += 1.0
    rows[k] = h
    numbers[k, 0] = innovation
    numbers[k, 1] = s
    written[0] = k + 1


@kernel
def at_rest(
    x: Array,
    p: Array,
    h: Array,
    row: Array,
    rate: Vec3,
    zupt: bool,
    zaru: bool,
    noise: Noise,
    kept: tuple[Array, Array, Array, IntArray],
    counts: Array,
    earth: Ellipsoid,
) -> None:
    """Zero velocity and zero rate."""
    v, c_wb, axis = velocity_of(row), attitude_of(row), earth_axis(place_of(row))
    for j in range(3):
        if zupt:
            z = zero_velocity(h, j, v)
            measure(ZUPT, x, p, h, z, noise.zero_velocity**2, noise, kept, counts)
    for j in range(3):
        if zaru:
            z = zero_rate(h, j, rate, c_wb, axis, earth.omega_ie)
            measure(ZARU, x, p, h, z, noise.zero_rate**2, noise, kept, counts)


@kernel
def under_way(
    x: Array,
    p: Array,
    h: Array,
    row: Array,
    par: Array,
    rate: Vec3,
    ahead: float,
    speed: float,
    nhc: bool,
    noise: Noise,
    kept: tuple[Array, Array, Array, IntArray],
    counts: Array,
) -> None:
    """Non-holonomic constraint and odometer (``speed`` NaN: none); ``ahead``: forward force."""
    v, c_wb = velocity_of(row), attitude_of(row)
    if nhc:
        forward = np.sqrt(v[0] * v[0] + v[1] * v[1])
        extra = noise.turn * abs(rate[2]) + noise.speed * forward
        z = no_side_slip(h, v, c_wb, rate, par)
        measure(NHC, x, p, h, z, (noise.side + extra) ** 2, noise, kept, counts)
        z = no_lift(h, v, c_wb, ahead, par)
        measure(NHC, x, p, h, z, (noise.up + extra) ** 2, noise, kept, counts)
    if not np.isnan(speed):
        z = odometer(h, v, c_wb, speed, par)
        sigma = noise.odometer + noise.odometer_share * abs(speed)
        measure(ODOMETER, x, p, h, z, sigma * sigma, noise, kept, counts)


@kernel
def from_gnss(
    x: Array,
    p: Array,
    h: Array,
    row: Array,
    fix: Array,
    arms: tuple[Vec3, Vec3],
    ago: float,
    noise: Noise,
    kept: tuple[Array, Array, Array, IntArray],
    counts: Array,
    earth: Ellipsoid,
) -> None:
    """A fix: 13 numbers, Earth-fixed position and velocity (NaN: none), six variances, the form.

    Variances are along east, north, up; as the wander axes are turned against them, both
    horizontal ones are taken as their mean. ``arms``: what the lever arm added to both, wander
    axes; it is taken off already, but turns with the attitude error.
    """
    place, v = place_of(row), velocity_of(row)
    z = gnss_position(place, row[9], v, (fix[0], fix[1], fix[2]), ago, earth)
    seen = see_fix(
        int(fix[12]), place, row[9], v, ((fix[0], fix[1], fix[2]), (fix[3], fix[4], fix[5])), ago,
        earth,
    )  # fmt: skip
    flat = 0.5 * (fix[6] + fix[7])
    for j in range(2):
        position_row(h, j, seen)
        add_arm(h, seen[1][j], arms[0])
        measure(GNSS, x, p, h, seen[0][j], flat, noise, kept, counts)
    h[:] = 0.0
    h[2] = 1.0
    add_arm(h, (0.0, 0.0, 1.0), arms[0])
    measure(GNSS, x, p, h, z[2], fix[8], noise, kept, counts)
    if not np.isnan(fix[3]):
        flat = 0.5 * (fix[9] + fix[10])
        for j in range(2):
            velocity_row(h, j, seen, place, row[9], v, earth)
            add_arm(h, seen[1][j], arms[1])
            measure(GNSS_VELOCITY, x, p, h, seen[0][2 + j], flat, noise, kept, counts)
        up = mat_vec(place, (fix[3], fix[4], fix[5]))[2]
        gnss_velocity(h, 2, place, row[9], v, earth)
        add_arm(h, (0.0, 0.0, 1.0), arms[1])
        measure(GNSS_VELOCITY, x, p, h, v[2] - up, fix[11], noise, kept, counts)
