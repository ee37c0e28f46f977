"""The delay of a receiver, from a trajectory whose clock is the IMU's.

Half a second is 5 m at 10 m/s, more than a good receiver's noise, and dead reckoning drifts by
more than that: so the drive is cut into windows, and in each one everything slow is fitted away
(a parabola per axis, a turn and a stretch of the track). What remains and points along the
velocity is time. The windows vote; their scatter is the uncertainty. Only windows vote in which GPS
shows the changes of velocity that the track has: those of a track that drifts are not motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.earth import position_difference, turn_of_axes
from vehnav.evaluation.matching import in_long_gaps
from vehnav.logs.log import Gnss
from vehnav.trajectory import Trajectory, interpolate_positions
from vehnav.units import NS

Array = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

WINDOW: Final = 40.0
"""s: long enough for a change of speed or a bend, short enough for drift to be a parabola."""
MAX_OFFSET: Final = 3.0
"""s: receivers are not later than this; larger ones are clocks (see ``clock_findings``)."""
SCAN_STEP: Final = 0.25
FIX_INTERVAL: Final = 0.5
"""s: faster receivers are thinned; their fixes are correlated anyway."""
MIN_FIXES: Final = 15
"""In a window, for nine unknowns."""
SHOWN: Final = 0.5
"""Of the track's changes of velocity, what GPS must show: the rest is drift."""
SHOWN_SIGMAS: Final = 3.0
"""By which these changes stand out of the noise of the fixes."""
MIN_WINDOWS: Final = 4
"""To say how far they scatter."""
ITERATIONS: Final = 8
MIN_EFFECTIVE: Final = 3.0
"""Windows after weighting: 1 / sum of squared shares."""
SHARPEST: Final = 1e-3
"""s: no window is believed more than this."""
SCATTER_FACTOR: Final = 1.5
"""Over simulated drives with correlated GPS noise the plain scatter of the windows is 1.4 times too
small (they share what the parabolas leave)."""


@dataclass(frozen=True)
class TimeOffset:
    """What to add to the stamps of the GPS.

    Attributes
    ----------
    offset : float
        s; minus the delay of the receiver.
    sigma : float
        s, one standard deviation, from the scatter of the windows.
    windows : int
        How many voted.
    """

    offset: float
    sigma: float
    windows: int

    def to_dict(self) -> dict[str, Any]:
        """The fields by their names in the report."""
        return {"offset_s": self.offset, "sigma_s": self.sigma, "windows": self.windows}


@dataclass(frozen=True)
class _Window:
    """The fixes of one window, and the piece of the trajectory around them."""

    piece: Trajectory
    t_ns: TimeArray
    lat: Array
    lon: Array
    height: Array


def estimate_time_offset(trajectory: Trajectory, gnss: Gnss) -> TimeOffset | None:
    """Seconds to add to the stamps of the GPS, with uncertainty; None where motion does not tell.

    Fewer than four windows of 40 s with a change of speed or direction, or a scatter of more
    than 0.3 s, tell nothing.
    """
    windows = _windows(trajectory, gnss)
    if len(windows) < MIN_WINDOWS:
        return None
    scan = np.arange(-MAX_OFFSET, MAX_OFFSET + 0.5 * SCAN_STEP, SCAN_STEP)
    costs = [_total(windows, float(offset)) for offset in scan]
    offset = float(scan[int(np.argmin(costs))])
    found = None
    for _ in range(ITERATIONS):
        found = _vote(windows, offset)
        if found is None:
            return None
        step = found.offset - offset
        offset = float(np.clip(found.offset, -MAX_OFFSET, MAX_OFFSET))
        if abs(step) < 1e-4:
            break
    if found is None or found.sigma > 0.3 or abs(offset) >= MAX_OFFSET:
        return None
    return found


def _windows(trajectory: Trajectory, gnss: Gnss) -> list[_Window]:
    """Fixes in stretches of 40 s, well inside the trajectory and outside its gaps."""
    margin = round((MAX_OFFSET + 1.0) / NS)
    inside = gnss.t_ns >= trajectory.t_ns[0] + margin
    inside &= gnss.t_ns <= trajectory.t_ns[-1] - margin
    for shift in (-margin, 0, margin):
        at = np.clip(gnss.t_ns + shift, trajectory.t_ns[0], trajectory.t_ns[-1])
        inside &= ~in_long_gaps(at, trajectory.t_ns)
    index = np.flatnonzero(inside)
    if index.size == 0:
        return []
    slot = ((gnss.t_ns[index] - gnss.t_ns[index[0]]) * NS / FIX_INTERVAL + 0.01).astype(np.int64)
    index = index[np.diff(slot, prepend=-1) > 0]
    number = ((gnss.t_ns[index] - gnss.t_ns[index[0]]) * NS / WINDOW).astype(np.int64)
    groups = np.split(index, np.flatnonzero(np.diff(number)) + 1)
    windows = []
    for k in groups:
        if k.size >= MIN_FIXES:
            edges = (gnss.t_ns[k[0]] - margin, gnss.t_ns[k[-1]] + margin)
            first, last = np.searchsorted(trajectory.t_ns, edges)
            piece = trajectory.rows(slice(max(int(first) - 1, 0), int(last) + 1))
            windows.append(_Window(piece, gnss.t_ns[k], gnss.lat[k], gnss.lon[k], gnss.height[k]))
    return windows


