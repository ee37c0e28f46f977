"""What axes and units take from GPS: velocity between two instants, and the fixes it used up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from vehnav.clues import GpsBetween, GpsMotion
from vehnav.evaluation.reference import mean_motion, seconds, tracks, trusted_velocity
from vehnav.logs.log import Gnss
from vehnav.prepare import Samples
from vehnav.start import GpsUse
from vehnav.units import NS

WINDOW: Final = 1.5
"""s on each side, for the velocity of a receiver that logs none."""
FEWEST: Final = 5
"""Fixes below which there is no motion to speak of."""


def gps_between(
    gnss: Gnss | None, start_ns: int, *, without: Sequence[tuple[int, int]] = ()
) -> GpsBetween | None:
    """Velocity by GPS between two instants (s from ``start_ns``), from the fixes between them only.

    None where there is no GPS, or it must not be used. A stretch that ends at some instant owes
    nothing to any fix after it, nor to those in the intervals ``without`` (ns).
    """
    if gnss is None:
        return None
    allowed = np.ones(gnss.t_ns.size, bool)
    for start, end in without:
        allowed &= (gnss.t_ns < start) | (gnss.t_ns > end)

    def between(first: float, last: float) -> GpsMotion | None:
        t = np.asarray((gnss.t_ns - start_ns) * NS, float)
        inside = allowed & (t >= first) & (t <= last)
        if np.count_nonzero(inside) < FEWEST:
            return None
        part = Gnss(
            gnss.t_ns[inside],
            gnss.lat[inside],
            gnss.lon[inside],
            gnss.height[inside],
            None if gnss.v_n is None else gnss.v_n[inside],
        )
        velocity = trusted_velocity(part)
        if velocity is None:
            velocity = mean_motion(seconds(part), tracks(part), WINDOW)
        return GpsMotion(t[inside], velocity[:, :2])

    return between


def with_axes(use: GpsUse, samples: Samples, gnss: Gnss | None) -> GpsUse:
    """The use of GPS with what units and axes took from it: those fixes judge nothing either."""
    units, evidence = samples.orientation.units, samples.orientation.evidence
    for name, until in (
        ("units", None if units is None else units.gps_until),
        ("axes", evidence.gps_until),
    ):
        if until is None or gnss is None:
            continue
        if use.aids:  # its fixes judge nothing already
            use = replace(use, used_for=(*use.used_for, name))
            continue
        start_ns = int(samples.t_ns[0]) - round(float(samples.t[0]) / NS)
        last = start_ns + int(np.ceil(until / NS)) + 1  # the fix itself, whatever the rounding
        known = use.until_ns if use.until_ns is not None else int(samples.t_ns[0]) - 1
        more = np.count_nonzero((gnss.t_ns > known) & (gnss.t_ns <= last))
        use = replace(
            use,
            used_for=(*use.used_for, name),
            fixes_used=use.fixes_used + int(more),
            until_ns=max(known, last),
        )
    return use
