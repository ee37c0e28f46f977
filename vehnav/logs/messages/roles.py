"""Which part of a message is an IMU, a fix or a speed: found by the names of its fields.

Messages are recognised by structure, not by type name, so that ``Vectornav{header, imu}`` or
``Customgps{Latitude, ...}`` works like the standard types. Names are compared without case and
underscores. Units: what the type's documentation says; rows below name the source.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

from vehnav.logs.messages.types import Array, Path, Scalar, Struct, Text, Type, plain, structs
from vehnav.units import DEG

RoleName = Literal["imu", "gnss", "speed"]

GYRO = {
    # name: (factor to SI, sampling)
    **dict.fromkeys(
        ("angularvelocity", "angularrate", "rotationrate", "angvel", "gyro", "gyroscope", "omega"),
        (1.0, "rates"),
    ),
    "gyrorad": (1.0, "rates"),  # PX4 SensorCombined
    "deltaangle": (1.0, "increments"),  # PX4 VehicleImu
}
ACCEL = {
    **dict.fromkeys(
        ("linearacceleration", "linearaccel", "specificforce", "acceleration", "accel"),
        (1.0, "rates"),
    ),
    **dict.fromkeys(("accelerometer", "acc", "accelerometerms2"), (1.0, "rates")),
    "deltavelocity": (1.0, "increments"),
}
LATITUDE = ("latitude", "lat", "latitudedeg", "latdeg")
LONGITUDE = ("longitude", "lon", "lng", "long", "longitudedeg", "londeg")
HEIGHT = (
    *("heightellipsoid", "altitudeellipsoidm", "altellipsoid", "altitude", "alt", "height"),
    *("altitudemslm", "hmsl", "altitudem", "heightm"),
)
RADIAN_FIXES = ("PVTGeodetic", "INSNavGeod")
"""Septentrio's geodetic messages are in radians (mosaic reference guide, PVTGeodetic)."""
FORWARD = ("longitudinalvelocity", "forwardvelocity", "vehiclespeed", "wheelspeed")
STAMPS = ("stamp", "timestamp", "time", "timeusec", "timens")
SECONDS = ("sec", "secs", "seconds")
NANOSECONDS = ("nanosec", "nsec", "nsecs", "nanos", "nanoseconds")


@dataclass(frozen=True)
class Stamp:
    """Where a message carries its own time.

    Attributes
    ----------
    seconds, nanoseconds : Path or None
        A pair, Unix or not; or ``seconds`` alone is a count of unknown unit.
    """

    seconds: Path
    nanoseconds: Path | None = None


@dataclass(frozen=True)
class Quantity:
    """Numbers that belong together, each a leaf, or one leaf of several numbers."""

    leaves: tuple[Path, ...]
    factor: float = 1.0


@dataclass(frozen=True)
class Role:
    """A usable part of a message.

    Attributes
    ----------
    name : {"imu", "gnss", "speed"}
    path : Path
        The structure it was found in; () is the message itself.
    quantities : dict
        Of "gyro", "accel", "lat", "lon", "height", "v_n", "covariance", "speed", "across", ...
    stamps : tuple of Stamp
        Innermost first.
    frame : Path or None
        The leaf of the frame id.
    sampling : {"rates", "increments"}
    axes : str
        Where the axes point: FLU by the custom of ROS (REP 103, REP 145), FRD by PX4's definition.
    axes_fixed : bool
        Whether the type defines them; a custom is often broken.
    """

    name: RoleName
    path: Path
    quantities: dict[str, Quantity]
    stamps: tuple[Stamp, ...] = ()
    frame: Path | None = None
    sampling: Literal["rates", "increments"] = "rates"
    axes: str = "FLU"
    axes_fixed: bool = False

    def wanted(self) -> dict[Path, tuple[str, int]]:
        """Leaf -> (quantity, column), as decoders take it."""
        leaves: dict[Path, tuple[str, int]] = {}
        for name, quantity in self.quantities.items():
            for column, leaf in enumerate(quantity.leaves):
                leaves[leaf] = (name, column)
        for k, stamp in enumerate(self.stamps):
            leaves[stamp.seconds] = (f"stamp{k}", 0)
            if stamp.nanoseconds is not None:
                leaves[stamp.nanoseconds] = (f"nanos{k}", 0)
        if self.frame is not None:
            leaves[self.frame] = ("frame", 0)
        return leaves


