"""What a run is told: one frozen record, in the units of the command line.

Every field has the name of the option of ``vehnav run`` with underscores; cli.md's defaults. The
pipeline alone unpacks it into the keyword arguments of the physics.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

from vehnav.errors import ConfigError

if TYPE_CHECKING:
    from vehnav.sensors import Sensor

AIDS = ("zupt", "zaru", "nhc", "odometer", "gnss")


@dataclass(frozen=True)
class Config:
    """Options of a run.

    Attributes
    ----------
    axes, accel_axes : str or None
        Letters (:mod:`vehnav.mounting`); ``auto`` or None: those that the format declares.
    mount : (roll, pitch, yaw), deg
    accel_scale : float
        What the accelerometer's numbers are multiplied with, e.g. of a calibration.
    start, end : float or None
        s from the start of the log.
    stamps : {"auto", "raw"}
        Whether jittered stamps of an even sensor are regressed.
    max_gap : float
        s; longer gaps coast.
    split : bool
        Whether a gap of over 10 s makes two results instead of an error.
    method : {"stops", "free", "filter", "smooth"}
    aid : tuple of str or None
        Aids of the filter, of :data:`AIDS`; None: all that the log has except ``gnss``.
    sensor : str or None
        Name of the catalogue or TOML file: its noise weighs the stops beside the log's own rest
        and is that of the filter; its stop threshold counts where none is given.
    sensor_grade : {"auto", "mems", "tactical"}
        Noise of the filter, which alone has it; ``auto``: by the gyro at rest.
    azimuth : {"relative", "absolute"}
        Law of the wander axes, which the filter, ``frame="wander"`` and ``coords="quasi"`` have.
    as_published : bool
        The two procedures of paper 002 alone.
    levelling, reset : bool
        The two procedures.
    causal : bool
        Whether only what was known at the time may be used.
    frame : {"enu", "eci", "wander"}
        Of the mechanization.
    coords : {"auto", "normal", "quasi"}
        Whether quasi-coordinates are written too; ``auto``: in wander axes beyond 85 degrees.
    vertical : {"clamp", "free"}
        Of the stop methods; the filter always estimates the height and refuses ``free``.
    ellipsoid : {"wgs84", "krasovsky"}
    levelling_rate : float or None
        k g, 1/s; None: 1 / (t + 0.5 s), the running mean since levelling started.
    stop_threshold : float or None
        deg/s
    stop_statistic : {"slow", "rms"}
    stop_window, stop_dwell : float or None
        s
    gps : {"start", "none", "aid"}
        What the solution may take from GPS.
    gnss_form : {"direct", "normal", "quasi"}
        How the filter compares fixes with its state (paper 003).
    lever_arm : (right, forward, up) or None
        m from the IMU to the antenna, axes of the vehicle.
    outage : tuple of str
        Stretches, s from the start of the log, whose fixes do not aid: ``A:B`` or
        ``every=180,length=60,from=60``.
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
    accel_scale: float = 1.0
    start: float | None = None
    end: float | None = None
    stamps: Literal["auto", "raw"] = "auto"
    max_gap: float = 0.5
    split: bool = False
    method: Literal["stops", "free", "filter", "smooth"] = "stops"
    aid: tuple[str, ...] | None = None
    sensor: str | None = None
    sensor_grade: Literal["auto", "mems", "tactical"] = "auto"
    azimuth: Literal["relative", "absolute"] = "relative"
    as_published: bool = False
    levelling: bool = True
    reset: bool = True
    causal: bool = False
    frame: Literal["enu", "eci", "wander"] = "enu"
    coords: Literal["auto", "normal", "quasi"] = "auto"
    vertical: Literal["clamp", "free"] = "clamp"
    ellipsoid: Literal["wgs84", "krasovsky"] = "wgs84"
    levelling_rate: float | None = None
    stop_threshold: float | None = None
    stop_statistic: Literal["slow", "rms"] = "slow"
    stop_window: float | None = None
    stop_dwell: float | None = None
    gps: Literal["start", "none", "aid"] = "start"
    gnss_form: Literal["direct", "normal", "quasi"] = "direct"
    lever_arm: tuple[float, float, float] | None = None
    outage: tuple[str, ...] = ()
    gps_start_seconds: float = 60.0
    start_position: tuple[float, float, float] | None = None
    start_heading: float | None = None
    start_attitude: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if self.start is not None and self.end is not None and self.end <= self.start:
            raise ConfigError(f"--end {self.end:g} is not after --start {self.start:g}")
        if self.start_position is not None and abs(self.start_position[0]) > 90.0:
            raise ConfigError(f"--start-position: latitude {self.start_position[0]} is beyond 90")
        if not 0.5 < self.accel_scale < 2.0:
            raise ConfigError(f"--accel-scale {self.accel_scale:g}: a scale error is within 0.5..2")
        for name in ("max_gap", "gps_start_seconds"):
            if getattr(self, name) < 0.0:
                raise ConfigError(f"--{name.replace('_', '-')} must not be negative")

        self._check_aids()

    def _check_aids(self) -> None:
        unknown = sorted(set(self.aid or ()) - set(AIDS))
        if unknown:
            raise ConfigError(f"--aid {','.join(unknown)}: the aids are {', '.join(AIDS)}")
        if not self.aided and (self.aid is not None or self.gps == "aid"):
            raise ConfigError("--aid and --gps aid belong to --method filter or smooth")
        if self.method == "smooth" and self.causal:
            raise ConfigError("--method smooth looks ahead; with --causal use --method filter")
        for option, given in self._of_the_stops().items():
            if self.aided and given:
                raise ConfigError(
                    f"{option} belongs to --method stops; the filter levels and resets by itself"
                )
        if self.aided and self.vertical == "free":
            raise ConfigError(
                "--vertical free belongs to --method stops or free; the filter always integrates "
                "the height and its error is a state"
            )
        for option, given in self._of_the_filter().items():
            if not self.aided and given:
                raise ConfigError(f"{option} belongs to --method filter or smooth")
        carried = self.free_azimuth or self.coords == "quasi"
        if self.azimuth == "absolute" and not carried:
            raise ConfigError(
                "--azimuth absolute is a law of wander axes: add --frame wander, --coords quasi or "
                "--method filter"
            )
        for text in self.outage:
            outage_spans(text, 0.0)
        if self.outage and self.gps != "aid":
            raise ConfigError("--outage cuts out fixes that aid; it belongs to --gps aid")

    def _of_the_stops(self) -> dict[str, bool]:
        """Options that mean nothing to the filter, and whether they were given."""
        return {
            "--as-published": self.as_published,
            "--no-levelling": not self.levelling,
            "--no-reset": not self.reset,
            "--levelling-rate": self.levelling_rate is not None,
            "--frame eci": self.frame == "eci",
        }

    def _of_the_filter(self) -> dict[str, bool]:
        """Options that mean nothing to the stop methods, and whether they were given."""
        return {
            f"--sensor-grade {self.sensor_grade}": self.sensor_grade != "auto",
            f"--gnss-form {self.gnss_form}": self.gnss_form != "direct",
        }

    @cached_property
    def known_sensor(self) -> Sensor | None:
        """The sensor of ``--sensor``, read once; ConfigError where it cannot be."""
        if self.sensor is None:
            return None
        from vehnav.sensors import load_sensor

        return load_sensor(self.sensor)

    def __getstate__(self) -> dict[str, Any]:
        """The fields alone go to another process; what was read from them is read there again."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @property
    def aided(self) -> bool:
        """Whether the method is a filter."""
        return self.method in ("filter", "smooth")

    @property
    def free_azimuth(self) -> bool:
        """Whether the solution is carried in wander axes, as the filter's always is."""
        return self.aided or self.frame == "wander"

    @property
    def tactical(self) -> bool | None:
        """Grade of the filter noise; None: by the gyro at rest."""
        return None if self.sensor_grade == "auto" else self.sensor_grade == "tactical"

    def uses(self, aid: str) -> bool:
        """Whether the filter uses an aid where the log has it."""
        if self.aid is None:
            return aid != "gnss" or self.gps == "aid"
        return aid in self.aid or (aid == "gnss" and self.gps == "aid")

    def to_dict(self) -> dict[str, Any]:
        """As plain data, for the report."""
        return asdict(self)


def outage_spans(text: str, end: float) -> list[tuple[float, float]]:
    """Stretches (start, end), s, that ``A:B`` or ``every=S,length=S,from=S`` name up to ``end``.

    >>> outage_spans("every=100,length=20,from=50", 260.0)
    [(50.0, 70.0), (150.0, 170.0)]
    """
    try:
        if "=" not in text:
            first, last = (float(x) for x in text.split(":"))
            if 0.0 <= first < last:
                return [(first, last)]
        else:
            rule = {k.strip(): float(x) for k, x in (p.split("=") for p in text.split(","))}
            every, length, first = (rule.pop(k) for k in ("every", "length", "from"))
            if not rule and 0.0 < length < every and first >= 0.0:
                count = max(0, math.ceil((end - length - first) / every))
                return [(first + k * every, first + k * every + length) for k in range(count)]
    except (ValueError, KeyError):
        pass
    raise ConfigError(f"--outage {text!r}: expected START:END or every=S,length=S,from=S (seconds)")
