"""Stops judged by GPS speed (the judge of spec C 1)."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.evaluation.reference import seconds, tracks
from vehnav.logs.log import Gnss
from vehnav.rest import runs
from vehnav.units import NS

Array = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

MOVING: Final = 1.0
"""m/s above which the vehicle moves."""
STANDING_BY_VELOCITY: Final = 0.1
"""m/s below which a receiver with velocity stands."""
STANDING_BY_POSITION: Final = 0.5
"""m/s below which a receiver without velocity stands (noise of a 3 s difference)."""
EDGE: Final = 2.0
"""s at both ends of standing and moving that do not count: the judge is no sharper."""
LONG_STOP: Final = 5.0
"""s: a stop this long must not be missed."""
HALF_DIFFERENCE: Final = 1.5
"""s on each side of the central difference, where there is no velocity."""


@dataclass(frozen=True)
class StopScore:
    """Detected stops against GPS speed.

    Attributes
    ----------
    found : float or None
        Share of the standing time that lies in stops; None where the GPS never stands.
    wrong : float or None
        Share of the moving time that lies in stops.
    standing_s, moving_s : float
        Judged time.
    fastest_m_s : float or None
        Largest GPS speed inside a stop.
    missed : tuple of (start s, end s)
        GPS stops of 5 s or more without any detected one, from the start of the log.
    """

    found: float | None
    wrong: float | None
    standing_s: float
    moving_s: float
    fastest_m_s: float | None
    missed: tuple[tuple[float, float], ...]

    def to_dict(self) -> dict[str, Any]:
        """The fields by name."""
        return asdict(self)


def gps_speed(gnss: Gnss) -> tuple[npt.NDArray[np.int64], Array, float]:
    """(stamps ns, horizontal speed m/s, standing limit m/s) of a receiver.

    Its velocity where it logs one, else the central difference of positions over 3 s.
    """
    if gnss.v_n is not None:
        speed = np.hypot(gnss.v_n[:, 0], gnss.v_n[:, 1])
        return gnss.t_ns, np.asarray(speed), STANDING_BY_VELOCITY
    t, position = seconds(gnss), tracks(gnss)
    before, after = np.maximum(t - HALF_DIFFERENCE, t[0]), np.minimum(t + HALF_DIFFERENCE, t[-1])
    step = np.stack(
        [np.interp(after, t, position[:, k]) - np.interp(before, t, position[:, k]) for k in (0, 1)]
    )
    speed = np.hypot(step[0], step[1]) / np.maximum(after - before, 1e-9)
    return gnss.t_ns, np.asarray(speed), STANDING_BY_POSITION


def score_stops(t_ns: npt.NDArray[np.int64], stopped: BoolArray, gnss: Gnss) -> StopScore:
    """Judge the samples inside stops by GPS speed.

    Parameters
    ----------
    t_ns : (n,) int64
        Stamps of the IMU.
    stopped : (n,) bool
        Whether each sample lies in a stop.
    gnss : Gnss
        With its delay taken out (``--gps-time-offset``).
    """
    stamps, speed, limit = gps_speed(gnss)
    t = (t_ns - t_ns[0]) * NS
    at = np.interp(t, (stamps - t_ns[0]) * NS, speed)
    known = (t_ns > stamps[0]) & (t_ns < stamps[-1])
    standing, moving = (at < limit) & known, (at > MOVING) & known
    inner_standing, inner_moving = _without_edges(t, standing), _without_edges(t, moving)
    dt = float(np.median(np.diff(t)))
    missed = [
        (float(t[a]), float(t[b]))
        for a, b in runs(standing)
        if t[b] - t[a] >= LONG_STOP and not np.any(stopped[a : b + 1])
    ]
    both = stopped & known
    return StopScore(
        found=float(np.mean(stopped[inner_standing])) if np.any(inner_standing) else None,
        wrong=float(np.mean(stopped[inner_moving])) if np.any(inner_moving) else None,
        standing_s=float(np.sum(inner_standing)) * dt,
        moving_s=float(np.sum(inner_moving)) * dt,
        fastest_m_s=float(np.max(at[both])) if np.any(both) else None,
        missed=tuple(missed),
    )


def speed_inside(stamps: npt.NDArray[np.int64], speed: Array, start: int, end: int) -> float | None:
    """Largest GPS speed between two instants (ns), m/s; None without a fix there."""
    inside = (stamps >= start) & (stamps <= end)
    return float(np.max(speed[inside])) if np.any(inside) else None


def _without_edges(t: Array, mask: BoolArray) -> BoolArray:
    inner = np.zeros_like(mask)
    for a, b in runs(mask):
        inner[a : b + 1] = (t[a : b + 1] >= t[a] + EDGE) & (t[a : b + 1] <= t[b] - EDGE)
    return inner
