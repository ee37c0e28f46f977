"""Ideal sensors along a motion: exact rates at instants, exact increments over steps.

omega_ib_b = omega_eb_b + C_bn omega_ie_n,
f_b = C_bn (a_n + 2 omega_ie_n x v_n + gamma up)  (paper 004 eq. 3),

with a_n the acceleration relative to the Earth and gamma the normal gravity. Positions and
increments by Gauss-Legendre quadrature on panels short enough for the fastest tone of the motion.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.earth import Ellipsoid, c_en, ecef_from_geodetic, radii
from vehnav.simulate.motion import Course, Motion, Prepared, to_axes

Array = npt.NDArray[np.float64]

_NODES: Final = 4
_PANEL_PHASE: Final = 1.6
"""rad of the fastest tone in a panel: four nodes leave 2e-8 of its amplitude."""
_BLOCK: Final = 2048
"""Samples worked on at a time: the working arrays stay in the cache."""


def _collocation(m: int) -> tuple[Array, Array, Array]:
    """Gauss-Legendre on [0, 1]: nodes (m,), weights (m,), integrals to the nodes (m, m)."""
    x, w = np.polynomial.legendre.leggauss(m)
    c = 0.5 * (x + 1.0)
    powers = np.arange(1, m + 1)
    to_nodes = (c[:, None] ** powers / powers) @ np.linalg.inv(c[:, None] ** (powers - 1))
    return c, 0.5 * w, to_nodes


_C, _W, _A = _collocation(_NODES)


@dataclass(frozen=True)
class States:
    """Truth at n instants; C_nb takes body to East-North-Up.

    Attributes
    ----------
    lat, lon, height : (n,)
        rad, rad, m.
    v_n : (n, 3)
        m/s.
    c_nb : (n, 3, 3)
    omega_ib_b : (n, 3)
        rad/s: what ideal gyroscopes read.
    f_b : (n, 3)
        m/s2: what ideal accelerometers read.
    """

    lat: Array
    lon: Array
    height: Array
    v_n: Array
    c_nb: Array
    omega_ib_b: Array
    f_b: Array


def gravity(lat: Array, height: Array, *, earth: Ellipsoid) -> Array:
    """Normal gravity (n,), m/s2, of arrays; the formula of :func:`vehnav.earth.normal_gravity`."""
    s2 = np.sin(lat) ** 2
    k = math.sqrt(1.0 - earth.e2) * earth.gamma_p / earth.gamma_e - 1.0
    gamma = earth.gamma_e * (1.0 + k * s2) / np.sqrt(1.0 - earth.e2 * s2)
    x = height / earth.a
    factor = 1.0 - 2.0 * (1.0 + earth.f + earth.m - 2.0 * earth.f * s2) * x + 3.0 * x * x
    return np.asarray(gamma * factor)


def inertial_readings(
    course: Course, lat: Array, height: Array, *, earth: Ellipsoid
) -> tuple[Array, Array]:
    """(omega_ib_b, f_b), both (n, 3), of a course at its latitudes and heights."""
    zero = np.zeros_like(lat)
    omega_ie_n = earth.omega_ie * np.stack([zero, np.cos(lat), np.sin(lat)], axis=-1)
    f_n = course.a_n + 2.0 * np.cross(omega_ie_n, course.v_n)
    f_n[:, 2] += gravity(lat, height, earth=earth)
    return course.omega_eb_b + to_axes(course.c_nb, omega_ie_n), to_axes(course.c_nb, f_n)


def panels_per_step(motion: Motion, dt: float) -> int:
    """Quadrature panels within a step of ``dt`` s."""
    return max(1, math.ceil(abs(dt) * motion.top_rate / _PANEL_PHASE))


@dataclass(frozen=True)
class Block:
    """States at the edges of m steps, and the increments over them.

    Attributes
    ----------
    states : States
        At the m + 1 edges.
    dtheta, dvel : (m, 3)
        Integrals of omega_ib_b (rad) and of f_b (m/s) over the steps; empty where not asked for.
    """

    states: States
    dtheta: Array
    dvel: Array


def integrate(
    motion: Motion, t: Array, *, increments: bool, start: tuple[float, float, float]
) -> Block:
    """States at edges ``t`` (m + 1,), s, from the position ``start`` at t[0].

    Time may run backward. With ``increments`` the ideal increments over the steps as well.
    """
    panels = panels_per_step(motion, float(np.max(np.abs(np.diff(t)))))
    edges = _refined(t, panels)
    h = np.diff(edges)
    comb, even = _comb(edges, h)
    prepared = motion.prepare(comb, even=even)
    index = np.arange(comb.size).reshape(comb.shape)
    nodes = prepared.take(index[:-1, 1:].ravel())
    at_edges, at_nodes = _places(motion, comb, nodes, h, start)
    lat, lon, height = (x[::panels] for x in at_edges)
    course = prepared.take(index[::panels, 0]).course(lat, height)
    omega, f = inertial_readings(course, lat, height, earth=motion.earth)
    states = States(lat, lon, height, course.v_n, course.c_nb, omega, f)
    if not increments:
        return Block(states, np.empty((0, 3)), np.empty((0, 3)))
    inner = nodes.course(at_nodes[0], at_nodes[2])
    readings = inertial_readings(inner, at_nodes[0], at_nodes[2], earth=motion.earth)
    dtheta, dvel = (
        np.einsum("mkj,k->mj", x.reshape(-1, _NODES, 3), _W) * h[:, None] for x in readings
    )
    return Block(states, _summed(dtheta, panels), _summed(dvel, panels))


def _comb(edges: Array, h: Array) -> tuple[Array, bool]:
    """Instants (m + 1, 1 + nodes): each edge and the nodes after it; and whether rows are alike.

    Steps that differ by the rounding of stamps to a nanosecond are alike: 1e-7 rad of phase.
    """
    mean = float(np.mean(h))
    even = bool(np.max(np.abs(h - mean)) < 2e-9)
    steps = np.full(edges.size, mean) if even else np.append(h, h[-1])
    return edges[:, None] + steps[:, None] * np.concatenate([[0.0], _C]), even


def _refined(t: Array, panels: int) -> Array:
    """Every step of ``t`` cut into equal panels."""
    if panels == 1:
        return t
    parts = t[:-1, None] + np.diff(t)[:, None] * (np.arange(panels) / panels)
    return np.append(parts.ravel(), t[-1])


def _summed(x: Array, panels: int) -> Array:
    return np.asarray(x.reshape(-1, panels, 3).sum(axis=1))


def _places(
    motion: Motion, comb: Array, nodes: Prepared, h: Array, start: tuple[float, float, float]
) -> tuple[tuple[Array, Array, Array], tuple[Array, Array, Array]]:
    """(lat, lon, height) at the edges and at the nodes of the panels."""
    known, inside = motion.place(comb[:, 0]), motion.place(comb[:-1, 1:].ravel())
    if known is not None and inside is not None:
        return known, inside
    v = nodes.velocity()
    height = _integral(v[:, 2], h, start[2])
    lat_nodes = np.full(len(v), start[0])
    while True:  # the radii hang on the latitude by e^2: each turn gains three digits or more
        r_m, _ = radii(lat_nodes, height[1], earth=motion.earth)
        lat = _integral(v[:, 1] / r_m, h, start[0])
        moved = float(np.max(np.abs(lat[1] - lat_nodes)))
        lat_nodes = lat[1]
        if moved < 1e-14:
            break
    _, r_n = radii(lat_nodes, height[1], earth=motion.earth)
    lon = _integral(v[:, 0] / (r_n * np.cos(lat_nodes)), h, start[1])
    return (lat[0], lon[0], height[0]), (lat[1], lon[1], height[1])


def _integral(rate: Array, h: Array, start: float) -> tuple[Array, Array]:
    """Integral of ``rate`` (given at the nodes), at the edges and at the nodes."""
    per_panel = rate.reshape(-1, _NODES)
    edges = start + np.concatenate([[0.0], np.cumsum((per_panel @ _W) * h)])
    nodes = edges[:-1, None] + (per_panel @ _A.T) * h[:, None]
    return edges, nodes.ravel()


def march(motion: Motion, t: Array, *, increments: bool) -> Iterator[Block]:
    """Blocks of consecutive steps along ``t`` (n,), s; t[0] need not be zero.

    Each block begins with the edge that the one before it ends with.
    """
    place = motion.origin
    if t[0] != 0.0:
        lead = np.linspace(0.0, t[0], 2 + math.ceil(abs(t[0]) / 0.1))
        end = integrate(motion, lead, increments=False, start=place).states
        place = (float(end.lat[-1]), float(end.lon[-1]), float(end.height[-1]))
    for k in range(0, t.size - 1, _BLOCK):
        block = integrate(motion, t[k : k + _BLOCK + 1], increments=increments, start=place)
        s = block.states
        place = (float(s.lat[-1]), float(s.lon[-1]), float(s.height[-1]))
        yield block


def ideal_record(motion: Motion, t: Array, *, increments: bool) -> Block:
    """Truth at instants ``t`` (n,), s, and with ``increments`` those over the n - 1 steps."""
    blocks = list(march(motion, t, increments=increments))
    first = blocks[0].states

    def joined(name: str) -> Array:
        rest = (getattr(b.states, name)[1:] for b in blocks)
        return np.concatenate([getattr(first, name)[:1], *rest])

    return Block(
        states=States(**{name: joined(name) for name in States.__dataclass_fields__}),
        dtheta=np.concatenate([b.dtheta for b in blocks]),
        dvel=np.concatenate([b.dvel for b in blocks]),
    )


def inertial_states(
    t: Array, lat: Array, lon: Array, height: Array, v_n: Array, c_nb: Array, *, earth: Ellipsoid
) -> tuple[Array, Array, Array]:
    """(r_i, v_i, c_ib): inertial truth, the frame i coinciding with e at t = 0.

    v_i = C_ie (v_e + Omega x r_e) (paper 000, initial conditions).
    """
    r_e = ecef_from_geodetic(lat, lon, height, earth=earth)
    c_e = c_en(lat, lon)
    v_e = np.einsum("nij,nj->ni", c_e, v_n)
    spin = np.stack([-earth.omega_ie * r_e[:, 1], earth.omega_ie * r_e[:, 0], 0.0 * t], axis=-1)
    angle = earth.omega_ie * t
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(t), np.ones_like(t)
    rows = [[c, -s, zero], [s, c, zero], [zero, zero, one]]
    c_ie = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    r_i, v_i = (np.einsum("nij,nj->ni", c_ie, x) for x in (r_e, v_e + spin))
    return r_i, v_i, c_ie @ c_e @ c_nb
