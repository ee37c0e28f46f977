"""The land filter: strapdown in compiled blocks, error states at the epochs, closed loop.

Epochs come every 0.1 s and at every fix. In between the free-azimuth strapdown runs with constant
biases (:mod:`vehnav.aiding.blocks`); at an epoch the covariance is carried over the block, the
measurements of the epoch are applied one after the other and the estimated errors taken off
(:mod:`vehnav.aiding.epochs`). What each measurement did is kept, so that the smoother can run back
over the same epochs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vehnav.aiding.blocks import (
    ROW,
    attitude_of,
    place_of,
    run_block,
    take_off,
    take_off_parameters,
)
from vehnav.aiding.epochs import GNSS, KINDS, at_rest, from_gnss, open_gap, predict, under_way
from vehnav.aiding.gaps import GapSigmas
from vehnav.aiding.kalman import symmetrise
from vehnav.aiding.lost import SIZE as LOST
from vehnav.aiding.lost import refused, set_on_fix
from vehnav.aiding.measurements import arms_of, take_arms_off
from vehnav.aiding.vehicle import SIZE, Noise
from vehnav.earth import Ellipsoid
from vehnav.kernel import entry_kernel, kernel
from vehnav.rotation import Vec3
from vehnav.strapdown.increments import Increments

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

PARAMETERS = SIZE - 9
"""Numbers in a parameter row."""


@dataclass(frozen=True)
class Aids:
    """Measurements, put to the epochs.

    Attributes
    ----------
    epochs : (m,) int64
        Indices of the instants that are epochs; the first is the start.
    stopped : (m,) bool
        Whether the vehicle stands over the whole epoch (the block before it).
    zupt, zaru, nhc : bool
        What is used of standing and of driving.
    speed : (m,)
        Odometer reading, m/s, NaN: none.
    fix : (m,) int64
        Number of the fix of an epoch, -1: none.
    fixes : (k, 13)
        Earth-fixed position and velocity (NaN: none), variances east, north, up of both, and the
        number of the form (:mod:`vehnav.aiding.gnss_forms`).
    ago : (k,)
        s by which the fix is older than its epoch.
    shaken : (m, 6)
        :func:`vehnav.aiding.vibration.shaken_densities` at the epochs.
    skewed : (m, 3)
        :func:`vehnav.aiding.vibration.skewed_rates` at the epochs; zero where the vehicle stands.
    arm : (right, forward, up)
        m from the IMU to the antenna, body axes.
    """

    epochs: IntArray
    stopped: BoolArray
    zupt: bool
    zaru: bool
    nhc: bool
    speed: Array
    fix: IntArray
    fixes: Array
    ago: Array
    shaken: Array
    skewed: Array
    arm: Vec3 = (0.0, 0.0, 0.0)

    def part(self, m: int) -> Aids:
        """Those of the first ``m`` epochs."""
        return replace(
            self, epochs=self.epochs[:m], stopped=self.stopped[:m], speed=self.speed[:m],
            fix=self.fix[:m], shaken=self.shaken[:m], skewed=self.skewed[:m],
        )  # fmt: skip


@dataclass(frozen=True)
class FilterStart:
    """State at the first epoch.

    Attributes
    ----------
    row : (22,)
        Navigation row.
    parameters : (15,)
        Parameter row.
    covariance : (24, 24)
    """

    row: Array
    parameters: Array
    covariance: Array


@dataclass(frozen=True)
class Innovations:
    """How the measurements of one kind fared.

    Attributes
    ----------
    used, inflated, rejected : int
    mean_nis : float
        Mean normalised innovation squared: 1 where the filter is honest.
    set_on : int
        How often the solution was set on fixes (:mod:`vehnav.aiding.lost`).
    """

    used: int
    inflated: int
    rejected: int
    mean_nis: float
    set_on: int = 0


@dataclass(frozen=True)
class Filtered:
    """The forward solution.

    Attributes
    ----------
    rows : (n, 22)
        Navigation rows at all instants from the first epoch on; at an epoch after feedback.
    parameters : (m, 15)
        At the epochs, after feedback.
    covariance : (m, 24, 24)
        At the epochs, after feedback.
    fed_back : (m, 9)
        Navigation errors that were taken off at the epochs.
    phi : (m, 9, 24)
        First rows of the transition over the block before each epoch.
    measurements : (rows (u, 24), gains (u, 24), (innovation, variance) (u, 2))
    until : (m,) int64
        Number of measurements applied up to and with each epoch.
    innovations : dict of str to Innovations
    """

    rows: Array
    parameters: Array
    covariance: Array
    fed_back: Array
    phi: Array
    measurements: tuple[Array, Array, Array]
    until: IntArray
    innovations: dict[str, Innovations]

    @property
    def parameter_sigmas(self) -> Array:
        """(15,) at the last epoch, where a smoother has nothing to add."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance[-1]))[9:])

    def light(self) -> Filtered:
        """Without what only the run back needs: two thirds of the memory."""
        nothing = np.zeros((0, 0))
        return replace(
            self, covariance=self.covariance[-1:].copy(), phi=nothing,
            measurements=(nothing, nothing, nothing),
        )  # fmt: skip


