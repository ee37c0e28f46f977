"""Header, publish and log time of a topic: which of them to believe.

``log`` is when the recorder received a message, ``publish`` when the middleware sent it, ``header``
what the driver wrote into it. The header counts where it is there, runs forward, and runs as fast
as the recorder's clock; else the recorder's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from vehnav.logs.messages.roles import Role
from vehnav.units import NS

Ints = npt.NDArray[np.int64]
Columns = dict[str, npt.NDArray[Any]]
ClockName = Literal["header", "publish", "log"]

MAX_RATE_ERROR = 0.005
"""Of a header clock against the recorder's; a driver that counts samples wrongly is off by more."""
MAX_BACKWARD_SHARE = 0.01
"""Stamps that run backward; up to this share they are sorted, beyond it the clock is not used."""
CLOCK_SET_S = 1.0
"""A step back by more is a clock that was set."""
JITTER_ALLOWANCE_S = 0.2
"""s by which receive times may shift over a whole log without saying anything about the rate."""
UNIX_FROM_NS = 315_532_800_000_000_000
"""1980: a smaller stamp counts from some boot, not from 1970."""
GAP_STEPS = 1.5
_NS_PER = (1, 1_000, 1_000_000, 1_000_000_000)


@dataclass(frozen=True)
class ClockStats:
    """One clock of a topic against the recorder's.

    Attributes
    ----------
    offset_s : float
        Median of log time minus stamp.
    spread_s : float
        Its standard deviation, from the median absolute deviation.
    rate_error : float or None
        How much faster the stamps run than log time, relative; None where that cannot be told:
        fewer than three stamps, or log time that stands.
    backward, repeated, gaps : int
        Steps below zero, of zero, and over 1.5 medians.
    step_s : tuple of float
        Percentiles 0, 1, 50, 99, 100 of the steps: host stamps show their jitter here.
    """

    offset_s: float
    spread_s: float
    rate_error: float | None
    backward: int
    repeated: int
    gaps: int
    step_s: tuple[float, float, float, float, float]


@dataclass(frozen=True)
class Clock:
    """The stamps that were chosen for a topic, and why.

    Attributes
    ----------
    offset_s : float
        Median of log time minus these stamps.
    """

    t_ns: Ints
    name: ClockName
    reason: str
    stats: ClockStats

    @property
    def unix(self) -> bool:
        """Whether the stamps count from 1970."""
        return bool(self.t_ns.size and np.median(self.t_ns) > UNIX_FROM_NS)


def clock_stats(t_ns: Ints, log_ns: Ints) -> ClockStats:
    """Statistics of stamps (n,) against log times (n,), n > 0."""
    late = (log_ns - t_ns) * NS
    offset = float(np.median(late))
    steps = np.diff(t_ns) * NS if t_ns.size > 1 else np.zeros(1)
    forward = steps[steps > 0]
    median = float(np.median(forward)) if forward.size else 0.0
    low, p1, p50, p99, high = np.percentile(steps, (0, 1, 50, 99, 100)).tolist()
    return ClockStats(
        offset_s=offset,
        spread_s=1.4826 * float(np.median(np.abs(late - offset))),
        rate_error=_rate_error(t_ns, log_ns),
        backward=int(np.sum(steps < 0)),
        repeated=int(np.sum(steps == 0)) if t_ns.size > 1 else 0,
        gaps=int(np.sum(steps > GAP_STEPS * median)) if median else 0,
        step_s=(low, p1, p50, p99, high),
    )


