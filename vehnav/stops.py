"""Stops of the vehicle, found by the angular rate under a threshold (paper 002; spec C 1).

Engine vibration is fast, the vehicle's own rotation slow. So the default statistic ``slow`` is the
vector standard deviation, over a centred 2 s window, of the 0.25 s running mean of the angular
rate: free of the gyro bias by construction and of vibration by the mean. The same of the specific
force must be small too. ``rms`` is the paper's own form: the 1 s moving RMS of the bias-free rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from vehnav.rest import TimeIntegral, running_deviation, running_mean, runs, samples_in_window
from vehnav.units import DEG

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Statistic = Literal["slow", "rms"]

SLOW_MEAN = 0.25
"""s: the running mean that takes engine vibration (over 5 Hz) out."""
FORCE_THRESHOLD = 0.10
"""m/s2: slow deviation of the specific force in a stop."""
RMS_FORCE_THRESHOLD = 0.3
"""m/s2: 1 s deviation of the specific force in a stop of the paper's statistic (spec A 4.2)."""
EXTEND = 0.5
"""s by which both ends of a quiet run are moved outward: the window is its own guard."""
RMS_GUARD = 0.3
"""s by which both ends of a stop of the paper's statistic are moved inward (spec A 4.2)."""
TRIM_MEAN = 0.5
"""s: running mean of the specific force that has to stay near that of the stop until its end."""
TRIM_FORCE = 0.06
"""m/s2 by which it may differ: above the noise of the mean, below any departure."""
TRIM_SIGMAS = 4.0
"""or that many of its own deviations in the middle of the stop, where vibration is strong."""
ARRIVAL = 2.5
"""s within which the last of the speed goes, at the start of a stop."""
ARRIVAL_SPEED = 0.2
"""m/s that may be left on the first instant of a stop."""
SETTLE = 1.0
"""s after the start until the level may be taken: suspension rocking decays (spec A 4.2)."""
MIN_SHARE = 0.6
"""of the expected samples that a window must hold: a gap is not quiet."""
SHORT_REST = 0.6
"""s at the start of a log that may stand for a stop where there is no other."""
SHORT_SHARE = 0.4, 0.25
"""of the thresholds of rate (0.12 deg/s by default) and force (0.025 m/s2): the deviations there.
Over 0.6 s they are smaller than over 2 s: a vehicle on a motorway shows 0.26 deg/s or more (kitti
0042), one that stands for 0.9 s 0.10 (ugv)."""
MIN_SHORT = 8
"""Samples that it must hold."""
MARGIN_WARNING = 0.8
"""A stop whose statistics come this near to the threshold is reported."""


@dataclass(frozen=True)
class StopRule:
    """How stops are told from driving.

    Attributes
    ----------
    statistic : {"slow", "rms"}
    threshold : float
        rad/s, on the statistic of the angular rate.
    window : float
        s, centred.
    dwell : float
        s that the statistic must stay under the threshold.
    """

    statistic: Statistic = "slow"
    threshold: float = 0.30 * DEG
    window: float = 2.0
    dwell: float = 1.0


RMS_RULE = StopRule(statistic="rms", threshold=0.20 * DEG, window=1.0, dwell=3.0)
"""Paper 002's statistic with the values of spec A 4.5 for MEMS."""


@dataclass(frozen=True)
class StopStatistics:
    """The two statistics on every sample.

    Attributes
    ----------
    rate, force : (n,)
        rad/s and m/s2; inf where the window is not wholly inside the log or holds too few samples.
    force_threshold : float
        m/s2
    """

    rate: Array
    force: Array
    force_threshold: float

    def margin(self, threshold: float) -> Array:
        """(n,) the larger of the two over its threshold: below 1 is quiet."""
        return np.maximum(self.rate / threshold, self.force / self.force_threshold)


@dataclass(frozen=True)
class Stop:
    """One stop.

    Attributes
    ----------
    first, last : int
        Indices of its first and last sample.
    start, end : float
        s since the first sample of the log.
    settled : float
        s, from when on the specific force is that of rest: levelling begins here.
    rate, force : float
        Medians of the statistics inside, rad/s and m/s2.
    margin : float
        95th percentile of the margin inside: under 1, and the smaller the surer.
    """

    first: int
    last: int
    start: float
    end: float
    settled: float
    rate: float
    force: float
    margin: float

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.end - self.start


