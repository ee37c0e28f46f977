"""Vibration: sums of tones on the velocity and on the attitude of the vehicle.

Tones have closed-form derivatives, so that the ideal sensors stay exact. Slow tones (under 4 Hz)
are the suspension and the road, fast ones (over 5 Hz) the engine, the tyres and the body: a stop
rule sees them differently (0.25 s means pass the slow ones only).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from vehnav.units import DEG

Array = npt.NDArray[np.float64]
Envelope = Literal["always", "moving"]

HALF_SPEED = 0.7
"""m/s at which the vibration of the road has half its full strength."""


@dataclass(frozen=True)
class Tones:
    """Tones of six channels: velocity right, forward, up (m/s); heading, pitch, roll (rad).

    Attributes
    ----------
    omega : (m,)
        Angular frequencies, rad/s.
    cosine, sine : (m, 6)
        Coefficients of cos(omega t) and sin(omega t).
    envelope : {"always", "moving"}
        ``moving``: times v^2 / (v^2 + v0^2), zero at rest; ``always``: constant.
    """

    omega: Array
    cosine: Array
    sine: Array
    envelope: Envelope = "always"

    def value_and_rate(
        self, t: Array, speed: Array, speed_dot: Array, *, even: bool
    ) -> tuple[Array, Array]:
        """Values and time derivatives, both (n p, 6), at instants ``t`` (n, p) in rows.

        With ``even`` every row has the same offsets to its first instant: sines are taken of the
        first column only and turned on by the addition theorem.
        """
        if even:
            rows = self._carrier(t[:, 0]) @ self._coefficients(t[0] - t[0, 0])
            both = np.swapaxes(rows, 0, 1).reshape(-1, 12)
        else:
            both = self._carrier(t.ravel()) @ self._coefficients(np.zeros(1))[0]
        y, y_dot = both[:, :6], both[:, 6:]
        if self.envelope == "always":
            return y, y_dot
        q = speed**2 + HALF_SPEED**2
        e = speed**2 / q
        e_dot = 2.0 * speed * speed_dot * HALF_SPEED**2 / q**2
        return e[:, None] * y, e[:, None] * y_dot + e_dot[:, None] * y

    def _carrier(self, t: Array) -> Array:
        """(n, 2 m): cosines and sines."""
        phase = t[:, None] * self.omega
        return np.concatenate([np.cos(phase), np.sin(phase)], axis=1)

    def _coefficients(self, later: Array) -> Array:
        """(p, 2 m, 12): carrier at t -> values and derivatives at t + ``later`` (p,)."""
        w = self.omega[:, None]
        phase = later[:, None, None] * w
        c, s = np.cos(phase), np.sin(phase)
        cosine = c * self.cosine + s * self.sine
        sine = c * self.sine - s * self.cosine
        values = np.concatenate([cosine, sine], axis=1)
        rates = np.concatenate([w * sine, -w * cosine], axis=1)
        return np.concatenate([values, rates], axis=2)

    @property
    def top(self) -> float:
        """Highest angular frequency, rad/s."""
        return float(np.max(self.omega, initial=0.0))


def draw_tones(
    rng: np.random.Generator,
    *,
    band: tuple[float, float],
    count: int,
    accel_rms: npt.ArrayLike,
    rate_rms: npt.ArrayLike,
    envelope: Envelope,
) -> Tones:
    """Tones of random frequency and phase with given strengths.

    Parameters
    ----------
    band : (float, float)
        Lowest and highest frequency, Hz; the tones are spread over it, one per equal part.
    accel_rms : (3,)
        m/s2: right, forward, up.
    rate_rms : (3,)
        rad/s: heading, pitch, roll.
    """
    edges = np.linspace(band[0], band[1], count + 1)
    omega = 2.0 * np.pi * rng.uniform(edges[:-1], edges[1:])
    strength = np.concatenate([np.asarray(accel_rms, float), np.asarray(rate_rms, float)])
    amplitude = np.sqrt(2.0 / count) * strength / omega[:, None]
    phase = rng.uniform(0.0, 2.0 * np.pi, (count, 6))
    return Tones(omega, amplitude * np.cos(phase), amplitude * np.sin(phase), envelope)


def shake_tones(
    *, amplitude: float, frequency: float, pitch_phase: float, roll_phase: float
) -> Tones:
    """Pitch and roll of ``amplitude`` (rad) sin(2 pi ``frequency`` t + phase) (paper 004)."""
    cosine, sine = np.zeros((1, 6)), np.zeros((1, 6))
    for channel, phase in ((4, pitch_phase), (5, roll_phase)):
        cosine[0, channel] = amplitude * np.sin(phase)
        sine[0, channel] = amplitude * np.cos(phase)
    return Tones(np.array([2.0 * np.pi * frequency]), cosine, sine)


@dataclass(frozen=True)
class Strength:
    """How strongly a vehicle shakes; factors on :func:`vehicle_tones`.

    Attributes
    ----------
    road, road_fast : float
        Slow and fast part while moving.
    idle, idle_fast : float
        Slow and fast part of the running engine, always.
    """

    road: float = 1.0
    road_fast: float = 1.0
    idle: float = 1.0
    idle_fast: float = 1.0


SILENT = Strength(0.0, 0.0, 0.0, 0.0)


def vehicle_tones(rng: np.random.Generator, strength: Strength) -> tuple[Tones, ...]:
    """Vibration of a car: strengths of 1 are near the medians of six real logs.

    The slow part of the angular rate while moving was over 0.4 deg/s in 99.9 % of the time on
    the rougher of them and its specific force over 0.1 m/s2; at rest 0.01-0.1 deg/s and
    0.004-0.02 m/s2; the fast part of an idling engine 0.05-1.8 deg/s.
    """
    parts: tuple[
        tuple[float, tuple[float, float], int, list[float], list[float], Envelope], ...
    ] = (
        # factor, Hz, tones, m/s2 (right, forward, up), deg/s (heading, pitch, roll)
        (strength.road, (0.5, 3.6), 10, [0.14, 0.07, 0.21], [0.26, 0.60, 0.75], "moving"),
        (strength.road_fast, (7.0, 18.0), 8, [0.25, 0.15, 0.50], [0.30, 0.70, 0.80], "moving"),
        (strength.idle, (0.6, 3.4), 5, [0.004, 0.004, 0.006], [0.012, 0.02, 0.02], "always"),
        (strength.idle_fast, (9.0, 18.0), 5, [0.05, 0.04, 0.08], [0.10, 0.15, 0.20], "always"),
    )
    drawn = [
        draw_tones(
            rng,
            band=band,
            count=count,
            accel_rms=factor * np.array(accel),
            rate_rms=factor * np.array(rate) * DEG,
            envelope=envelope,
        )
        for factor, band, count, accel, rate, envelope in parts
    ]
    kept = [tones for tones, part in zip(drawn, parts, strict=True) if part[0] > 0.0]
    groups = ([t for t in kept if t.envelope == e] for e in ("moving", "always"))
    return tuple(_merged(group) for group in groups if group)


def _merged(group: list[Tones]) -> Tones:
    """Tones of one envelope as one set."""
    return Tones(
        np.concatenate([t.omega for t in group]),
        np.concatenate([t.cosine for t in group]),
        np.concatenate([t.sine for t in group]),
        group[0].envelope,
    )
