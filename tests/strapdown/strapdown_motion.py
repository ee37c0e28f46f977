"""Exact motions for the strapdown tests: closed-form velocity and angles, everything else derived.

Independent of ``vehnav.strapdown`` and of ``vehnav.simulate``. Positions and increments come from
Gauss-Legendre collocation inside every step (error below rounding for smooth motion); the whole is
judged in the inertial frame by :mod:`test_motion`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vehnav.earth import WGS84, Ellipsoid, position_difference
from vehnav.rotation import c_nb_from_angles
from vehnav.strapdown.increments import Increments

Array = npt.NDArray[np.float64]
TimeFunction = Callable[[Array], Array]
NODES = 5


@dataclass(frozen=True)
class Motion:
    """Velocity (east, north, up) and angles (heading, pitch, roll) with their derivatives."""

    start: tuple[float, float, float]
    v_n: TimeFunction
    dv_n: TimeFunction
    angles: TimeFunction
    rates: TimeFunction


@dataclass(frozen=True)
class Truth:
    """States and ideal sensors at the instants; increments over the steps between them."""

    t: Array
    position: Array
    v_n: Array
    c_nb: Array
    omega_ib_b: Array
    f_b: Array
    dtheta: Array
    dvel: Array

    def increments(self) -> Increments:
        return Increments(self.t, self.dtheta, self.dvel, np.zeros(self.t.size - 1, bool))


def gamma(lat: Array, earth: Ellipsoid) -> Array:
    """Somigliana in the form of paper 004 (semi-axes a and b)."""
    b = earth.a * np.sqrt(1.0 - earth.e2)
    c2, s2 = np.cos(lat) ** 2, np.sin(lat) ** 2
    top = earth.a * earth.gamma_e * c2 + b * earth.gamma_p * s2
    return np.asarray(top / np.sqrt(earth.a**2 * c2 + b**2 * s2))


def gamma_at(lat: Array, h: Array, earth: Ellipsoid) -> Array:
    """With the second-order free-air term of the geodetic literature (NGA.STND.0036, 4-3)."""
    x, s2 = h / earth.a, np.sin(lat) ** 2
    factor = 1.0 - 2.0 * (1.0 + earth.f + earth.m - 2.0 * earth.f * s2) * x + 3.0 * x * x
    return gamma(lat, earth) * factor


def radii(lat: Array, h: Array, earth: Ellipsoid) -> tuple[Array, Array]:
    w = np.sqrt(1.0 - earth.e2 * np.sin(lat) ** 2)
    return earth.a * (1.0 - earth.e2) / w**3 + h, earth.a / w + h


def _body_rate(angles: Array, rates: Array) -> Array:
    """omega_nb_b of heading, pitch, roll and their rates (spec A 1.1)."""
    (_, pitch, roll), (dk, dp, dr) = angles.T, rates.T
    x = dp * np.cos(roll) + dk * np.cos(pitch) * np.sin(roll)
    y = -dk * np.sin(pitch) + dr
    z = dp * np.sin(roll) - dk * np.cos(pitch) * np.cos(roll)
    return np.stack([x, y, z], axis=1)


def ideal_sensors(
    motion: Motion, t: Array, position: Array, *, earth: Ellipsoid, gravity_at: str
) -> tuple[Array, Array]:
    """omega_ib_b and f_b at instants: paper 004, equations (6) and (11), written out by rows."""
    lat, _, h = position.T
    v_e, v_north, v_h = motion.v_n(t).T
    r_m, r_n = radii(lat, h, earth)
    dlat, dlon = v_north / r_m, v_e / (r_n * np.cos(lat))
    s, c = np.sin(lat), np.cos(lat)
    u = earth.omega_ie
    g = gamma_at(lat, h if gravity_at == "height" else np.full_like(h, motion.start[2]), earth)
    a_e, a_n, a_h = motion.dv_n(t).T
    f_n = np.stack(
        [
            a_e + (2 * u + dlon) * (c * v_h - s * v_north),
            a_n + (2 * u + dlon) * s * v_e + dlat * v_h,
            a_h - (2 * u + dlon) * c * v_e - dlat * v_north + g,
        ],
        axis=1,
    )
    omega_in_n = np.stack([-dlat, (u + dlon) * c, (u + dlon) * s], axis=1)
    angles = motion.angles(t)
    c_bn = np.swapaxes(c_nb_from_angles(*angles.T), 1, 2)
    omega = _body_rate(angles, motion.rates(t)) + np.einsum("kij,kj->ki", c_bn, omega_in_n)
    return omega, np.einsum("kij,kj->ki", c_bn, f_n)


def positions(
    motion: Motion, t: Array, *, earth: Ellipsoid
) -> tuple[Array, Array, Array, Array, Array]:
    """Positions at the instants, and nodes, their positions and weights inside every step."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    x, w = 0.5 * (x + 1.0), 0.5 * w
    powers = np.arange(1, NODES + 1)
    to_node = (x[:, None] ** powers / powers) @ np.linalg.inv(x[:, None] ** (powers - 1))
    dt = np.diff(t)
    nodes = t[:-1, None] + dt[:, None] * x
    v = motion.v_n(nodes.ravel()).reshape(*nodes.shape, 3)

    def integrate(rate: Array, start: float) -> tuple[Array, Array]:
        at = start + np.concatenate([[0.0], np.cumsum(dt * (rate @ w))])
        return at, at[:-1, None] + dt[:, None] * (rate @ to_node.T)

    h, h_node = integrate(v[..., 2], motion.start[2])
    lat_node = np.full_like(nodes, motion.start[0])
    for _ in range(7):
        r_m, _ = radii(lat_node, h_node, earth)
        lat, lat_node = integrate(v[..., 1] / r_m, motion.start[0])
    _, r_n = radii(lat_node, h_node, earth)
    lon, lon_node = integrate(v[..., 0] / (r_n * np.cos(lat_node)), motion.start[1])
    at_nodes = np.stack([lat_node, lon_node, h_node], axis=-1)
    return np.stack([lat, lon, h], axis=1), nodes, at_nodes, w, dt


