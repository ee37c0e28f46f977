"""The error equations of paper 001 along a drive, for unit sources and unit noise.

States: attitude error Psi, velocity error, position error, East-North-Up each (signs of
:mod:`vehnav.aiding.error_model`). A column of X (9, columns) is what one unit of a source does; a
matrix P (12, 12) per random process is the covariance of the nine errors and of the bias of its
triad. Trapezoid of spec B 1.3::

    X <- Phi X + (I + F tau/2) S tau,    P <- Phi (P + Q tau/2) Phi' + Q tau/2

Stops are exact linear maps (spec B 1.3, step 4). While standing the velocity error is zero. The
level at the end of a stop is the mean over a window of T seconds of what the accelerometers show:
``Psi_E = -b_N/g, Psi_N = b_E/g`` of their error b, plus T/2 of the rate at which the platform
drifts within the window, plus the mean of their noise. Where the gyro bias is taken from the stops,
what the gyros show while standing is subtracted until the next stop.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.aiding.error_model import fill_error_matrix_001
from vehnav.budget.drive import Grid
from vehnav.budget.sources import COLUMNS, OFF_DIAGONAL, SENSOR_COLUMNS, Process
from vehnav.earth import Ellipsoid, normal_gravity
from vehnav.kernel import entry_kernel

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_BLOCK: Final = 4096
"""Intervals whose matrices are made at a time."""


@dataclass(frozen=True)
class Rules:
    """What the equations keep and what is done at the start and at the stops.

    Attributes
    ----------
    kept : int
        A value of :data:`vehnav.aiding.error_model.MODELS`.
    held : bool
        Whether height and vertical velocity come from outside.
    levelled : bool
        Whether the start is levelled by the accelerometers.
    window : float
        s of the mean of the level.
    gyro_from_stops : bool
        Whether the gyro bias seen in a stop is taken off until the next.
    """

    kept: int
    held: bool
    levelled: bool
    window: float
    gyro_from_stops: bool


@entry_kernel
def error_matrices(
    lat: Array, height: Array, v: Array, f_n: Array, kept: int, held: bool, earth: Ellipsoid,
    out: Array,
) -> None:  # fmt: skip
    """F (m, 9, 9) of every interval, 1/s."""
    for k in range(lat.shape[0]):
        fill_error_matrix_001(
            out[k], lat[k], height[k], (v[k, 0], v[k, 1], v[k, 2]),
            (f_n[k, 0], f_n[k, 1], f_n[k, 2]), kept, held, earth,
        )  # fmt: skip


def source_rates(c: Array, gyro: Array, force: Array) -> Array:
    """(m, 6, 33): rates of Psi (rows 0-2) and of the velocity error (3-5) per unit error.

    ``c`` (m, 3, 3): C_nb; ``gyro``, ``force`` (m, 3, 3, 3): C[r, i] omega_k and C[r, i] f_k.
    """
    s = np.zeros((c.shape[0], 6, SENSOR_COLUMNS))
    for rows, first, sign, product in (
        (slice(0, 3), 0, -1.0, gyro),
        (slice(3, 6), 12, 1.0, force),
    ):
        s[:, rows, first : first + 3] = sign * c
        for i in range(3):
            s[:, rows, first + 3 + i] = sign * product[:, :, i, i]
        for n, (i, k) in enumerate(OFF_DIAGONAL):
            s[:, rows, first + 6 + n] = sign * product[:, :, i, k]
    s[:, :3, 24:] = -force.reshape(-1, 3, 9)
    return s


@dataclass(frozen=True)
class Standing:
    """A vehicle at rest: what its sensors' errors do, and the map that levels it.

    Attributes
    ----------
    c : (3, 3)
        C_nb.
    gravity : float
        m/s2
    omega_ie : (3,)
        Earth rate in East-North-Up, rad/s.
    rates : (6, 33)
        As :func:`source_rates`.
    """

    c: Array
    gravity: float
    omega_ie: Array
    rates: Array

    @classmethod
    def at(cls, c: Array, lat: float, height: float, earth: Ellipsoid) -> Standing:
        """With attitude ``c`` at a latitude (rad) and height (m)."""
        g = normal_gravity(lat, height, earth)
        omega_ie = earth.omega_ie * np.array([0.0, np.cos(lat), np.sin(lat)])
        gyro, force = (np.einsum("ri,k->rik", c, x) for x in (c.T @ omega_ie, g * c[2]))
        return cls(c, g, omega_ie, source_rates(c[None], gyro[None], force[None])[0])

    def level(self, x: Array, applied: Array, window: float) -> None:
        """Level the columns ``x`` (9, COLUMNS) in place; ``applied``: gyro correction in force."""
        psi_e, psi_n = np.zeros(COLUMNS), np.zeros(COLUMNS)
        psi_e[:SENSOR_COLUMNS] = -self.rates[4] / self.gravity
        psi_n[:SENSOR_COLUMNS] = self.rates[3] / self.gravity
        _, u_n, u_u = self.omega_ie
        drift = np.stack([psi_n * u_u - x[2] * u_n, -psi_e * u_u])
        drift[:, :SENSOR_COLUMNS] += self.rates[:2] + self.c[:2] @ applied
        x[0], x[1] = psi_e + 0.5 * window * drift[0], psi_n + 0.5 * window * drift[1]

    def level_noise(self, p: Array, processes: tuple[Process, ...], window: float) -> None:
        """The same in place for the covariances ``p`` (n, 12, 12) of unit processes."""
        _, u_n, u_u = self.omega_ie
        for n, process in enumerate(processes):
            level, drift = np.zeros((2, 12)), np.zeros((2, 12))
            if process.gyro:
                drift[:, 9:] = -self.c[:2]
            elif process.kind != "white":
                level[0, 9:], level[1, 9:] = -self.c[1] / self.gravity, self.c[0] / self.gravity
            drift[0] += level[1] * u_u
            drift[1] -= level[0] * u_u
            drift[0, 2] -= u_n
            m = np.eye(12)
            m[:2] = level + 0.5 * window * drift
            p[n] = m @ p[n] @ m.T
            if process.kind == "white":
                noise = window / 3.0 if process.gyro else 1.0 / (window * self.gravity**2)
                p[n, [0, 1], [0, 1]] += noise

    def gyro_errors(self) -> Array:
        """(3, 33) rad/s: what the gyros show besides the Earth rate, body axes."""
        return np.asarray(-self.c.T @ self.rates[:3])


class Propagation:
    """The errors on their way along a grid; see :func:`propagate`."""

    def __init__(
        self, grid: Grid, processes: tuple[Process, ...], rules: Rules, earth: Ellipsoid
    ) -> None:
        self.grid, self.processes, self.rules, self.earth = grid, processes, rules, earth
        self.x = np.zeros((9, COLUMNS))
        self.x[:, SENSOR_COLUMNS:] = np.eye(9)
        self.p = np.zeros((len(processes), 12, 12))
        self.applied = np.zeros((3, SENSOR_COLUMNS))
        self.noise = np.zeros((len(processes), 12))
        bias = slice(9, 12)
        for n, process in enumerate(processes):
            if process.kind == "markov":
                self.p[n, bias, bias] = np.eye(3)
            if process.kind == "white":
                self.noise[n, (slice(0, 3) if process.gyro else slice(3, 5))] = 1.0
                self.noise[n, 5] = not (process.gyro or rules.held)
            if process.kind == "walk":
                self.noise[n, bias] = 1.0
        inside = np.flatnonzero(grid.stop >= 0)
        first, last = (
            dict(zip(grid.stop[order].tolist(), order.tolist(), strict=True))
            for order in (inside[::-1], inside)
        )
        self.spans = {stop: (first[stop], last[stop]) for stop in first}
        """Stop -> its first and last instant."""
        if rules.levelled:
            self._level(0, rules.window)

    def _standing(self, k: int) -> Standing:
        k = min(k, self.grid.size - 1)
        g = self.grid
        return Standing.at(g.c_nb[k].reshape(3, 3), g.lat[k], g.height[k], self.earth)

    def _level(self, k: int, window: float) -> None:
        standing = self._standing(k)
        standing.level(self.x, self.applied, window)
        standing.level_noise(self.p, self.processes, window)

    def at_stop(self, k: int) -> None:
        """What is done at an instant inside a stop."""
        self.x[3:6] = 0.0
        self.p[:, 3:6] = 0.0
        self.p[:, :, 3:6] = 0.0
        t = self.grid.t
        first, last = self.spans[int(self.grid.stop[k])]
        if last == first:
            return
        if k == first and self.rules.gyro_from_stops:
            self._take_gyro_bias(k, float(t[last] - t[first]))
        if k == last:
            self._level(k, min(self.rules.window, float(t[last] - t[first])))

    def _take_gyro_bias(self, k: int, length: float) -> None:
        """Constant errors show in full; a wandering bias starts anew; white noise by its mean."""
        self.applied = self._standing(k).gyro_errors()
        for n, process in enumerate(self.processes):
            if process.gyro:
                self.p[n, 9:], self.p[n, :, 9:] = 0.0, 0.0
                if process.kind == "white":
                    self.p[n, 9:, 9:] = np.eye(3) / length

    def block(self, first: int, last: int) -> tuple[Array, ...]:
        """Matrices of the intervals ``first`` to ``last``-1.

        Phi (m, 9, 9), what the sources add (m, 9, 33), what a gyro correction does (m, 9, 3), Phi
        of each process (m, n, 12, 12), and variances that come to it, halved (m, n, 12).
        """
        g, rules = self.grid, self.rules
        part = slice(first, last)
        m = last - first
        tau = np.diff(g.t[first : last + 1])[:, None, None]
        force = g.force[part].reshape(m, 3, 3, 3)
        f = np.empty((m, 9, 9))
        error_matrices(
            g.lat[part].copy(), g.height[part].copy(), g.v_n[part].copy(),
            np.einsum("mrii->mr", force), rules.kept, rules.held, self.earth, f,
        )  # fmt: skip
        gamma = (np.eye(9) + 0.5 * tau * f) * tau
        phi = np.eye(9) + gamma @ f
        if rules.held:
            gamma[:, :, 5] = 0.0
        c = g.c_nb[part].reshape(m, 3, 3)
        added = gamma[:, :, :6] @ source_rates(c, g.gyro[part].reshape(m, 3, 3, 3), force)
        corrected = gamma[:, :, :3] @ c
        big = np.zeros((m, len(self.processes), 12, 12))
        half = np.zeros((m, len(self.processes), 12))
        big[:, :, :9, :9] = phi[:, None]
        for n, process in enumerate(self.processes):
            decay = np.exp(-tau[:, 0, 0] / process.time) if process.kind == "markov" else 1.0
            big[:, n, :9, 9:] = -corrected if process.gyro else gamma[:, :, 3:6] @ c
            big[:, n, [9, 10, 11], [9, 10, 11]] = np.broadcast_to(decay, (m,))[:, None]
            half[:, n] = 0.5 * tau[:, 0] * self.noise[n]
            if process.kind == "markov":
                half[:, n, 9:] = 0.5 * (1.0 - np.asarray(decay) ** 2)[:, None]
        return phi, added, corrected, big, half

    def step(self, phi: Array, added: Array, corrected: Array, big: Array, half: Array) -> None:
        """Over one interval."""
        self.x = phi @ self.x
        self.x[:, :SENSOR_COLUMNS] += added
        if self.rules.gyro_from_stops:
            self.x[:, :SENSOR_COLUMNS] += corrected @ self.applied
        diagonal = np.arange(12)
        self.p[:, diagonal, diagonal] += half
        self.p = big @ self.p @ big.transpose(0, 2, 1)
        self.p[:, diagonal, diagonal] += half


def propagate(
    grid: Grid,
    processes: tuple[Process, ...],
    rules: Rules,
    at: IntArray,
    *,
    earth: Ellipsoid,
) -> tuple[Array, Array]:
    """Errors at the instants ``at`` (q,) of a grid.

    Returns
    -------
    columns : (q, 9, COLUMNS)
    covariance : (q, processes, 9, 9)
    """
    way = Propagation(grid, processes, rules, earth)
    x = np.empty((at.size, 9, COLUMNS))
    p = np.empty((at.size, len(processes), 9, 9))
    due = 0
    for first in range(0, grid.size + 1, _BLOCK):
        last = min(first + _BLOCK, grid.size)
        matrices = way.block(first, last) if last > first else None
        for k in range(first, min(first + _BLOCK, grid.size + 1)):
            if grid.stop[k] >= 0:
                way.at_stop(k)
            if due < at.size and at[due] == k:
                x[due], p[due] = way.x, way.p[:, :9, :9]
                due += 1
            if matrices is not None and k < last:
                way.step(*(matrix[k - first] for matrix in matrices))
    return x, p