@kernel
def mean_rate(t: Array, dtheta: Array, a: int, b: int, par: Array) -> Vec3:
    """Corrected mean rate over the steps a ... b-1, rad/s."""
    x, y, z = 0.0, 0.0, 0.0
    for k in range(a, b):
        x += dtheta[k, 0]
        y += dtheta[k, 1]
        z += dtheta[k, 2]
    dt = t[b] - t[a]
    return (x / dt - par[3], y / dt - par[4], (z / dt - par[5]) * (1.0 - par[10]))


@kernel
def mean_force(t: Array, dvel: Array, a: int, b: int) -> tuple[float, float]:
    """Mean specific force right and forward over the steps a ... b-1, m/s2."""
    x, y = 0.0, 0.0
    for k in range(a, b):
        x += dvel[k, 0]
        y += dvel[k, 1]
    dt = t[b] - t[a]
    return (x / dt, y / dt)


@entry_kernel
def run_epochs(
    imu: tuple[Array, Array, Array, BoolArray],
    gap_attitude: Array,
    gap_velocity: Array,
    epochs: IntArray,
    stopped: BoolArray,
    use: tuple[bool, bool, bool],
    speed: Array,
    fix: IntArray,
    fixes: Array,
    ago: Array,
    arm: Vec3,
    shaken: Array,
    skewed: Array,
    noise: Noise,
    absolute: bool,
    earth: Ellipsoid,
    rows: Array,
    parameters: Array,
    covariance: Array,
    fed_back: Array,
    phi: Array,
    kept: tuple[Array, Array, Array, IntArray],
    until: IntArray,
    counts: Array,
) -> None:
    """The loop over epochs; outputs of the first epoch hold the start."""
    t, dtheta, dvel, coast = imu
    p = covariance[0].copy()
    par, now = parameters[0].copy(), parameters[0].copy()
    x, h, work = np.zeros(SIZE), np.zeros(SIZE), np.zeros((SIZE, SIZE))
    seen = np.zeros(fixes.shape[1])
    lost = np.zeros(LOST)
    for e in range(epochs.shape[0]):
        b = epochs[e]
        rate, force = (0.0, 0.0, 0.0), (0.0, 0.0)
        if e > 0:
            a = epochs[e - 1]
            skew = (skewed[e, 0], skewed[e, 1], skewed[e, 2])
            now[:] = par
            for j in range(3):
                now[3 + j] += par[14] * skew[j]
            run_block(t, dtheta, dvel, coast, a, b, rows, now, absolute, earth)
            rate = mean_rate(t, dtheta, a, b, now)
            dt = t[b] - t[a]
            force = mean_force(t, dvel, a, b)
            predict(
                p, rows[(a + b) // 2], rate, force, shaken[e], skew, dt, phi[e], work,
                noise, absolute, earth,
            )  # fmt: skip
            for k in range(a, b):
                if gap_velocity[k] > 0.0:
                    left = (gap_attitude[k, 0], gap_attitude[k, 1], gap_attitude[k, 2])
                    c_wb = attitude_of(rows[k])
                    open_gap(p, c_wb, left, gap_velocity[k], t[k + 1] - t[k])
            if stopped[e]:
                at_rest(x, p, h, rows[b], rate, use[0], use[1], noise, kept, counts, earth)
            under_way(
                x, p, h, rows[b], par, rate, force[1], speed[e], use[2] and not stopped[e], noise,
                kept, counts,
            )  # fmt: skip
        if fix[e] >= 0:
            k = fix[e]
            arms = arms_of(attitude_of(rows[b]), rate, arm)
            take_arms_off(fixes[k], place_of(rows[b]), arms, seen)
            if set_on_fix(lost, t[b], seen, ago[k], p, rows[b], fed_back[e], earth):
                counts[GNSS, 4] += 1.0
            rejected = counts[GNSS, 2]
            from_gnss(x, p, h, rows[b], seen, arms, ago[k], noise, kept, counts, earth)
            refused(lost, t[b], seen, counts[GNSS, 2] > rejected)
        symmetrise(p)
        take_off(rows[b], x, earth)
        take_off_parameters(par, x)
        fed_back[e] += x[:9]
        x[:] = 0.0
        parameters[e] = par
        covariance[e] = p
        until[e] = kept[3][0]


def run_filter(
    increments: Increments,
    gaps: GapSigmas,
    aids: Aids,
    start: FilterStart,
    *,
    noise: Noise,
    absolute: bool = False,
    earth: Ellipsoid,
) -> Filtered:
    """Run forward over the epochs from the first one.

    Parameters
    ----------
    increments : Increments
        Body axes; instants before the first epoch get no solution.
    gaps : GapSigmas
    aids : Aids
    start : FilterStart
    noise : Noise
    absolute : bool
        Absolute-free azimuth of the axes instead of relative-free.
    """
    n, m = increments.t.size, aids.epochs.size
    moving = int(np.count_nonzero(~aids.stopped))
    most = 2 * moving + 6 * (m - moving) + m + 6 * (np.count_nonzero(aids.fix >= 0) + 1)
    rows, parameters = np.zeros((n, ROW)), np.zeros((m, PARAMETERS))
    covariance, fed_back = np.zeros((m, SIZE, SIZE)), np.zeros((m, 9))
    rows[aids.epochs[0]], parameters[0], covariance[0] = (
        start.row,
        start.parameters,
        start.covariance,
    )
    phi = np.zeros((m, 9, SIZE))
    kept = (np.zeros((most, SIZE)), np.zeros((most, SIZE)), np.zeros((most, 2)), np.zeros(1, int))
    until, counts = np.zeros(m, np.int64), np.zeros((len(KINDS), 5))
    run_epochs(
        (_ready(increments.t), _ready(increments.dtheta), _ready(increments.dvel),
         np.require(increments.coast, np.bool_, ["C", "W"])),
        _ready(gaps.attitude), _ready(gaps.velocity),
        aids.epochs, aids.stopped, (aids.zupt, aids.zaru, aids.nhc), aids.speed, aids.fix,
        aids.fixes, aids.ago, aids.arm, aids.shaken, aids.skewed, noise, absolute, earth, rows,
        parameters, covariance, fed_back, phi, kept, until, counts,
    )  # fmt: skip
    u = int(kept[3][0])
    return Filtered(
        rows, parameters, covariance, fed_back, phi,
        (kept[0][:u], kept[1][:u], kept[2][:u]), until, _innovations(counts),
    )  # fmt: skip


def _innovations(counts: Array) -> dict[str, Innovations]:
    return {
        name: Innovations(int(a), int(b), int(c), float(d / max(a + c, 1.0)), int(e))
        for name, (a, b, c, d, e) in zip(KINDS, counts, strict=True)
        if a + c > 0
    }


def _ready(x: Array) -> Array:
    return np.require(x, np.float64, ["C", "W"])
