"""MCAP files built in memory by the official writer, with payloads by independent serialisers."""

from __future__ import annotations

import io
from dataclasses import dataclass
from functools import cache

import numpy as np
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

T0 = 1_700_000_000_123_456_789
MS = 1_000_000
RAD = np.pi / 180.0


@cache
def store(ros: int = 2, extra: tuple[tuple[str, str], ...] = ()):
    """Types of ROS 1 or 2, and more given as (name, definition)."""
    types = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    for name, text in extra:
        types.register(get_types_from_msg(text, name))
    return types


def build(types, name: str, values: dict):
    """A message object; what ``values`` lacks is zero."""
    fields = {}
    for field, (kind, detail) in types.fielddefs[name][1]:
        given = values.get(field)
        fields[field] = _value(types, kind.name, detail, given)
    return types.types[name](**fields)


def _value(types, kind, detail, given):
    if kind == "NAME":
        return build(types, detail, given or {})
    if kind == "BASE":
        return given if given is not None else ("" if detail[0] == "string" else 0)
    element, length = detail
    if given is not None:
        return np.asarray(given) if element[0].name == "BASE" else given
    return np.zeros(length or 0, element[1][0] if element[0].name == "BASE" else object)


def serialize(types, name: str, values: dict, *, little_endian: bool = True) -> bytes:
    """Payload of a message given as nested dictionaries."""
    message = build(types, name, values)
    if "seq" in types.types["std_msgs/msg/Header"].__dataclass_fields__:
        return bytes(types.serialize_ros1(message, name))
    return bytes(types.serialize_cdr(message, name, little_endian=little_endian))


def stamp(t_ns: int, frame: str = "imu_link", *, ros: int = 2) -> dict:
    """A std_msgs/Header."""
    sec, nanosec = divmod(int(t_ns), 1_000_000_000)
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame}


def xyz(v) -> dict:
    """A geometry_msgs/Vector3."""
    return dict(zip("xyz", map(float, v), strict=True))


@dataclass
class Channel:
    """A channel and its messages.

    ``messages`` are (log time, publish time, payload).
    """

    topic: str
    encoding: str
    schema: tuple[str, str, bytes] | None
    messages: list[tuple[int, int, bytes]]


COMPRESSION = {
    "zstd": CompressionType.ZSTD,
    "lz4": CompressionType.LZ4,
    "none": CompressionType.NONE,
}


def mcap(
    channels: list[Channel],
    *,
    compression: str = "zstd",
    profile: str = "ros2",
    index: IndexType = IndexType.ALL,
    **options,
) -> bytes:
    """A file; messages of all channels in order of log time."""
    out = io.BytesIO()
    writer = Writer(out, compression=COMPRESSION[compression], index_types=index, **options)
    writer.start(profile, "tests")
    ids, everything = [], []
    for k, channel in enumerate(channels):
        schema_id = 0
        if channel.schema is not None:
            schema_id = writer.register_schema(*channel.schema)
        ids.append(writer.register_channel(channel.topic, channel.encoding, schema_id))
        everything += [(log, k, publish, data) for log, publish, data in channel.messages]
    everything.sort(key=lambda m: m[:2])
    for log, k, publish, data in everything:
        writer.add_message(ids[k], log, data, publish)
    writer.finish()
    return out.getvalue()


def ros_channel(topic, types, name, rows, *, delay_ns=MS, little_endian=True) -> Channel:
    """A channel of a ROS type; ``rows`` are (stamp, values)."""
    ros = 1 if "seq" in types.types["std_msgs/msg/Header"].__dataclass_fields__ else 2
    text = types.generate_msgdef(name, ros_version=ros)[0].encode()
    shown = name if ros == 2 else name.replace("/msg/", "/")
    messages = [
        (int(t) + delay_ns, int(t), serialize(types, name, values, little_endian=little_endian))
        for t, values in rows
    ]
    encoding = "cdr" if ros == 2 else "ros1"
    return Channel(topic, encoding, (shown, f"ros{ros}msg", text), messages)


@dataclass
class Drive:
    """Numbers of a short drive: what the readers must give back."""

    t: np.ndarray
    gyro: np.ndarray
    accel: np.ndarray
    t_gps: np.ndarray
    lat: np.ndarray  # deg
    lon: np.ndarray
    height: np.ndarray
    t_speed: np.ndarray
    speed: np.ndarray


def drive(n: int = 400, seed: int = 1) -> Drive:
    """100 Hz IMU, 5 Hz GPS, 20 Hz wheel speed."""
    rng = np.random.default_rng(seed)
    t = T0 + 10 * MS * np.arange(n)
    t_gps, t_speed = t[::20], t[::5]
    return Drive(
        t,
        rng.normal(size=(n, 3)),
        rng.normal(size=(n, 3)) + [0, 0, 9.8],
        t_gps,
        48.0 + 1e-5 * np.arange(t_gps.size),
        11.0 - 1e-5 * np.arange(t_gps.size),
        500 + rng.normal(size=t_gps.size),
        t_speed,
        5 + rng.normal(size=t_speed.size),
    )


def imu_rows(d: Drive, frame: str = "imu_link"):
    """Rows of sensor_msgs/Imu."""
    for t, g, a in zip(d.t, d.gyro, d.accel, strict=True):
        values = {"angular_velocity": xyz(g), "linear_acceleration": xyz(a)}
        yield t, {"header": stamp(t, frame), **values}


def fix_rows(d: Drive, **more):
    """Rows of sensor_msgs/NavSatFix."""
    for t, lat, lon, h in zip(d.t_gps, d.lat, d.lon, d.height, strict=True):
        values = {"latitude": float(lat), "longitude": float(lon), "altitude": float(h)}
        yield t, {"header": stamp(t, "gps"), **values, **more}


def twist_rows(d: Drive):
    """Rows of geometry_msgs/TwistStamped."""
    for t, v in zip(d.t_speed, d.speed, strict=True):
        yield t, {"header": stamp(t, "base"), "twist": {"linear": xyz((v, 0, 0))}}


def ros_drive(d: Drive, ros: int = 2) -> list[Channel]:
    """The drive as standard messages."""
    types = store(ros)
    return [
        ros_channel("/imu/data", types, "sensor_msgs/msg/Imu", imu_rows(d)),
        ros_channel("/gps/fix", types, "sensor_msgs/msg/NavSatFix", fix_rows(d)),
        ros_channel("/wheel/twist", types, "geometry_msgs/msg/TwistStamped", twist_rows(d)),
    ]


def assert_drive(log, d: Drive, *, sources=("/imu/data", "/gps/fix", "/wheel/twist")) -> None:
    """The log holds exactly the numbers of the drive."""
    assert log.imu.source == sources[0]
    np.testing.assert_array_equal(log.imu.t_ns, d.t)
    np.testing.assert_array_equal(log.imu.gyro, d.gyro)
    np.testing.assert_array_equal(log.imu.accel, d.accel)
    assert log.gnss.source == sources[1]
    np.testing.assert_array_equal(log.gnss.t_ns, d.t_gps)
    np.testing.assert_array_equal(log.gnss.lat, d.lat * RAD)
    np.testing.assert_array_equal(log.gnss.lon, d.lon * RAD)
    np.testing.assert_array_equal(log.gnss.height, d.height)
    assert log.speed.source == sources[2]
    np.testing.assert_array_equal(log.speed.t_ns, d.t_speed)
    np.testing.assert_array_equal(log.speed.speed, d.speed)