def find_roles(root: Struct) -> list[Role]:
    """Every usable part of a message type, outermost first.

    A structure inside one that was already taken for the same role is not offered again.
    """
    roles: list[Role] = []
    for path, chain in structs(root):
        fields = {plain(name): (name, kind) for name, kind in reversed(list(chain[-1]))}
        for role, detect in (("imu", _imu), ("gnss", _gnss), ("speed", _speed)):
            if any(r.name == role and path[: len(r.path)] == r.path for r in roles):
                continue
            found = detect(path, fields, chain)
            if found is not None:
                roles.append(found)
    return roles


Fields = dict[str, tuple[str, Type]]
Chain = tuple[Struct, ...]


def _role(
    name: RoleName, path: Path, chain: Chain, quantities: dict[str, Quantity], sampling: str
) -> Role:
    stamps, frame = _stamps(path, chain)
    return Role(
        name,
        path,
        quantities,
        stamps,
        frame,
        "increments" if sampling == "increments" else "rates",
    )


# --- IMU -----------------------------------------------------------------------------------------


def _imu(path: Path, fields: Fields, chain: Chain) -> Role | None:
    gyro = _named_triple(path, fields, GYRO)
    accel = _named_triple(path, fields, ACCEL)
    if gyro is None or accel is None or gyro[1] != accel[1]:
        return None
    role = _role("imu", path, chain, {"gyro": gyro[0], "accel": accel[0]}, gyro[1])
    px4 = chain[-1].name.startswith("px4_msgs")
    return replace(role, axes="FRD", axes_fixed=True) if px4 else role


def _named_triple(
    path: Path, fields: Fields, names: dict[str, tuple[float, str]]
) -> tuple[Quantity, str] | None:
    """A vector called one of ``names``: a structure x, y, z, an array of 3, or three scalars."""
    for name, (factor, sampling) in names.items():
        leaves = _triple(path, fields, name)
        if leaves:
            return Quantity(leaves, factor), sampling
    return None


def _triple(path: Path, fields: Fields, name: str) -> tuple[Path, ...] | None:
    if name in fields:
        own, kind = fields[name]
        if isinstance(kind, Array) and kind.length == 3 and isinstance(kind.element, Scalar):
            return ((*path, own),)
        if isinstance(kind, Struct):
            inner = {plain(n): (n, k) for n, k in kind}
            return _scalars((*path, own), inner, ("x", "y", "z"))
        return None
    return _scalars(path, fields, tuple(name + axis for axis in "xyz"))


def _scalars(path: Path, fields: Fields, names: tuple[str, ...]) -> tuple[Path, ...] | None:
    """Leaves of these names, all of them numbers; None otherwise."""
    if not all(n in fields and isinstance(fields[n][1], Scalar) for n in names):
        return None
    return tuple((*path, fields[n][0]) for n in names)


# --- fixes ---------------------------------------------------------------------------------------


def _gnss(path: Path, fields: Fields, chain: Chain) -> Role | None:
    lat = _first(path, fields, LATITUDE)
    lon = _first(path, fields, LONGITUDE)
    if lat is None or lon is None:
        return None
    counts = lat[1].is_integer
    angle = 1e-7 * DEG if counts else DEG  # integer degrees are 1e-7 deg: u-blox, PX4, MAVLink
    if chain[-1].name.endswith(RADIAN_FIXES):
        angle = 1.0
    quantities = {"lat": Quantity((lat[0],), angle), "lon": Quantity((lon[0],), angle)}
    height = _first(path, fields, HEIGHT)
    if height is not None:
        quantities["height"] = Quantity((height[0],), 1e-3 if height[1].is_integer else 1.0)
    quantities |= _gnss_extras(path, fields)
    return _role("gnss", path, chain, quantities, "rates")


def _first(path: Path, fields: Fields, names: tuple[str, ...]) -> tuple[Path, Scalar] | None:
    for name in names:
        if name in fields:
            own, kind = fields[name]
            if isinstance(kind, Scalar):
                return (*path, own), kind
    return None


