"""Kalman filter and smoother that know no navigation: kernels on small arrays.

Error states in closed loop: the estimate x is fed back and set to zero after every epoch; what is
carried on is the covariance. Measurements are scalars, one after the other.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vehnav.kernel import kernel

Array = npt.NDArray[np.float64]


@kernel
def transition_rows(f: Array, dt: float, phi: Array) -> None:
    """First m rows of 1 + F dt + F^2 dt^2 / 2 into ``phi`` (m, n); F (m, n), other rows zero."""
    m, n = f.shape
    half = 0.5 * dt * dt
    for a in range(m):
        for b in range(n):
            total = 0.0
            for c in range(m):
                total += f[a, c] * f[c, b]
            phi[a, b] = dt * f[a, b] + half * total
        phi[a, a] += 1.0


@kernel
def propagate(p: Array, phi: Array, work: Array) -> None:
    """P <- Phi P Phi^T: first m rows of Phi given, the other states constant."""
    m, n = phi.shape
    for a in range(m):
        for b in range(n):
            total = 0.0
            for c in range(n):
                total += phi[a, c] * p[c, b]
            work[a, b] = total
    for a in range(m):
        for b in range(m):
            total = 0.0
            for c in range(n):
                total += work[a, c] * phi[b, c]
            p[a, b] = total
        for b in range(m, n):
            p[a, b] = work[a, b]
            p[b, a] = p[a, b]


@kernel
def update(
    x: Array, p: Array, h: Array, z: float, r: float, huber: float, gate: float, gain: Array
) -> tuple[float, float, float]:
    """One scalar measurement z = h x + noise of variance ``r``.

    Writes x, P and the gain. A normalised innovation over ``huber`` inflates r so that the pull
    stays at ``huber`` sigmas of the inflated one; over ``gate`` nothing is done. Returns the
    innovation, its variance as used (0: rejected), and the normalised innovation squared before.
    """
    n = x.shape[0]
    innovation = z
    s = r
    for a in range(n):
        total = 0.0
        for b in range(n):
            total += p[a, b] * h[b]
        gain[a] = total
        innovation -= h[a] * x[a]
    for a in range(n):
        s += h[a] * gain[a]
    nis = innovation * innovation / s
    if nis > gate * gate:
        gain[:] = 0.0
        return innovation, 0.0, nis
    if nis > huber * huber:
        s = abs(innovation) * np.sqrt(s) / huber
    for a in range(n):
        ga = gain[a] / s
        for b in range(n):
            p[a, b] -= ga * gain[b]
    for a in range(n):
        gain[a] /= s
        x[a] += gain[a] * innovation
    return innovation, s, nis


@kernel
def symmetrise(p: Array) -> None:
    """P <- (P + P^T) / 2."""
    n = p.shape[0]
    for a in range(n):
        for b in range(a):
            mean = 0.5 * (p[a, b] + p[b, a])
            p[a, b] = mean
            p[b, a] = mean


# ---- backward: the adjoint form of the fixed-interval smoother (Bryson and Frazier) ------------


@kernel
def adjoint_update(
    lam: Array, big: Array, h: Array, gain: Array, innovation: float, s: float, work: Array
) -> None:
    """Back through one scalar update: lambda (n,), Lambda (n, n).

    lambda <- (1 - K h)^T lambda - h innovation / s;
    Lambda <- (1 - K h)^T Lambda (1 - K h) + h h^T / s.
    """
    n = lam.shape[0]
    along = 0.0
    quadratic = 0.0
    for a in range(n):
        along += gain[a] * lam[a]
        total = 0.0
        for b in range(n):
            total += big[a, b] * gain[b]
        work[a] = total
    for a in range(n):
        quadratic += gain[a] * work[a]
    for a in range(n):
        lam[a] -= h[a] * (along + innovation / s)
        for b in range(n):
            big[a, b] += h[a] * h[b] * (quadratic + 1.0 / s) - h[a] * work[b] - work[a] * h[b]


@kernel
def adjoint_propagate(lam: Array, big: Array, phi: Array, work: Array) -> None:
    """Back over a step: lambda <- Phi^T lambda, Lambda <- Phi^T Lambda Phi."""
    m, n = phi.shape
    for b in range(n):
        total = lam[b] if b >= m else 0.0
        for a in range(m):
            total += phi[a, b] * lam[a]
        work[0, b] = total
    for b in range(n):
        lam[b] = work[0, b]
    for a in range(n):  # work = Lambda Phi
        for b in range(n):
            total = big[a, b] if b >= m else 0.0
            for c in range(m):
                total += big[a, c] * phi[c, b]
            work[a, b] = total
    for a in range(n):
        for b in range(n):
            total = work[a, b] if a >= m else 0.0
            for c in range(m):
                total += phi[c, a] * work[c, b]
            big[a, b] = total
