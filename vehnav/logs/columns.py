"""What the columns of a table mean: quantities, their units, the names that people give them."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from vehnav.errors import ConfigError, LogError
from vehnav.logs.log import ReadOptions
from vehnav.units import ACCEL_UNITS, DEG, GYRO_UNITS

ANGLE_UNITS: Final = {"deg": DEG, "rad": 1.0}
SPEED_UNITS: Final = {"m/s": 1.0, "km/h": 1.0 / 3.6, "mph": 0.44704, "knots": 1852.0 / 3600.0}
LENGTH_UNITS: Final = {"m": 1.0, "mm": 1e-3, "ft": 0.3048}
TIME_UNITS: Final = {"ns": 1, "us": 1_000, "ms": 1_000_000, "s": 1_000_000_000}
"""Nanoseconds in the units of time columns."""


@dataclass(frozen=True)
class Group:
    """A kind of quantity: its units (factor to SI and radians) and the one taken by default."""

    units: Mapping[str, float]
    default: str


GROUPS: Final = MappingProxyType(
    {
        "gyro": Group(GYRO_UNITS, "rad/s"),
        "accel": Group(ACCEL_UNITS, "m/s2"),
        "dtheta": Group(ANGLE_UNITS, "rad"),
        "dvel": Group(SPEED_UNITS, "m/s"),
        "angle": Group(ANGLE_UNITS, "deg"),
        "length": Group(LENGTH_UNITS, "m"),
        "number": Group(MappingProxyType({"1": 1.0}), "1"),
        "speed": Group(SPEED_UNITS, "m/s"),
    }
)

QUANTITIES: Final = MappingProxyType(
    {
        **{f"gyro_{axis}": "gyro" for axis in "xyz"},
        **{f"accel_{axis}": "accel" for axis in "xyz"},
        **{f"dtheta_{axis}": "dtheta" for axis in "xyz"},
        **{f"dvel_{axis}": "dvel" for axis in "xyz"},
        **dict.fromkeys(("lat", "lon", "course"), "angle"),
        **dict.fromkeys(("height", "sigma_east", "sigma_north", "sigma_up"), "length"),
        **dict.fromkeys(("v_east", "v_north", "v_up", "v_down", "gps_speed", "speed"), "speed"),
        **dict.fromkeys(("sigma_v_east", "sigma_v_north", "sigma_v_up"), "speed"),
        "sigma_horizontal": "length",
        "status": "number",
    }
)
"""Quantity -> its group."""

TIMES: Final = ("time", "log_time", "fix_time", "time_part")
"""Stamps: of the sample, of the recorder, one that changes with each new fix, and nanoseconds
that belong to ``time``."""

GPS_QUANTITIES: Final = frozenset(QUANTITIES) - {
    *(f"{name}_{axis}" for name in ("gyro", "accel", "dtheta", "dvel") for axis in "xyz"),
    "speed",
}

UNIT_SPELLINGS: Final = MappingProxyType(
    {
        "rad/s": "rad/s,rad s^-1,rad*s^-1,rads,rad_s,rps,radians/s,rad/sec,rad.s^-1",
        "deg/s": "deg/s,°/s,dps,deg_s,degs,deg s^-1,degree/s,degrees/s,deg/sec",
        "deg/h": "deg/h,°/h,dph,deg_h",
        "mrad/s": "mrad/s",
        "m/s2": "m/s2,m/s^2,m/s²,m s^-2,m*s^-2,m_s2,ms2,mps2,m/s/s,m.s^-2,m_s_2,m/s**2",
        "g": "g,g0",
        "mg": "mg,milli-g,millig",
        "deg": "deg,°,degree,degrees,wgs84",
        "rad": "rad,radian,radians",
        "m": "m,meter,metre,meters",
        "mm": "mm",
        "ft": "ft",
        "m/s": "m/s,m s^-1,m_s,mps",
        "km/h": "km/h,kmh,kph,km_h",
        "mph": "mph",
        "knots": "knots,kn,kt,kts",
        "ns": "ns,nanoseconds",
        "us": "us,µs,μs,microseconds",
        "ms": "ms,milliseconds,millis",
        "s": "s,sec,seconds",
    }
)
_SPELLED = {text: unit for unit, texts in UNIT_SPELLINGS.items() for text in texts.split(",")}
# what may end a name without brackets, longest first: accel_x_g, gyro_x_dps, v_east_m_s, time_ms
_SUFFIXES = sorted((t for t in _SPELLED if re.fullmatch(r"[a-z0-9_]+", t)), key=len, reverse=True)

ALIASES: Final = MappingProxyType(
    {
        **{
            f"gyro_{axis}": (
                f"gyro_{axis} g{axis} gyr_{axis} w{axis} w_{axis} omega_{axis} gyro{axis} "
                f"angular_velocity_{axis} imu_angular_velocity_{axis} ang_vel_{axis} "
                f"field_angular_velocity_{axis} w_rs_s_{axis} gyroscope_{axis} "
                f"rotation_rate_{axis} angvel_{axis} angular_rate_{axis} {axis}_gyro"
            )
            for axis in "xyz"
        },
        **{
            f"accel_{axis}": (
                f"accel_{axis} acc_{axis} a{axis} a_{axis} acc{axis} accel{axis} f_{axis} "
                f"linear_acceleration_{axis} imu_linear_acceleration_{axis} "
                f"field_linear_acceleration_{axis} a_rs_s_{axis} accelerometer_{axis} "
                f"acceleration_{axis} specific_force_{axis} {axis}_accel"
            )
            for axis in "xyz"
        },
        **{f"dtheta_{axis}": f"dtheta_{axis} delta_theta_{axis} dang_{axis}" for axis in "xyz"},
        **{f"dvel_{axis}": f"dvel_{axis} delta_v_{axis} dv_{axis} dvel{axis}" for axis in "xyz"},
        "lat": "lat latitude field_latitude gps_lat gps_latitude",
        "lon": "lon lng long longitude field_longitude gps_lon gps_longitude",
        "height": "height alt altitude field_altitude h ele elevation gps_alt gps_altitude "
        "ellipsoidal_height",
        "v_east": "v_east ve vel_east velocity_east vel_e v_e",
        "v_north": "v_north vn vel_north velocity_north vel_n v_n",
        "v_up": "v_up vu vel_up velocity_up vel_u v_u",
        "v_down": "v_down vd vel_down velocity_down vel_d v_d",
        "gps_speed": "gps_speed ground_speed sog",
        "course": "course cog bearing gps_course track heading_motion direction",
        "sigma_east": "sigma_east sde sd_e sigma_e std_east",
        "sigma_north": "sigma_north sdn sd_n sigma_n std_north",
        "sigma_up": "sigma_up sdu sd_u sigma_u std_up vertical_accuracy verticalaccuracy vacc",
        "sigma_horizontal": "sigma_horizontal horizontal_accuracy hacc h_acc horizontalaccuracy",
        "sigma_v_east": "sigma_v_east sdve",
        "sigma_v_north": "sigma_v_north sdvn",
        "sigma_v_up": "sigma_v_up sdvu",
        "speed": "speed v wheel_speed vehicle_speed velocity forward_speed",
        "time": "t_header time t timestamp stamp header_stamp field_header_stamp unix_time "
        "epoch unix_timestamp utc gps_time time_stamp",
        "log_time": "t_log log_time rosbagtimestamp receive_time",
        "fix_time": "fix_time",
        "status": "field_status_status status_status",
    }
)
"""Quantity -> names it goes by in lower case, units removed, other signs as "_"; first wins."""


@dataclass(frozen=True)
class Column:
    """Where a quantity stands in the table.

    Attributes
    ----------
    index : int
    name : str
        As in the header.
    sign : int
        -1 where it was declared with a minus sign.
    unit : str or None
        As declared by the name, the preset or an option; None: not declared.
    """

    index: int
    name: str
    sign: int = 1
    unit: str | None = None


def spelled_unit(text: str) -> str | None:
    """The unit that a header means by ``text``, or None.

    >>> spelled_unit("m s^-2"), spelled_unit("dps"), spelled_unit("furlong")
    ('m/s2', 'deg/s', None)
    """
    return _SPELLED.get(text.strip().lower().replace("⁻¹", "^-1").replace("⁻²", "^-2"))


def plain_name(header: str) -> str:
    """A header in lower case, with "_" for all other signs.

    >>> plain_name("imu.angular_velocity.x"), plain_name("Acc X (m/s^2)")
    ('imu_angular_velocity_x', 'acc_x_m_s_2')
    """
    return re.sub(r"[^a-z0-9]+", "_", header.strip().lower()).strip("_")


def name_and_unit(header: str) -> tuple[str, str | None]:
    """Name in lower case with "_" for other signs, and the unit that the header declares.

    >>> name_and_unit("a_RS_S_x [m s^-2]"), name_and_unit("gyro_x_dps"), name_and_unit("Lat (°)")
    (('a_rs_s_x', 'm/s2'), ('gyro_x', 'deg/s'), ('lat', 'deg'))
    """
    text, unit = header.strip().lower(), None
    bracket = re.fullmatch(r"(.*?)\s*[\[(]\s*(.*?)\s*[\])]", text)
    if bracket:
        text, unit = bracket[1], spelled_unit(bracket[2])
    name = plain_name(text)
    if unit is None:
        for suffix in _SUFFIXES:
            if name.endswith("_" + suffix):
                return name.removesuffix("_" + suffix), _SPELLED[suffix]
    return name, unit


def named_columns(names: Sequence[str]) -> dict[str, Column]:
    """Quantity -> column, for every quantity that goes by a known name.

    A name counts as it stands before it counts with its ending read as a unit: ``v_s`` may be a
    velocity in frame s.
    """
    known: dict[str, Column] = {}
    for index, header in enumerate(names):
        plain = plain_name(header)
        base, unit = name_and_unit(header)
        known.setdefault(base, Column(index, header, unit=unit))
        known.setdefault(plain, Column(index, header))
    return {
        quantity: next(known[alias] for alias in aliases.split() if alias in known)
        for quantity, aliases in ALIASES.items()
        if any(alias in known for alias in aliases.split())
    }


def declared_columns(
    options: ReadOptions, names: Sequence[str], path: str, *, only_present: bool = False
) -> dict[str, Column]:
    """Quantity -> column, as ``--columns`` says.

    A value is a header name, or the number of the column counted from 1, with a minus sign before
    it where the sign is to be turned. A quantity may carry its unit: ``lat_deg``, ``speed_km_h``,
    ``time_ms``.

    Raises
    ------
    ConfigError
        Unknown quantity.
    LogError
        A column that the file does not have (left out under ``only_present``).
    """
    found: dict[str, Column] = {}
    for key, value in options.columns.items():
        quantity, unit = quantity_and_unit(key)
        sign = -1 if value.startswith("-") and value not in names else 1
        name = value[1:].strip() if sign < 0 else value
        index = _index_of(name, names)
        if index is None:
            if only_present:
                continue
            raise LogError(
                f"{path}: no column {name!r} (--columns {key}={value}); "
                f"the file has {list_names(names)}"
            )
        header_unit = name_and_unit(names[index])[1]
        found[quantity] = Column(index, names[index], sign, unit or header_unit)
    return found


def quantity_and_unit(key: str) -> tuple[str, str | None]:
    """Quantity and unit of a key of ``--columns``."""
    if key in QUANTITIES or key in TIMES:
        return key, None
    name, unit = name_and_unit(key)
    name = {"t": "time", "acc_x": "accel_x", "acc_y": "accel_y", "acc_z": "accel_z"}.get(name, name)
    if name in TIMES and (unit is None or unit in TIME_UNITS):
        return name, unit
    if name in QUANTITIES and (unit is None or unit in GROUPS[QUANTITIES[name]].units):
        return name, unit
    known = [*TIMES, *QUANTITIES]
    near = difflib.get_close_matches(name, known, 1)
    hint = f"did you mean {near[0]!r}?" if near else "known are " + ", ".join(known)
    raise ConfigError(f"--columns: {key!r} is not a quantity; {hint}")


def _index_of(name: str, names: Sequence[str]) -> int | None:
    """The column of that name, of that name in another case, or of that number from 1."""
    lower = [n.lower() for n in names]
    for known, wanted in ((list(names), name), (lower, name.lower())):
        if wanted in known:
            return known.index(wanted)
    if name.isdigit() and 1 <= int(name) <= len(names):
        return int(name) - 1
    return None


def list_names(names: Sequence[str]) -> str:
    """The names of a header for a message, long ones cut."""
    shown = [name if len(name) <= 40 else name[:37] + "..." for name in names[:40] if name]
    more = f" and {len(names) - 40} more" if len(names) > 40 else ""
    return ", ".join(shown) + more