def _gnss_extras(path: Path, fields: Fields) -> dict[str, Quantity]:
    """Status, accuracy and velocity, where the names leave no doubt."""
    extras: dict[str, Quantity] = {}
    covariance = fields.get("positioncovariance")
    if covariance and isinstance(covariance[1], Array) and covariance[1].length in (9, None):
        extras["covariance"] = Quantity(((*path, covariance[0]),))
    kind = _first(path, fields, ("positioncovariancetype",))
    if kind:
        extras["covariance_type"] = Quantity((kind[0],))
    status = fields.get("status")
    if status and isinstance(status[1], Struct):
        inner = {plain(n): (n, k) for n, k in status[1]}
        found = _first((*path, status[0]), inner, ("status",))
        if found:
            extras["status"] = Quantity((found[0],))
    return extras | _gnss_velocity(path, fields)


def _gnss_velocity(path: Path, fields: Fields) -> dict[str, Quantity]:
    """North, east, down (u-blox NavPVT in mm/s, PX4 in m/s); track and speed; east, north, up."""
    for names in (("veln", "vele", "veld"), ("velnms", "velems", "veldms")):
        leaves = _scalars(path, fields, names)
        if leaves:
            first = fields[names[0]][1]
            unit = 1e-3 if isinstance(first, Scalar) and first.is_integer else 1.0
            return {"v_ned": Quantity(leaves, unit)} | _ublox_accuracy(path, fields)
    track = _scalars(path, fields, ("track", "speed", "climb"))  # gps_common/GPSFix: deg, m/s
    if track:
        return {"v_track": Quantity(track)}
    enu = _triple(path, fields, "velocity")  # foxglove.LocationFix
    return {"v_enu": Quantity(enu)} if enu and len(enu) == 3 else {}


def _ublox_accuracy(path: Path, fields: Fields) -> dict[str, Quantity]:
    """hAcc, vAcc (u-blox: u32 mm) and fix type, speed accuracy."""
    extras = {}
    accuracy = _scalars(path, fields, ("hacc", "vacc"))
    if accuracy:
        first = fields["hacc"][1]
        unit = 1e-3 if isinstance(first, Scalar) and first.is_integer else 1.0
        extras["accuracy"] = Quantity(accuracy, unit)
    fix = _first(path, fields, ("fixtype",))
    if fix:
        extras["fix_type"] = Quantity((fix[0],))
    return extras


# --- speed ---------------------------------------------------------------------------------------


def _speed(path: Path, fields: Fields, chain: Chain) -> Role | None:
    forward = _first(path, fields, FORWARD)
    if forward:
        return _role("speed", path, chain, {"speed": Quantity((forward[0],))}, "rates")
    linear = fields.get("linear")
    if not (path and plain(path[-1]) == "twist") or linear is None or "angular" not in fields:
        return None
    leaves = _triple(path, fields, "linear")
    if leaves is None or len(leaves) != 3:
        return None
    return _role("speed", path, chain, {"linear": Quantity(leaves)}, "rates")


# --- stamps --------------------------------------------------------------------------------------


def _stamps(path: Path, chain: Chain) -> tuple[tuple[Stamp, ...], Path | None]:
    """Stamps of a structure and of those around it, innermost first; and its frame id."""
    stamps: list[Stamp] = []
    frame: Path | None = None
    for depth in range(len(chain) - 1, -1, -1):
        here = path[:depth]
        for inner_path, struct in _own_and_header(here, chain[depth]):
            fields = {plain(n): (n, k) for n, k in struct}
            stamps.extend(_stamp_fields(inner_path, fields))
            if frame is None and "frameid" in fields and isinstance(fields["frameid"][1], Text):
                frame = (*inner_path, fields["frameid"][0])
    return tuple(stamps), frame


def _own_and_header(path: Path, struct: Struct) -> Iterator[tuple[Path, Struct]]:
    for name, kind in struct:
        if plain(name) == "header" and isinstance(kind, Struct):
            yield (*path, name), kind
    yield path, struct


def _stamp_fields(path: Path, fields: Fields) -> Iterator[Stamp]:
    for name in STAMPS:
        if name not in fields:
            continue
        own, kind = fields[name]
        here = (*path, own)
        if isinstance(kind, Scalar) and kind.size == 8:
            yield Stamp(here)
        elif isinstance(kind, Struct):
            inner = {plain(n): (n, k) for n, k in kind}
            seconds = _first(here, inner, SECONDS)
            nanos = _first(here, inner, NANOSECONDS)
            if seconds and nanos:
                yield Stamp(seconds[0], nanos[0])