def exact(
    motion: Motion,
    t: Array,
    *,
    earth: Ellipsoid = WGS84,
    gravity_at: str = "reference",
    increments: bool = True,
) -> Truth:
    """Truth of a motion at the instants ``t``; without ``increments`` those are empty."""
    position, nodes, at_nodes, w, dt = positions(motion, t, earth=earth)
    dtheta = dvel = np.empty((0, 3))
    if increments:
        omega, f = ideal_sensors(
            motion, nodes.ravel(), at_nodes.reshape(-1, 3), earth=earth, gravity_at=gravity_at
        )
        scaled = dt[:, None] * w
        dtheta, dvel = (
            np.einsum("km,kmi->ki", scaled, y.reshape(*nodes.shape, 3)) for y in (omega, f)
        )
    omega, f = ideal_sensors(motion, t, position, earth=earth, gravity_at=gravity_at)
    c_nb = c_nb_from_angles(*motion.angles(t).T)
    return Truth(t, position, motion.v_n(t), c_nb, omega, f, dtheta, dvel)


# ---- motions -----------------------------------------------------------------------------------


def _columns(t: Array, *columns: Array | float) -> Array:
    return np.stack([np.broadcast_to(np.asarray(c, float), t.shape) for c in columns], axis=1)


def circle(
    *,
    lat_deg: float = 55.75,
    heading: float = 0.0,
    speed: float = 25.0,
    rate: float = 5e-4,
    shake: float = 0.0,
    frequency: float = 1.0,
) -> Motion:
    """Experiment E1 of paper 004, and E2 with pitch and roll shaking (rad, Hz; rate 0 at t = 0)."""
    w = 2.0 * np.pi * frequency

    def heading_at(t: Array) -> Array:
        return heading + rate * t

    def v_n(t: Array) -> Array:
        k = heading_at(t)
        return _columns(t, speed * np.sin(k), speed * np.cos(k), 0.0)

    def dv_n(t: Array) -> Array:
        k = heading_at(t)
        return _columns(t, speed * rate * np.cos(k), -speed * rate * np.sin(k), 0.0)

    def angles(t: Array) -> Array:
        return _columns(t, heading_at(t), shake * np.cos(w * t), shake * np.cos(w * t))

    def rates(t: Array) -> Array:
        swing = -shake * w * np.sin(w * t)
        return _columns(t, rate, swing, swing)

    return Motion((np.radians(lat_deg), np.radians(37.6), 0.0), v_n, dv_n, angles, rates)


