"""One drive in every encoding, plain and nested: equal arrays."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from mcap_build import (
    MS,
    RAD,
    Channel,
    assert_drive,
    build,
    drive,
    fix_rows,
    imu_rows,
    mcap,
    ros_channel,
    ros_drive,
    serialize,
    stamp,
    store,
    twist_rows,
    xyz,
)

from vehnav.logs.log import ReadOptions
from vehnav.logs.mcap import read_mcap

VECTORNAV = "std_msgs/Header header\nsensor_msgs/Imu imu\nsensor_msgs/MagneticField mag_field\n"
CUSTOM = (
    (
        "vn_driver/msg/Vectornav",
        "string raw\n" + VECTORNAV,
    ),
    (
        "gps_driver/msg/Customgps",
        "std_msgs/Header header\nfloat64 Latitude\nfloat64 Longitude\nfloat64 Altitude\n"
        "float64 UTM_easting\nuint8 zone\nstring letter\nfloat32 hdop\nstring gpgga_read\n",
    ),
    (
        "car_msgs/msg/VelocityReport",
        "std_msgs/Header header\nfloat32 longitudinal_velocity\nfloat32 lateral_velocity\n",
    ),
    ("car_msgs/msg/Detection", "string label\nfloat64[] scores\n"),
    ("car_msgs/msg/Box", "float64 width\nuint8 kind\n"),
    (
        "car_msgs/msg/Everything",
        "uint8 version\nstring[] names\nDetection[] detections\nBox[] boxes\nBox[3] three\n"
        "Detection[2] two\nuint16[] counts\nfloat64[] weights\nVectornav_like inner\n",
    ),
    (
        "car_msgs/msg/Vectornav_like",
        "std_msgs/Header header\nsensor_msgs/Imu imu\nwstring remark\n",
    ),
)


def read(tmp_path, data: bytes, **options):
    path = tmp_path / "log.mcap"
    path.write_bytes(data)
    return read_mcap(path, ReadOptions(**options))


# ---- one builder for each encoding -----------------------------------------------------------


def nested_drive(d, ros):
    """The drive inside messages of drivers' own types, names in other case."""
    types = store(ros, CUSTOM[:2])
    imu = [
        (t, {"raw": "$VNYMR" + "x" * (t % 7), "header": v["header"], "imu": v})
        for t, v in imu_rows(d)
    ]
    fixes = [
        (t, {"header": v["header"], "Latitude": v["latitude"], "Longitude": v["longitude"],
             "Altitude": v["altitude"], "letter": "U", "gpgga_read": "$GPGGA"})
        for t, v in fix_rows(d)
    ]  # fmt: skip
    plain = ros_drive(d, ros)
    return [
        ros_channel("/imu", types, "vn_driver/msg/Vectornav", imu),
        ros_channel("/gps", types, "gps_driver/msg/Customgps", fixes),
        plain[2],
    ]


JSON_VECTOR = {"type": "object", "properties": {a: {"type": "number"} for a in "xyz"}}
JSON_TIME = {
    "type": "object",
    "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
}


def json_channel(topic, name, properties, rows, *, schema=True):
    text = json.dumps({"title": name, "type": "object", "properties": properties}).encode()
    messages = [(int(t) + MS, int(t), json.dumps(value).encode()) for t, value in rows]
    return Channel(topic, "json", (name, "jsonschema", text) if schema else None, messages)