def _equations(window: _Window, offset: float) -> tuple[Array, Array, Array]:
    """Residual (2 m,), velocity column (2 m,) and slow columns (2 m, 8) at a trial offset.

    gps(t) = p(t + offset) + d(offset) v + slow; the slow columns are a parabola per axis, a turn
    about and a stretch from the window's middle.
    """
    t_ns = window.t_ns + np.int64(round(offset / NS))
    half = 50_000_000  # ns; the velocity is the one of the track itself, over 0.1 s
    here, before, after = (
        interpolate_positions(window.piece, t_ns + np.int64(shift)) for shift in (0, -half, half)
    )
    k = t_ns.size // 2
    residual = position_difference(window.lat, window.lon, here[0], here[1], window.height)
    velocity = position_difference(after[0], after[1], before[0], before[1], window.height)
    velocity /= 2.0 * half * NS
    turn = turn_of_axes(here[0], here[1], here[0][k], here[1][k])[:, :2, :2]  # near a pole
    residual, velocity = (np.einsum("kij,kj->ki", turn, x) for x in (residual, velocity))
    track = position_difference(here[0], here[1], here[0][k], here[1][k], window.height)
    track -= track.mean(axis=0)
    s = (window.t_ns - window.t_ns[0]) * NS / WINDOW - 0.5
    power = np.stack([np.ones_like(s), s, s * s], axis=1)
    zero = np.zeros_like(power)
    scale = max(float(np.max(np.abs(track))), 1.0)
    slow = np.concatenate(
        [
            np.concatenate([power, zero, -track[:, 1:] / scale, track[:, :1] / scale], axis=1),
            np.concatenate([zero, power, track[:, :1] / scale, track[:, 1:] / scale], axis=1),
        ]
    )
    return residual.T.ravel(), velocity.T.ravel(), slow


def _shown_by_gps(window: _Window, offset: float) -> bool:
    """Whether GPS shows the changes of velocity that the track has in a window.

    Velocities of both between the fixes beside each one, without their mean and trend: the slope of
    those by GPS on those of the track is one where the track is right, and the share of the motion
    in the power where it drifts.
    """
    t_ns = window.t_ns + np.int64(round(offset / NS))
    lat, lon, _ = interpolate_positions(window.piece, t_ns)
    k = t_ns.size // 2
    at = (lat[k], lon[k], window.height)
    by_track = position_difference(lat, lon, *at)
    by_gps = position_difference(window.lat, window.lon, *at)
    s = (window.t_ns - window.t_ns[0]) * NS
    between = (s[2:] - s[:-2])[:, None]
    trend = np.stack([np.ones(s.size - 2), s[1:-1] / WINDOW], axis=1)
    u, g = (
        np.concatenate(_without(trend, *((p[2:] - p[:-2]) / between).T)) for p in (by_track, by_gps)
    )
    power = float(u @ u)
    slope = float(u @ g) / max(power, 1e-12)
    noise = float(np.sqrt(np.mean((g - slope * u) ** 2)))
    return slope > SHOWN and slope * np.sqrt(power) > SHOWN_SIGMAS * noise


def _without(slow: Array, *vectors: Array) -> list[Array]:
    """What of the vectors is orthogonal to the slow columns."""
    u, size, _ = np.linalg.svd(slow, full_matrices=False)
    basis = u[:, size > 1e-6 * size[0]]
    return [v - basis @ (basis.T @ v) for v in vectors]


def _total(windows: list[_Window], offset: float) -> float:
    """Sum over the windows of what the slow errors leave, each at most 4 times its median.

    A window of wild drift must not decide alone.
    """
    left = np.array(
        [
            float(np.linalg.norm(_without(slow, residual)[0]))
            for residual, _, slow in (_equations(w, offset) for w in windows)
        ]
    )
    return float(np.sum(np.minimum(left, 4.0 * np.median(left)) ** 2))


def _vote(windows: list[_Window], offset: float) -> TimeOffset | None:
    """The weighted mean of the windows' own offsets (Huber), and its scatter.

    The weight of a window is its information, |v|^2 / s^2 with s its own residual.
    """
    own, weight = [], []
    for window in windows:
        residual, velocity, slow = _equations(window, offset)
        r, v = _without(slow, residual, velocity)
        power = float(v @ v)
        if power < 1.0 or not _shown_by_gps(window, offset):
            continue  # steady motion: a shift in time is a shift in place
        step = float(v @ r) / power
        left = r - step * v
        variance = float(left @ left) / max(r.size - 9, 1)
        own.append(offset + step)
        weight.append(1.0 / (variance / power + SHARPEST**2))
    if len(own) < MIN_WINDOWS:
        return None
    x, w = np.array(own), np.array(weight)
    w = np.minimum(w, 10.0 * np.median(w))  # no window decides alone
    mean = _weighted_median(x, w)
    for _ in range(20):
        spread = 1.4826 * _weighted_median(np.abs(x - mean), w) + SHARPEST
        huber = w * np.minimum(1.0, 1.5 * spread / np.maximum(np.abs(x - mean), 1e-12))
        mean = float(np.sum(huber * x) / np.sum(huber))
    share = huber / np.sum(huber)
    effective = 1.0 / float(np.sum(share**2))
    if effective < MIN_EFFECTIVE:
        return None
    # few windows may agree by chance: the variance of Student's t, and the residuals' own say
    scatter2 = float(np.sum((share * (x - mean)) ** 2)) * effective / (effective - 2.0)
    formal2 = 1.0 / float(np.sum(huber))
    return TimeOffset(mean, SCATTER_FACTOR * float(np.sqrt(scatter2 + formal2)), len(own))


def _weighted_median(x: Array, w: Array) -> float:
    order = np.argsort(x)
    total = np.cumsum(w[order])
    return float(x[order][int(np.searchsorted(total, 0.5 * total[-1]))])
