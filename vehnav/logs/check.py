"""Raw columns become clean records: what every reader does to its numbers, in one place.

Rows that are not numbers are dropped, stamps are put in order, repeats are merged, fixes that
cannot be true are rejected. Everything done is counted in a :class:`~vehnav.errors.Finding` with
the first and the last time; sound input passes through without a copy. A clock that jumps forward
stays as it is: gaps belong to the pipeline.
"""

from __future__ import annotations

from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from vehnav.errors import Finding, LogError
from vehnav.logs import clock, fixes
from vehnav.logs.clock import NO_TIME
from vehnav.logs.log import Array, Gnss, Imu, Speed, TimeArray

__all__ = ["NO_TIME", "clean_gnss", "clean_imu", "clean_speed"]

MAX_SPEED: Final = fixes.MAX_SPEED
"""m/s; no road vehicle is faster."""


def clean_imu(
    t_ns: TimeArray,
    gyro: Array,
    accel: Array,
    *,
    source: str,
    frame_id: str = "",
    sampling: Literal["rates", "increments"] = "rates",
    where: str,
) -> tuple[Imu, list[Finding]]:
    """Inertial samples in order, finite and each stamp once.

    Parameters
    ----------
    t_ns : (n,) int64
        Stamps in the order of the file; :data:`NO_TIME` where a row has none.
    gyro, accel : (n, 3)
        rad/s and m/s2 (or increments, rad and m/s), sensor axes; may hold NaN.
    source, frame_id, sampling
        As in :class:`~vehnav.logs.log.Imu`.
    where : str
        Beginning of the findings' texts: file and topic or columns.

    Returns
    -------
    Imu, list of Finding
        Repeated stamps become the mean of their rates, or the sum of their increments.

    Raises
    ------
    LogError
        No row is left.
    """
    findings: list[Finding] = []
    gyro, accel = np.asarray(gyro, np.float64), np.asarray(accel, np.float64)
    good = clock.finite_rows(t_ns, gyro, accel)
    if not good.any():
        raise LogError(f"{where}: none of {t_ns.size} rows holds a stamp and six finite numbers")
    if not good.all():
        findings.append(clock.non_finite(t_ns, good, where))
        t_ns, gyro, accel = t_ns[good], gyro[good], accel[good]
    order = clock.time_order(t_ns, where, findings)
    if order is not None:
        t_ns, gyro, accel = t_ns[order], gyro[order], accel[order]
    first = clock.first_of_each(t_ns)
    if first.size < t_ns.size:
        how = "their means" if sampling == "rates" else "their sums"
        findings.append(clock.duplicates(t_ns, first, where, how))
        merge = clock.mean_of_each if sampling == "rates" else np.add.reduceat
        t_ns, gyro, accel = t_ns[first], merge(gyro, first), merge(accel, first)
    imu = Imu(t_ns, gyro, accel, sampling=sampling, source=source, frame_id=frame_id)
    return imu, findings


def clean_speed(
    t_ns: TimeArray, speed: Array, *, source: str, where: str
) -> tuple[Speed | None, list[Finding]]:
    """Forward speed in order, finite, possible and each stamp once (mean of repeats).

    Parameters
    ----------
    t_ns : (m,) int64
    speed : (m,)
        m/s; may hold NaN.

    Returns
    -------
    Speed or None
        None where no row is left.
    list of Finding
    """
    findings: list[Finding] = []
    speed = np.asarray(speed, np.float64)
    good = clock.finite_rows(t_ns, speed)
    if not good.all():
        findings.append(clock.non_finite(t_ns, good, where))
    possible = good & (np.abs(np.where(good, speed, 0.0)) <= MAX_SPEED)
    if possible.sum() < good.sum():
        bad = good & ~possible
        text = f"{bad.sum()} of {t_ns.size} speeds above {MAX_SPEED:.0f} m/s rejected"
        findings.append(clock.finding_at("speed-rejected", "warning", where, text, t_ns[bad]))
    t_ns, speed = t_ns[possible], speed[possible]
    if not t_ns.size:
        return None, findings
    order = clock.time_order(t_ns, where, findings)
    if order is not None:
        t_ns, speed = t_ns[order], speed[order]
    first = clock.first_of_each(t_ns)
    if first.size < t_ns.size:
        findings.append(clock.duplicates(t_ns, first, where, "their means"))
        t_ns, speed = t_ns[first], clock.mean_of_each(speed, first)
    return Speed(t_ns, speed, source=source), findings