def stop_statistics(t: Array, omega: Array, f: Array, rule: StopRule) -> StopStatistics:
    """Statistics of ``rule`` on every sample.

    Parameters
    ----------
    t : (n,)
        s, strictly increasing.
    omega, f : (n, 3)
        Angular rate, rad/s, and specific force, m/s2, on any axes.
    """
    if rule.statistic == "slow":
        rate = running_deviation(t, running_mean(t, omega, SLOW_MEAN), rule.window)
        force = running_deviation(t, running_mean(t, f, SLOW_MEAN), rule.window)
        limit = FORCE_THRESHOLD
    else:
        bias = quiet_bias(t, omega)
        mean_square = running_mean(t, ((omega - bias) ** 2).sum(axis=1)[:, None], rule.window)
        rate = np.sqrt(np.maximum(mean_square[:, 0], 0.0))
        force = running_deviation(t, f, rule.window)
        limit = RMS_FORCE_THRESHOLD
    valid = _window_inside(t, rule.window)
    return StopStatistics(np.where(valid, rate, np.inf), np.where(valid, force, np.inf), limit)


def find_stops(t: Array, omega: Array, f: Array, rule: StopRule) -> list[Stop]:
    """The stops of a log, in order (spec C section 1, rules 1-4).

    Parameters
    ----------
    t : (n,)
        s since the first sample, strictly increasing.
    omega, f : (n, 3)
        Angular rate, rad/s, and specific force, m/s2, on any axes; biases do not matter.
    rule : StopRule
    """
    statistics = stop_statistics(t, omega, f, rule)
    return stops_from_statistics(t, f, statistics, rule)


def stops_from_statistics(
    t: Array, f: Array, statistics: StopStatistics, rule: StopRule
) -> list[Stop]:
    """Stops of statistics that are already there; ``f`` (n, 3) m/s2 trims their ends."""
    margin = statistics.margin(rule.threshold)
    quiet = runs(margin < 1.0)
    long_enough = t[quiet[:, 1]] - t[quiet[:, 0]] >= rule.dwell
    stops: list[Stop] = []
    for first, last in quiet[long_enough]:
        inside = slice(first, last + 1)
        figures = (
            float(np.median(statistics.rate[inside])),
            float(np.median(statistics.force[inside])),
            float(np.percentile(margin[inside], 95)),
        )
        shift = EXTEND if rule.statistic == "slow" else -RMS_GUARD
        first = int(np.searchsorted(t, t[first] - shift, side="left"))
        last = int(np.searchsorted(t, t[last] + shift, side="right")) - 1
        if stops and first <= stops[-1].last:
            first = stops[-1].last + 1
        first, last = _first_still(t, f, first, last), _last_still(t, f, first, last)
        if last > first:
            settled = _settled(t, f, first, last)
            stops.append(Stop(first, last, float(t[first]), float(t[last]), settled, *figures))
    return stops


def short_start(t: Array, omega: Array, f: Array, rule: StopRule) -> Stop | None:
    """The start of a log as a stop, where nothing in it is still for long enough to be one.

    Recordings are often started with the vehicle, after less rest than the rule wants. From 0.6 s
    level and gyro bias are weak: the caller says so. None where the start is not quiet.

    Parameters
    ----------
    t, omega, f
        As for :func:`find_stops`.
    rule : StopRule
        Only the statistic ``slow`` has such a start.
    """
    if rule.statistic != "slow":
        return None
    found = None
    expected = 1.0 / float(np.median(np.diff(t)))
    for length in np.arange(SHORT_REST, rule.window + rule.dwell, 0.1):
        n = int(np.searchsorted(t, t[0] + length, side="right"))
        if n < max(MIN_SHARE * expected * length, MIN_SHORT):
            return found
        rate, force = (
            float(np.sqrt(np.sum(running_mean(t[:n], x[:n], SLOW_MEAN).var(axis=0))))
            for x in (omega, f)
        )
        shares = rate / rule.threshold, force / FORCE_THRESHOLD
        if shares[0] >= SHORT_SHARE[0] or shares[1] >= SHORT_SHARE[1]:
            return found
        margin = max(shares)
        found = Stop(0, n - 1, float(t[0]), float(t[n - 1]), float(t[0]), rate, force, margin)
    return found


