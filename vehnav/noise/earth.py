"""The Earth rate in the mean rates of the rests.

A gyro at rest shows its bias and the Earth's rotation. What of it falls on a level axis hangs on
the heading, which is taken from the courses of GPS while the vehicle drives up to a rest and away
from it, turned by the gyro in between.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.alignment import Rest
from vehnav.clues import GpsBetween
from vehnav.earth import WGS84, earth_rate
from vehnav.gps_axes import gps_between
from vehnav.logs.log import Log
from vehnav.prepare import Samples
from vehnav.units import DEG

Array = npt.NDArray[np.float64]

AROUND: Final = 20.0
"""s before and after a rest in which courses count."""
MOVING: Final = 3.0
"""m/s from which a course is one."""
FEWEST: Final = 3
"""Courses that a heading takes."""
SCATTER: Final = 10.0 * DEG
"""Spread of the headings from them up to which they agree: nobody reversed."""
HEADING: Final = 3.0 * DEG
"""Of the best heading: side slip, mounting, delay of the fixes in a turn."""


@dataclass(frozen=True)
class EarthRates:
    """Earth rate on the sensor's own axes in each rest.

    Attributes
    ----------
    rate : (p, 3)
        rad/s, what is known of it.
    variance : (p, 3)
        Of what is not.
    headings : (p,)
        rad, clockwise from north; nan where not known.
    """

    rate: Array
    variance: Array
    headings: Array


def earth_rates(
    log: Log, samples: Samples, spans: list[tuple[int, int]], c_gyro: Array
) -> EarthRates:
    """What the Earth's rotation adds to each rest.

    Parameters
    ----------
    log : Log
        For GPS: latitude and courses.
    samples : Samples
    spans : list of (first, last)
        Indices of the rests.
    c_gyro : (3, 3)
        C_bs of the gyros.
    """
    count = len(spans)
    rate, variance = np.zeros((count, 3)), np.zeros((count, 3))
    up = c_gyro.T @ np.array([0.0, 0.0, 1.0])
    headings = np.full(count, np.nan)
    if log.gnss is None or log.gnss.t_ns.size == 0:
        square = WGS84.omega_ie**2
        return EarthRates(rate, variance + square / 3.0, headings)  # from anywhere on a sphere
    lat = float(np.median(log.gnss.lat))
    omega_ie_n = np.array(earth_rate(lat, WGS84))
    between = gps_between(log.gnss, log.start_ns)
    sure = samples.orientation.evidence.certain
    for k, (first, last) in enumerate(spans):
        inside = slice(first, last + 1)
        rest = Rest(samples.omega[inside].mean(axis=0), samples.f[inside].mean(axis=0))
        heading = rest_heading(samples, first, last, between) if between and sure else None
        if heading is None:
            rate[k] = up * omega_ie_n[2]
            variance[k] = 0.5 * (1.0 - up**2) * omega_ie_n[1] ** 2
        else:
            headings[k] = heading
            rate[k] = c_gyro.T @ rest.c_nb(heading).T @ omega_ie_n
            variance[k] = (1.0 - up**2) * (HEADING * omega_ie_n[1]) ** 2
    return EarthRates(rate, variance, headings)


def rest_heading(samples: Samples, first: int, last: int, between: GpsBetween) -> float | None:
    """Heading in the rest from ``first`` to ``last``, rad; None where the courses do not agree."""
    t = samples.t
    bias = float(samples.omega[first : last + 1, 2].mean())
    found: list[Array] = []
    for a, b in ((t[first] - AROUND, t[first]), (t[last], t[last] + AROUND)):
        motion = between(float(a), float(b))
        if motion is None:
            continue
        fast = np.hypot(motion.v[:, 0], motion.v[:, 1]) > MOVING
        near = (motion.t > t[0]) & (motion.t < t[-1])
        at = motion.t[fast & near]
        course = np.arctan2(motion.v[fast & near, 0], motion.v[fast & near, 1])
        found.append(course - _turned(samples, first, at, bias))
    headings = np.concatenate(found) if found else np.empty(0)
    if headings.size < FEWEST:
        return None
    mean = np.arctan2(np.sin(headings).mean(), np.cos(headings).mean())
    away = np.angle(np.exp(1j * (headings - mean)))
    return float(mean) if float(np.std(away)) < SCATTER else None


def _turned(samples: Samples, k: int, at: Array, bias: float) -> Array:
    """Clockwise turn, rad, from the sample ``k`` to the instants ``at``."""
    t, up = samples.t, samples.omega[:, 2] - bias
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (up[1:] + up[:-1]) * np.diff(t))])
    return np.asarray(angle[k] - np.interp(at, t, angle))