def static(*, lat_deg: float, heading: float = 0.0) -> Motion:
    return circle(lat_deg=lat_deg, heading=heading, speed=0.0, rate=0.0)


def car(*, lat_deg: float = 50.0, rocking: float = 1.0) -> Motion:
    """A lively car: changing speed, turns, grades; rocks at 1.3 and 1.7 Hz times ``rocking``."""

    def speed(t: Array) -> tuple[Array, Array]:
        return (
            14.0 + 5.0 * np.sin(0.11 * t) + 1.5 * np.sin(0.53 * t),
            0.55 * np.cos(0.11 * t) + 0.795 * np.cos(0.53 * t),
        )

    def heading(t: Array) -> tuple[Array, Array]:
        return (
            0.6 + 0.012 * t + 1.1 * np.sin(0.07 * t) + 0.25 * np.sin(0.41 * t),
            0.012 + 0.077 * np.cos(0.07 * t) + 0.1025 * np.cos(0.41 * t),
        )

    def climb(t: Array) -> tuple[Array, Array]:
        return 0.4 * np.sin(0.05 * t), 0.02 * np.cos(0.05 * t)

    def v_n(t: Array) -> Array:
        (v, _), (k, _), (up, _) = speed(t), heading(t), climb(t)
        return _columns(t, v * np.sin(k), v * np.cos(k), up)

    def dv_n(t: Array) -> Array:
        (v, a), (k, dk), (_, a_up) = speed(t), heading(t), climb(t)
        return _columns(
            t, a * np.sin(k) + v * dk * np.cos(k), a * np.cos(k) - v * dk * np.sin(k), a_up
        )

    p, r = 2.0 * np.pi * 1.3 * rocking, 2.0 * np.pi * 1.7 * rocking

    def onset(t: Array) -> tuple[Array, Array]:
        """Rocking grows from nothing: the first step of a log has no step before it."""
        decay = np.exp(-t * t / 8.0)
        return 1.0 - decay, 0.25 * t * decay

    def angles(t: Array) -> Array:
        on, _ = onset(t)
        pitch = 0.03 * np.sin(0.05 * t) + 0.010 * on * np.sin(p * t)
        roll = 0.02 * np.sin(0.07 * t) + 0.012 * on * np.cos(r * t)
        return _columns(t, heading(t)[0], pitch, roll)

    def rates(t: Array) -> Array:
        on, d_on = onset(t)
        pitch = 0.0015 * np.cos(0.05 * t)
        pitch = pitch + 0.010 * (on * p * np.cos(p * t) + d_on * np.sin(p * t))
        roll = 0.0014 * np.cos(0.07 * t)
        roll = roll + 0.012 * (d_on * np.cos(r * t) - on * r * np.sin(r * t))
        return _columns(t, heading(t)[1], pitch, roll)

    return Motion((np.radians(lat_deg), np.radians(36.2), 120.0), v_n, dv_n, angles, rates)


# ---- judging -----------------------------------------------------------------------------------


def horizontal_error(position: Array, reference: Array, *, earth: Ellipsoid = WGS84) -> Array:
    """(n, 2) east and north of positions minus references, m."""
    return position_difference(
        position[:, 0], position[:, 1], reference[:, 0], reference[:, 1], reference[:, 2],
        earth=earth,
    )  # fmt: skip


def distance(position: Array, reference: Array, *, earth: Ellipsoid = WGS84) -> float:
    """Largest horizontal error, m."""
    return float(np.linalg.norm(horizontal_error(position, reference, earth=earth), axis=1).max())
