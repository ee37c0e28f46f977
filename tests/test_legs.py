"""The drive between two stops: against the mechanization, and covariances against draws."""

from __future__ import annotations

import numpy as np
import pytest

from vehnav.legs import LegNoise, Sensitivity, fit_legs, open_leg, sensitivity
from vehnav.rotation import c_from_rotvec, c_nb_from_angles
from vehnav.strapdown.enu import Solution, mechanize_enu
from vehnav.strapdown.increments import Increments, increments_from_rates

G = 9.81
START = (0.8, 0.2, 100.0)
NOISE = LegNoise(
    gyro_white=4e-4,
    accel_white=1e-2,
    gyro_bias_walk=1e-5,
    accel_bias=0.02,
    level=1.7e-3,
    gravity=G,
)


def drive(seconds: float = 60.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A turning, braking leg: times, rates and specific force in the body, level road."""
    t = np.arange(0.0, seconds, 0.02)
    omega, f = np.zeros((t.size, 3)), np.zeros((t.size, 3))
    omega[:, 2] = 0.3 * np.sin(2 * np.pi * t / 25.0)
    f[:, 1] = 1.5 * np.sin(2 * np.pi * t / seconds)
    f[:, 2] = G
    return t, omega, f


def solve(increments: Increments, tilt: np.ndarray) -> Solution:
    c_nb = c_from_rotvec(tilt) @ c_nb_from_angles(0.7, 0.02, -0.03)
    return mechanize_enu(increments, position=START, c_nb=c_nb)


def errors_of(perturbed: Solution, true: Solution) -> np.ndarray:
    """(m, 7) psi, dv, dr: by the attitude matrices and positions of two solutions."""
    turn = perturbed.c_nb @ true.c_nb.transpose(0, 2, 1)
    psi = 0.5 * np.stack(
        [
            turn[:, 2, 1] - turn[:, 1, 2],
            turn[:, 0, 2] - turn[:, 2, 0],
            turn[:, 1, 0] - turn[:, 0, 1],
        ],
        axis=1,
    )
    d = perturbed.position - true.position
    radius = np.array([6.39e6 * np.cos(START[0]), 6.37e6])  # to 0.2 %
    dr = np.stack([d[:, 1] * radius[0], d[:, 0] * radius[1]], axis=1)
    return np.concatenate([psi, (perturbed.v_n - true.v_n)[:, :2], dr], axis=1)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("source", ["gyro", "accel", "tilt"])
def test_sensitivities_are_the_differences_of_two_mechanizations(source, axis) -> None:
    t, omega, f = drive()
    size = {"gyro": 1e-5, "accel": 1e-3, "tilt": 1e-4}[source]
    unit = np.eye(3)[axis] * size
    true = solve(increments_from_rates(t, omega, f, max_gap=1.0), np.zeros(3))
    extra = {"gyro": (unit, 0.0), "accel": (0.0, unit), "tilt": (0.0, 0.0)}[source]
    wrong = solve(
        increments_from_rates(t, omega + extra[0], f + extra[1], max_gap=1.0),
        unit if source == "tilt" else np.zeros(3),
    )
    found = errors_of(wrong, true)
    leg = sensitivity(t[::5], true.c_nb[::5], true.v_n[::5], gravity=G)
    linear = getattr(leg, source)[..., axis] * size
    miss = np.abs(linear - found[::5]).max(axis=0)
    size_of = np.abs(found[::5]).max(axis=0)
    # left out of the linear model: Earth and transport rate times a minute (0.5 %), Schuler (0.3 %)
    # and Coriolis; a heading error turns the Earth rate into tilt, g times as strong (5 %)
    share = 0.05 if axis == 2 else 0.01
    assert np.all(miss[:3] < 1e-6)  # rad, of up to 6e-4
    assert miss[3:5].max() < share * size_of[3:5].max()
    assert miss[5:7].max() < share * size_of[5:7].max()


def straight(seconds: float) -> Sensitivity:
    """A leg heading north without acceleration: what the analytic noise covariances assume."""
    t = np.arange(0.0, seconds + 1e-9, 0.1)
    v_n = np.tile([0.0, 10.0, 0.0], (t.size, 1))
    return sensitivity(t, np.tile(np.eye(3), (t.size, 1, 1)), v_n, gravity=G)


def drawn_noise(leg: Sensitivity, runs: int, rng: np.random.Generator) -> np.ndarray:
    """(runs, m, 7) errors from drawn white noise: Euler sums on the grid."""
    t = leg.t
    dt = t[1] - t[0]
    steps = t.size - 1
    psi = np.cumsum(NOISE.gyro_white * np.sqrt(dt) * rng.normal(size=(runs, steps, 3)), axis=1)
    psi = np.concatenate([np.zeros((runs, 1, 3)), psi], axis=1)
    middle = 0.5 * (psi[:, 1:] + psi[:, :-1])
    a = G * dt * np.stack([middle[..., 1], -middle[..., 0]], axis=-1)  # psi x g
    a += NOISE.accel_white * np.sqrt(dt) * rng.normal(size=(runs, steps, 2))
    v = np.concatenate([np.zeros((runs, 1, 2)), np.cumsum(a, axis=1)], axis=1)
    r = np.cumsum(0.5 * dt * (v[:, 1:] + v[:, :-1]), axis=1)
    r = np.concatenate([np.zeros((runs, 1, 2)), r], axis=1)
    return np.concatenate([psi, v, r], axis=2)


def drawn_legs(leg: Sensitivity, runs: int) -> tuple[np.ndarray, np.ndarray]:
    """(runs, m, 7) errors and (runs, 4) what the stop shows, every source drawn."""
    rng = np.random.default_rng(11)
    duration = leg.t[-1]
    gyro = NOISE.gyro_bias_walk * np.sqrt(duration) * rng.normal(size=(runs, 3))
    accel = NOISE.accel_bias * rng.normal(size=(runs, 3))
    level = NOISE.level * rng.normal(size=(runs, 2, 2))
    start = accel @ leg.level_start.T
    start[:, :2] += level[:, 0]
    errors = drawn_noise(leg, runs, rng)
    for value, part in ((gyro, leg.gyro), (accel, leg.accel), (start, leg.tilt)):
        errors += np.einsum("mkj,rj->rmk", part, value)
    seen = np.concatenate([errors[:, -1, 3:5], errors[:, -1, :2]], axis=1)
    seen[:, 2:] -= (accel @ leg.level_end.T)[:, :2] + level[:, 1]
    return errors, seen


@pytest.fixture(scope="module")
def regression() -> tuple[Sensitivity, np.ndarray, np.ndarray]:
    leg = straight(60.0)
    return leg, *drawn_legs(leg, 1500)


def test_what_remains_has_the_variance_that_is_stated(regression) -> None:
    """The normalised square of the remaining error is 1 at every instant, for every state."""
    leg, errors, seen = regression
    remaining = np.zeros((seen.shape[0], 3, 7))
    index = [leg.t.size // 4, leg.t.size // 2, leg.t.size - 1]
    for k, z in enumerate(seen):
        (fit,), _ = fit_legs([leg], z[None, :], NOISE)
        sigma = np.sqrt(np.maximum(fit.variance[index], 1e-18))  # velocity at the end: known
        remaining[k] = (errors[k, index] - fit.mean[index]) / sigma
    share = np.mean(remaining**2, axis=0)
    # chi-square of 1500 draws: 1 +- 0.037 (one sigma); 5 sigma
    assert share[:2] == pytest.approx(1.0, abs=0.19)
    assert share[2, [0, 1, 5, 6]] == pytest.approx(1.0, abs=0.19)


def test_regression_beats_the_linear_distribution(regression) -> None:
    leg, errors, seen = regression
    s = (leg.t / leg.t[-1])[None, :, None]
    linear = errors[..., 3:5] - s * seen[:, None, :2]
    r_linear = np.sum(0.1 * linear, axis=1)
    r_fit = np.zeros((400, 2))
    for k in range(400):
        (fit,), _ = fit_legs([leg], seen[k : k + 1], NOISE)
        r_fit[k] = errors[k, -1, 5:7] - fit.mean[-1, 5:7]
    assert np.sqrt(np.mean(r_fit**2)) < 0.5 * np.sqrt(np.mean(r_linear**2))


def test_an_open_leg_has_the_variance_of_the_draws(regression) -> None:
    leg, errors, _ = regression
    stated = open_leg(leg, NOISE).variance[-1]
    assert np.var(errors[:, -1], axis=0) == pytest.approx(stated, rel=0.2)


def test_common_accelerometer_bias_shows_after_a_turn() -> None:
    """Two levelled stops at headings 180 deg apart: the tilt change is twice the bias over g."""
    t = np.arange(0.0, 60.0, 0.1)
    heading = np.interp(t, [0.0, 20.0, 40.0, 60.0], [0.0, 0.0, np.pi, np.pi])
    c_nb = c_nb_from_angles(heading, 0.0, 0.0)
    leg = sensitivity(t, c_nb, np.zeros((t.size, 3)), gravity=G)
    bias = np.array([0.03, -0.02, 0.0])
    end = (leg.accel + leg.tilt @ leg.level_start)[-1] @ bias
    seen = np.concatenate([end[3:5], end[:2] - (leg.level_end @ bias)[:2]])
    quiet = LegNoise(1e-6, 1e-5, 1e-9, 0.1, 1e-6, G)
    _, found = fit_legs([leg], seen[None, :], quiet)
    assert found[:2] == pytest.approx(bias[:2], rel=0.01)
    assert seen[2] == pytest.approx(2.0 * bias[1] / G, rel=0.05)
