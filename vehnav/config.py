"""What a run is told: one frozen record, in the units of the command line.

Every field has the name of the option of ``vehnav run`` with underscores; cli.md's defaults. The
pipeline alone unpacks it into the keyword arguments of the physics.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

from vehnav.errors import ConfigError


@dataclass(frozen=True)
class Config:
    """Options of a run.

    Attributes
    ----------
    axes, accel_axes : str or None
        Letters (:mod:`vehnav.mounting`); ``auto`` or None: those that the format declares.
    mount : (roll, pitch, yaw), deg
    start, end : float or None
        s from the start of the log.
    max_gap : float
        s; longer gaps coast.
    split : bool
        Whether a gap of over 10 s makes two results instead of an error.
    method : {"stops", "free"}
    as_published : bool
        The two procedures of paper 002 alone.
    levelling, reset : bool
        The two procedures.
    causal : bool
        Whether only what was known at the time may be used.
    frame : {"enu", "eci"}
        Of the mechanization.
    vertical : {"clamp", "free"}
    ellipsoid : {"wgs84", "krasovsky"}
    levelling_rate : float or None
        k g, 1/s; None: 1 / (t + 0.5 s), the running mean since levelling started.
    stop_threshold : float or None
        deg/s
    stop_statistic : {"slow", "rms"}
    stop_window, stop_dwell : float or None
        s
    gps : {"start", "none"}
        What the solution may take from GPS.
    gps_start_seconds : float
        s after the first departure that give the heading.
    start_position : (lat deg, lon deg, height m) or None
    start_heading : float or None
        deg clockwise from north.
    start_attitude : (heading, pitch, roll) or None
        deg; lets a log without a stop run.
    """

    axes: str | None = None
    accel_axes: str | None = None
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    start: float | None = None
    end: float | None = None
    max_gap: float = 0.5
    split: bool = False
    method: Literal["stops", "free"] = "stops"
    as_published: bool = False
    levelling: bool = True
    reset: bool = True
    causal: bool = False
    frame: Literal["enu", "eci"] = "enu"
    vertical: Literal["clamp", "free"] = "clamp"
    ellipsoid: Literal["wgs84", "krasovsky"] = "wgs84"
    levelling_rate: float | None = None
    stop_threshold: float | None = None
    stop_statistic: Literal["slow", "rms"] = "slow"
    stop_window: float | None = None
    stop_dwell: float | None = None
    gps: Literal["start", "none"] = "start"
    gps_start_seconds: float = 60.0
    start_position: tuple[float, float, float] | None = None
    start_heading: float | None = None
    start_attitude: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if self.start is not None and self.end is not None and self.end <= self.start:
            raise ConfigError(f"--end {self.end:g} is not after --start {self.start:g}")
        if self.start_position is not None and abs(self.start_position[0]) > 90.0:
            raise ConfigError(f"--start-position: latitude {self.start_position[0]} is beyond 90")
        for name in ("max_gap", "gps_start_seconds"):
            if getattr(self, name) < 0.0:
                raise ConfigError(f"--{name.replace('_', '-')} must not be negative")

    def to_dict(self) -> dict[str, Any]:
        """As plain data, for the report."""
        return asdict(self)
