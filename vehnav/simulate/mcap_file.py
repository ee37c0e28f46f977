"""MCAP files of IMU, fixes and speed: ROS 2 CDR, whole chunks encoded as arrays.

Standard messages where there is one: ``sensor_msgs/msg/Imu`` and ``NavSatFix``,
``geometry_msgs/msg/TwistStamped``. What they cannot say has a message of our own: increments, and
fixes with a velocity. Axes of what is written are the caller's business.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.logs.log import Gnss, Imu, Speed
from vehnav.rotation import exact_degrees

Array = npt.NDArray[np.float64]
Bytes = npt.NDArray[np.uint8]

_RULE = "=" * 80
_HEADER = f"""{_RULE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_RULE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_VECTOR = f"""{_RULE}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""
_SCHEMAS: Final = {
    "sensor_msgs/msg/Imu": f"""std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
{_HEADER}{_RULE}
MSG: geometry_msgs/Quaternion
float64 x 0
float64 y 0
float64 z 0
float64 w 1
{_VECTOR}""",
    "vehnav_msgs/msg/ImuIncrements": f"""# rad and m/s over the step before the stamp
std_msgs/Header header
geometry_msgs/Vector3 delta_angle
geometry_msgs/Vector3 delta_velocity
{_HEADER}{_VECTOR}""",
    "sensor_msgs/msg/NavSatFix": f"""uint8 COVARIANCE_TYPE_UNKNOWN=0
uint8 COVARIANCE_TYPE_APPROXIMATED=1
uint8 COVARIANCE_TYPE_DIAGONAL_KNOWN=2
uint8 COVARIANCE_TYPE_KNOWN=3
std_msgs/Header header
sensor_msgs/NavSatStatus status
float64 latitude
float64 longitude
float64 altitude
float64[9] position_covariance
uint8 position_covariance_type
{_HEADER}{_RULE}
MSG: sensor_msgs/NavSatStatus
int8 STATUS_FIX=0
uint16 SERVICE_GPS=1
int8 status
uint16 service
""",
    "vehnav_msgs/msg/GnssFix": f"""# degrees, metres above the ellipsoid; east, north, up m/s
std_msgs/Header header
float64 latitude
float64 longitude
float64 altitude
float64[9] position_covariance
uint8 position_covariance_type
geometry_msgs/Vector3 velocity
{_HEADER}{_VECTOR}""",
    "geometry_msgs/msg/TwistStamped": f"""std_msgs/Header header
geometry_msgs/Twist twist
{_HEADER}{_RULE}
MSG: geometry_msgs/Twist
geometry_msgs/Vector3 linear
geometry_msgs/Vector3 angular
{_VECTOR}""",
}
"""Message type -> definition (fields of the ROS 2 interfaces, without their comments)."""

_CHUNK_NS: Final = 10_000_000_000


@dataclass(frozen=True)
class Topic:
    """Messages of one topic, encoded.

    Attributes
    ----------
    name, type : str
        Topic and message type.
    t_ns : (n,) int64
    payload : (n, size) uint8
        CDR with its encapsulation.
    """

    name: str
    type: str
    t_ns: npt.NDArray[np.int64]
    payload: Bytes


def _encoded(t_ns: npt.NDArray[np.int64], frame_id: str, fields: list[tuple[Any, ...]]) -> Bytes:
    """CDR messages (n, size) of a header and fields (dtype, values (n,) or (n, k)), aligned."""
    text = frame_id.encode() + b"\0"
    columns: list[tuple[str, Any]] = [
        ("u1", np.broadcast_to(np.array([0, 1, 0, 0], np.uint8), (t_ns.size, 4))),
        ("<i4", t_ns // 1_000_000_000),
        ("<u4", t_ns % 1_000_000_000),
        ("<u4", np.full(t_ns.size, len(text))),
        ("u1", np.broadcast_to(np.frombuffer(text, np.uint8), (t_ns.size, len(text)))),
        *fields,
    ]
    offset, offsets, formats = 0, [], []
    for kind, values in columns:
        size = np.dtype(kind).itemsize
        offset += -(offset - 4) % size if offset >= 4 else 0
        shape = values.shape[1:]
        offsets.append(offset)
        formats.append((kind, shape))
        offset += size * int(np.prod(shape, initial=1))
    names = [f"f{k}" for k in range(len(columns))]
    record = np.zeros(
        t_ns.size,
        np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": offset}),
    )
    for name, (_, values) in zip(names, columns, strict=True):
        record[name] = values
    return record.view(np.uint8).reshape(t_ns.size, offset)


def imu_topic(imu: Imu, name: str = "/imu/data") -> Topic:
    """The IMU, on the axes as they stand in the record."""
    frame = imu.frame_id or "imu_link"
    if imu.sampling == "increments":
        payload = _encoded(imu.t_ns, frame, [("<f8", imu.gyro), ("<f8", imu.accel)])
        return Topic(name, "vehnav_msgs/msg/ImuIncrements", imu.t_ns, payload)
    n = imu.t_ns.size
    unknown = np.zeros((n, 9))
    no_orientation = unknown.copy()
    no_orientation[:, 0] = -1.0
    fields = [
        ("<f8", np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))),
        ("<f8", no_orientation),
        ("<f8", imu.gyro),
        ("<f8", unknown),
        ("<f8", imu.accel),
        ("<f8", unknown),
    ]
    return Topic(name, "sensor_msgs/msg/Imu", imu.t_ns, _encoded(imu.t_ns, frame, fields))


def gnss_topic(gnss: Gnss, name: str = "/gps/fix") -> Topic:
    """The fixes; with a velocity as ``vehnav_msgs/msg/GnssFix``."""
    n = gnss.t_ns.size
    covariance = np.zeros((n, 9))
    if gnss.sigma_pos is not None:
        covariance[:, ::4] = gnss.sigma_pos**2
    kind = np.full(n, 0 if gnss.sigma_pos is None else 2)
    place = [
        ("<f8", exact_degrees(gnss.lat)),
        ("<f8", exact_degrees(gnss.lon)),
        ("<f8", gnss.height),
        ("<f8", covariance),
        ("u1", kind),
    ]
    if gnss.v_n is not None:
        payload = _encoded(gnss.t_ns, "gps", [*place, ("<f8", gnss.v_n)])
        return Topic(name, "vehnav_msgs/msg/GnssFix", gnss.t_ns, payload)
    status = [("i1", np.zeros(n)), ("<u2", np.ones(n))]
    payload = _encoded(gnss.t_ns, "gps", [*status, *place])
    return Topic(name, "sensor_msgs/msg/NavSatFix", gnss.t_ns, payload)


def speed_topic(speed: Speed, name: str = "/vehicle/speed") -> Topic:
    """Wheel speed: forward is x."""
    linear = np.stack([speed.speed, 0.0 * speed.speed, 0.0 * speed.speed], axis=-1)
    payload = _encoded(speed.t_ns, "base_link", [("<f8", linear), ("<f8", np.zeros_like(linear))])
    return Topic(name, "geometry_msgs/msg/TwistStamped", speed.t_ns, payload)


_MESSAGE: Final = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)


def _records(topic: Topic, channel: int) -> Bytes:
    """(n, size): message records, header and payload."""
    n, size = topic.payload.shape
    head = np.zeros(n, _MESSAGE)
    head["opcode"] = 5
    head["length"] = size + _MESSAGE.itemsize - 9
    head["channel"] = channel
    head["sequence"] = np.arange(n)
    head["log_time"] = head["publish_time"] = topic.t_ns
    return np.concatenate([head.view(np.uint8).reshape(n, -1), topic.payload], axis=1)


def write_mcap(path: Path, topics: list[Topic]) -> None:
    """Write topics as a chunked, indexed, zstd-compressed MCAP file with checksums.

    Messages of one instant stand in the order of ``topics``.
    """
    from vehnav.simulate.mcap_container import Container

    records = [_records(topic, k + 1) for k, topic in enumerate(topics)]
    first = min(int(t.t_ns[0]) for t in topics if t.t_ns.size)
    last = max(int(t.t_ns[-1]) for t in topics if t.t_ns.size)
    with path.open("wb") as stream:
        container = Container(stream)
        for k, topic in enumerate(topics):
            container.declare(k + 1, topic.name, topic.type, _SCHEMAS[topic.type])
        for begin in range(first, last + 1, _CHUNK_NS):
            rows = [slice(*np.searchsorted(t.t_ns, [begin, begin + _CHUNK_NS])) for t in topics]
            container.chunk(
                [r[s] for r, s in zip(records, rows, strict=True)],
                [t.t_ns[s] for t, s in zip(topics, rows, strict=True)],
            )
        container.finish()
