"""Recordings kept as folders: the same drive through each kind comes back as the same arrays."""

from __future__ import annotations

import numpy as np
import pytest

from vehnav.errors import FormatError, LogError
from vehnav.logs.read import read_log
from vehnav.units import STANDARD_GRAVITY

N = 200
T0 = 1_700_000_000_120_000_000
T = T0 + 10_000_000 * np.arange(N)
_RNG = np.random.default_rng(7)
GYRO = _RNG.normal(size=(N, 3)) * 0.1
ACCEL = _RNG.normal(size=(N, 3)) * 0.3 + [0.0, 0.0, 9.81]
K = np.arange(20)
T_FIX = T0 + 100_000_000 * K
LAT, LON = 50.0 + 1e-6 * K, 14.5 + 1e-6 * K
TWO_ROUNDINGS = 1e-15


def put(path, header, columns, *, delimiter=",", decimal="."):
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [delimiter.join(row).replace(".", decimal) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([header, *rows, ""]), encoding="utf-8")


def s(values, form="%.17g"):
    return [form % v for v in values]


def assert_drive(log, *, t=T, rtol=TWO_ROUNDINGS):
    np.testing.assert_array_equal(log.imu.t_ns, t)
    np.testing.assert_allclose(log.imu.gyro, GYRO, rtol=rtol)
    np.testing.assert_allclose(log.imu.accel, ACCEL, rtol=rtol)


# ---- Sensor Logger ---------------------------------------------------------------------------


def sensor(folder, name, values, *, t=T):
    """Columns in the order of the app: z, y, x."""
    columns = [s(t, "%d"), s((t - T0) / 1e9, "%.9f"), *(s(values[:, j]) for j in (2, 1, 0))]
    put(folder / name, "time,seconds_elapsed,z,y,x", columns)


def sensor_logger(folder, *, platform="android", standardised="false"):
    sensor(folder, "Gyroscope.csv", GYRO)
    put(
        folder / "Metadata.csv",
        "version,device name,recording epoch time,platform,standardisation",
        [["3"], ["phone"], ["1700000000120"], [platform], [standardised]],
    )
    put(
        folder / "Location.csv",
        "time,seconds_elapsed,bearingAccuracy,speedAccuracy,verticalAccuracy,horizontalAccuracy,"
        "speed,bearing,altitude,longitude,latitude",
        [
            s(T_FIX, "%d"),
            s((T_FIX - T0) / 1e9, "%.6f"),
            *([["5"] * 20] * 2),
            ["4.0"] * 20,
            ["3.0"] * 20,
            ["2.0"] * 20,
            ["90"] * 20,
            ["210.5"] * 20,
            s(LON),
            s(LAT),
        ],
    )


def free_and_gravity(folder, sign=1.0):
    gravity = np.tile([0.1, -0.2, 9.8], (N, 1))
    sensor(folder, "Accelerometer.csv", sign * (ACCEL - gravity))
    sensor(folder, "Gravity.csv", sign * gravity)


def test_sensor_logger_android(tmp_path):
    sensor_logger(tmp_path)
    sensor(tmp_path, "TotalAcceleration.csv", ACCEL)
    sensor(tmp_path, "Accelerometer.csv", ACCEL * 0.0)
    log = read_log(str(tmp_path))
    assert_drive(log)
    assert log.imu.axes == "RFU"
    assert log.unix_clock
    assert log.findings == ()
    assert log.imu.source == "Gyroscope.csv, TotalAcceleration.csv"
    np.testing.assert_array_equal(log.gnss.t_ns, T_FIX)
    np.testing.assert_allclose(np.degrees(log.gnss.lat), LAT, rtol=1e-15)
    np.testing.assert_allclose(log.gnss.v_n, np.tile([2.0, 0.0, 0.0], (20, 1)), atol=1e-15)
    np.testing.assert_allclose(log.gnss.sigma_pos, np.tile([3.0, 3.0, 4.0], (20, 1)))


@pytest.mark.parametrize(("standardised", "sign"), [("false", -1.0), ("true", 1.0)])
def test_sensor_logger_ios(tmp_path, standardised, sign):
    """Core Motion's signs are opposite to Android's, unless the app has turned them."""
    sensor_logger(tmp_path, platform="ios", standardised=standardised)
    free_and_gravity(tmp_path, sign)
    assert_drive(read_log(str(tmp_path)), rtol=1e-14)  # the sum loses a digit


def test_sensor_logger_ios_uncalibrated_is_in_g(tmp_path):
    sensor_logger(tmp_path, platform="ios")
    sensor(tmp_path, "AccelerometerUncalibrated.csv", -ACCEL / STANDARD_GRAVITY)
    log = read_log(str(tmp_path))
    assert_drive(log)
    assert [f.code for f in log.findings] == ["unit-inferred"]


def test_sensor_logger_without_gravity_is_refused(tmp_path):
    sensor_logger(tmp_path)
    sensor(tmp_path, "Accelerometer.csv", ACCEL)
    with pytest.raises(LogError, match=r"Accelerometer\.csv is acceleration without gravity"):
        read_log(str(tmp_path))


