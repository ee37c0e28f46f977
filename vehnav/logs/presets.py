"""The table layouts that are known: one row each in one table, recognised by the header's names.

A preset says which column holds which quantity and in which unit. ``vehnav`` is the last one: it
takes any header whose names are in :data:`vehnav.logs.columns.ALIASES`, vehnav's own among them.
Names are compared in lower case, other signs as "_", with or without the unit that ends them, never
by position: apps change the order of their columns. Only tables without a header go by position.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

from vehnav.errors import ConfigError, LogError
from vehnav.logs import headerless
from vehnav.logs.columns import Column, name_and_unit, named_columns, plain_name
from vehnav.logs.table import Sheet


def _nothing() -> Mapping[str, str]:
    return MappingProxyType({})


def _vector(quantity: str, names: str) -> dict[str, str]:
    """Three columns: ``names`` holds "?" where the axis stands."""
    return {f"{quantity}_{axis}": names.replace("?", axis) for axis in "xyz"}


def _numbered(first: int, *quantities: str) -> dict[str, str]:
    """Columns of a table without a header, counted from ``first``."""
    return {quantity: str(first + k) for k, quantity in enumerate(quantities)}


@dataclass(frozen=True)
class Preset:
    """One layout.

    Attributes
    ----------
    name : str
        What ``--preset`` calls it.
    title : str
        What it is, for people.
    columns : mapping
        Quantity -> name as :func:`~vehnav.logs.columns.plain_name` has it; "*" at the beginning
        stands for any beginning, "-" before all turns the sign. Empty: by
        :data:`~vehnav.logs.columns.ALIASES`.
    detect : tuple of str
        Names that together belong to no other layout.
    sample : callable or None
        Recognises a table without a header by its numbers.
    units : mapping
        Quantity, or beginning of a quantity up to "_" -> unit, where the header does not say.
    axes : str
        Where x, y, z of the sensor usually point; "": nobody knows.
    axes_fixed : bool
        Whether the format defines them, so that another mounting contradicts it.
    """

    name: str
    title: str
    columns: Mapping[str, str] = field(default_factory=_nothing)
    detect: tuple[str, ...] = ()
    sample: Callable[[Sheet], bool] | None = None
    units: Mapping[str, str] = field(default_factory=_nothing)
    axes: str = ""
    axes_fixed: bool = False

    def matches(self, sheet: Sheet) -> bool:
        """Whether the table is this layout's."""
        if self.sample is not None:
            return sheet.names[:1] == ("1",) and self.sample(sheet)
        known = _lookup(sheet.names)
        return bool(self.detect) and all(_find(known, name) is not None for name in self.detect)

    def place(self, names: Sequence[str]) -> dict[str, Column]:
        """Quantity -> column of those that the header has."""
        if not self.columns:
            return named_columns(names)
        known = _lookup(names)
        placed = {}
        for quantity, name in self.columns.items():
            k = _find(known, name.removeprefix("-"))
            if k is None:
                continue
            unit = self.units.get(quantity, self.units.get(quantity.split("_")[0]))
            unit = unit or name_and_unit(names[k])[1]
            placed[quantity] = Column(k, names[k], -1 if name.startswith("-") else 1, unit)
        return placed


def _lookup(names: Sequence[str]) -> dict[str, int]:
    """Name, with and without its unit -> first column of that name."""
    known: dict[str, int] = {}
    for k, name in enumerate(names):
        known.setdefault(plain_name(name), k)
    for k, name in enumerate(names):
        known.setdefault(name_and_unit(name)[0], k)
    return known


def _find(known: Mapping[str, int], name: str) -> int | None:
    if not name.startswith("*"):
        return known.get(name)
    return next((k for known_name, k in known.items() if known_name.endswith(name[1:])), None)


_ROS_VECTORS = {
    **_vector("gyro", "*angular_velocity_?"),
    **_vector("accel", "*linear_acceleration_?"),
}
_ROS_FIX = {
    "lat": "*latitude",
    "lon": "*longitude",
    "height": "*altitude",
    "status": "*status_status",
}
_ROS_UNITS = {"gyro": "rad/s", "accel": "m/s2"}  # REP 103

