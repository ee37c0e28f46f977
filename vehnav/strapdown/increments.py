"""From samples to increments: what the sensors measured over each step.

A step runs from sample k to sample k+1. Rates are integrated by 4-point quadrature with the true,
uneven steps (spec A 5.4): fourth order, against first order of a held sample and second order of
the trapezoid; one-sided at the ends and beside gaps. Over a gap, and where neighbouring steps are
too uneven, the trapezoid is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Holding = Literal["cubic", "trapezoid", "left", "right"]

GAP_FACTOR = 1.5
"""A step longer than this many median steps is a gap (cli.md, Gaps)."""
HOLD = 0.5
"""s beside a long gap whose mean rate is held over it."""
MAX_UNEVEN = 3.0
"""4-point weights are used while neighbouring steps differ by less than this factor: beyond it
they blow up (noise gain 5.3 at a factor of 20; spec A 5.4)."""


@dataclass(frozen=True)
class Increments:
    """What the sensors measured over n-1 steps between n instants, in body axes.

    Attributes
    ----------
    t : (n,)
        Instants, s since the start.
    dtheta : (n-1, 3)
        Integral of omega_ib_b over the step, rad.
    dvel : (n-1, 3)
        Integral of the specific force f_b over the step, m/s.
    coast : (n-1,) bool
        Steps over a gap so long that the velocity is held instead of integrated.
    """

    t: Array
    dtheta: Array
    dvel: Array
    coast: npt.NDArray[np.bool_]

    @property
    def dt(self) -> Array:
        """(n-1,) step lengths, s; negative when reversed."""
        return np.diff(self.t)

    def corrected(self, gyro_bias: npt.ArrayLike, accel_bias: npt.ArrayLike) -> Increments:
        """With the biases of the gyros and of the accelerometers removed.

        Parameters
        ----------
        gyro_bias : (3,) or (n-1, 3)
            rad/s, body axes; per step where it varies.
        accel_bias : (3,) or (n-1, 3)
            m/s2, the same.
        """
        dtheta = self.dtheta - np.asarray(gyro_bias, float) * self.dt[:, None]
        dvel = self.dvel - np.asarray(accel_bias, float) * self.dt[:, None]
        return Increments(self.t, dtheta, dvel, self.coast)

    def part(self, first: int, last: int) -> Increments:
        """The steps between instants ``first`` and ``last``, both included."""
        steps = slice(first, last)
        return Increments(
            self.t[first : last + 1], self.dtheta[steps], self.dvel[steps], self.coast[steps]
        )

    def reversed(self) -> Increments:
        """The same motion run backward in time: steps in reverse order, all signs turned.

        The instants decrease, so the mechanization takes negative steps; its formulas hold.
        """
        return Increments(
            self.t[::-1].copy(),
            -self.dtheta[::-1],
            -self.dvel[::-1],
            self.coast[::-1].copy(),
        )


def gap_steps(t: Array) -> npt.NDArray[np.bool_]:
    """(n-1,) which steps are longer than 1.5 median steps."""
    dt = np.diff(t)
    return np.asarray(dt > GAP_FACTOR * np.median(dt))


def increments_from_rates(
    t: Array,
    omega_ib_b: Array,
    f_b: Array,
    *,
    max_gap: float,
    holding: Holding = "cubic",
) -> Increments:
    """Integrate point samples over the steps between them.

    Parameters
    ----------
    t : (n,)
        Instants, s, strictly increasing.
    omega_ib_b, f_b : (n, 3)
        Angular rate, rad/s, and specific force, m/s2, at the instants.
    max_gap : float
        s; a gap up to this long is bridged with the values at its edges, a longer one coasts.
    holding : {"cubic", "trapezoid", "left", "right"}
        How samples are joined; ``left`` is paper 004's.
    """
    if t.size < 2:
        raise ValueError("at least two samples are needed")
    both = np.concatenate([omega_ib_b, f_b], axis=1)
    gaps = gap_steps(t)
    integral = _quadrature(t, both, gaps, holding)
    coast = gaps & (np.diff(t) > max_gap)
    for k in np.flatnonzero(coast):
        integral[k, :3] = _held_rate(t, omega_ib_b, int(k)) * (t[k + 1] - t[k])
    return Increments(t, integral[:, :3], integral[:, 3:], coast)


def _held_rate(t: Array, omega: Array, k: int) -> Array:
    """(3,) rate held over the gap after sample k: the mean over the HOLD seconds on both sides.

    A single sample at each edge would carry its vibration over the whole gap.
    """
    before = (t <= t[k]) & (t > t[k] - HOLD)
    after = (t >= t[k + 1]) & (t < t[k + 1] + HOLD)
    return np.asarray(0.5 * (omega[before].mean(axis=0) + omega[after].mean(axis=0)))


def increments_from_log(t: Array, dtheta: Array, dvel: Array, *, max_gap: float) -> Increments:
    """Increments as logged: row k covers the step that ends at instant k (row 0 is not used).

    Over a gap the logged increment covers one ordinary step only; it is stretched to the length of
    the gap, which holds its mean rate.
    """
    dt = np.diff(t)
    gaps = gap_steps(t)
    stretch = np.where(gaps, dt / np.median(dt), 1.0)[:, None]
    return Increments(t, dtheta[1:] * stretch, dvel[1:] * stretch, gaps & (dt > max_gap))


def _quadrature(t: Array, y: Array, gaps: npt.NDArray[np.bool_], holding: Holding) -> Array:
    """(n-1, m) integrals of y (n, m) over the steps."""
    h = np.diff(t)[:, None]
    if holding == "left":
        return np.asarray(y[:-1] * h)
    if holding == "right":
        return np.asarray(y[1:] * h)
    out = 0.5 * h * (y[:-1] + y[1:])
    if holding == "trapezoid" or t.size < 4:
        return out
    alike = (h[1:] <= MAX_UNEVEN * h[:-1]) & (h[:-1] <= MAX_UNEVEN * h[1:])
    alike &= ~(gaps[1:] | gaps[:-1])[:, None]
    three = alike[:-1] & alike[1:]
    first = _one_sided(h[:-2], h[1:-1], h[2:], y[:-3], y[1:-2], y[2:-1], y[3:])
    last = _one_sided(h[2:], h[1:-1], h[:-2], y[3:], y[2:-1], y[1:-2], y[:-3])
    out[:-2] = np.where(three, first, out[:-2])
    out[2:] = np.where(three, last, out[2:])
    w0, w1, w2, w3 = _weights(h[:-2], h[1:-1], h[2:])
    central = w0 * y[:-3] + w1 * y[1:-2] + w2 * y[2:-1] + w3 * y[3:]
    out[1:-1] = np.where(three, central, out[1:-1])
    return out


def _one_sided(h: Array, b: Array, c: Array, y0: Array, y1: Array, y2: Array, y3: Array) -> Array:
    """Integral over [0, h] of the cubic through the nodes 0, h, h+b, h+b+c (Newton's form)."""
    d01, d12, d23 = (y1 - y0) / h, (y2 - y1) / b, (y3 - y2) / c
    d012, d123 = (d12 - d01) / (h + b), (d23 - d12) / (b + c)
    d0123 = (d123 - d012) / (h + b + c)
    trapezoid = 0.5 * h * (y0 + y1)
    return np.asarray(trapezoid - h**3 / 6.0 * (d012 - (0.5 * h + b) * d0123))


def _weights(a: Array, h: Array, b: Array) -> tuple[Array, Array, Array, Array]:
    """Weights of the nodes -a, 0, h, h+b for the integral over [0, h] (spec A 5.4)."""
    s = a + h + b
    return (
        -(h**3) * (h + 2 * b) / (12 * a * (a + h) * s),
        h * (h**2 + 4 * a * h + 2 * b * h + 6 * a * b) / (12 * a * (h + b)),
        h * (h**2 + 2 * a * h + 4 * b * h + 6 * a * b) / (12 * b * (a + h)),
        -(h**3) * (h + 2 * a) / (12 * b * (b + h) * s),
    )
