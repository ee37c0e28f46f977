"""Runs of the land filter whose errors are drawn from its own model, and how they are judged.

The simulator gives the truth and perfect increments; constant biases and white noise are added
here, in plain numpy, and so are fixes. The true start is the truth with errors drawn from P0. The
filter is told exactly that model, so its normalised errors must be chi-square: mean 1 per state.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vehnav.aiding.blocks import ROW, take_off
from vehnav.aiding.filter import PARAMETERS, Aids, FilterStart, run_filter
from vehnav.aiding.gaps import GapSigmas
from vehnav.aiding.vehicle import ACCEL_SCALE, CUT, GYRO_SCALE, SIZE, TACTICAL, Prior
from vehnav.earth import WGS84, c_en, ecef_from_geodetic
from vehnav.rotation import c_from_rotvec
from vehnav.simulate import ideal_log, make_scenario, stamps
from vehnav.simulate.motion import RIGID
from vehnav.simulate.scenarios import Scenario
from vehnav.strapdown.increments import Increments
from vehnav.units import DEG, DEG_PER_HOUR, NS

STANDARD_GRAVITY = 9.80665
PAPER = np.array([0, 1, 3, 4, 6, 7, 8, 9, 10, 11, 12, 13, 14])
"""The 13 states of paper 003: no height, no vertical velocity."""
GYRO_SCALE_PARAMETER, ACCEL_SCALE_PARAMETER = GYRO_SCALE - 9, ACCEL_SCALE - 9
NOTHING = 1e9
"""Sigmas of an innovation that is neither weighed down nor rejected."""


@dataclass(frozen=True)
class Grade:
    """A sensor whose errors are constant biases and white noise: rad/s, m/s2, per sqrt(s)."""

    gyro_bias: float
    accel_bias: float
    gyro: float
    accel: float


HG1700 = Grade(
    1.0 * DEG_PER_HOUR, 1e-3 * STANDARD_GRAVITY, 0.125 * DEG / 60.0, 0.02 / 60.0
)  # 1 deg/h, 1 mg, 0.125 deg/sqrt(h), 0.02 m/s/sqrt(h) (spec B 5)
MEMS_TACTICAL = Grade(10.0 * DEG_PER_HOUR, 2e-3 * STANDARD_GRAVITY, 0.25 * DEG / 60.0, 0.05 / 60.0)
MEMS_INDUSTRIAL = Grade(100.0 * DEG_PER_HOUR, 5e-3 * STANDARD_GRAVITY, 0.5 * DEG / 60.0, 0.1 / 60.0)


@dataclass(frozen=True)
class Way:
    """A truth with its perfect increments."""

    t: np.ndarray
    truth: object
    dtheta: np.ndarray
    dvel: np.ndarray


def town(latitude, duration=600.0, rate=50.0, seed=1):
    """Legs of a minute at 15 m/s with turns and slopes, stops of 15 s, at any latitude.

    The body does not lean, so that it moves along its own axis exactly.
    """
    made = make_scenario(f"town,duration={duration},first_stop=15,seed={seed}")
    motion = replace(made.motion, origin=(latitude * DEG, 0.65, 150.0), body=RIGID)
    return way_of(Scenario("town", motion), rate)


def way_of(scenario, rate=50.0):
    if isinstance(scenario, str):
        scenario = make_scenario(scenario)
    t_ns = stamps(scenario.motion.duration, rate)
    truth, imu = ideal_log(scenario.motion, t_ns, sampling="increments")
    return Way((t_ns - t_ns[0]) * NS, truth, imu.gyro[1:], imu.accel[1:])


def prior_of(grade, **more):
    """Position 1 m, velocity 0.05 m/s, tilt 0.05 deg, heading 0.5 deg (spec B 5)."""
    known = {
        "tilt": 0.05 * DEG, "heading": 0.5 * DEG, "velocity": 0.05, "position": (1.0, 1.0, 1.0),
        "gyro": grade.gyro_bias, "accel": grade.accel_bias, "odometer": 0.0, "mount": 0.0,
        "lever": 0.0, "gyro_scale": 0.0, "accel_scale": 0.0, "slip": 0.0,
        "squat": 0.0, "cut": 0.0,
    }  # fmt: skip
    return Prior(**(known | more))


def noise_of(grade, **more):
    """The filter's noise: that of the grade and nothing else."""
    known = {
        "gyro": grade.gyro, "accel": grade.accel, "accel_share": 0.0, "gyro_walk": 0.0,
        "accel_walk": 0.0, "huber": NOTHING, "gate": NOTHING, "turn": 0.0, "speed": 0.0,
        "odometer_share": 0.0,
    }  # fmt: skip
    return TACTICAL._replace(**(known | more))


