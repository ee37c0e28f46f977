"""Truth motions: everything that ideal sensors need, in closed form or by exact quadrature.

A :class:`Motion` gives velocity and attitude with their derivatives; a :class:`RoadMotion` leaves
only the position to a quadrature (:mod:`vehnav.simulate.truth` does it), a :class:`PolarMotion`
knows it in closed form, so that nothing happens at a pole.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

from vehnav.earth import WGS84, Ellipsoid, c_en, radii
from vehnav.rotation import c_nb_from_angles
from vehnav.simulate.program import Program, ProgramState
from vehnav.simulate.vibration import Tones
from vehnav.units import DEG

Array = npt.NDArray[np.float64]
Position = tuple[float, float, float]


@dataclass(frozen=True)
class Course:
    """Velocity and attitude of a motion at n instants, without its position.

    Attributes
    ----------
    v_n : (n, 3)
        m/s, East-North-Up.
    a_n : (n, 3)
        Acceleration relative to the Earth, C_ne d2r_e/dt2, m/s2.
    c_nb : (n, 3, 3)
    omega_eb_b : (n, 3)
        Rate relative to the Earth, rad/s.
    """

    v_n: Array
    a_n: Array
    c_nb: Array
    omega_eb_b: Array


class Prepared(Protocol):
    """A motion at N instants, before its position is known."""

    def velocity(self) -> Array:
        """(N, 3): East-North-Up velocity, m/s."""

    def course(self, lat: Array, height: Array) -> Course:
        """Velocity and attitude with their derivatives, where the vehicle is at that time."""

    def take(self, index: npt.NDArray[np.int64]) -> Prepared:
        """Some of the instants."""


class Motion(Protocol):
    """What the simulator needs of a motion."""

    @property
    def earth(self) -> Ellipsoid:
        """The ellipsoid with its gravity."""

    @property
    def origin(self) -> Position:
        """Position at t = 0: lat rad, lon rad, height m."""

    @property
    def duration(self) -> float:
        """How long it goes on, s."""

    @property
    def top_rate(self) -> float:
        """Highest angular frequency in it, rad/s: decides the panels of the quadrature."""

    def prepare(self, t: Array, *, even: bool) -> Prepared:
        """What velocity and course need at instants ``t`` (n, p), s, flattened by rows.

        ``even``: the same offsets within every row.
        """

    def place(self, t: Array) -> tuple[Array, Array, Array] | None:
        """(lat, lon, height) where known in closed form, else None: integrate the velocity."""

    def standing(self, t: Array) -> npt.NDArray[np.bool_]:
        """(n,) bool: at a stop."""


@dataclass(frozen=True)
class Body:
    """How the body of the vehicle follows its way.

    Attributes
    ----------
    pitch_per_accel : float
        rad per m/s2: the nose rises when the vehicle speeds up.
    roll_per_accel : float
        rad per m/s2 of centripetal acceleration to the right: the right side rises.
    bank : {"lean", "coordinated"}
        ``coordinated``: roll = atan(v yaw rate / g), as an aircraft; ``lean``: as above.
    """

    pitch_per_accel: float = 0.4 * DEG
    roll_per_accel: float = 0.4 * DEG
    bank: Literal["lean", "coordinated"] = "lean"


RIGID = Body(0.0, 0.0)
AIRCRAFT = Body(0.0, 0.0, "coordinated")
_G = 9.80665


@dataclass(frozen=True)
class RoadMotion:
    """A driving program on the ellipsoid, with the body's movements and vibration.

    Attributes
    ----------
    program : Program
    origin : (float, float, float)
        Position at t = 0.
    body : Body
    tones : tuple of Tones
    earth : Ellipsoid
    """

    program: Program
    origin: Position
    body: Body = RIGID
    tones: tuple[Tones, ...] = ()
    earth: Ellipsoid = WGS84

    @property
    def duration(self) -> float:
        """Length of the program, s."""
        return self.program.duration

    @property
    def top_rate(self) -> float:
        """Highest angular frequency, rad/s; a smooth step of a second counts as 10."""
        return max([10.0, *(tones.top for tones in self.tones)])

    def place(self, t: Array) -> None:
        """No closed form: the position is the integral of the velocity."""
        return

    def standing(self, t: Array) -> npt.NDArray[np.bool_]:
        """(n,) bool: the program stands (the engine may shake)."""
        return self.program.standing(t)

    def prepare(self, t: Array, *, even: bool) -> OnRoad:
        """The program and the vibration at instants ``t`` (n, p), flattened by rows."""
        p = self.program.state(t.ravel())
        shake, shake_dot = np.zeros((t.size, 6)), np.zeros((t.size, 6))
        for tones in self.tones:
            y, y_dot = tones.value_and_rate(t, p.speed, p.speed_dot, even=even)
            shake, shake_dot = shake + y, shake_dot + y_dot
        return OnRoad(p, shake, shake_dot, self.body, self.earth)


@dataclass(frozen=True)
class OnRoad:
    """A :class:`RoadMotion` at N instants; ``shake`` as the channels of :class:`Tones`."""

    program: ProgramState
    shake: Array
    shake_dot: Array
    body: Body
    earth: Ellipsoid

    def take(self, index: npt.NDArray[np.int64]) -> OnRoad:
        """Some of the instants."""
        return OnRoad(
            self.program.take(index),
            self.shake[index],
            self.shake_dot[index],
            self.body,
            self.earth,
        )

    def velocity(self) -> Array:
        """(N, 3): East-North-Up velocity, m/s."""
        p, shake = self.program, self.shake
        ahead = p.speed * np.cos(p.grade) + shake[:, 1]
        up = p.speed * np.sin(p.grade) + shake[:, 2]
        return _from_heading(p.heading, shake[:, 0], ahead, up)

    def course(self, lat: Array, height: Array) -> Course:
        """Velocity and attitude with their derivatives; see :class:`Course`."""
        p, shake, shake_dot = self.program, self.shake, self.shake_dot
        sg, cg = np.sin(p.grade), np.cos(p.grade)
        ahead = p.speed_dot * cg - p.speed * p.grade_dot * sg + shake_dot[:, 1]
        up = p.speed_dot * sg + p.speed * p.grade_dot * cg + shake_dot[:, 2]
        v_n = self.velocity()
        v_n_dot = _from_heading(p.heading, shake_dot[:, 0], ahead, up)
        v_n_dot[:, 0] += p.yaw_rate * v_n[:, 1]
        v_n_dot[:, 1] -= p.yaw_rate * v_n[:, 0]
        roll, roll_dot = self._roll()
        angles = (
            p.heading + shake[:, 3],
            p.grade + self.body.pitch_per_accel * p.speed_dot + shake[:, 4],
            roll + shake[:, 5],
        )
        rates = (
            p.yaw_rate + shake_dot[:, 3],
            p.grade_dot + self.body.pitch_per_accel * p.speed_ddot + shake_dot[:, 4],
            roll_dot + shake_dot[:, 5],
        )
        c_nb = c_nb_from_angles(*angles)
        omega_en_n = transport_rates(lat, height, v_n, earth=self.earth)
        return Course(
            v_n=v_n,
            a_n=v_n_dot + np.cross(omega_en_n, v_n),
            c_nb=c_nb,
            omega_eb_b=body_rate(angles, rates) + to_axes(c_nb, omega_en_n),
        )

    def _roll(self) -> tuple[Array, Array]:
        """Roll angle and its rate from the centripetal acceleration."""
        p = self.program
        a = p.speed * p.yaw_rate
        a_dot = p.speed_dot * p.yaw_rate + p.speed * p.yaw_rate_dot
        if self.body.bank == "lean":
            return -self.body.roll_per_accel * a, -self.body.roll_per_accel * a_dot
        return np.arctan(a / _G), a_dot * _G / (_G**2 + a**2)


def _from_heading(heading: Array, right: Array, ahead: Array, up: Array) -> Array:
    """East-North-Up components (N, 3) of right, ahead, up ones."""
    s, c = np.sin(heading), np.cos(heading)
    return np.stack([c * right + s * ahead, c * ahead - s * right, up], axis=-1)


def body_rate(angles: tuple[Array, Array, Array], rates: tuple[Array, Array, Array]) -> Array:
    """omega_nb_b (n, 3), rad/s, of heading, pitch, roll and their rates (spec A 1.1).

    R_y(roll)^T (R_x(pitch)^T (0, 0, -heading rate) + (pitch rate, 0, 0)) + (0, roll rate, 0);
    the minus because the heading counts clockwise.
    """
    _, pitch, roll = angles
    heading_dot, pitch_dot, roll_dot = rates
    sp, cp, sr, cr = np.sin(pitch), np.cos(pitch), np.sin(roll), np.cos(roll)
    z = -heading_dot * cp
    return np.stack(
        [cr * pitch_dot - sr * z, roll_dot - heading_dot * sp, sr * pitch_dot + cr * z], axis=-1
    )


@dataclass(frozen=True)
class PolarMotion:
    """Past a pole at constant height: the ellipsoid normal turns evenly in a fixed plane.

    The up vector is u(t) = cos(a) u0 + sin(a) u1, a = rate (t - t0): a great circle of normals,
    closest to the North pole at t0. The body is level, its forward axis along du/dt.

    Attributes
    ----------
    speed : float
        At the closest point, m/s.
    miss : float
        Distance of the closest point from the pole, m.
    duration : float
        s; the closest point is at half of it.
    height : float
        m.
    earth : Ellipsoid
    """

    speed: float
    miss: float
    duration: float
    height: float = 0.0
    earth: Ellipsoid = WGS84

    @property
    def _radius(self) -> float:
        """Radius of curvature at the pole, a / sqrt(1 - e^2), and the height, m."""
        return float(self.earth.a / np.sqrt(1.0 - self.earth.e2)) + self.height

    @property
    def origin(self) -> Position:
        """Position at t = 0."""
        lat, lon, h = self.place(np.zeros(1))
        return float(lat[0]), float(lon[0]), float(h[0])

    @property
    def top_rate(self) -> float:
        """Nothing in it is fast."""
        return 1.0

    def standing(self, t: Array) -> npt.NDArray[np.bool_]:
        """(n,) bool: never."""
        return np.zeros(t.size, bool)

    def frame(self, t: Array) -> tuple[Array, Array, float]:
        """Up u and its direction of turning w (n, 3), Earth axes, and the rate (rad/s)."""
        rate = self.speed / self._radius
        colat = self.miss / self._radius
        u0 = np.array([np.sin(colat), 0.0, np.cos(colat)])
        u1 = np.array([0.0, 1.0, 0.0])
        a = rate * (t - 0.5 * self.duration)[:, None]
        return np.cos(a) * u0 + np.sin(a) * u1, np.cos(a) * u1 - np.sin(a) * u0, rate

    def earth_fixed(self, t: Array) -> tuple[Array, Array, Array]:
        """Position, velocity, acceleration (n, 3) in Earth axes.

        r = N D u + h u with N = a q^(-1/2), q = 1 - e^2 u_z^2, D = diag(1, 1, 1 - e^2).
        """
        u, w, rate = self.frame(t)
        e2 = self.earth.e2
        uz, wz = u[:, 2:], w[:, 2:]
        q = 1.0 - e2 * uz**2
        q_dot = -2.0 * e2 * rate * uz * wz
        q_ddot = -2.0 * e2 * rate**2 * (wz**2 - uz**2)
        n = self.earth.a * q**-0.5
        n_dot = -0.5 * n * q_dot / q
        n_ddot = n * (0.75 * (q_dot / q) ** 2 - 0.5 * q_ddot / q)
        d = np.array([1.0, 1.0, 1.0 - e2])
        r = n * d * u + self.height * u
        v = d * (n_dot * u + n * rate * w) + self.height * rate * w
        acc = (
            d * (n_ddot * u + 2.0 * n_dot * rate * w - n * rate**2 * u) - self.height * rate**2 * u
        )
        return r, v, acc

    def place(self, t: Array) -> tuple[Array, Array, Array]:
        """(lat, lon, height): the normal says the latitude without iteration."""
        u, _, _ = self.frame(t)
        lat = np.arctan2(u[:, 2], np.hypot(u[:, 0], u[:, 1]))
        return lat, np.arctan2(u[:, 1], u[:, 0]), np.full(t.size, self.height)

    def prepare(self, t: Array, *, even: bool) -> OverPole:
        """The motion at instants ``t``; everything waits for its turn."""
        return OverPole(self, t.ravel())


@dataclass(frozen=True)
class OverPole:
    """A :class:`PolarMotion` at N instants; nothing in it is singular at a pole."""

    motion: PolarMotion
    t: Array

    def take(self, index: npt.NDArray[np.int64]) -> OverPole:
        """Some of the instants."""
        return OverPole(self.motion, self.t[index])

    def velocity(self) -> Array:
        """(N, 3): East-North-Up velocity, m/s."""
        lat, lon, _ = self.motion.place(self.t)
        return to_axes(c_en(lat, lon), self.motion.earth_fixed(self.t)[1])

    def course(self, lat: Array, height: Array) -> Course:
        """Velocity and attitude with their derivatives; the position is known anyway."""
        lat, lon, _ = self.motion.place(self.t)
        c = c_en(lat, lon)
        _, v_e, a_e = self.motion.earth_fixed(self.t)
        u, w, rate = self.motion.frame(self.t)
        c_eb = np.stack([np.cross(w, u), w, u], axis=-1)
        return Course(
            v_n=to_axes(c, v_e),
            a_n=to_axes(c, a_e),
            c_nb=np.swapaxes(c, -1, -2) @ c_eb,
            omega_eb_b=np.tile([-rate, 0.0, 0.0], (self.t.size, 1)),
        )


def to_axes(c: Array, x: Array) -> Array:
    """C^T x of each row: c (n, 3, 3), x (n, 3)."""
    return np.asarray(np.einsum("nij,ni->nj", c, x))


def transport_rates(lat: Array, height: Array, v_n: Array, *, earth: Ellipsoid) -> Array:
    """omega_en_n (n, 3), rad/s: the ENU frame turns because the vehicle moves (004, 001 eq. 1)."""
    r_m, r_n = radii(lat, height, earth=earth)
    return np.stack([-v_n[:, 1] / r_m, v_n[:, 0] / r_n, v_n[:, 0] * np.tan(lat) / r_n], axis=-1)
