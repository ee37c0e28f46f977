"""What the sources of error do to the position: columns of the models that causes are fitted with.

A column is the position error (estimate minus truth, east and north, m) that one unit of a source
makes at every judged instant. Two models:
:func:`vehnav.evaluation.cause_inertial.inertial_design` for the methods that integrate on through
(free, levelling, reset, as published), :func:`vehnav.evaluation.cause_offline.offline_design` for
the default, whose velocity and level are tied down at both ends of every leg.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.legs import LegNoise
from vehnav.rest import runs
from vehnav.rotation import quaternion_from_c
from vehnav.trajectory import Trajectory, interpolate
from vehnav.units import DEG, DEG_PER_HOUR, MILLI_G, NS

Array = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

MAX_STEPS: Final = 4000
"""Steps of the error equations: an hour at 0.9 s."""
STEP: Final = 0.2
"""s, the finest step."""
INTERVALS: Final = 40
"""Pieces that a slow change of a source is made of, at most."""
INTERVAL: Final = 20.0
"""s, the shortest of them."""
TYPICAL_NOISE: Final = LegNoise(6e-4, 4e-3, 7e-6, 0.02, 0.0017, 9.81)
"""Of a MEMS sensor, where a log shows no rest to take it from."""

HEADING_PRIOR: Final = 10.0 * DEG
GYRO_PRIOR: Final = 20.0 * DEG_PER_HOUR
"""The least prior of a gyro bias; a noisy sensor has a wider one (:func:`gyro_prior`)."""
DRIFT_PRIOR: Final = 10.0 * DEG_PER_HOUR
ACCEL_PRIOR: Final = 5.0 * MILLI_G
SCALE_PRIOR: Final = 0.01
DELAY_PRIOR: Final = 0.5
SHEAR_PRIOR: Final = 0.2 * DEG
TILT_PRIOR: Final = 1.0 * DEG


@dataclass(frozen=True)
class Source:
    """A possible cause: one column, or several that are one cause in pieces.

    Attributes
    ----------
    name : str
        Fixed word.
    label : str
        For a person.
    unit : str
    factor : float
        The unit in SI.
    columns : slice
    """

    name: str
    label: str
    unit: str
    factor: float
    columns: slice

    @property
    def single(self) -> bool:
        """Whether it is one value, not pieces of noise."""
        return bool(self.columns.stop - self.columns.start == 1)


@dataclass(frozen=True)
class Design:
    """Sources, their responses, their prior.

    Attributes
    ----------
    sources : tuple of Source
    response : (m, 2, p)
        East and north error, m, at the judged instants, per unit of each column.
    prior : (p, p)
        Covariance of the columns' values, SI.
    turn : (g, 3, p)
        Attitude error, rad, along the drive, per unit of each column; g = 0: not modelled.
    noise : tuple of str
        Names of the sources that are the noise of the sensors.
    """

    sources: tuple[Source, ...]
    response: Array
    prior: Array
    turn: Array
    noise: tuple[str, ...]

    def prior_with(self, factor: float) -> Array:
        """The prior (p, p) with the noise of the sensors times a factor."""
        scale = np.ones(self.prior.shape[0])
        for source in self.sources:
            if source.name in self.noise:
                scale[source.columns] = factor
        return np.asarray(scale[:, None] * self.prior * scale)


@dataclass(frozen=True)
class Motion:
    """The drive on a coarse grid of g instants, from the start of the solution.

    Attributes
    ----------
    start_ns : int
    t : (g,)
        s since ``start_ns``.
    lat, height : (g,)
        rad, m.
    v_n : (g, 3), c_nb : (g, 3, 3)
    stop : (g,) int64
        Number of the stop, -1 on the way.
    """

    start_ns: int
    t: Array
    lat: Array
    height: Array
    v_n: Array
    c_nb: Array
    stop: npt.NDArray[np.int64]

    @property
    def stops(self) -> int:
        """Number of stops."""
        return int(self.stop.max()) + 1

    def seconds(self, t_ns: TimeArray) -> Array:
        """S since the start of stamps."""
        return np.asarray((t_ns - self.start_ns) * NS, dtype=np.float64)

    def turned(self) -> Array:
        """(g-1, 3) rad: rotation of the body over each step, in body axes."""
        step = self.c_nb[:-1].transpose(0, 2, 1) @ self.c_nb[1:]
        q = quaternion_from_c(step)
        size = np.linalg.norm(q[:, 1:], axis=1)
        angle = 2.0 * np.arctan2(size, q[:, 0])
        return np.asarray(q[:, 1:] * (angle / np.maximum(size, 1e-300))[:, None])

    def edges(self) -> Array:
        """(k+1,) s: the pieces of slow changes, of equal length."""
        duration = float(self.t[-1])
        count = int(np.clip(duration / INTERVAL, 1, INTERVALS))
        return np.linspace(0.0, duration, count + 1)

    def legs(self) -> list[tuple[int, int]]:
        """(first, last) instants of every stretch between stops, both ends included."""
        last = self.t.size - 1
        return [(max(a - 1, 0), min(b + 1, last)) for a, b in runs(self.stop < 0).tolist()]


def motion_of(track: Trajectory) -> Motion:
    """The drive from its first stop on (from its start where it has none), on a coarse grid."""
    spans = [(int(a), int(b)) for a, b in runs(track.stopped)]
    first = spans[0][0] if spans else 0
    t = (track.t_ns - track.t_ns[first]) * NS
    step = max(STEP, float(t[-1]) / MAX_STEPS)
    regular = np.searchsorted(t, np.arange(0.0, float(t[-1]), step))
    corners = [k for span in spans for k in span]
    index = np.unique(np.concatenate([regular, corners, [first, t.size - 1]]).astype(np.int64))
    number = np.full(t.size, -1, dtype=np.int64)
    for k, (a, b) in enumerate(spans):
        number[a : b + 1] = k
    return Motion(
        int(track.t_ns[first]),
        t[index],
        track.lat[index],
        track.height[index],
        track.v_n[index],
        track.c_nb[index],
        number[index],
    )


class Columns:
    """Hands out columns to the sources of a design, with their priors."""

    def __init__(self) -> None:
        self.sources: list[Source] = []
        self._blocks: list[Array] = []
        self.count = 0

    def add(self, name: str, label: str, unit: str, factor: float, prior: npt.ArrayLike) -> slice:
        """New columns with independent sigmas (k,), or a covariance (k, k)."""
        block = np.asarray(prior, float)
        if block.ndim < 2:
            block = np.diag(np.atleast_1d(block) ** 2)
        columns = slice(self.count, self.count + block.shape[0])
        self.count = columns.stop
        self.sources.append(Source(name, label, unit, factor, columns))
        self._blocks.append(block)
        return columns

    def prior(self) -> Array:
        """(p, p): the whole prior covariance."""
        out = np.zeros((self.count, self.count))
        for source, block in zip(self.sources, self._blocks, strict=True):
            out[source.columns, source.columns] = block
        return out


def start_and_delay(columns: Columns, position_sigma: float) -> tuple[slice, slice]:
    """Columns that every model has: start position (2), delay of the GPS (1)."""
    start = columns.add("start-position", "start position", "m", 1.0, [position_sigma] * 2)
    delay = columns.add("gps-delay", "GPS late by", "s", 1.0, DELAY_PRIOR)
    return start, delay


def put_start_and_delay(
    response: Array, start: slice, delay: slice, track: Trajectory, t_ns: TimeArray
) -> None:
    """Write their responses: a shift; the way driven during the delay."""
    response[:, :, start] = np.eye(2)
    response[:, :, delay] = interpolate(track, t_ns).v_n[:, :2, None]


def gyro_prior(noise: LegNoise) -> float:
    """rad/s: a bias is hardly larger than the scatter of one-second means under way."""
    return max(noise.gyro_white, GYRO_PRIOR)


def drift_covariance(edges: Array, white: float, walk: float) -> Array:
    """(k, k) of the mean errors over k pieces: white noise, and the walk since the start."""
    length, middle = np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
    return np.asarray(
        np.diag(white**2 / length) + walk**2 * np.minimum(middle[:, None], middle[None, :])
    )


def at_instants(t: Array, grid: Array, values: Array) -> Array:
    """(m, ...) values (g, ...) on a grid, linear in time, at instants t (m,)."""
    k = np.clip(np.searchsorted(grid, t, side="right") - 1, 0, grid.size - 2)
    s = ((t - grid[k]) / (grid[k + 1] - grid[k])).reshape((-1,) + (1,) * (values.ndim - 1))
    return np.asarray((1.0 - s) * values[k] + s * values[k + 1])