def test_one_file_of_the_folder(tmp_path):
    sensor_logger(tmp_path)
    with pytest.raises(LogError, match="give the folder"):
        read_log(str(tmp_path / "Gyroscope.csv"))


def test_accelerometer_on_its_own_stamps(tmp_path):
    """A force that is linear in time comes back exactly; a hole in it is a gap, not a bridge."""
    sensor_logger(tmp_path)
    t = T0 - 4_000_000 + 7_000_000 * np.arange(290)
    t = np.delete(t, np.arange(100, 160))  # 0.42 s
    slope = np.array([1.0, -2.0, 0.5])
    force = 9.8 + np.outer((t - T0) / 1e9, slope)
    sensor(tmp_path, "TotalAcceleration.csv", force, t=t)
    log = read_log(str(tmp_path))
    left_out = (t[99] < T) & (t[100] > T)
    np.testing.assert_array_equal(log.imu.t_ns, T[~left_out])
    seconds = (log.imu.t_ns - T0) / 1e9
    np.testing.assert_allclose(log.imu.accel, 9.8 + np.outer(seconds, slope), rtol=1e-12)
    (gap,) = [f for f in log.findings if f.code == "gap"]
    assert (gap.start_ns, gap.end_ns) == (T[left_out][0], T[left_out][-1])
    assert f"{left_out.sum()} samples" in gap.text


def test_sensors_of_different_times(tmp_path):
    sensor_logger(tmp_path)
    sensor(tmp_path, "TotalAcceleration.csv", ACCEL, t=T + 10**12)
    with pytest.raises(LogError, match="share no time"):
        read_log(str(tmp_path))


# ---- phyphox ---------------------------------------------------------------------------------


def phyphox(folder, *, delimiter=",", decimal=".", accel="Acceleration", location=True, pause=0.0):
    """Times from the start; a pause of the experiment is only in meta/time.csv."""

    def sheet(name, header, columns):
        quoted = delimiter.join(f'"{part}"' for part in header.split("|"))
        put(folder / name, quoted, columns, delimiter=delimiter, decimal=decimal)

    t = s((T - T0) / 1e9, "%.9E")
    sheet(
        "Gyroscope.csv",
        "Time (s)|Gyroscope x (rad/s)|Gyroscope y (rad/s)|Gyroscope z (rad/s)|Absolute (rad/s)",
        [t, *(s(GYRO[:, j]) for j in range(3)), ["0.1"] * N],
    )
    sheet(
        "Accelerometer.csv",
        f"Time (s)|{accel} x (m/s^2)|{accel} y (m/s^2)|{accel} z (m/s^2)|Absolute (m/s^2)",
        [t, *(s(ACCEL[:, j]) for j in range(3)), ["9.8"] * N],
    )
    if location:
        sheet(
            "Location.csv",
            "Time (s)|Latitude (°)|Longitude (°)|Height (m)|Velocity (m/s)|Direction (°)|"
            "Horizontal Accuracy (m)|Vertical Accuracy (m)",
            [s((T_FIX - T0) / 1e9), s(LAT), s(LON), *([v] * 20 for v in ("200.0", "2.0", "180.0"))]
            + [["3.0"] * 20, ["4.0"] * 20],
        )
    start = T0 / 1e9
    events = [("START", 0.0, start), ("PAUSE", 1.0, start + 1.0)]
    events += [("START", 1.0, start + 1.0 + pause), ("PAUSE", 2.0, start + 2.0 + pause)]
    sheet(
        "meta/time.csv",
        "event|experiment time|system time|system time text",
        [
            [f'"{event}"' for event, _, _ in events],
            [f"{since:.9E}" for _, since, _ in events],
            [f"{system:.3f}" for _, _, system in events],
            ['"2023-11-14 22:13:20 UTC+00:00"'] * 4,
        ],
    )


@pytest.mark.parametrize(
    ("delimiter", "decimal"), [(",", "."), (";", ","), ("\t", "."), ("\t", ",")]
)
def test_phyphox(tmp_path, delimiter, decimal):
    phyphox(tmp_path, delimiter=delimiter, decimal=decimal)
    log = read_log(str(tmp_path))
    assert_drive(log)
    assert log.imu.axes == "RFU"
    assert log.unix_clock
    np.testing.assert_array_equal(log.gnss.t_ns, T_FIX)
    np.testing.assert_allclose(log.gnss.v_n, np.tile([0.0, -2.0, 0.0], (20, 1)), atol=1e-15)
    np.testing.assert_allclose(log.gnss.sigma_pos, np.tile([3.0, 3.0, 4.0], (20, 1)))


def test_phyphox_paused(tmp_path):
    phyphox(tmp_path, pause=5.0)
    after = T - T0 >= 1_000_000_000
    assert_drive(read_log(str(tmp_path)), t=np.where(after, T + 5_000_000_000, T))