def _rate_error(t_ns: Ints, log_ns: Ints) -> float | None:
    """Relative, between the medians of the first and the last tenth; what jitter explains is 0."""
    part = max(1, t_ns.size // 10)
    if t_ns.size < 3:
        return None
    span = (float(np.median(t_ns[-part:])) - float(np.median(t_ns[:part]))) * NS
    recorder = (float(np.median(log_ns[-part:])) - float(np.median(log_ns[:part]))) * NS
    if recorder <= 0:
        return None
    excess = span - recorder
    if abs(excess) <= min(JITTER_ALLOWANCE_S, 0.25 * recorder):
        return 0.0
    return excess / recorder


def header_stamps(role: Role, columns: Columns) -> Ints | None:
    """The stamps inside the messages, ns: the innermost that are set; None without any."""
    for k, stamp in enumerate(role.stamps):
        first = columns.get(f"stamp{k}")
        if first is None:
            continue
        if stamp.nanoseconds is None:
            t_ns = _counted(first[:, 0], columns["log"])
        else:
            t_ns = _pair(first[:, 0], columns[f"nanos{k}"][:, 0])
        if t_ns is not None and np.count_nonzero(t_ns) > t_ns.size // 2:
            return t_ns
    return None


def _pair(seconds: npt.NDArray[Any], nanoseconds: npt.NDArray[Any]) -> Ints | None:
    whole = seconds.astype(np.int64)
    if np.any(np.abs(whole) > 9_000_000_000):
        return None
    t_ns: Ints = whole * 1_000_000_000 + nanoseconds.astype(np.int64)
    return t_ns


def _counted(count: npt.NDArray[Any], log_ns: Ints) -> Ints | None:
    """A count of unknown unit: of s, ms, us, ns that which keeps pace with the recorder."""
    if count.size < 3 or not np.all(np.isfinite(count)):
        return None
    span = float(count[-1]) - float(count[0])
    recorder = float(log_ns[-1]) - float(log_ns[0])
    if span <= 0 or recorder <= 0:
        return None
    for unit in _NS_PER:
        if abs(span * unit / recorder - 1) < 0.2:
            if np.max(np.abs(count.astype(np.float64))) * unit > 9e18:
                return None
            if count.dtype.kind in "iu":
                exact: Ints = count.astype(np.int64) * unit
                return exact
            rounded: Ints = np.rint(count * unit).astype(np.int64)
            return rounded
    return None


def choose_clock(role: Role, columns: Columns, wanted: str | None) -> Clock:
    """Stamps of a topic: the header's where they are sound, else the recorder's.

    Parameters
    ----------
    wanted : {"header", "log"} or None
        The user's choice; "header" still needs stamps in the messages.
    """
    log_ns = columns["log"]
    header = None if wanted == "log" else header_stamps(role, columns)
    if wanted == "log":
        return Clock(log_ns, "log", "as asked for", clock_stats(log_ns, log_ns))
    if header is None:
        return _recorder(columns, "the messages carry no stamps")
    stats = clock_stats(header, log_ns)
    doubt = "" if wanted == "header" else _doubt(stats, header)
    if not doubt or not _runs(log_ns):
        return Clock(header, "header", "as asked for" if wanted else "sound", stats)
    return _recorder(columns, doubt)


def _recorder(columns: Columns, why: str) -> Clock:
    """Log time, or publish time where log time does not run."""
    log_ns, publish_ns = columns["log"], columns["publish"]
    if not _runs(log_ns) and _runs(publish_ns):
        why += " and log time does not run"
        return Clock(publish_ns, "publish", why, clock_stats(publish_ns, log_ns))
    return Clock(log_ns, "log", why, clock_stats(log_ns, log_ns))


def _runs(t_ns: Ints) -> bool:
    """Whether a clock increases at all."""
    return t_ns.size < 2 or bool(t_ns[-1] > t_ns[0] and np.mean(np.diff(t_ns) >= 0) > 0.5)


def _doubt(stats: ClockStats, t_ns: Ints) -> str:
    """Why header stamps are not to be used, or ""."""
    if t_ns.size and not t_ns.all():
        return f"{int(np.sum(t_ns == 0))} header stamps are zero"
    if stats.backward > MAX_BACKWARD_SHARE * t_ns.size or stats.step_s[0] < -CLOCK_SET_S:
        worst = -stats.step_s[0]
        return f"the header stamps run backward {stats.backward} times, by up to {worst:.3g} s"
    error = stats.rate_error
    if error is not None and abs(error) > MAX_RATE_ERROR:
        return f"the header clock is {100 * error:+.2f} % off the recorder's"
    return ""