def true_row(way, k, like):
    """(22,) navigation row of the truth at instant k, in the azimuth of the row ``like``.

    Its place is the computed one turned without twist until its up is the true up (gamma_3 = 0).
    """
    truth = way.truth
    c_en_k = c_en(truth.lat[k], truth.lon[k])
    place = like[:9].reshape(3, 3)
    up = place @ c_en_k[:, 2]  # true up in computed axes
    axis = np.cross(up, [0.0, 0.0, 1.0])
    # c_true c_computed^T takes the true up to the third axis by the shortest turn
    turn = shortest_turn(axis, up[2])
    c_we = turn @ place
    row = np.zeros(ROW)
    row[:9], row[9] = c_we.ravel(), truth.height[k]
    row[10:13] = c_we @ c_en_k @ truth.v_n[k]
    row[13:] = (c_we @ c_en_k @ truth.c_nb[k]).ravel()
    return row


def shortest_turn(axis, cosine):
    """Rotation by the vector whose sine and cosine are given (Rodrigues)."""
    x, y, z = axis
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + k + k @ k / (1.0 + cosine)


def navigation_error(way, k, row):
    """(9,) errors of a row by the definitions of the error model, computed minus true."""
    truth = way.truth
    true = true_row(way, k, row)
    r = ecef(row)
    r_true = ecef_from_geodetic(truth.lat[k], truth.lon[k], truth.height[k])
    position = row[:9].reshape(3, 3) @ (r - r_true)
    c, c_true = row[13:].reshape(3, 3), true[13:].reshape(3, 3)
    turn = c_true @ c.T
    alpha = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0],
                            turn[1, 0] - turn[0, 1]])  # fmt: skip
    velocity = row[10:13] - c @ c_true.T @ true[10:13]
    return np.concatenate([position, velocity, alpha])


def ecef(row):
    """(3,) Earth-fixed position of a navigation row."""
    up = row[6:9]
    radius = WGS84.a / np.sqrt(1.0 - WGS84.e2 * up[2] ** 2)
    return np.array([*((radius + row[9]) * up[:2]), (radius * (1 - WGS84.e2) + row[9]) * up[2]])


@dataclass(frozen=True)
class Drawn:
    """One run: its increments, start, true parameters and fixes."""

    increments: Increments
    start: FilterStart
    parameters: np.ndarray
    fixes: np.ndarray


def draw(way, grade, prior, noise, rng, *, position=1.5, velocity=0.05):
    """Errors of one run; fixes at every second with noise in m and m/s per axis."""
    p0 = prior.covariance()
    x = np.zeros(SIZE)  # not shaken
    x[:CUT] = rng.normal(size=CUT) * np.sqrt(np.diag(p0)[:CUT])
    dt = np.diff(way.t)[:, None]
    par = np.zeros(PARAMETERS)
    par[:6] = x[9:15]  # the filter starts with no bias known
    par[6:] = -x[15:]
    dtheta = way.dtheta.copy()
    dtheta[:, 2] /= 1.0 - par[GYRO_SCALE_PARAMETER]
    dvel = way.dvel.copy()
    dvel[:, 1] /= 1.0 - par[ACCEL_SCALE_PARAMETER]
    dtheta += par[3:6] * dt + grade.gyro * np.sqrt(dt) * rng.normal(size=dtheta.shape)
    dvel += par[:3] * dt + grade.accel * np.sqrt(dt) * rng.normal(size=dvel.shape)
    row = true_row(way, 0, start_axes(way))
    take_off(row, -x[:9], WGS84)
    fixes = draw_fixes(way, rng, position, velocity)
    increments = Increments(way.t, dtheta, dvel, np.zeros(way.t.size - 1, bool))
    return Drawn(increments, FilterStart(row, np.zeros(PARAMETERS), p0), par, fixes)


def shake(way, drawn, aids, rng):
    """Add lopsided vibration of 1 deg/s per axis, of which the gyro loses a drawn share."""
    drawn.parameters[CUT - 9] = np.sqrt(drawn.start.covariance[CUT, CUT]) * rng.normal()
    skewed = DEG * rng.normal(size=(aids.epochs.size, 3))
    block = np.searchsorted(aids.epochs, np.arange(way.t.size - 1), side="right")
    lost = drawn.parameters[CUT - 9] * skewed[np.minimum(block, aids.epochs.size - 1)]
    drawn.increments.dtheta[:] += lost * np.diff(way.t)[:, None]
    return replace(aids, skewed=skewed)