def test_phyphox_without_gravity_or_without_dates(tmp_path):
    phyphox(tmp_path / "free", accel="Linear Acceleration")
    with pytest.raises(
        LogError, match=r"'Linear Acceleration x \(m/s\^2\)' is acceleration without"
    ):
        read_log(str(tmp_path / "free"))
    phyphox(tmp_path / "undated")
    (tmp_path / "undated" / "meta" / "time.csv").unlink()
    log = read_log(str(tmp_path / "undated"))
    assert not log.unix_clock
    assert_drive(log, t=T - T0)


# ---- gnss-ins-sim ----------------------------------------------------------------------------


def gnss_ins_sim(folder):
    put(folder / "time.csv", "time (sec)", [s((T - T0) / 1e9)])
    put(
        folder / "gyro-0.csv",
        "gyro_x (deg/s),gyro_y (deg/s),gyro_z (deg/s)",
        [s(np.degrees(GYRO[:, j])) for j in range(3)],
    )
    put(
        folder / "accel-0.csv",
        "accel_x (m/s^2),accel_y (m/s^2),accel_z (m/s^2)",
        [s(ACCEL[:, j]) for j in range(3)],
    )
    put(folder / "gps_time.csv", "gps_time (sec)", [s((T_FIX - T0) / 1e9)])
    put(
        folder / "gps-0.csv",
        "gps_lat (deg),gps_lon (deg),gps_alt (m),gps_vN (m/s),gps_vE (m/s),gps_vD (m/s)",
        [s(LAT), s(LON), *([v] * 20 for v in ("200.0", "1.0", "2.0", "-3.0"))],
    )


def test_gnss_ins_sim(tmp_path):
    gnss_ins_sim(tmp_path)
    log = read_log(str(tmp_path))
    assert_drive(log, t=T - T0, rtol=2 * TWO_ROUNDINGS)
    assert (log.imu.axes, log.imu.axes_declared) == ("FRD", True)
    assert not log.unix_clock
    np.testing.assert_array_equal(log.gnss.t_ns, T_FIX - T0)
    np.testing.assert_allclose(np.degrees(log.gnss.lon), LON, rtol=1e-15)
    np.testing.assert_allclose(log.gnss.v_n, np.tile([2.0, 1.0, 3.0], (20, 1)))


def test_gnss_ins_sim_written_half(tmp_path):
    gnss_ins_sim(tmp_path)
    file = tmp_path / "gyro-0.csv"
    file.write_text("\n".join(file.read_text().splitlines()[:100]) + "\n")
    with pytest.raises(FormatError, match="have 200, 99 and 200 rows"):
        read_log(str(tmp_path))


# ---- KITTI OXTS ------------------------------------------------------------------------------


def kitti(folder, *, skip=()):
    data = folder / "oxts" / "data"
    data.mkdir(parents=True)
    stamps = [str(np.datetime64(int(t), "ns")).replace("T", " ") for t in T]
    (folder / "oxts" / "timestamps.txt").write_text("\n".join(stamps) + "\n")
    for k in range(N):
        packet = np.zeros(30)
        packet[:3] = 49.0 + 1e-6 * k, 8.4, 112.0
        packet[6:11] = 1.0, 2.0, 9.0, 9.0, 3.0  # vn, ve, forward, left, up
        packet[11:14], packet[17:20] = ACCEL[k], GYRO[k]
        packet[23:25] = 0.05, 0.02
        if k not in skip:
            (data / f"{k:010d}.txt").write_text(" ".join(s(packet)))


@pytest.mark.parametrize("inside", ["", "oxts"])
def test_kitti_oxts(tmp_path, inside):
    kitti(tmp_path)
    log = read_log(str(tmp_path / inside))
    assert_drive(log, rtol=0.0)
    assert (log.imu.axes, log.imu.axes_declared) == ("FLU", True)
    assert log.findings == ()
    np.testing.assert_allclose(np.degrees(log.gnss.lat), 49.0 + 1e-6 * np.arange(N), rtol=1e-15)
    np.testing.assert_array_equal(log.gnss.v_n, np.tile([2.0, 1.0, 3.0], (N, 1)))
    np.testing.assert_array_equal(log.gnss.sigma_pos, np.full((N, 3), 0.05))
    np.testing.assert_array_equal(log.gnss.sigma_vel, np.full((N, 3), 0.02))


def test_kitti_with_lost_packets(tmp_path):
    kitti(tmp_path, skip=(17, 18))
    log = read_log(str(tmp_path))
    np.testing.assert_array_equal(log.imu.t_ns, np.delete(T, [17, 18]))
    assert log.damaged
    assert "2 of 200 packets missing" in log.findings[0].text


# ---- others ----------------------------------------------------------------------------------


def test_folders_that_are_no_recording(tmp_path):
    (tmp_path / "notes.txt").write_text("nothing")
    with pytest.raises(LogError, match=r"a folder of no known kind \(.*KITTI OXTS.*notes\.txt"):
        read_log(str(tmp_path))
    (tmp_path / "drive_0.db3").write_bytes(b"SQLite format 3\0")
    with pytest.raises(LogError, match="rosbags-convert --src"):
        read_log(str(tmp_path))