PRESETS: Final = (
    Preset(
        name="euroc",
        title="EuRoC / ASL folder imu0/data.csv",
        columns={
            "time": "timestamp",
            **_vector("gyro", "w_rs_s_?"),
            **_vector("accel", "a_rs_s_?"),
        },
        detect=("timestamp", "w_rs_s_x", "w_rs_s_y", "w_rs_s_z", "a_rs_s_x"),
        units={"time": "ns"},
    ),
    Preset(
        name="kf-gins",
        title="increments without a header (KF-GINS, i2Nav, PSINS)",
        columns=_numbered(
            1, "time", *(f"dtheta_{a}" for a in "xyz"), *(f"dvel_{a}" for a in "xyz")
        ),
        sample=headerless.increments,
        units={"time": "s"},
        axes="FRD",
        axes_fixed=True,
    ),
    Preset(
        name="kf-gins-gnss",
        title="fixes without a header (KF-GINS)",
        columns=_numbered(
            1, "time", "lat", "lon", "height", "sigma_north", "sigma_east", "sigma_up"
        ),
        sample=headerless.fixes,
        units={"time": "s"},
    ),
    Preset(
        name="kf-gins-nav",
        title="truth without a header (KF-GINS): week, seconds, position, velocity, attitude",
        columns=_numbered(2, "time", "lat", "lon", "height", "v_north", "v_east", "v_down"),
        sample=headerless.navigation,
        units={"time": "s"},
    ),
    Preset(
        name="rostopic",
        title="rostopic echo -p",
        columns={"time": "field_header_stamp", "log_time": "time", **_ROS_VECTORS, **_ROS_FIX},
        detect=("time", "field_header_stamp"),
        units={**_ROS_UNITS, "time": "ns", "log": "ns"},
        axes="FLU",
    ),
    Preset(
        name="bagpy",
        title="bagpy and other exports with seconds and nanoseconds apart",
        columns={
            "time": "*header_stamp_secs",
            "time_part": "*header_stamp_nsecs",
            "log_time": "time",
            **_ROS_VECTORS,
            **_ROS_FIX,
        },
        detect=("*header_stamp_secs", "*header_stamp_nsecs"),
        units={**_ROS_UNITS, "time": "s", "log": "s"},
        axes="FLU",
    ),
    Preset(
        name="ros2-csv",
        title="ROS 2 exports with sec and nanosec apart",
        columns={
            "time": "*header_stamp_sec",
            "time_part": "*header_stamp_nanosec",
            **_ROS_VECTORS,
            **_ROS_FIX,
        },
        detect=("*header_stamp_sec", "*header_stamp_nanosec"),
        units={**_ROS_UNITS, "time": "s"},
        axes="FLU",
    ),
    Preset(
        name="sensorlog",
        title="SensorLog (iOS)",
        columns={
            "time": "loggingtime",
            **{f"gyro_{a}": f"gyrorotation{a}" for a in "xyz"},
            # Apple counts what is felt downward: -1 g on z when the phone lies on its back
            **{f"accel_{a}": f"-accelerometeracceleration{a}" for a in "xyz"},
            "fix_time": "locationtimestamp_since1970",
            "lat": "locationlatitude",
            "lon": "locationlongitude",
            "height": "locationaltitude",
            "gps_speed": "locationspeed",
            "course": "locationcourse",
            "sigma_horizontal": "locationhorizontalaccuracy",
        },
        detect=("loggingtime", "accelerometeraccelerationx"),
        units={"gyro": "rad/s", "accel": "g", "lat": "deg", "lon": "deg", "course": "deg"},
        axes="RFU",
    ),
    Preset(
        name="racebox",
        title="RaceBox CSV",
        columns={
            "time": "time",
            **_vector("gyro", "gyro?"),
            **_vector("accel", "gforce?"),
            "lat": "latitude",
            "lon": "longitude",
            "height": "altitude",
        },
        detect=("record", "gforcex", "gforcey", "gforcez", "gyrox"),
        units={"gyro": "deg/s", "accel": "g"},
    ),
    Preset(
        name="dresden",
        title="Tinkerforge brick with GPS in the same rows (balzer82)",
        columns={
            "time": "millis",
            "fix_time": "time",
            "gyro_x": "rollrate",
            "gyro_y": "pitchrate",
            "gyro_z": "yawrate",
            **_vector("accel", "a?"),
            "lat": "latitude",
            "lon": "longitude",
            "height": "altitude",
            "gps_speed": "speed",
            "course": "course",
        },
        detect=("millis", "rollrate", "pitchrate", "yawrate", "ax", "ay", "az"),
        units={"gyro": "deg/s", "accel": "m/s2", "time": "ms", "gps_speed": "km/h"},
        axes="FLU",  # roll about x, pitch about y, yaw about z
    ),
    Preset(name="vehnav", title="vehnav's own, and any header of known names"),
)

GRAVITY_FREE: Final = (
    (r"linear acceleration [xyz]\b.*", "phyphox"),
    (r"(motion)?user_?acceleration.*", "Core Motion"),
    (r"free_?acc.*", "Xsens"),
    (r"lin(ear)?_?acc[_ ]?[xyz]\b.*", "Android"),
)
"""Names of accelerations from which gravity was taken away, and who writes them."""


def choose_preset(sheet: Sheet, wanted: str | None) -> Preset:
    """The layout of a table: the wanted one, else the first that matches, else ``vehnav``.

    Raises
    ------
    ConfigError
        No preset of that name.
    """
    if wanted is not None:
        known = {preset.name: preset for preset in PRESETS}
        if wanted not in known:
            near = difflib.get_close_matches(wanted, known, 1) or list(known)
            raise ConfigError(f"--preset: no preset {wanted!r}; did you mean {' or '.join(near)}?")
        return known[wanted]
    return next((preset for preset in PRESETS if preset.matches(sheet)), PRESETS[-1])


def refuse_gravity_free(path: str, names: Sequence[str], columns: Mapping[str, Column]) -> None:
    """LogError where the only acceleration is one without gravity.

    Dead reckoning needs what an accelerometer feels: level, stops and scale come from gravity.
    """
    used = [columns[f"accel_{axis}"].name for axis in "xyz" if f"accel_{axis}" in columns]
    if not used and any(name.startswith("dvel_") for name in columns):
        return
    for name in used or names:
        for pattern, writer in GRAVITY_FREE:
            if re.fullmatch(pattern, name.strip().lower()):
                raise LogError(
                    f"{path}: column {name!r} is acceleration without gravity ({writer}); "
                    "dead reckoning needs what the accelerometer feels, gravity included: "
                    "record that instead (9.8 m/s2 at rest)"
                )
