"""Which fixes of a receiver can be true, and what to do about what a good one lacks.

Every decision is one function on arrays; :func:`vehnav.logs.check.clean_gnss` puts them in order.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.errors import Finding
from vehnav.logs.clock import finding_at, finite_rows
from vehnav.logs.log import Array, TimeArray
from vehnav.units import NS

BoolArray = npt.NDArray[np.bool_]

MAX_SPEED: Final = 150.0
"""m/s; no road vehicle is faster."""
JUMP_ALLOWANCE: Final = 30.0
"""m that two fixes may differ whatever their stamps: host stamps of batched fixes jitter."""
MAX_FALSE_RUN_S: Final = 10.0
"""A stretch of fixes cut off on both sides by impossible jumps is false up to this length."""
MAX_ACCELERATION: Final = 10.0
"""m/s2; no road vehicle starts faster."""
STALE_MIN_SPEED: Final = 3.0
"""m/s before and after an identical repeat; below it receivers hold the position on purpose."""
STALE_ALLOWANCE: Final = 1.0
"""m by which a released static hold or noise may exceed :data:`MAX_ACCELERATION`."""
MIN_SIGMA: Final = 1e-4
"""m, m/s; no receiver is better: smaller values are zeros or uninitialised memory."""
MAX_SIGMA: Final = 1e6
MAX_MISSING_VELOCITY: Final = 0.1
"""Share of fixes without velocity up to which the others are worth keeping."""

_EARTH_RADIUS = 6_371_000.0


def plausible_positions(
    t_ns: TimeArray,
    columns: dict[str, Array],
    status: npt.NDArray[np.integer] | None,
    rejected: dict[str, BoolArray],
) -> BoolArray:
    """Which fixes can be true each by itself; the others go to ``rejected`` under one reason."""
    lat, lon = columns["lat"], columns["lon"]
    finite = finite_rows(t_ns, lat, lon)
    lat0, lon0 = np.where(finite, lat, 0.0), np.where(finite, lon, 0.0)
    reasons = {
        "not finite": ~finite,
        "position (0, 0)": (lat0 == 0.0) & (lon0 == 0.0),
        "latitude over 90 or longitude over 360 deg": (np.abs(lat0) > 0.5 * np.pi)
        | (np.abs(lon0) > 2.0 * np.pi),
    }
    if status is not None:
        reasons["status no fix"] = status == -1
        if not np.all(status == -2):
            reasons["status unknown"] = status == -2
    keep = np.ones(t_ns.size, np.bool_)
    for reason, bad in reasons.items():
        rejected[reason] = bad & keep
        keep &= ~bad
    return keep


def _step_lengths(columns: dict[str, Array], a: TimeArray, b: TimeArray) -> Array:
    """Horizontal distance between fixes of index a and b, m (sphere, short arcs)."""
    lat, lon = columns["lat"], columns["lon"]
    d_lon = np.remainder(lon[b] - lon[a] + np.pi, 2.0 * np.pi) - np.pi
    north = lat[b] - lat[a]
    east = d_lon * np.cos(0.5 * (lat[a] + lat[b]))
    return np.asarray(_EARTH_RADIUS * np.hypot(north, east))


def _impossible(
    t_ns: TimeArray, columns: dict[str, Array], a: TimeArray, b: TimeArray
) -> BoolArray:
    reach = MAX_SPEED * (t_ns[b] - t_ns[a]) * NS + JUMP_ALLOWANCE
    return np.asarray(_step_lengths(columns, a, b) > reach)


def reject_jumps(
    t_ns: TimeArray, columns: dict[str, Array], index: TimeArray, rejected: dict[str, BoolArray]
) -> TimeArray:
    """Without short stretches that no vehicle can have reached from both neighbouring ones.

    The fixes are cut at every step faster than :data:`MAX_SPEED`. A stretch between two cuts is
    false when its neighbours fit together without it; one at an end, when the next is longer.
    """
    bad = np.zeros(t_ns.size, np.bool_)
    rejected["impossible jump"] = bad
    for _ in range(5):  # neighbours of a dropped stretch are judged anew
        cuts = np.flatnonzero(_impossible(t_ns, columns, index[:-1], index[1:])) + 1
        if not cuts.size:
            break
        start, end = np.append(0, cuts), np.append(cuts, index.size)
        length = end - start
        short = (t_ns[index[end - 1]] - t_ns[index[start]]) * NS <= MAX_FALSE_RUN_S
        false = np.zeros(start.size, np.bool_)
        before, after = index[end[:-2] - 1], index[start[2:]]
        false[1:-1] = short[1:-1] & ~_impossible(t_ns, columns, before, after)
        false[1:-1] &= length[1:-1] <= np.maximum(length[:-2], length[2:])
        false[0] = short[0] and length[0] < length[1]
        false[-1] = short[-1] and length[-1] < length[-2]
        if not false.any():
            break
        drop = np.repeat(false, length)
        bad[index[drop]] = True
        index = index[~drop]
    return index


def reject_stale(
    t_ns: TimeArray, columns: dict[str, Array], index: TimeArray, rejected: dict[str, BoolArray]
) -> TimeArray:
    """Without repeats of an identical position while the vehicle certainly drove.

    A receiver may hold its position while the vehicle stands. A repeat is stale only where the
    vehicle moved before and after it, and the step that follows is longer than any vehicle drives
    from rest; that step then makes up for the repeats.
    """
    bad = np.zeros(t_ns.size, np.bool_)
    rejected["stale repeat while moving"] = bad
    if index.size < 5:
        return index
    same = np.ones(index.size - 1, np.bool_)
    for name in ("lat", "lon", "height"):
        value = columns[name][index]
        same &= (value[1:] == value[:-1]) | (np.isnan(value[1:]) & np.isnan(value[:-1]))
    start = np.flatnonzero(np.append(True, ~same))  # first fix of every run of equal ones
    last = np.append(start[1:], index.size) - 1
    k = np.flatnonzero(last > start)
    k = k[(k >= 1) & (k + 2 < start.size)]
    if not k.size:
        return index
    t = t_ns[index] * NS
    seconds_in = t[start[k]] - t[start[k - 1]]
    seconds_step = t[start[k + 1]] - t[last[k]]
    seconds_out = t[start[k + 2]] - t[start[k + 1]]
    at = index[start]
    step = _step_lengths(columns, at[k], at[k + 1])
    speed_in = _step_lengths(columns, at[k - 1], at[k]) / seconds_in
    speed_out = _step_lengths(columns, at[k + 1], at[k + 2]) / seconds_out
    stale = (speed_in > STALE_MIN_SPEED) & (speed_out > STALE_MIN_SPEED)
    stale &= step > 0.5 * MAX_ACCELERATION * seconds_step**2 + STALE_ALLOWANCE
    drop = np.zeros(index.size, np.bool_)
    for run in k[stale]:
        drop[start[run] + 1 : last[run] + 1] = True
    bad[index[drop]] = True
    return index[~drop]


def rejections(t_ns: TimeArray, rejected: dict[str, BoolArray], where: str) -> list[Finding]:
    """One finding that counts the rejected fixes by reason, if there are any."""
    counts = {reason: int(bad.sum()) for reason, bad in rejected.items() if bad.any()}
    if not counts:
        return []
    by_reason = ", ".join(f"{count} {reason}" for reason, count in counts.items())
    text = f"{sum(counts.values())} of {t_ns.size} fixes rejected: {by_reason}"
    bad = np.logical_or.reduce(list(rejected.values()))
    return [finding_at("gps-rejected", "warning", where, text, t_ns[bad])]


# ---- what may be missing from a good fix -----------------------------------------------------


def filled_height(t_ns: TimeArray, height: Array, where: str, findings: list[Finding]) -> Array:
    """Heights, missing ones interpolated; zeros where all are missing."""
    good = np.isfinite(height)
    if good.all():
        return height
    how = "interpolated" if good.any() else "taken as 0"
    text = f"{(~good).sum()} of {t_ns.size} fixes have no height; {how}"
    findings.append(finding_at("gps-height-missing", "warning", where, text, t_ns[~good]))
    return _interpolated(t_ns, height, good) if good.any() else np.zeros(t_ns.size)


def filled_velocity(
    t_ns: TimeArray, v_n: Array | None, where: str, findings: list[Finding]
) -> Array | None:
    """The velocity, short holes interpolated; None where too much of it is missing."""
    if v_n is None:
        return None
    good = finite_rows(t_ns, v_n)
    if good.all():
        return v_n
    enough = good.mean() >= 1.0 - MAX_MISSING_VELOCITY
    how = "interpolated" if enough else "velocity not used"
    text = f"{(~good).sum()} of {t_ns.size} fixes have no velocity; {how}"
    findings.append(finding_at("gps-velocity-missing", "warning", where, text, t_ns[~good]))
    if not enough:
        return None
    return np.column_stack([_interpolated(t_ns, v_n[:, j], good) for j in range(3)])


def filled_sigma(
    t_ns: TimeArray, sigma: Array | None, what: str, where: str, findings: list[Finding]
) -> Array | None:
    """Sigmas, invalid ones replaced by the worst valid of their axis; None where it has none."""
    if sigma is None:
        return None
    good = np.isfinite(sigma) & (sigma >= MIN_SIGMA) & (sigma <= MAX_SIGMA)
    if good.all():
        return sigma
    rows = ~good.all(axis=1)
    usable = bool(good.any(axis=0).all())
    how = "the largest valid one taken" if usable else "not used"
    text = f"{rows.sum()} of {t_ns.size} fixes have no valid {what} sigma; {how}"
    findings.append(finding_at("gps-sigma-invalid", "info", where, text, t_ns[rows]))
    if not usable:
        return None
    worst = np.max(np.where(good, sigma, 0.0), axis=0)
    return np.where(good, sigma, worst)


def _interpolated(t_ns: TimeArray, value: Array, good: BoolArray) -> Array:
    seconds = (t_ns - t_ns[0]) * NS
    return np.where(good, value, np.interp(seconds, seconds[good], value[good]))