def json_time(t):
    return {"sec": int(t) // 10**9, "nsec": int(t) % 10**9}


def json_drive(d, schema=True):
    """As nuscenes2mcap writes it."""
    imu = [
        (t, {"timestamp": json_time(t), "frame_id": "imu_link",
             "rotation_rate": xyz(g), "linear_accel": xyz(a)})
        for t, g, a in zip(d.t, d.gyro, d.accel, strict=True)
    ]  # fmt: skip
    fixes = [
        (t, {"timestamp": json_time(t), "latitude": v["latitude"], "longitude": v["longitude"],
             "altitude": v["altitude"]})
        for t, v in fix_rows(d)
    ]  # fmt: skip
    speed = [
        (t, {"timestamp": json_time(t), "longitudinal_velocity": float(v)})
        for t, v in zip(d.t_speed, d.speed, strict=True)
    ]
    number = {"type": "number"}
    return [
        json_channel("/imu/data", "IMU",
                     {"timestamp": JSON_TIME, "frame_id": {"type": "string"},
                      "rotation_rate": JSON_VECTOR, "linear_accel": JSON_VECTOR}, imu,
                     schema=schema),
        json_channel("/gps/fix", "foxglove.LocationFix",
                     {"timestamp": JSON_TIME, "latitude": number, "longitude": number,
                      "altitude": number}, fixes, schema=schema),
        json_channel("/wheel/twist", "Velocity",
                     {"timestamp": JSON_TIME, "longitudinal_velocity": number}, speed,
                     schema=schema),
    ]  # fmt: skip


def protobuf_drive(d):
    """Foxglove's LocationFix, and a team's own IMU and speed types."""
    descriptor_pb2 = pytest.importorskip("google.protobuf.descriptor_pb2")
    location = pytest.importorskip("foxglove_schemas_protobuf.LocationFix_pb2").LocationFix
    from google.protobuf import descriptor_pool, timestamp_pb2
    from google.protobuf.message_factory import GetMessageClass
    from mcap_protobuf.schema import build_file_descriptor_set

    field = descriptor_pb2.FieldDescriptorProto
    file = descriptor_pb2.FileDescriptorProto(
        name="car.proto", package="car", syntax="proto3",
        dependency=["google/protobuf/timestamp.proto"],
    )  # fmt: skip

    def message(name, **fields):
        proto = file.message_type.add(name=name)
        for number, (key, kind) in enumerate(fields.items(), 1):
            new = proto.field.add(name=key, number=number, label=field.LABEL_OPTIONAL)
            if isinstance(kind, str):
                new.type, new.type_name = field.TYPE_MESSAGE, kind
            else:
                new.type = kind

    double = field.TYPE_DOUBLE
    message("Vec", x=double, y=double, z=double)
    message("Imu", stamp=".google.protobuf.Timestamp", gyro=".car.Vec", accel=".car.Vec")
    message("Frame", imu=".car.Imu", counter=field.TYPE_UINT32)
    message("Speed", stamp=".google.protobuf.Timestamp", vehicle_speed=double)
    pool = descriptor_pool.DescriptorPool()
    time_file = descriptor_pb2.FileDescriptorProto.FromString(
        timestamp_pb2.DESCRIPTOR.serialized_pb
    )
    pool.Add(time_file)
    pool.Add(file)
    schema = descriptor_pb2.FileDescriptorSet(file=[file, time_file]).SerializeToString()
    frame, speed = (
        GetMessageClass(pool.FindMessageTypeByName(f"car.{n}")) for n in ("Frame", "Speed")
    )

    def channel(topic, name, text, messages):
        rows = [(int(t) + MS, int(t), m.SerializeToString()) for t, m in messages]
        return Channel(topic, "protobuf", (name, "protobuf", text), rows)

    def time(t):
        return {"seconds": int(t) // 10**9, "nanos": int(t) % 10**9}

    imu = [
        (t, frame(imu={"stamp": time(t), "gyro": xyz(g), "accel": xyz(a)}, counter=1))
        for t, g, a in zip(d.t, d.gyro, d.accel, strict=True)
    ]
    fixes = [
        (t, location(timestamp=timestamp_pb2.Timestamp(**time(t)), frame_id="gps",
                     latitude=v["latitude"], longitude=v["longitude"], altitude=v["altitude"]))
        for t, v in fix_rows(d)
    ]  # fmt: skip
    speeds = [
        (t, speed(stamp=time(t), vehicle_speed=v)) for t, v in zip(d.t_speed, d.speed, strict=True)
    ]
    fix_schema = build_file_descriptor_set(location).SerializeToString()
    return [
        channel("/imu/data", "car.Frame", schema, imu),
        channel("/gps/fix", "foxglove.LocationFix", fix_schema, fixes),
        channel("/wheel/twist", "car.Speed", schema, speeds),
    ]


STANDARD = ("/imu/data", "/gps/fix", "/wheel/twist")
WAYS = {
    "ros1": (lambda d: ros_drive(d, 1), STANDARD),
    "ros2": (lambda d: ros_drive(d, 2), STANDARD),
    "ros1 nested": (lambda d: nested_drive(d, 1), ("/imu (imu)", "/gps", "/wheel/twist")),
    "ros2 nested": (lambda d: nested_drive(d, 2), ("/imu (imu)", "/gps", "/wheel/twist")),
    "json": (json_drive, STANDARD),
    "json without schema": (lambda d: json_drive(d, schema=False), STANDARD),
    "protobuf": (protobuf_drive, ("/imu/data (imu)", "/gps/fix", "/wheel/twist")),
}


@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize("way", WAYS)
def test_one_drive_in_every_encoding(tmp_path, way, chunked):
    make, sources = WAYS[way]
    d = drive(120)
    log = read(tmp_path, mcap(make(d), use_chunking=chunked, chunk_size=10_000))
    assert_drive(log, d, sources=sources)
    assert not log.damaged
    assert log.integrity["bad"] == 0


# ---- ROS: the walk through a message ---------------------------------------------------------


@pytest.mark.parametrize("ros", [1, 2])
def test_sequences_of_everything_before_the_imu_are_stepped_over(tmp_path, ros):
    extra = CUSTOM[3:6]
    like = (CUSTOM[6][0], CUSTOM[6][1].replace("wstring remark\n", ""))
    types = store(ros, (*extra[:2], like, extra[2]))
    rng = np.random.default_rng(5)
    d = drive(100)

    def detection():
        return build(types, "car_msgs/msg/Detection",
                     {"label": "x" * rng.integers(6), "scores": rng.normal(size=rng.integers(4))}
                     )  # fmt: skip

    def box():
        return build(types, "car_msgs/msg/Box", {"width": 1.5, "kind": 7})

    rows = [
        (t, {
            "names": np.array(["n" * rng.integers(5) for _ in range(rng.integers(4))], object),
            "detections": np.array([detection() for _ in range(rng.integers(4))], object),
            "boxes": np.array([box() for _ in range(rng.integers(5))], object),
            "three": np.array([box() for _ in range(3)], object),
            "two": np.array([detection() for _ in range(2)], object),
            "counts": rng.integers(9, size=rng.integers(6)).astype(np.uint16),
            "weights": rng.normal(size=rng.integers(3)),
            "inner": {"header": v["header"], "imu": v},
        })
        for t, v in imu_rows(d)
    ]  # fmt: skip
    log = read(tmp_path, mcap([ros_channel("/all", types, "car_msgs/msg/Everything", rows)]))
    assert log.imu.source == "/all (inner.imu)"
    np.testing.assert_array_equal(log.imu.t_ns, d.t)
    np.testing.assert_array_equal(log.imu.gyro, d.gyro)
    np.testing.assert_array_equal(log.imu.accel, d.accel)
    assert log.integrity["bad"] == 0


def test_a_format_that_is_not_agreed_on_behind_the_imu_does_no_harm(tmp_path):
    types = store(2, ((CUSTOM[6][0], CUSTOM[6][1].replace("wstring", "string")),))
    d = drive(30)
    rows = [(t, {"header": v["header"], "imu": v, "remark": "ok"}) for t, v in imu_rows(d)]
    channel = ros_channel("/imu", types, CUSTOM[6][0], rows)
    name, language, text = channel.schema
    channel.schema = (name, language, text.replace(b"string remark", b"wstring remark"))
    log = read(tmp_path, mcap([channel]))
    np.testing.assert_array_equal(log.imu.gyro, d.gyro)


def test_the_velocity_report_of_a_car(tmp_path):
    d = drive()
    rows = [
        (t, {"header": stamp(t), "longitudinal_velocity": np.float32(v)})
        for t, v in zip(d.t_speed, d.speed, strict=True)
    ]
    channels = [
        ros_channel("/status", store(2, CUSTOM[2:3]), "car_msgs/msg/VelocityReport", rows),
        ros_channel("/odom", store(), "geometry_msgs/msg/TwistStamped", twist_rows(d)),
    ]
    log = read(tmp_path, mcap(channels))
    assert log.speed.source == "/status"
    np.testing.assert_array_equal(log.speed.speed, d.speed.astype(np.float32).astype(float))


XCDR2 = {"plain": (0x07, True), "delimited": (0x09, False), "mutable": (0x0B, False)}


@pytest.mark.parametrize("kind", XCDR2)
def test_xcdr2_is_recognised(tmp_path, kind):
    """Plain XCDR2 aligns doubles to 4 bytes: padding before them falls away."""
    number, understood = XCDR2[kind]
    d = drive(50)
    types = store()
    channel = ros_channel("/imu", types, "sensor_msgs/msg/Imu", imu_rows(d, "base"))
    head = 4 + 8 + 4 + 5  # encapsulation, stamp, length, "base\0"
    padded, tight = head + 7, head + 3  # to 8 bytes (XCDR1) and to 4, from behind the encapsulation
    channel.messages = [
        (log, publish, bytes([0, number]) + data[2:head] + bytes(tight - head) + data[padded:])
        for log, publish, data in channel.messages
    ]
    log = read(tmp_path, mcap([channel]))
    if understood:
        np.testing.assert_array_equal(log.imu.gyro, d.gyro)
        np.testing.assert_array_equal(log.imu.accel, d.accel)
    else:
        assert log.imu is None
        text = " ".join(f.text for f in log.findings)
        assert "XCDR2" in text
        assert f"0x{number:04x}" in text


# ---- tier 2: types with a certain layout -----------------------------------------------------

GPSFIX = (
    (
        "gps_msgs/msg/GPSStatus",
        "std_msgs/Header header\nuint16 satellites_used\nint32[] satellite_used_prn\n"
        "uint16 satellites_visible\nint32[] satellite_visible_prn\nint16 status\n",
    ),
    (
        "gps_msgs/msg/GPSFix",
        "std_msgs/Header header\nGPSStatus status\nfloat64 latitude\nfloat64 longitude\n"
        "float64 altitude\nfloat64 track\nfloat64 speed\nfloat64 climb\nfloat64 time\n"
        "float64[9] position_covariance\nuint8 position_covariance_type\n",
    ),
)


def test_gpsfix_has_velocity_by_track_and_speed(tmp_path):
    types = store(2, GPSFIX)
    d = drive()
    rows = [
        (t, {"header": v["header"], "latitude": v["latitude"], "longitude": v["longitude"],
             "altitude": v["altitude"], "track": 90.0, "speed": 4.0, "climb": 0.5,
             "status": {"satellite_used_prn": np.arange(k % 5, dtype=np.int32)},
             "position_covariance": np.diag([1.0, 4.0, 9.0]).ravel(),
             "position_covariance_type": 2})
        for k, (t, v) in enumerate(fix_rows(d))
    ]  # fmt: skip
    log = read(tmp_path, mcap([ros_channel("/gps", types, "gps_msgs/msg/GPSFix", rows)]))
    np.testing.assert_array_equal(log.gnss.lat, d.lat * RAD)
    np.testing.assert_allclose(
        log.gnss.v_n, np.tile([4.0, 0.0, 0.5], (d.t_gps.size, 1)), atol=1e-12
    )
    np.testing.assert_array_equal(log.gnss.sigma_pos[0], [1.0, 2.0, 3.0])


NAVPVT = (
    "ublox_msgs/msg/NavPVT",
    "uint32 i_tow\nuint16 year\nuint8 month\nuint8 day\nuint8 hour\nuint8 min\nuint8 sec\n"
    "uint8 valid\nuint32 t_acc\nint32 nano\nuint8 fix_type\nuint8 flags\nuint8 flags2\n"
    "uint8 num_sv\nint32 lon\nint32 lat\nint32 height\nint32 h_msl\nuint32 h_acc\nuint32 v_acc\n"
    "int32 vel_n\nint32 vel_e\nint32 vel_d\nint32 g_speed\nint32 heading\nuint32 s_acc\n"
    "uint32 head_acc\nuint16 p_dop\nuint8[6] reserved1\nint32 head_veh\nint16 mag_dec\n"
    "uint16 mag_acc\n",
)


def test_navpvt_counts_become_si(tmp_path):
    """u-blox interface description, UBX-NAV-PVT: 1e-7 deg, mm, mm/s; fixType 0 is no fix."""
    d = drive()
    rows = [
        (t, {"lat": 480000000 + 10 * k, "lon": 110000000, "height": 512345, "h_msl": 465000,
             "h_acc": 1500, "v_acc": 2500, "vel_n": 1000, "vel_e": -2000, "vel_d": 300,
             "fix_type": 0 if k == 2 else 3, "nano": -5})
        for k, t in enumerate(d.t_gps)
    ]  # fmt: skip
    log = read(tmp_path, mcap([ros_channel("/pvt", store(2, (NAVPVT,)), NAVPVT[0], rows)]))
    keep = np.arange(d.t_gps.size) != 2
    lat_deg = 48 + 1e-6 * np.arange(d.t_gps.size)[keep]
    np.testing.assert_allclose(log.gnss.lat, lat_deg * RAD, rtol=1e-15)
    np.testing.assert_allclose(log.gnss.height, 512.345, rtol=1e-12)
    np.testing.assert_allclose(log.gnss.v_n[0], [-2.0, 1.0, -0.3], rtol=1e-12)
    np.testing.assert_allclose(log.gnss.sigma_pos[0], [1.5, 1.5, 2.5], rtol=1e-12)
    np.testing.assert_array_equal(log.gnss.t_ns, d.t_gps[keep] + MS)  # it has no header


PX4 = (
    (
        "px4_msgs/msg/SensorCombined",
        "uint64 timestamp\nfloat32[3] gyro_rad\nuint32 gyro_integral_dt\n"
        "int32 accelerometer_timestamp_relative\nfloat32[3] accelerometer_m_s2\n"
        "uint32 accelerometer_integral_dt\nuint8 accelerometer_clipping\n",
    ),
    (
        "px4_msgs/msg/SensorGps",
        "uint64 timestamp\nuint64 timestamp_sample\nuint32 device_id\nfloat64 latitude_deg\n"
        "float64 longitude_deg\nfloat64 altitude_msl_m\nfloat64 altitude_ellipsoid_m\n"
        "float32 s_variance_m_s\nfloat32 c_variance_rad\nuint8 fix_type\nfloat32 eph\n"
        "float32 vel_n_m_s\nfloat32 vel_e_m_s\nfloat32 vel_d_m_s\n",
    ),
    (
        "px4_msgs/msg/VehicleImu",
        "uint64 timestamp\nuint64 timestamp_sample\nuint32 accel_device_id\nuint32 gyro_device_id\n"
        "float32[3] delta_angle\nfloat32[3] delta_velocity\nuint32 delta_angle_dt\n"
        "uint32 delta_velocity_dt\n",
    ),
)


def test_px4_counts_microseconds_since_boot(tmp_path):
    d = drive()
    types = store(2, PX4)
    boot = d.t[0] - 77_000_000_123
    imu = [
        (t, {"timestamp": (int(t) - boot) // 1000, "gyro_rad": g.astype("f4"),
             "accelerometer_m_s2": a.astype("f4")})
        for t, g, a in zip(d.t, d.gyro, d.accel, strict=True)
    ]  # fmt: skip
    fixes = [
        (t, {"timestamp": (int(t) - boot) // 1000, "latitude_deg": v["latitude"],
             "longitude_deg": v["longitude"], "altitude_msl_m": 1.0,
             "altitude_ellipsoid_m": v["altitude"], "fix_type": 3, "vel_n_m_s": 1.5,
             "vel_e_m_s": 2.5, "vel_d_m_s": -0.5})
        for t, v in fix_rows(d)
    ]  # fmt: skip
    channels = [
        ros_channel("/fmu/out/sensor_combined", types, PX4[0][0], imu),
        ros_channel("/fmu/out/vehicle_gps_position", types, PX4[1][0], fixes),
    ]
    log = read(tmp_path, mcap(channels))
    np.testing.assert_array_equal(log.imu.t_ns, (d.t - boot) // 1000 * 1000)
    np.testing.assert_array_equal(log.gnss.t_ns, (d.t_gps - boot) // 1000 * 1000)
    assert not log.unix_clock
    assert (log.imu.axes, log.imu.axes_declared) == ("FRD", True)
    np.testing.assert_array_equal(log.imu.gyro, d.gyro.astype("f4").astype(float))
    np.testing.assert_array_equal(log.gnss.height, d.height)
    np.testing.assert_array_equal(log.gnss.v_n[0], [2.5, 1.5, 0.5])


def test_px4_increments_are_increments(tmp_path):
    d = drive()
    rows = [
        (t, {"timestamp": int(t) // 1000, "delta_angle": (g / 100).astype("f4"),
             "delta_velocity": (a / 100).astype("f4")})
        for t, g, a in zip(d.t, d.gyro, d.accel, strict=True)
    ]  # fmt: skip
    log = read(tmp_path, mcap([ros_channel("/imu", store(2, PX4[2:]), PX4[2][0], rows)]))
    assert log.imu.sampling == "increments"
    np.testing.assert_array_equal(log.imu.accel, (d.accel / 100).astype("f4").astype(float))


def test_a_location_fix_has_velocity_and_covariance(tmp_path):
    location = pytest.importorskip("foxglove_schemas_protobuf.LocationFix_pb2").LocationFix
    from mcap_protobuf.schema import build_file_descriptor_set

    d = drive()
    schema = ("foxglove.LocationFix", "protobuf",
              build_file_descriptor_set(location).SerializeToString())  # fmt: skip
    messages = [
        (int(t), int(t), location(latitude=v["latitude"], longitude=v["longitude"],
                                  position_covariance=[4.0, 0, 0, 0, 9.0, 0, 0, 0, 16.0],
                                  position_covariance_type=2).SerializeToString())
        for t, v in fix_rows(d)
    ]  # fmt: skip
    log = read(tmp_path, mcap([Channel("/fix", "protobuf", schema, messages)]))
    np.testing.assert_array_equal(log.gnss.sigma_pos[0], [2.0, 3.0, 4.0])
    assert log.gnss.v_n is None


# ---- what cannot be understood ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("channel", "word"),
    [
        (Channel("/x", "cdr", ("a/msg/B", "ros2idl", b"module a {};"), []), "ros2idl"),
        (Channel("/x", "cdr", None, []), "schema language"),
        (Channel("/x", "flatbuffer", ("B", "flatbuffer", b"\0"), []), "flatbuffer"),
        (Channel("/x", "cdr", ("a/msg/B", "ros2msg", b"Missing m\n"), []), "'Missing'"),
        (Channel("/x", "cdr", ("a/msg/B", "ros2msg", b"a/B again\n"), []), "contains itself"),
        (Channel("/x", "cdr", ("a/msg/B", "ros2msg", b"%% nothing"), []), "no field"),
        (Channel("/x", "protobuf", ("a.B", "protobuf", b"\xff\xff"), []), "protobuf schema"),
        (Channel("/x", "json", ("B", "jsonschema", b"{"), []), "JSON schema"),
    ],
)
def test_what_cannot_be_understood_is_said_in_the_contents(tmp_path, channel, word):
    channel.messages = [(1, 1, b"\0\1\0\0")]
    log = read(tmp_path, mcap([channel, *ros_drive(drive(40))]))
    row = next(row for row in log.contents if row["name"] == "/x")
    assert word in row["problem"]
    assert log.imu.t_ns.size == 40


@pytest.mark.parametrize("chunked", [True, False])
def test_a_schema_that_doubles_at_every_level_is_refused(tmp_path, chunked):
    levels = "".join(f"{'=' * 80}\nMSG: a/L{k}\nL{k + 1} left\nL{k + 1} right\n" for k in range(25))
    text = f"L0 top\nImu imu\n{levels}{'=' * 80}\nMSG: a/L25\nfloat64 x\n"
    text += f"{'=' * 80}\nMSG: a/Imu\nfloat64[3] gyro\nfloat64[3] accel\n"
    channel = Channel("/x", "cdr", ("a/msg/B", "ros2msg", text.encode()), [(1, 1, b"\0\1\0\0")])
    log = read(tmp_path, mcap([channel, *ros_drive(drive(40))], use_chunking=chunked))
    assert log.imu.source == "/imu/data"
    assert "50000 fields" in log.contents[0]["problem"]


def test_serialize_agrees_with_the_layout_of_a_ros_imu():
    """The independent serialiser puts the rates where the layout of ROS 2 has them."""
    values = {"header": stamp(5, "imu_link"), "angular_velocity": xyz((1, 2, 3))}
    data = serialize(store(), "sensor_msgs/msg/Imu", values)
    assert len(data) == 324
    assert np.frombuffer(data, "<f8", 3, 4 + 128).tolist() == [1.0, 2.0, 3.0]


def test_numbers_written_as_text_are_numbers(tmp_path):
    """Some drivers write the altitude as text: the same log as with numbers."""
    d = drive()
    channels = json_drive(d, schema=False)
    plain = read(tmp_path, mcap(channels))
    for k, channel in enumerate(channels):
        if channel.topic == "/gps/fix":
            rows = [(a, b, json.loads(text)) for a, b, text in channel.messages]
            for _, _, row in rows:
                row["altitude"], row["latitude"] = str(row["altitude"]), repr(row["latitude"])
            texts = [(a, b, json.dumps(row).encode()) for a, b, row in rows]
            channels[k] = replace(channel, messages=texts)
    text = read(tmp_path, mcap(channels))
    for name in ("t_ns", "lat", "lon", "height"):
        np.testing.assert_array_equal(getattr(text.gnss, name), getattr(plain.gnss, name))
    assert np.ptp(plain.gnss.height) > 0.0 or plain.gnss.height[0] != 0.0