def clean_gnss(
    t_ns: TimeArray,
    lat: Array,
    lon: Array,
    height: Array,
    *,
    v_n: Array | None = None,
    sigma_pos: Array | None = None,
    sigma_vel: Array | None = None,
    status: npt.NDArray[np.integer] | None = None,
    source: str,
    where: str,
) -> tuple[Gnss | None, list[Finding]]:
    """Fixes that can be true, in order, each stamp once (the first).

    Parameters
    ----------
    t_ns : (m,) int64
    lat, lon : (m,)
        rad; longitudes up to a full turn are brought to -pi..pi.
    height : (m,)
        m; missing ones are interpolated (0 where all are), with a finding.
    v_n, sigma_pos, sigma_vel : (m, 3) or None
        East, north, up; a sigma outside 0.1 mm .. 1000 km is not one.
    status : (m,) int or None
        As ``sensor_msgs/NavSatStatus``: -1 no fix; -2 unknown, which rejects a fix only where
        others of the same source have a status (many drivers never fill it).

    Returns
    -------
    Gnss or None
        None where no fix is left.
    list of Finding
        ``gps-rejected`` counts the rejected ones by reason.
    """
    findings: list[Finding] = []
    names = ("lat", "lon", "height", "v_n", "sigma_pos", "sigma_vel")
    columns = {
        name: np.asarray(value, np.float64)
        for name, value in zip(names, (lat, lon, height, v_n, sigma_pos, sigma_vel), strict=True)
        if value is not None
    }
    index = _accepted(t_ns, columns, status, where, findings)
    if not index.size:
        return None, findings
    columns = {name: value[index] for name, value in columns.items()}
    return _completed(t_ns[index], columns, source, where, findings), findings


def _accepted(
    t_ns: TimeArray,
    columns: dict[str, Array],
    status: npt.NDArray[np.integer] | None,
    where: str,
    findings: list[Finding],
) -> clock.IndexArray:
    """Rows of the fixes that can be true, in order of time."""
    rejected: dict[str, clock.BoolArray] = {}
    index = np.flatnonzero(fixes.plausible_positions(t_ns, columns, status, rejected))
    order = clock.time_order(t_ns[index], where, findings)
    if order is not None:
        index = index[order]
    first = clock.first_of_each(t_ns[index])
    if first.size < index.size:
        findings.append(clock.duplicates(t_ns[index], first, where, "the first of each"))
        index = index[first]
    index = fixes.reject_jumps(t_ns, columns, index, rejected)
    index = fixes.reject_stale(t_ns, columns, index, rejected)
    findings.extend(fixes.rejections(t_ns, rejected, where))
    return index


def _completed(
    t_ns: TimeArray, columns: dict[str, Array], source: str, where: str, findings: list[Finding]
) -> Gnss:
    """The record of accepted fixes, with what they lack filled or left out."""
    lon = columns["lon"]
    v_n = fixes.filled_velocity(t_ns, columns.get("v_n"), where, findings)
    sigma_vel = None if v_n is None else columns.get("sigma_vel")
    return Gnss(
        t_ns,
        columns["lat"],
        np.where(np.abs(lon) > np.pi, np.remainder(lon + np.pi, 2.0 * np.pi) - np.pi, lon),
        fixes.filled_height(t_ns, columns["height"], where, findings),
        v_n=v_n,
        sigma_pos=fixes.filled_sigma(t_ns, columns.get("sigma_pos"), "position", where, findings),
        sigma_vel=fixes.filled_sigma(t_ns, sigma_vel, "velocity", where, findings),
        source=source,
    )