def start_axes(way):
    """A row with the place axes east, north, up at the start."""
    row = np.zeros(ROW)
    row[:9] = c_en(way.truth.lat[0], way.truth.lon[0]).T.ravel()
    return row


def draw_fixes(way, rng, position, velocity):
    """(k, 13) Earth-fixed position, velocity, variances and form, at the whole seconds after 0."""
    at = np.searchsorted(way.t, np.arange(1.0, way.t[-1] + 1e-6) - 1e-6)
    truth = way.truth
    out = np.zeros((at.size, 13))  # the form: direct
    out[:, :3] = ecef_from_geodetic(truth.lat[at], truth.lon[at], truth.height[at])
    out[:, :3] += position * rng.normal(size=(at.size, 3))
    out[:, 3:6] = np.einsum("kij,kj->ki", c_en(truth.lat[at], truth.lon[at]), truth.v_n[at])
    out[:, 3:6] += velocity * rng.normal(size=(at.size, 3))
    out[:, 6:9], out[:, 9:12] = position**2, velocity**2
    return out


def aids_of(way, drawn, *, epoch=0.1, gnss=None, zupt=False, nhc=False, speed=None):
    """Epochs every 0.1 s; fixes where ``gnss`` (t) is true; the stops of the truth."""
    step = round(epoch / (way.t[1] - way.t[0]))
    epochs = np.arange(0, way.t.size, step)
    seconds = np.arange(1.0, way.t[-1] + 1e-6)
    at = np.searchsorted(way.t[epochs], seconds - 1e-6)
    fix = np.full(epochs.size, -1, np.int64)
    use = np.ones(seconds.size, bool) if gnss is None else np.array([gnss(s) for s in seconds])
    fix[at[use]] = np.flatnonzero(use)
    standing = way.truth.stopped
    count = np.concatenate([[0], np.cumsum(standing)])
    before = np.concatenate([[0], epochs[:-1]])
    still = count[epochs + 1] - count[before] == epochs - before + 1
    reading = np.full(epochs.size, np.nan) if speed is None else speed[epochs]
    return Aids(
        epochs.astype(np.int64), still, zupt, False, nhc, reading, fix, drawn.fixes,
        np.zeros(seconds.size), np.zeros((epochs.size, 6)), np.zeros((epochs.size, 3)),
    )  # fmt: skip


def filtered(drawn, aids, noise, *, absolute=False):
    """The forward solution of a run."""
    n = drawn.increments.t.size
    nothing = GapSigmas(np.zeros((n - 1, 3)), np.zeros(n - 1))
    return run_filter(
        drawn.increments, nothing, aids, drawn.start, noise=noise, absolute=absolute, earth=WGS84
    )


def nees(way, drawn, aids, found, states, every=50):
    """Squared errors in the metric of the covariance, at every ``every``-th epoch."""
    out = []
    for e in range(every, aids.epochs.size, every):
        k = aids.epochs[e]
        x = np.concatenate([
            navigation_error(way, k, found.rows[k]),
            drawn.parameters[:6] - found.parameters[e][:6],
            found.parameters[e][6:] - drawn.parameters[6:],
        ])[states]  # fmt: skip
        p = found.covariance[e][np.ix_(states, states)]
        out.append(x @ np.linalg.solve(p, x))
    return np.array(out)


def forward_speed(way):
    """(n,) m/s: velocity along the forward axis of the body."""
    return np.einsum("kj,kj->k", way.truth.c_nb[:, :, 1], way.truth.v_n)


def normalised(found):
    """(fixes, 6) squared innovations over their variances, of runs that have fixes only."""
    z = found.measurements[2]
    return (z[:, 0] ** 2 / z[:, 1]).reshape(-1, 6)


def remounted(way, *, right, up):
    """The same drive felt in a case turned so that it travels ``right`` and ``up`` of its nose.

    ``v_b = v (right, 1, up)`` to the first order, rad.
    """
    c = c_from_rotvec([up, 0.0, -right])  # old body to new
    truth = replace(way.truth, c_nb=way.truth.c_nb @ c.T)
    return Way(way.t, truth, way.dtheta @ c.T, way.dvel @ c.T)