def _first_still(t: Array, f: Array, first: int, last: int) -> int:
    """Where a stop really begins: a gentle arrival is quieter than the threshold.

    The first instant on which the accelerometers show less than 0.2 m/s yet to vanish. Rocking on
    the springs has no net speed and is standing.
    """
    if last - first < 8:
        return first
    half = (first + last) // 2
    rest = f[half : last + 1].mean(axis=0)
    early = t[first : half + 1]
    end = np.minimum(early + ARRIVAL, t[half])
    mean = TimeIntegral(early, f[first : half + 1] - rest).mean(early, end)
    left = np.linalg.norm(mean * (end - early)[:, None], axis=1)
    return first + int(np.argmax(left < ARRIVAL_SPEED))


def _last_still(t: Array, f: Array, first: int, last: int) -> int:
    """Where a stop really ends: a gentle start is quieter than the threshold.

    The last instant whose 0.5 s mean of the specific force is that of the middle half (spec A 4.2
    rule 4).
    """
    near = _near_rest(t, f, first, last)
    return first + int(near[-1]) if near.size else last


def _settled(t: Array, f: Array, first: int, last: int) -> float:
    """From when on the level may be taken, s: after SETTLE, and once the force is that of rest."""
    near = _near_rest(t, f, first, last)
    steady = float(t[first + int(near[0])]) if near.size else float(t[first])
    return min(max(float(t[first]) + SETTLE, steady), 0.5 * float(t[first] + t[last]))


def _near_rest(t: Array, f: Array, first: int, last: int) -> IntArray:
    """Instants, counted from ``first``, whose mean specific force is that of the middle half."""
    if last - first < 8:
        return np.arange(last + 1 - first)
    inside = slice(first, last + 1)
    mean = running_mean(t[inside], f[inside], TRIM_MEAN)
    quarter = (last + 1 - first) // 4
    middle = slice(quarter, last + 1 - first - quarter)
    away = np.linalg.norm(mean - np.median(mean[middle], axis=0), axis=1)
    noise = float(np.sqrt(np.mean(away[middle] ** 2)))
    return np.flatnonzero(away <= max(TRIM_FORCE, TRIM_SIGMAS * noise))


def stopped_mask(n: int, stops: list[Stop]) -> npt.NDArray[np.bool_]:
    """(n,) True on the samples of a stop."""
    return stop_numbers(n, stops) >= 0


def stop_numbers(n: int, stops: list[Stop]) -> IntArray:
    """(n,) number of the stop that a sample lies in, -1 while moving."""
    numbers = np.full(n, -1, dtype=np.int64)
    for k, stop in enumerate(stops):
        numbers[stop.first : stop.last + 1] = k
    return numbers


def quiet_bias(t: Array, omega: Array) -> Array:
    """(3,) gyro bias, rad/s, from the quietest windows (spec A 4.2 rule 1).

    The log is cut into 2 s windows; of the 5 % with the smallest deviation the median of their
    means is taken, so neither stops nor a threshold need be known.
    """
    window = max(2.0, 4.0 * float(np.median(np.diff(t))))
    number = ((t - t[0]) / window).astype(np.int64)
    count = np.bincount(number)
    full = count >= MIN_SHARE * np.median(count)
    total = np.stack([np.bincount(number, omega[:, k]) for k in range(3)], axis=1)
    square = np.bincount(number, np.sum((omega - omega.mean(axis=0)) ** 2, axis=1))
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = total / count[:, None]
        variance = square / count - np.sum((mean - omega.mean(axis=0)) ** 2, axis=1)
    mean, variance = mean[full], variance[full]
    quietest = np.argsort(variance, kind="stable")[: max(1, variance.size // 20)]
    return np.asarray(np.median(mean[quietest], axis=0))


def _window_inside(t: Array, window: float) -> npt.NDArray[np.bool_]:
    """(n,) the centred window lies in the log and holds enough of the expected samples."""
    expected = window / float(np.median(np.diff(t)))
    half = 0.5 * window
    whole = (t - half >= t[0] - 1e-9) & (t + half <= t[-1] + 1e-9)
    return np.asarray(whole & (samples_in_window(t, window) >= MIN_SHARE * expected))
