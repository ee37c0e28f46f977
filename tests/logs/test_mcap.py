"""MCAP: standard messages come back as the numbers that were written, whatever the container."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import IndexType
from mcap_build import (
    MS,
    RAD,
    T0,
    assert_drive,
    drive,
    fix_rows,
    imu_rows,
    mcap,
    ros_channel,
    ros_drive,
    stamp,
    store,
    twist_rows,
    xyz,
)
from mcap_ros2.decoder import DecoderFactory

from vehnav.errors import LogError
from vehnav.logs.log import ReadOptions
from vehnav.logs.mcap import read_mcap
from vehnav.units import DEG

PLAIN = ReadOptions()


def read(tmp_path, data: bytes, name="log.mcap", **options):
    path = tmp_path / name
    path.write_bytes(data)
    return read_mcap(path, ReadOptions(**options))


def codes(log) -> list[str]:
    return [finding.code for finding in log.findings]


def found(log, code: str) -> str:
    return " ".join(f.text for f in log.findings if f.code == code)


# ---- containers ------------------------------------------------------------------------------


@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_standard_messages_come_back_exactly(tmp_path, ros, compression):
    d = drive()
    data = mcap(ros_drive(d, ros), compression=compression, profile=f"ros{ros}", chunk_size=20_000)
    log = read(tmp_path, data)
    assert_drive(log, d)
    assert log.unix_clock
    assert not log.damaged
    assert log.imu.frame_id == "imu_link"
    total = d.t.size + d.t_gps.size + d.t_speed.size
    assert log.integrity == {
        "declared": total, "read": total, "recovered": 0, "unverified": 0, "bad": 0,
    }  # fmt: skip
    rows = {row["name"]: row for row in log.contents}
    assert rows["/imu/data"]["count"] == d.t.size
    assert rows["/imu/data"]["used_as"] == "IMU"
    assert rows["/imu/data"]["rate_hz"] == pytest.approx(100.0)
    assert rows["/gps/fix"]["first_ns"] == d.t_gps[0] + MS


@pytest.mark.parametrize(
    "options",
    [
        {"use_chunking": False},
        {"use_statistics": False},
        {"index": IndexType.NONE},
        {"index": IndexType.CHUNK},
        {"index": IndexType.MESSAGE},
        {"repeat_channels": False, "repeat_schemas": False},
        {"enable_crcs": False},
        {"use_chunking": False, "index": IndexType.NONE, "use_statistics": False,
         "repeat_channels": False, "repeat_schemas": False, "use_summary_offsets": False},
    ],
    ids=["unchunked", "no statistics", "no index", "no message index", "no chunk index",
         "no repeated channels", "no checksums", "bare"],
)  # fmt: skip
def test_legal_files_without_the_usual_help_lose_nothing(tmp_path, options):
    d = drive()
    log = read(tmp_path, mcap(ros_drive(d), chunk_size=20_000, **options))
    assert_drive(log, d)
    assert not log.damaged


def test_absent_checksums_are_said_once(tmp_path):
    log = read(tmp_path, mcap(ros_drive(drive()), chunk_size=10_000, enable_crcs=False))
    assert codes(log).count("no-checksum") == 1
    assert "not verifiable" in found(log, "no-checksum")
    assert not log.damaged


def test_big_endian_payloads_and_long_frame_ids(tmp_path):
    d = drive(60)
    types = store()
    rows = [(t, v | {"header": stamp(t, "x" * (k % 9))}) for k, (t, v) in enumerate(imu_rows(d))]
    data = mcap([ros_channel("/imu", types, "sensor_msgs/msg/Imu", rows, little_endian=False)])
    log = read(tmp_path, data)
    np.testing.assert_array_equal(log.imu.gyro, d.gyro)
    np.testing.assert_array_equal(log.imu.accel, d.accel)
    np.testing.assert_array_equal(log.imu.t_ns, d.t)


def test_chunks_that_overlap_in_time_come_back_in_order(tmp_path):
    d = drive(200)
    types = store()
    both = list(imu_rows(d))
    first = ros_channel("/imu", types, "sensor_msgs/msg/Imu", both[::2], delay_ns=0)
    second = ros_channel("/imu", types, "sensor_msgs/msg/Imu", both[1::2], delay_ns=0)
    # two publishers of one topic, the second one's messages recorded behind the first one's
    second.messages = [(log + 0, pub, data) for log, pub, data in second.messages]
    data = mcap([first, second], chunk_size=3000)
    log = read(tmp_path, data)
    np.testing.assert_array_equal(log.imu.t_ns, d.t)
    np.testing.assert_array_equal(log.imu.gyro, d.gyro)
    assert "backward-stamps" not in codes(log)


# ---- which topic -----------------------------------------------------------------------------


def two_imus(d):
    types = store()
    slow = list(imu_rows(d))[::4]
    return [
        ros_channel("/slow", types, "sensor_msgs/msg/Imu", slow),
        ros_channel("/fast", types, "sensor_msgs/msg/Imu", imu_rows(d)),
    ]


def test_of_two_imus_the_faster_is_used_and_the_other_named(tmp_path):
    log = read(tmp_path, mcap(two_imus(drive())))
    assert log.imu.source == "/fast"
    assert "/slow (100)" in found(log, "topic-choice")
    assert "--imu-topic" in found(log, "topic-choice")


def test_the_user_chooses(tmp_path):
    log = read(tmp_path, mcap(two_imus(drive())), imu_topic="/slow")
    assert log.imu.source == "/slow"
    assert log.imu.t_ns.size == 100


def test_an_imu_that_was_never_filled_gives_way(tmp_path):
    d = drive()
    zero = [(t, {"header": stamp(t), "angular_velocity": xyz((0.1, 0, 0))}) for t in d.t]
    zero += [(d.t[-1] + MS, zero[-1][1])]
    types = store()
    channels = [ros_channel("/camera/gyro", types, "sensor_msgs/msg/Imu", zero), *ros_drive(d)]
    log = read(tmp_path, mcap(channels))
    assert log.imu.source == "/imu/data"
    assert "/camera/gyro" in found(log, "topic-unusable")
    assert "zero" in found(log, "topic-unusable")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"imu_topic": "/nope"}, ["/nope", "--imu-topic", "/imu/data [sensor_msgs/msg/Imu] 400"]),
        ({"imu_topic": "/gps/fix"}, ["/gps/fix", "IMU", "NavSatFix"]),
        ({"gps_topic": "/imu/data"}, ["/imu/data", "GPS"]),
        ({"speed_topic": "/gps/fix"}, ["/gps/fix", "speed"]),
    ],
)
def test_a_topic_that_cannot_be_used_is_an_error_that_says_what_is_there(tmp_path, options, words):
    with pytest.raises(LogError) as error:
        read(tmp_path, mcap(ros_drive(drive())), **options)
    for word in words:
        assert word in str(error.value)


def test_commands_and_gps_velocities_are_no_wheel_speed(tmp_path):
    d = drive()
    types = store()
    name = "geometry_msgs/msg/TwistStamped"
    sideways = [
        (t, {"header": stamp(t), "twist": {"linear": xyz((3.0, 4.0, 0))}}) for t in d.t_speed
    ]
    channels = [
        ros_channel("/imu", types, "sensor_msgs/msg/Imu", imu_rows(d)),
        ros_channel("/cmd_vel", types, name, twist_rows(d)),
        ros_channel("/gps/vel", types, name, twist_rows(d)),
    ]
    assert read(tmp_path, mcap(channels)).speed is None
    channels.append(ros_channel("/twist", types, name, sideways))
    log = read(tmp_path, mcap(channels))
    assert log.speed is None
    assert "sideways" in found(log, "speed-rejected")
    chosen = read(tmp_path, mcap(channels), speed_topic="/cmd_vel")
    np.testing.assert_array_equal(chosen.speed.speed, d.speed)


@pytest.mark.parametrize(
    ("name", "wrap"),
    [
        ("geometry_msgs/msg/TwistWithCovarianceStamped", lambda v: {"twist": {"twist": v}}),
        ("nav_msgs/msg/Odometry", lambda v: {"child_frame_id": "b", "twist": {"twist": v}}),
        ("geometry_msgs/msg/TwistStamped", lambda v: {"twist": v}),
    ],
)
def test_every_standard_twist_gives_forward_speed(tmp_path, name, wrap):
    d = drive()
    rows = [
        (t, {"header": stamp(t), **wrap({"linear": xyz((v, 0.01, 0))})})
        for t, v in zip(d.t_speed, d.speed, strict=True)
    ]
    log = read(tmp_path, mcap([ros_channel("/odom", store(), name, rows)]))
    np.testing.assert_array_equal(log.speed.speed, d.speed)
    np.testing.assert_array_equal(log.speed.t_ns, d.t_speed)
    assert log.imu is None


# ---- fixes -----------------------------------------------------------------------------------


def test_covariance_becomes_standard_deviations(tmp_path):
    d = drive()
    covariance = np.diag([4.0, 9.0, 16.0]).ravel()
    rows = list(fix_rows(d, position_covariance=covariance, position_covariance_type=2))
    log = read(tmp_path, mcap([ros_channel("/fix", store(), "sensor_msgs/msg/NavSatFix", rows)]))
    np.testing.assert_array_equal(log.gnss.sigma_pos, np.tile([2.0, 3.0, 4.0], (d.t_gps.size, 1)))
    rows = list(fix_rows(d, position_covariance=covariance, position_covariance_type=0))
    log = read(tmp_path, mcap([ros_channel("/fix", store(), "sensor_msgs/msg/NavSatFix", rows)]))
    assert log.gnss.sigma_pos is None


def test_fixes_without_status_are_rejected_and_counted(tmp_path):
    d = drive()
    rows = list(fix_rows(d))
    for k in (3, 4, 5):
        rows[k][1]["status"] = {"status": -1, "service": 1}
    log = read(tmp_path, mcap([ros_channel("/fix", store(), "sensor_msgs/msg/NavSatFix", rows)]))
    assert log.gnss.t_ns.size == d.t_gps.size - 3
    assert "3 of" in found(log, "gps-rejected")


# ---- clocks ----------------------------------------------------------------------------------


def test_the_clock_is_stated_and_can_be_chosen(tmp_path):
    d = drive()
    data = mcap(ros_drive(d))
    log = read(tmp_path, data)
    assert "header time" in found(log, "clock")
    assert (log.imu.axes, log.imu.axes_declared) == ("FLU", False)
    clock = log.contents[0]["clock"]
    assert clock["stamps"] == "header"
    assert clock["offset_s"] == pytest.approx(1e-3)
    assert clock["step_s"] == pytest.approx([0.01] * 5)
    assert (clock["backward"], clock["repeated"], clock["gaps"]) == (0, 0, 0)
    log = read(tmp_path, data, time="log")
    np.testing.assert_array_equal(log.imu.t_ns, d.t + MS)


def test_header_stamps_that_are_not_set_or_run_wrong_give_way_to_log_time(tmp_path):
    d = drive()
    types = store()
    slow = d.t[0] + (d.t - d.t[0]) * 11 // 10
    for stamps, word in (
        (np.zeros(d.t.size, np.int64), "no stamps"),
        (np.where(np.arange(d.t.size) % 9, d.t, 0), "zero"),
        (d.t[::-1], "backward"),
        (slow, "+10.00 %"),
    ):
        rows = [
            (t, v | {"header": stamp(s)}) for (t, v), s in zip(imu_rows(d), stamps, strict=True)
        ]
        log = read(tmp_path, mcap([ros_channel("/imu", types, "sensor_msgs/msg/Imu", rows)]))
        np.testing.assert_array_equal(log.imu.t_ns, d.t + MS)
        assert word in found(log, "clock")
        assert "log time" in found(log, "clock")


def test_a_clock_whose_rate_cannot_be_told_says_so(tmp_path):
    """Two fixes, and a recorder whose time stands: no number, and what is stated stays JSON."""
    d = drive()
    imu, fixes, _ = ros_drive(d)
    fixes.messages = fixes.messages[:2]
    imu.messages = [(T0, publish, data) for _, publish, data in imu.messages]
    log = read(tmp_path, mcap([imu, fixes]))
    np.testing.assert_array_equal(log.imu.t_ns, d.t)
    assert [row["clock"]["rate_error"] for row in log.contents] == [None, None]
    json.dumps([dict(row) for row in log.contents], allow_nan=False)


def test_gps_on_another_clock_is_put_on_that_of_the_imu(tmp_path):
    d = drive()
    rows = [(t, v | {"header": stamp(t + 31_000 * 10**9)}) for t, v in fix_rows(d)]
    types = store()
    channels = [
        ros_channel("/imu", types, "sensor_msgs/msg/Imu", imu_rows(d)),
        ros_channel("/fix", types, "sensor_msgs/msg/NavSatFix", rows),
    ]
    log = read(tmp_path, mcap(channels))
    np.testing.assert_array_equal(log.gnss.t_ns, d.t_gps)
    assert "another clock" in found(log, "clock-offset")
    assert "31000.000" in found(log, "clock-offset")


def test_gps_that_is_late_keeps_its_stamps_with_a_warning(tmp_path):
    d = drive()
    types = store()
    channels = [
        ros_channel("/imu", types, "sensor_msgs/msg/Imu", imu_rows(d)),
        ros_channel("/fix", types, "sensor_msgs/msg/NavSatFix", fix_rows(d), delay_ns=231 * MS),
    ]
    log = read(tmp_path, mcap(channels))
    np.testing.assert_array_equal(log.gnss.t_ns, d.t_gps)
    assert "0.230 s" in found(log, "clock-offset")


# ---- bad input -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "word"),
    [
        (b"", "empty"),
        (b"time,gyro_x\n1,2\n", "not an MCAP file"),
        (b"\x89MCAP0\r\n", "no messages"),
        (mcap([]), "no messages"),
        (mcap([])[:30], "no messages"),
    ],
)
def test_files_without_anything_are_named_for_what_they_are(tmp_path, data, word):
    with pytest.raises(LogError, match=word):
        read(tmp_path, data)


def test_a_missing_file(tmp_path):
    with pytest.raises(LogError, match="cannot be opened"):
        read_mcap(tmp_path / "no.mcap", PLAIN)


def test_a_log_without_imu_lists_what_is_there(tmp_path):
    d = drive()
    types = store()
    log = read(tmp_path, mcap([ros_channel("/f", types, "sensor_msgs/msg/NavSatFix", fix_rows(d))]))
    assert log.imu is None
    assert [(row["name"], row["type"]) for row in log.contents] == [
        ("/f", "sensor_msgs/msg/NavSatFix")
    ]


# ---- real files, against the reader of the format's authors ---------------------------------


def _at(message, path):
    for name in path:
        message = getattr(message, name)
    return message


def official(path: Path, source: str):
    """(stamps, messages) of a topic, by mcap and mcap-ros2-support."""
    topic, _, rest = source.partition(" (")
    inner = [name for name in rest.strip(")").split(".") if name]
    stamps, parts = [], []
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, _, _, message in reader.iter_decoded_messages(topics=[topic]):
            part = _at(message, inner)
            head = getattr(part, "header", None) or message.header
            stamps.append(head.stamp.sec * 10**9 + head.stamp.nanosec)
            parts.append(part)
    return np.array(stamps), parts


@pytest.mark.parametrize(
    "name",
    [
        "boston_apan/going_in_circles.mcap",
        "mcap_by_others/rhoque_car_circles.mcap",
        "mcap_by_others/rosbagsrs_all_types_no_statistics.mcap",
        "mcap_by_others/hansmann_navsatfix_50min.mcap",
    ],
)
def test_real_files_agree_bit_for_bit_with_the_official_reader(shared_data, name):
    path = shared_data / name
    log = read_mcap(path, PLAIN)
    assert log.imu is not None or log.gnss is not None
    if log.imu is not None:
        stamps, parts = official(path, log.imu.source)
        names = ("angular_velocity", "linear_acceleration")
        gyro, accel = (
            np.array([[getattr(getattr(p, n), axis) for axis in "xyz"] for p in parts])
            for n in names
        )
        np.testing.assert_array_equal(log.imu.t_ns, stamps)
        np.testing.assert_array_equal(log.imu.gyro, gyro)
        np.testing.assert_array_equal(log.imu.accel, accel)
    if log.gnss is not None:
        stamps, parts = official(path, log.gnss.source)
        np.testing.assert_array_equal(log.gnss.t_ns, stamps)
        np.testing.assert_array_equal(log.gnss.lat, np.array([p.latitude for p in parts]) * DEG)
        np.testing.assert_array_equal(log.gnss.lon, np.array([p.longitude for p in parts]) * DEG)
        np.testing.assert_array_equal(log.gnss.height, [p.altitude for p in parts])


def test_real_failed_recordings(shared_data):
    for name, word in (("no_messages", "no messages"), ("zero_bytes", "0 bytes")):
        with pytest.raises(LogError, match=word):
            read_mcap(shared_data / f"mcap_by_others/sarthak_{name}.mcap", PLAIN)


def test_the_builder_itself_is_read_by_the_official_reader(tmp_path):
    d = drive(40)
    path = tmp_path / "x.mcap"
    path.write_bytes(mcap(ros_drive(d)))
    stamps, parts = official(path, "/imu/data")
    np.testing.assert_array_equal(stamps, d.t)
    np.testing.assert_array_equal([p.angular_velocity.y for p in parts], d.gyro[:, 1])
    assert stamps[0] == T0
    assert RAD == DEG
