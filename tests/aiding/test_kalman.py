"""The filter and the smoother kernels against dense batch least squares (numpy), and by law."""

from __future__ import annotations

import numpy as np
import pytest

from vehnav.aiding.kalman import (
    adjoint_propagate,
    adjoint_update,
    propagate,
    symmetrise,
    transition_rows,
    update,
)

N, M, STEPS = 5, 3, 12
"""States, states with rows in F, epochs."""


def problem(seed=0):
    rng = np.random.default_rng(seed)
    f = 0.3 * rng.normal(size=(M, N))
    p0 = np.diag(rng.uniform(0.5, 2.0, N))
    q = np.zeros((N, N))
    q[:M, :M] = 0.05 * np.eye(M)
    q[3, 3], q[4, 4] = 0.02, 0.1
    h = rng.normal(size=(STEPS, 2, N))
    z = rng.normal(size=(STEPS, 2))
    r = rng.uniform(0.2, 1.0, (STEPS, 2))
    return f, p0, q, h, z, r


def full_transition(f, dt):
    a = np.zeros((N, N))
    a[:M] = f
    return np.eye(N) + a * dt + 0.5 * dt * dt * a @ a


def batch(f, p0, q, h, z, r, dt, upto):
    """Weighted least squares over all states at once: means and covariances of every epoch."""
    phi = full_transition(f, dt)
    information, vector = np.zeros((STEPS * N, STEPS * N)), np.zeros(STEPS * N)
    information[:N, :N] += np.linalg.inv(p0)
    root = np.linalg.inv(q)
    for k in range(1, STEPS):
        a, b = slice((k - 1) * N, k * N), slice(k * N, (k + 1) * N)
        information[b, b] += root
        information[a, a] += phi.T @ root @ phi
        information[a, b] -= phi.T @ root
        information[b, a] -= root @ phi
    for k in range(upto):
        s = slice(k * N, (k + 1) * N)
        for j in range(2):
            information[s, s] += np.outer(h[k, j], h[k, j]) / r[k, j]
            vector[s] += h[k, j] * z[k, j] / r[k, j]
    covariance = np.linalg.inv(information)
    mean = covariance @ vector
    return mean.reshape(STEPS, N), covariance


def run(f, p0, q, h, z, r, dt, *, feedback=False):
    """The kernels as the land filter uses them; with feedback the estimate goes into ``base``."""
    x, p, base = np.zeros(N), p0.copy(), np.zeros(N)
    work, phi = np.zeros((N, N)), np.zeros((M, N))
    transition_rows(f, dt, phi)
    dense = full_transition(f, dt)
    out, kept = [], []
    for k in range(STEPS):
        if k:
            propagate(p, phi, work[:M])
            p += q
            x, base = dense @ x, dense @ base
        for j in range(2):
            gain = np.zeros(N)
            zz = z[k, j] - h[k, j] @ base
            innovation, s, _ = update(x, p, h[k, j], zz, r[k, j], 1e9, 1e9, gain)
            kept.append((h[k, j], gain, innovation, s))
        symmetrise(p)
        if feedback:
            base, x = base + x, np.zeros(N)
        out.append((base + x, p.copy()))
    return out, kept, phi


@pytest.mark.parametrize("feedback", [False, True])
def test_filter_and_smoother_equal_batch_least_squares(feedback):
    data = problem()
    dt = 0.4
    out, kept, phi = run(*data, dt, feedback=feedback)
    for k in (0, 5, STEPS - 1):
        mean, covariance = batch(*data, dt, k + 1)
        s = slice(k * N, (k + 1) * N)
        assert np.allclose(out[k][0], mean[k], atol=1e-9)
        assert np.allclose(out[k][1], covariance[s, s], atol=1e-9)
    mean, covariance = batch(*data, dt, STEPS)
    lam, big, work = np.zeros(N), np.zeros((N, N)), np.zeros((N, N))
    for k in range(STEPS - 1, -1, -1):
        x, p = out[k]
        smoothed = p - p @ big @ p
        s = slice(k * N, (k + 1) * N)
        assert np.allclose(x - p @ lam, mean[k], atol=1e-9)
        assert np.allclose(smoothed, covariance[s, s], atol=1e-9)
        assert np.all(np.diag(smoothed) <= np.diag(p) + 1e-12)
        for hh, gain, innovation, variance in reversed(kept[2 * k : 2 * k + 2]):
            adjoint_update(lam, big, hh, gain, innovation, variance, np.zeros(N))
        if k:
            adjoint_propagate(lam, big, phi, work)


def test_huber_pull_and_gate():
    """Beyond 2 sigmas the pull grows no more as the innovation does; beyond the gate none."""

    def pull(z, huber=2.0, gate=10.0):
        x, p = np.zeros(1), np.ones((1, 1))
        innovation, s, nis = update(x, p, np.ones(1), z, 1.0, huber, gate, np.zeros(1))
        assert innovation == z
        assert nis == pytest.approx(z * z / 2.0)
        return float(x[0]), s

    assert pull(2.0) == (1.0, 2.0)  # innovation variance 2, gain one half
    limit = 2.0 * np.sqrt(2.0) / 2.0  # z / (|z| sqrt(S) / 2) with P = 1
    assert pull(5.0)[0] == pytest.approx(limit)
    assert pull(9.0)[0] == pytest.approx(limit)
    assert pull(15.0) == (0.0, 0.0)
