"""The dispatcher: every kind of file goes to its reader, or is refused by name with what to do."""

from __future__ import annotations

import gzip
import sqlite3

import numpy as np
import pytest

from vehnav.errors import LogError, VehnavError
from vehnav.logs.log import ReadOptions
from vehnav.logs.read import FORMATS, identify, read_gnss, read_log, read_speed

IMU = "t_ns,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n" + "".join(
    f"{1_700_000_000_000_000_000 + k * 10_000_000},0.1,0.2,0.3,0,0,9.8\n" for k in range(1000)
)


def gps_text(start_s=1_700_000_000):
    rows = "".join(f"{start_s + k}.000000000,50.{k:05d},14.5,200\n" for k in range(11))
    return "time_s,lat_deg,lon_deg,height_m\n" + rows


def put(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return str(path)


def sqlite_bytes(tmp_path):
    path = tmp_path / "made.db3"
    connection = sqlite3.connect(path)
    connection.execute("create table messages (id integer)")
    connection.commit()
    connection.close()
    return path.read_bytes()


REFUSED = {
    "x.bag": (b"#ROSBAG V2.0\nE\0\0\0", r"ROS 1 bag.*rosbags-convert --src \S*x.bag --dst x"),
    "x.db3": (None, r"rosbag2 SQLite database.*rosbags-convert --src"),
    "x.csv.gz": (gzip.compress(IMU.encode()), r"compressed as a whole.*gunzip"),
    "x.mcap.zst": (b"\x28\xb5\x2f\xfd\x04\x00", r"compressed as a whole.*zstd -d"),
    "x.zip": (b"PK\x03\x04\x14\x00", r"zip archive; unpack it"),
    "x.mcap": (
        b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n",
        r"pointer to it in Git LFS.*git lfs pull",
    ),
    "y.mcap": (IMU.encode(), r"named \.mcap, but it is text.*rename it"),
    "x.parquet": (b"PAR1\x15\x04", r"Parquet"),
    "x.mat": (b"MATLAB 5.0 MAT-file", r"export it as CSV"),
    "x.csv": (bytes(range(256)) * 4, r"neither text nor a known recording \(it begins with 00 01"),
    "empty.mcap": (b"", r"empty \(0 bytes\)"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_by_name(tmp_path, name):
    content, words = REFUSED[name]
    path = put(tmp_path / name, sqlite_bytes(tmp_path) if content is None else content)
    for reader in (read_log, read_gnss, read_speed):
        with pytest.raises(LogError, match=words) as error:
            reader(path)
        assert str(error.value).startswith(path)


def test_missing_and_folder(tmp_path):
    with pytest.raises(LogError, match="no such file"):
        read_log(str(tmp_path / "nothing.mcap"))
    with pytest.raises(LogError, match=r"a folder of no known kind.*it is empty"):
        read_log(str(tmp_path))


def test_every_format_is_read_or_refused():
    for kind in FORMATS:
        assert bool(kind.refusal) != bool(kind.log or kind.gnss), kind.name
        assert kind.magic or kind.text is not None, kind.name


def test_mcap_goes_by_its_magic(tmp_path):
    assert identify(put(tmp_path / "renamed.bin", b"\x89MCAP0\r\n" + bytes(8))).name == "MCAP"
    # its first bytes lost: the suffix still sends it to the reader that saves what it can
    assert identify(put(tmp_path / "damaged.mcap", bytes(5000))).name == "MCAP"


def test_log_alone(tmp_path):
    log = read_log(put(tmp_path / "drive.csv", IMU))
    assert log.imu.t_ns.size == 1000
    assert log.imu.axes == "RFU"  # vehnav's own table, but others use such names
    assert not log.imu.axes_declared
    assert log.gnss is None
    assert log.findings == ()


@pytest.mark.parametrize(
    ("head", "axes"),
    [("# axes: FRD\n", "FRD"), ("# made by hand, axes=FLU\n", "FLU"), ("# axes unknown\n", "RFU")],
)
def test_a_file_may_declare_its_axes(tmp_path, head, axes):
    imu = read_log(put(tmp_path / "drive.csv", head + IMU)).imu
    assert (imu.axes, imu.axes_declared) == (axes, "unknown" not in head)


def test_a_gps_file_as_log(tmp_path):
    log = read_log(put(tmp_path / "gps.csv", gps_text()))
    assert log.imu is None
    assert log.gnss.t_ns.size == 11


def test_gps_and_speed_beside_the_recording(tmp_path):
    path = put(tmp_path / "drive.csv", IMU)
    gps = put(tmp_path / "gps.csv", gps_text())
    speed = put(tmp_path / "speed.csv", "time_s,speed_m_s\n1700000001,3.5\n1700000002,4.5\n")
    log = read_log(path, ReadOptions(gps_file=gps, speed_file=speed))
    assert log.gnss.t_ns[0] == 1_700_000_000_000_000_000
    np.testing.assert_allclose(np.degrees(log.gnss.lat), 50.0 + 1e-5 * np.arange(11), rtol=1e-15)
    np.testing.assert_array_equal(log.speed.speed, [3.5, 4.5])
    assert log.findings == ()
    late = read_log(path, ReadOptions(gps_file=gps, gps_time_offset=-0.25))
    assert late.gnss.t_ns[0] == 1_699_999_999_750_000_000


def test_gps_of_another_time_is_left_out_and_said(tmp_path):
    path = put(tmp_path / "drive.csv", IMU)
    gps = put(tmp_path / "gps.csv", gps_text(1_700_000_100))
    log = read_log(path, ReadOptions(gps_file=gps))
    assert log.gnss is None
    (finding,) = log.findings
    assert (finding.code, finding.level) == ("clock-offset", "warning")
    assert "GPS starts +100.000 s from the IMU" in finding.text
    assert "--gps-time-offset" in finding.text
    shifted = read_log(path, ReadOptions(gps_file=gps, gps_time_offset=-100.0))
    assert shifted.gnss.t_ns.size == 11


def test_declared_columns_belong_to_their_file(tmp_path):
    """Inertial columns are looked up in the recording, GPS columns in the GPS file."""
    path = put(tmp_path / "drive.csv", IMU.replace("gyro_x", "p").replace("t_ns", "clock"))
    gps = put(tmp_path / "gps.csv", gps_text().replace("lat_deg", "breite").replace("time_s", "z"))
    columns = {"gyro_x": "p", "time_ns": "clock", "lat_deg": "breite", "gps_time_s": "z"}
    log = read_log(path, ReadOptions(gps_file=gps, columns=columns))
    assert log.imu.t_ns.size == 1000
    assert log.gnss.t_ns.size == 11


def test_nothing_of_that_kind(tmp_path):
    path = put(tmp_path / "drive.csv", IMU)
    with pytest.raises(VehnavError, match="no column for lat_deg"):
        read_gnss(path)
    with pytest.raises(VehnavError, match="no columns for time and speed"):
        read_speed(path)
    pos = put(
        tmp_path / "x.pos",
        "%  GPST latitude(deg) longitude(deg) height(m) Q\n"
        "2025/07/08 19:34:18.499 40.0 -105.0 1601.4 1\n",
    )
    with pytest.raises(LogError, match="RTKLIB solution holds no speed"):
        read_speed(pos)


def test_real_failed_recordings(shared_data):
    with pytest.raises(LogError, match="empty"):
        read_log(str(shared_data / "mcap_by_others" / "sarthak_zero_bytes.mcap"))


def test_files_that_vehnav_keeps_beside_a_csv(tmp_path):
    path = put(tmp_path / "city.csv", IMU)
    put(tmp_path / "city.gps.csv", gps_text())
    put(tmp_path / "city.speed.csv", "t_ns,speed_m_s\n1700000001000000000,3.5\n")
    log = read_log(path)
    assert log.gnss.t_ns.size == 11
    assert log.speed.speed[0] == 3.5
    assert [(f.code, f.level) for f in log.findings] == [
        ("gps-beside", "info"),
        ("speed-beside", "info"),
    ]
    other = put(tmp_path / "other.csv", gps_text(1_700_000_005))
    named = read_log(path, ReadOptions(gps_file=other))
    assert named.gnss.t_ns[0] == 1_700_000_005_000_000_000


@pytest.mark.parametrize(
    ("mcap", "table", "gyro_scale", "accel_scale"),
    [
        ("boston_apan/driving.mcap", "boston_apan/driving_imu.csv", 1.0, 1.0),
        ("drive_0708/drive_0708.mcap", "drive_0708/imu.csv", np.pi / 180.0, 9.80665),
        (
            "kitti_oxts/2011_10_03_drive_0042.mcap",
            "kitti_oxts/2011_10_03_drive_0042_imu.csv",
            1.0,
            1.0,
        ),
    ],
)
def test_a_real_log_as_mcap_and_as_csv(shared_data, mcap, table, gyro_scale, accel_scale):
    """The MCAPs were written by others from the same numbers, with the official writer."""
    a = read_log(str(shared_data / mcap)).imu
    b = read_log(str(shared_data / table)).imu
    # six decimals of the CSV files, in their units; stamps to the microsecond
    half_a_digit = 0.51e-6
    assert np.max(np.abs(a.t_ns - b.t_ns)) <= 1000
    np.testing.assert_allclose(a.gyro, b.gyro, atol=half_a_digit * gyro_scale, rtol=1e-15)
    np.testing.assert_allclose(a.accel, b.accel, atol=half_a_digit * accel_scale, rtol=1e-15)
