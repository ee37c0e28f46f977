"""The errors of a trajectory against GPS or truth: series, statistics, the tree of the report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.errors import Finding
from vehnav.evaluation.align import Fit
from vehnav.evaluation.calibration import Calibration
from vehnav.evaluation.drift import Drift
from vehnav.evaluation.outages import MIN_DISTANCE, Outage
from vehnav.evaluation.segments import Segment
from vehnav.evaluation.statistics import Statistics, statistics
from vehnav.evaluation.time_offset import TimeOffset
from vehnav.trajectory import Trajectory

Array = npt.NDArray[np.float64]

PERCENT_FROM: Final = 200.0
"""m driven before an error is given in percent of it."""


@dataclass(frozen=True)
class Errors:
    """Estimate minus reference at the n judged fixes, with what they add up to.

    Attributes
    ----------
    t_ns : (n,) int64
        Stamps of the judged fixes, the time offset applied.
    lat, lon, height : (n,)
        The reference, rad, rad, m.
    states : Trajectory
        The estimate at the same instants (at the antenna, and aligned if that was asked for).
    east, north, up, along, cross : (n,)
        Position errors, m. Along and cross (to the right) by the course of the reference.
    distance : (n,)
        m driven by the reference since judging began, standing time removed.
    course : (n,)
        Course of the reference, rad; held while it stands.
    velocity : (n, 3) or None
        East, north, up velocity error, m/s, where the reference has velocity.
    heading, pitch, roll : (n,) or None
        Attitude errors, rad, where the reference has attitude.
    reference_sigma : (n, 3) or None
        Standard deviations of the fixes, m, where the receiver gives them.
    time_offset : float
        s, added to the stamps of the GPS.
    found_offset : TimeOffset or None
        The offset that the motion itself suggests, on top of nothing; None where it was not asked
        for or motion does not tell.
    fit : Fit or None
        The alignment to the reference before judging, if one was asked for.
    counts : mapping
        Fixes: total, judged, and why the others were not judged.
    segments : tuple of Segment
    outages : tuple of Outage
    drift : Drift or None
        Since the last correction; None where the trajectory has no stops.
    calibration : Calibration or None
        Of the trajectory's sigmas, where it has any.
    poses : mapping
        ``ape`` and ``rpe`` under evo's names.
    findings : tuple of Finding
        What was noticed about the pair of inputs.
    methods : mapping
        Filled by the caller: name of a method -> the same figures.
    """

    t_ns: npt.NDArray[np.int64]
    lat: Array
    lon: Array
    height: Array
    states: Trajectory
    east: Array
    north: Array
    up: Array
    along: Array
    cross: Array
    distance: Array
    course: Array
    velocity: Array | None = None
    heading: Array | None = None
    pitch: Array | None = None
    roll: Array | None = None
    reference_sigma: Array | None = None
    time_offset: float = 0.0
    found_offset: TimeOffset | None = None
    fit: Fit | None = None
    counts: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    segments: tuple[Segment, ...] = ()
    outages: tuple[Outage, ...] = ()
    drift: Drift | None = None
    calibration: Calibration | None = None
    poses: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    findings: tuple[Finding, ...] = ()
    methods: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def horizontal(self) -> Array:
        """(n,) m: size of the horizontal error."""
        return np.asarray(np.hypot(self.east, self.north))

    @property
    def horizontal_rms(self) -> float:
        """Root mean square of the horizontal error, m."""
        return float(np.sqrt(np.mean(self.horizontal**2)))

    def statistics(self) -> dict[str, Statistics | None]:
        """The statistics of every series by its name in the report (``heading_deg`` in degrees)."""
        speed = None if self.velocity is None else np.hypot(*self.velocity[:, :2].T)
        series = {
            "horizontal_m": self.horizontal,
            "east_m": self.east,
            "north_m": self.north,
            "up_m": self.up,
            "along_m": self.along,
            "cross_m": self.cross,
            "velocity_m_s": speed,
            "heading_deg": None if self.heading is None else np.degrees(self.heading),
        }
        return {name: None if x is None else statistics(x) for name, x in series.items()}

    def percent_of_distance(self) -> dict[str, float | None]:
        """Horizontal error in percent of the distance: at the end, and the largest after 200 m."""
        driven = float(self.distance[-1])
        far = self.distance >= PERCENT_FROM
        late = 100.0 * self.horizontal[far] / self.distance[far]
        return {
            "end": 100.0 * float(self.horizontal[-1]) / driven if driven >= MIN_DISTANCE else None,
            "max": float(np.max(late)) if late.size else None,
        }

    def reference_sigma_m(self) -> float | None:
        """Horizontal uncertainty of the reference (rms of the fixes' own sigmas), m, or None."""
        if self.reference_sigma is None:
            return None
        return float(np.sqrt(np.mean(np.sum(self.reference_sigma[:, :2] ** 2, axis=1))))

    def to_dict(self) -> dict[str, Any]:
        """The ``errors`` tree of ``report.json``: plain numbers, None where undefined."""
        horizontal = self.horizontal
        return {
            **{name: None if s is None else s.to_dict() for name, s in self.statistics().items()},
            "percent_of_distance": self.percent_of_distance(),
            "distance_m": float(self.distance[-1]),
            "cep50_m": float(np.percentile(horizontal, 50.0)),
            "cep95_m": float(np.percentile(horizontal, 95.0)),
            "reference_sigma_m": self.reference_sigma_m(),
            "segments": [s.to_dict() for s in self.segments],
            "outages": [o.to_dict() for o in self.outages],
            "drift": None if self.drift is None else self.drift.to_dict(),
            "calibration": None if self.calibration is None else self.calibration.to_dict(),
            **self.poses,
            "align": "none" if self.fit is None else self.fit.align,
            "methods": dict(self.methods),
        }
