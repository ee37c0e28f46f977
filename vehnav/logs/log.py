"""What a recording is, once read: frozen records of arrays on an int64 nanosecond clock.

Readers deliver these records in SI and radians, on the axes of the sensor as logged (frame s), and
checked: finite numbers, strictly increasing stamps, arrays of equal length. What had to be left
out to get there is counted in ``findings`` and ``integrity``; nothing is lost silently.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from vehnav.errors import Finding
from vehnav.units import NS

Array = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

MIN_IMU_RATE_HZ = 20.0
"""Below this a stop cannot be told from driving, nor a turn be integrated (spec C section 1)."""


def _check_clock(t_ns: TimeArray, what: str) -> None:
    if t_ns.dtype != np.int64 or t_ns.ndim != 1:
        raise ValueError(f"{what}: the clock must be a 1-D int64 array of nanoseconds")
    if t_ns.size > 1 and not np.all(t_ns[1:] > t_ns[:-1]):
        raise ValueError(f"{what}: stamps must increase strictly; the reader sorts and counts")


def _check_finite(values: Array | None, shape: tuple[int, ...], what: str) -> None:
    if values is None:
        return
    if values.shape != shape:
        raise ValueError(f"{what}: expected shape {shape}, got {values.shape}")
    if not np.all(np.isfinite(values)):
        raise ValueError(f"{what}: not finite; the reader rejects and counts such rows")


@dataclass(frozen=True)
class Imu:
    """Inertial samples on the sensor axes s.

    Attributes
    ----------
    t_ns : (n,) int64
        Strictly increasing; Unix nanoseconds where the log has them.
    gyro : (n, 3)
        Angular rate omega_is_s, rad/s; or its increment since the previous sample, rad.
    accel : (n, 3)
        Specific force f_s, m/s2 (up at rest); or its increment since the previous sample, m/s.
    sampling : {"rates", "increments"}
        What a sample means (spec A 1.4).
    source : str
        Topic or columns it came from.
    frame_id : str
        The frame that the log names, or "".
    axes : str
        Letters of :mod:`vehnav.mounting` that stand where the drive does not show the true ones;
        "" where the file says nothing of them.
    axes_declared : bool
        Whether file or format declare these axes (``# axes: FRD`` in a table, PX4, KF-GINS): what
        contradicts them is a warning. Else they are the habit of the kind: FLU for ROS (REP 103),
        RFU for vehnav's own names, a phone's own axes; a log that shows others is no contradiction.
    """

    t_ns: TimeArray
    gyro: Array
    accel: Array
    sampling: Literal["rates", "increments"] = "rates"
    source: str = ""
    frame_id: str = ""
    axes: str = "FLU"
    axes_declared: bool = False

    def __post_init__(self) -> None:
        _check_clock(self.t_ns, f"IMU {self.source}")
        _check_finite(self.gyro, (self.t_ns.size, 3), f"IMU {self.source} gyro")
        _check_finite(self.accel, (self.t_ns.size, 3), f"IMU {self.source} accel")

    @property
    def median_dt(self) -> float:
        """Median step, s (nan for fewer than two samples)."""
        return float(np.median(np.diff(self.t_ns))) * NS if self.t_ns.size > 1 else float("nan")

    @property
    def rate_hz(self) -> float:
        """Samples per second, by the median step."""
        return 1.0 / self.median_dt


@dataclass(frozen=True)
class Gnss:
    """Fixes of a receiver, accepted ones only (rejected ones are counted in the findings).

    Attributes
    ----------
    t_ns : (m,) int64
        Time of validity on the clock of the IMU as far as the log tells.
    lat, lon : (m,)
        Geodetic, rad, WGS84.
    height : (m,)
        m; ellipsoidal or mean sea level, as logged.
    v_n : (m, 3) or None
        East, north, up velocity of the receiver, m/s.
    sigma_pos, sigma_vel : (m, 3) or None
        Standard deviations east, north, up: m and m/s.
    source : str
        Topic, columns or file.
    """

    t_ns: TimeArray
    lat: Array
    lon: Array
    height: Array
    v_n: Array | None = None
    sigma_pos: Array | None = None
    sigma_vel: Array | None = None
    source: str = ""

    def __post_init__(self) -> None:
        m = self.t_ns.size
        _check_clock(self.t_ns, f"GPS {self.source}")
        for name in ("lat", "lon", "height"):
            _check_finite(getattr(self, name), (m,), f"GPS {self.source} {name}")
        for name in ("v_n", "sigma_pos", "sigma_vel"):
            _check_finite(getattr(self, name), (m, 3), f"GPS {self.source} {name}")


@dataclass(frozen=True)
class Speed:
    """Forward speed of the vehicle from wheels or odometry.

    Attributes
    ----------
    t_ns : (m,) int64
    speed : (m,)
        m/s, forward positive.
    source : str
    """

    t_ns: TimeArray
    speed: Array
    source: str = ""

    def __post_init__(self) -> None:
        _check_clock(self.t_ns, f"speed {self.source}")
        _check_finite(self.speed, (self.t_ns.size,), f"speed {self.source}")


@dataclass(frozen=True)
class Log:
    """A recording.

    Attributes
    ----------
    path : str
        Where it was read from.
    imu : Imu or None
        None where the recording has none (a GPS file); what needs it says so.
    gnss, speed : Gnss, Speed or None
    findings : tuple of Finding
        Everything noticed while reading, in order.
    unix_clock : bool
        Whether ``t_ns`` are Unix nanoseconds; otherwise nanoseconds from the start of the log.
    integrity : mapping
        Counts of the reader (messages or rows: declared, read, recovered, unverified, bad).
    damaged : bool
        Whether data was lost, recovered, or read from parts whose checksum does not match.
    contents : tuple of mapping
        One row per topic or column group: name, type, count, rate_hz (what ``info`` lists).
    gps_time_offset : float
        s, that was added to the stamps of the GPS on request.
    """

    path: str
    imu: Imu | None
    gnss: Gnss | None = None
    speed: Speed | None = None
    findings: tuple[Finding, ...] = ()
    unix_clock: bool = True
    integrity: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    damaged: bool = False
    contents: tuple[Mapping[str, Any], ...] = ()
    gps_time_offset: float = 0.0

    @property
    def start_ns(self) -> int:
        """The first stamp of the IMU, or of what there is: where seconds count from."""
        for record in (self.imu, self.gnss, self.speed):
            if record is not None and record.t_ns.size:
                return int(record.t_ns[0])
        return 0


@dataclass(frozen=True)
class ReadOptions:
    """How to read a recording; every field has the meaning of the option of the same name.

    Attributes
    ----------
    imu_topic, gps_topic, speed_topic : str or None
        Choose a topic; None: found by type.
    time : {"header", "log"} or None
        Which stamps count; None: header stamps where they are sound, else log time.
    columns : mapping of str to str
        For CSV: quantity -> column name, e.g. ``{"time_s": "t", "gyro_x": "wx"}``.
    preset : str or None
        Name of a CSV preset.
    gyro_unit, accel_unit : str or None
        Keys of :data:`vehnav.units.GYRO_UNITS`, :data:`~vehnav.units.ACCEL_UNITS`; None: as the
        format declares.
    gps_file, speed_file : str or None
        GPS or speed kept beside the recording.
    gps_time_offset : float
        s, added to the stamps of the GPS.
    """

    imu_topic: str | None = None
    gps_topic: str | None = None
    speed_topic: str | None = None
    time: Literal["header", "log"] | None = None
    columns: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    preset: str | None = None
    gyro_unit: str | None = None
    accel_unit: str | None = None
    gps_file: str | None = None
    speed_file: str | None = None
    gps_time_offset: float = 0.0
