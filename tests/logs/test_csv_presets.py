"""One drive through every CSV preset comes back as the same arrays."""

from __future__ import annotations

import numpy as np
import pytest

from vehnav.errors import LogError
from vehnav.logs.columns import QUANTITIES, TIMES
from vehnav.logs.csv import read_csv, read_csv_gnss
from vehnav.logs.log import ReadOptions
from vehnav.logs.presets import PRESETS
from vehnav.logs.read import read_log
from vehnav.units import ACCEL_UNITS, GYRO_UNITS

OPTIONS = ReadOptions()
N = 60
T0 = 1_700_000_000_120_000_000  # whole centiseconds, so that every layout can hold the stamps
T = T0 + 10_000_000 * np.arange(N)
_RNG = np.random.default_rng(5)
GYRO = _RNG.normal(size=(N, 3)) * 0.1
ACCEL = _RNG.normal(size=(N, 3)) * 0.3 + [0.0, 0.0, 9.81]
FIX_EVERY = 10
LAT = 50.0 + 1e-5 * (np.arange(N) // FIX_EVERY)
LON = 14.5 - 1e-5 * (np.arange(N) // FIX_EVERY)
HEIGHT = 250.0 + 0.5 * (np.arange(N) // FIX_EVERY)
SPEED, COURSE = 7.2, 60.0
HAS_FIXES = {"sensorlog", "racebox", "dresden"}
TWO_ROUNDINGS = 1e-15


def s(values, form="%.17g"):
    return [form % v for v in values]


def table(header, columns, delimiter=","):
    lines = [delimiter.join(row) for row in zip(*columns, strict=True)]
    return "\n".join([*([header] if header else []), *lines, ""])


def gyro(unit="rad/s"):
    return [s(GYRO[:, j] / GYRO_UNITS[unit]) for j in range(3)]


def accel(unit="m/s2", sign=1):
    return [s(sign * ACCEL[:, j] / ACCEL_UNITS[unit]) for j in range(3)]


def ns():
    return s(T, "%d")


def dates(form="%sZ"):
    return [form % str(np.datetime64(int(t), "ns"))[:23] for t in T]


def xyz(name):
    return ",".join(name.replace("?", axis) for axis in "xyz")


def euroc():
    header = (
        "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
        "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]"
    )
    return table(header, [ns(), *gyro(), *accel()])


def rostopic():
    header = (
        "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.orientation.x,"
        + xyz("field.angular_velocity.?")
        + ",field.angular_velocity_covariance0,"
        + xyz("field.linear_acceleration.?")
    )
    columns = [s(T + 2_000_000, "%d"), s(range(N), "%d"), ns(), ["imu_link"] * N, ["0.0"] * N]
    return table(header, [*columns, *gyro(), ["0.01"] * N, *accel()])


def bagpy(prefix=""):
    header = (
        f"Time,{prefix}header.seq,{prefix}header.stamp.secs,{prefix}header.stamp.nsecs,"
        f"{prefix}header.frame_id,"
        + xyz(f"{prefix}angular_velocity.?")
        + ","
        + xyz(f"{prefix}linear_acceleration.?")
    )
    columns = [
        s((T + 2_000_000) / 1e9, "%.6f"),
        s(range(N), "%d"),
        s(T // 10**9, "%d"),
        s(T % 10**9, "%d"),
        ["imu"] * N,
    ]
    return table(header, [*columns, *gyro(), *accel()])


def ros2_csv():
    header = (
        "header.stamp.sec,header.stamp.nanosec,header.frame_id,"
        + xyz("angular_velocity.?")
        + ","
        + xyz("linear_acceleration.?")
    )
    columns = [s(T // 10**9, "%d"), s(T % 10**9, "%d"), ["imu"] * N]
    return table(header, [*columns, *gyro(), *accel()])


def sensorlog():
    header = (
        "loggingTime(txt),loggingSample(N),locationTimestamp_since1970(s),"
        "locationLatitude(WGS84),locationLongitude(WGS84),locationAltitude(m),locationSpeed(m/s),"
        "locationCourse(°),locationHorizontalAccuracy(m),"
        "accelerometerTimestamp_sinceReboot(s),accelerometerAccelerationX(G),"
        "accelerometerAccelerationY(G),accelerometerAccelerationZ(G),"
        "gyroTimestamp_sinceReboot(s),gyroRotationX(rad/s),gyroRotationY(rad/s),gyroRotationZ(rad/s),"
        "motionUserAccelerationX(G)"
    )
    zone = [f"{str(np.datetime64(int(t) + 7_200_000_000_000, 'ns'))[:23]} +0200" for t in T]
    columns = [
        [text.replace("T", " ") for text in zone],
        s(range(N), "%d"),
        s(1.7e9 + np.arange(N) // FIX_EVERY, "%.3f"),
        *(s(column) for column in (LAT, LON, HEIGHT)),
        [str(SPEED)] * N,
        [str(COURSE)] * N,
        ["5.0"] * N,
        s((T - T0) / 1e9 + 5000.0, "%.6f"),
        *accel("g", -1),
        s((T - T0) / 1e9 + 5000.0, "%.6f"),
        *gyro(),
        ["0.001"] * N,
    ]
    return table(header, columns)


def sensorlog_old():
    """An older version: the same names without their units."""
    text = sensorlog()
    header, _, rows = text.partition("\n")
    names = ",".join(name.partition("(")[0] for name in header.split(","))
    return names + "\n" + rows


def racebox():
    header = "Record,Time,Latitude,Longitude,Altitude,Speed," + xyz("GForce?").upper() + ",Lap,"
    header += xyz("Gyro?").upper()
    columns = [
        s(range(N), "%d"),
        dates(),
        *(s(column) for column in (LAT, LON, HEIGHT)),
        ["26.0"] * N,
        *accel("g"),
        ["0"] * N,
        *gyro("deg/s"),
    ]
    return table(header, columns)


def dresden():
    header = (
        "date,time,millis,ax,ay,az,rollrate,pitchrate,yawrate,roll,pitch,yaw,speed,course,"
        "latitude,longitude,altitude,pdop"
    )
    columns = [
        ["260314"] * N,
        s(123803400 + 100 * (np.arange(N) // FIX_EVERY), "%d"),
        s(T / 1e6, "%.2f"),
        *accel(),
        *gyro("deg/s"),
        *([["0"] * N] * 3),
        [str(SPEED * 3.6)] * N,
        [str(COURSE)] * N,
        *(s(column) for column in (LAT, LON, HEIGHT)),
        ["4.7"] * N,
    ]
    return table(header, columns)


def vehnav():
    return table(f"t_ns,{xyz('gyro_?')},{xyz('accel_?')}", [ns(), *gyro(), *accel()])


WRITERS = {
    "euroc": euroc,
    "rostopic": rostopic,
    "bagpy": bagpy,
    "bagpy, nested": lambda: bagpy("imu."),
    "ros2-csv": ros2_csv,
    "sensorlog": sensorlog,
    "sensorlog, old": sensorlog_old,
    "racebox": racebox,
    "dresden": dresden,
    "vehnav": vehnav,
}
AXES = {"sensorlog": "RFU", "vehnav": "RFU", "euroc": "", "racebox": ""}
"""FLU for the others; "": the layout says nothing."""


@pytest.mark.parametrize("case", WRITERS)
def test_the_same_drive(tmp_path, case):
    path = tmp_path / "drive.csv"
    path.write_text(WRITERS[case](), encoding="utf-8")
    name = case.partition(",")[0]
    log = read_csv(str(path), OPTIONS)
    assert log.contents[0]["type"] == f"IMU (CSV, {name})"
    np.testing.assert_array_equal(log.imu.t_ns, T)
    np.testing.assert_allclose(log.imu.gyro, GYRO, rtol=TWO_ROUNDINGS)
    np.testing.assert_allclose(log.imu.accel, ACCEL, rtol=TWO_ROUNDINGS)
    assert log.imu.axes == AXES.get(name, "FLU")
    assert not log.imu.axes_declared
    assert {f.code for f in log.findings} <= {"clock-choice"}
    assert (log.gnss is not None) == (name in HAS_FIXES)
    forced = read_csv(str(path), ReadOptions(preset=name))
    np.testing.assert_array_equal(forced.imu.accel, log.imu.accel)


@pytest.mark.parametrize("case", ["sensorlog", "racebox", "dresden"])
def test_fixes_in_the_same_rows(tmp_path, case):
    path = tmp_path / "drive.csv"
    path.write_text(WRITERS[case](), encoding="utf-8")
    gnss = read_csv(str(path), OPTIONS).gnss
    np.testing.assert_array_equal(gnss.t_ns, T[::FIX_EVERY])
    np.testing.assert_allclose(np.degrees(gnss.lat), LAT[::FIX_EVERY], rtol=1e-15)
    np.testing.assert_allclose(gnss.height, HEIGHT[::FIX_EVERY])
    if case != "racebox":  # it has no course
        angle = np.radians(COURSE)
        v_n = SPEED * np.array([np.sin(angle), np.cos(angle), 0.0])
        np.testing.assert_allclose(gnss.v_n, np.tile(v_n, (len(gnss.t_ns), 1)), atol=1e-12)
    if case == "sensorlog":
        np.testing.assert_array_equal(gnss.sigma_pos[:, :2], 5.0)


def test_every_preset_is_tried_and_names_known_quantities():
    tried = {case.partition(",")[0] for case in WRITERS} | {
        "kf-gins",
        "kf-gins-gnss",
        "kf-gins-nav",
    }
    assert {preset.name for preset in PRESETS} == tried
    for preset in PRESETS:
        assert set(preset.columns) <= set(QUANTITIES) | set(TIMES)


def test_a_row_without_speed(tmp_path):
    text = sensorlog().replace(f",{SPEED},", ",-1.0,", 15)  # the first fix and half of the second
    path = tmp_path / "drive.csv"
    path.write_text(text, encoding="utf-8")
    log = read_csv(str(path), OPTIONS)
    assert log.gnss.v_n is None  # 2 of 6 have none
    assert "gps-velocity-missing" in {f.code for f in log.findings}


# ---- without a header ------------------------------------------------------------------------

SOW = 456_300.0


def kf_gins_imu(form="%.10f", delimiter=" "):
    """Increments over the step before each stamp, in GPS seconds of the week."""
    t = s(SOW + (T - T0) / 1e9, "%.4f")
    columns = [[form % v for v in x[:, j] * 0.01] for x in (GYRO, ACCEL) for j in range(3)]
    return table("", [t, *columns], delimiter)


@pytest.mark.parametrize("delimiter", [" ", ",", "\t", "   "])
def test_kf_gins(tmp_path, delimiter):
    path = tmp_path / "Leador-A15.txt"
    path.write_text(kf_gins_imu(delimiter=delimiter))
    log = read_log(str(path))
    assert log.imu.sampling == "increments"
    assert (log.imu.axes, log.imu.axes_declared) == ("FRD", True)
    assert not log.unix_clock
    np.testing.assert_array_equal(log.imu.t_ns, round(SOW * 1e9) + (T - T0))
    half_a_digit = 5.1e-11
    np.testing.assert_allclose(log.imu.gyro, GYRO * 0.01, atol=half_a_digit, rtol=0)
    np.testing.assert_allclose(log.imu.accel, ACCEL * 0.01, atol=half_a_digit, rtol=0)


def test_rates_without_a_header_are_not_taken_for_increments(tmp_path):
    path = tmp_path / "x.txt"
    path.write_text(table("", [s(SOW + (T - T0) / 1e9, "%.4f"), *gyro(), *accel()], " "))
    with pytest.raises(LogError, match="no column for gyro_x"):
        read_log(str(path))


def test_kf_gins_fixes_and_truth(tmp_path):
    k = np.arange(20)
    lat, lon = 30.4 + 1e-5 * k, 114.4 + 0 * k
    position = [s(lat, "%.12f"), s(lon, "%.12f"), s(20.0 + 0.0 * k, "%.3f")]
    fixes = [s(SOW + k, "%.3f"), *position, ["0.01"] * 20, ["0.02"] * 20, ["0.03"] * 20]
    truth = [
        ["2017"] * 20,
        s(SOW + k, "%.3f"),
        *position,
        *(["1.1"] * 20, ["2.2"] * 20, ["-0.3"] * 20, ["0.5"] * 20, ["1.5"] * 20, ["90.5"] * 20),
    ]
    (tmp_path / "GNSS_RTK.pos").write_text(table("", fixes, " "))
    (tmp_path / "truth.nav").write_text(table("", truth, " "))
    (tmp_path / "imu.txt").write_text(kf_gins_imu())
    options = ReadOptions(gps_file=str(tmp_path / "GNSS_RTK.pos"))
    gnss = read_log(str(tmp_path / "imu.txt"), options).gnss
    np.testing.assert_array_equal(gnss.t_ns, round(SOW * 1e9) + 10**9 * k)
    np.testing.assert_allclose(np.degrees(gnss.lat), lat, rtol=1e-14)
    np.testing.assert_allclose(gnss.sigma_pos, np.tile([0.02, 0.01, 0.03], (20, 1)))
    gnss, _ = read_csv_gnss(str(tmp_path / "truth.nav"), OPTIONS)
    np.testing.assert_array_equal(gnss.t_ns, round(SOW * 1e9) + 10**9 * k)
    np.testing.assert_allclose(gnss.v_n, np.tile([2.2, 1.1, 0.3], (20, 1)))


# ---- gravity ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("names", "writer"),
    [
        ("Linear Acceleration ? (m/s^2)", "phyphox"),
        ("motionUserAcceleration?(G)", "Core Motion"),
        ("FreeAcc_?", "Xsens"),
        ("lin_acc_?", "Android"),
    ],
)
def test_acceleration_without_gravity_is_refused_by_name(tmp_path, names, writer):
    path = tmp_path / "drive.csv"
    header = f"t_ns,{xyz('gyro_?')},{xyz(names)}"
    path.write_text(table(header, [ns(), *gyro(), *accel()]))
    first = names.replace("?", "x")
    with pytest.raises(LogError) as error:
        read_csv(str(path), OPTIONS)
    assert f"column {first!r} is acceleration without gravity ({writer})" in str(error.value)
    declared = {f"accel_{axis}": names.replace("?", axis) for axis in "xyz"}
    log = read_csv(str(path), ReadOptions(columns=declared, accel_unit="m/s2"))
    np.testing.assert_array_equal(log.imu.accel, ACCEL)  # declared by hand: the user knows


def test_gravity_beside_a_total_is_no_trouble(tmp_path):
    path = tmp_path / "drive.csv"
    header = f"t_ns,{xyz('gyro_?')},{xyz('accel_?')},{xyz('FreeAcc_?')}"
    path.write_text(table(header, [ns(), *gyro(), *accel(), *accel()]))
    np.testing.assert_array_equal(read_csv(str(path), OPTIONS).imu.accel, ACCEL)
