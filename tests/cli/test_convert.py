"""``vehnav convert``: trajectories to other formats, logs to clean logs equal bit for bit."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from drives import Circle, gnss_of, trajectory_of

from vehnav.cli.main import cli
from vehnav.export.formats import read_trajectory, write_trajectory
from vehnav.logs.log import Gnss, Imu, Log, ReadOptions, Speed
from vehnav.logs.read import read_log


def run(*args: object) -> Result:
    return CliRunner().invoke(cli, ["convert", *map(str, args)])


@pytest.fixture(scope="module")
def trajectory_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("convert") / "trajectory.csv"
    circle = Circle()
    t = np.arange(0.0, 60.0, 0.02)
    made = trajectory_of(t, circle.enu(t), circle.v(t), circle.heading(t))
    write_trajectory(made, path)
    return path


SUFFIXES = (".csv", ".parquet", ".json", ".tum", ".kitti", ".gpx", ".kml", ".geojson", ".mcap")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_trajectory_to_every_format(trajectory_file: Path, tmp_path: Path, suffix: str) -> None:
    result = run(trajectory_file, tmp_path / f"a{suffix}")
    assert result.exit_code == 0, result.stderr
    assert (tmp_path / f"a{suffix}").stat().st_size > 100
    assert f"a{suffix}" in result.stdout


def test_there_and_back(trajectory_file: Path, tmp_path: Path) -> None:
    """CSV -> TUM -> CSV at 10 Hz: the same instants, the same places to 0.1 mm."""
    first, last = tmp_path / "a.tum", tmp_path / "b.csv"
    assert run(trajectory_file, first, "--output-rate", 10).exit_code == 0
    assert run(first, last, "--quiet").stdout == ""
    ours, back = read_trajectory(trajectory_file), read_trajectory(last)
    kept = np.isin(ours.t_ns, back.t_ns)
    assert back.size == kept.sum() == 601
    origin = (ours.lat[0], ours.lon[0], ours.height[0])
    assert back.enu(origin) == pytest.approx(ours.rows(kept).enu(origin), abs=1e-4)


def log_files(folder: Path) -> tuple[Path, list[str]]:
    """A CSV recording on FRD in deg/s and g, its GPS and speed beside it, and the options."""
    rng = np.random.default_rng(8)
    t = 1_711_483_800_000_000_000 + np.arange(2000, dtype=np.int64) * 10_000_001
    gyro, accel = rng.normal(0.0, 5.0, (2000, 3)), rng.normal(0.0, 0.1, (2000, 3))
    accel[:, 2] -= 1.0
    rows = zip(t.tolist(), gyro.tolist(), accel.tolist(), strict=True)
    text = "".join(f"{s},{','.join(map(repr, g + f))}\n" for s, g, f in rows)
    path = folder / "raw.csv"
    path.write_text("stamp,wx,wy,wz,fx,fy,fz\n" + text)
    fixes = gnss_of(np.arange(0.0, 20.0), rng.normal(0.0, 3.0, (20, 3)))
    degrees = np.degrees(np.column_stack([fixes.lat, fixes.lon])).tolist()
    places = zip(fixes.t_ns.tolist(), degrees, strict=True)
    text = "".join(f"{s},{a!r},{b!r},30.125,1.5,1.7,{np.pi!r}\n" for s, (a, b) in places)
    names = "t_ns,lat_deg,lon_deg,height_m,sigma_east_m,sigma_north_m,sigma_up_m\n"
    (folder / "fixes.csv").write_text(names + text)
    wheels = zip(t[::50].tolist(), rng.uniform(0.0, 20.0, 40).tolist(), strict=True)
    text = "".join(f"{s},{v!r}\n" for s, v in wheels)
    (folder / "wheels.csv").write_text("t_ns,speed_m_s\n" + text)
    columns = "t_ns=stamp,gyro_x=wx,gyro_y=wy,gyro_z=wz,accel_x=fx,accel_y=fy,accel_z=fz"
    options = ["--columns", columns, "--gyro-unit", "deg/s", "--accel-unit", "g"]
    beside = ["--gps-file", str(folder / "fixes.csv"), "--speed-file", str(folder / "wheels.csv")]
    return path, [*options, *beside]


def same(a: object, b: object, fields: tuple[str, ...]) -> None:
    for name in fields:
        x, y = getattr(a, name), getattr(b, name)
        assert (x is None) == (y is None), name
        if x is not None:
            assert np.array_equal(x, y), name


@pytest.mark.parametrize("suffix", [".mcap", ".csv"])
def test_a_log_reads_back_bit_for_bit(tmp_path: Path, suffix: str) -> None:
    path, options = log_files(tmp_path)
    clean = tmp_path / f"clean{suffix}"
    result = run(path, clean, "--axes", "FRD", *options)
    assert result.exit_code == 0, result.stderr
    read = ReadOptions(
        columns=dict(pair.split("=") for pair in options[1].split(",")),
        gyro_unit="deg/s",
        accel_unit="g",
        gps_file=options[-3],
        speed_file=options[-1],
    )
    raw, back = read_log(str(path), read), read_log(str(clean))
    assert isinstance(raw.imu, Imu)
    assert isinstance(back.imu, Imu)
    # FRD to FLU turns the signs of y and z; to RFU it exchanges x and y, too
    turn = {
        ".mcap": np.diag([1.0, -1.0, -1.0]),
        ".csv": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]),
    }[suffix]
    assert np.array_equal(back.imu.t_ns, raw.imu.t_ns)
    assert np.array_equal(back.imu.gyro, raw.imu.gyro @ turn)
    assert np.array_equal(back.imu.accel, raw.imu.accel @ turn)
    assert back.imu.axes == {".mcap": "FLU", ".csv": "RFU"}[suffix]
    assert isinstance(back.gnss, Gnss)
    same(back.gnss, raw.gnss, ("t_ns", "lat", "lon", "height", "v_n", "sigma_pos", "sigma_vel"))
    assert isinstance(back.speed, Speed)
    same(back.speed, raw.speed, ("t_ns", "speed"))


def test_the_clean_mcap_is_standard(tmp_path: Path) -> None:
    """Read by the official reader and decoder, not by ours."""
    reader = pytest.importorskip("mcap.reader")
    ros2 = pytest.importorskip("mcap_ros2.decoder")
    path, options = log_files(tmp_path)
    assert run(path, tmp_path / "a.mcap", "--axes", "FRD", *options).exit_code == 0
    first: dict[str, object] = {}
    with (tmp_path / "a.mcap").open("rb") as file:
        messages = reader.make_reader(
            file, validate_crcs=True, decoder_factories=[ros2.DecoderFactory()]
        )
        for schema, _, _, decoded in messages.iter_decoded_messages():
            first.setdefault(schema.name, decoded)
    assert set(first) == {
        "sensor_msgs/msg/Imu",
        "sensor_msgs/msg/NavSatFix",
        "geometry_msgs/msg/TwistStamped",
    }
    line = path.read_text().splitlines()[1].split(",")
    imu = first["sensor_msgs/msg/Imu"]
    assert imu.angular_velocity.z == pytest.approx(-np.radians(float(line[3])), rel=1e-15)
    assert imu.linear_acceleration.z == pytest.approx(-9.80665 * float(line[6]), rel=1e-15)


def test_axes_that_gravity_contradicts_are_refused(tmp_path: Path) -> None:
    path, options = log_files(tmp_path)
    result = run(path, tmp_path / "a.mcap", *options)
    assert result.exit_code == 2
    assert "Set --axes" in result.stderr
    assert not (tmp_path / "a.mcap").exists()


def test_a_stale_file_beside_is_not_adopted(tmp_path: Path) -> None:
    path, options = log_files(tmp_path)
    (tmp_path / "a.speed.csv").write_text("t_ns,speed_m_s\n1,2\n")
    result = run(path, tmp_path / "a.csv", "--axes", "FRD", *options[:6])
    assert result.exit_code == 2
    assert "a.speed.csv: stands beside" in result.stderr


def test_a_log_to_a_map_is_its_gps_track(tmp_path: Path) -> None:
    path, options = log_files(tmp_path)
    result = run(path, tmp_path / "a.gpx", *options)
    assert result.exit_code == 0, result.stderr
    assert "is the GPS track" in result.stderr
    assert "<trkpt" in (tmp_path / "a.gpx").read_text()
    without = run(path, tmp_path / "b.gpx", *options[:6])
    assert without.exit_code == 2
    assert "no GPS track" in without.stderr


def test_json_and_wrong_names(trajectory_file: Path, tmp_path: Path) -> None:
    document = json.loads(run(trajectory_file, tmp_path / "a.tum", "--json").stdout)
    assert document["files"] == [str(tmp_path / "a.tum")]
    unknown = run(trajectory_file, tmp_path / "a.xyz")
    assert unknown.exit_code == 2
    assert ".geojson" in unknown.stderr
    nowhere = run(trajectory_file, tmp_path / "no" / "a.csv")
    assert nowhere.exit_code == 2
    assert run(tmp_path / "none.mcap", tmp_path / "a.csv").exit_code == 2


REAL = [
    ("kitti_oxts/2011_09_30_drive_0027.mcap", [], ".mcap"),
    ("kitti_oxts/2011_09_30_drive_0027.mcap", [], ".csv"),
    ("boston_apan/driving.mcap", ["--axes", "FRD"], ".mcap"),
    ("dresden_balzer/2014-03-26-000-Data.full.csv", [], ".mcap"),
    *(
        pytest.param(name, ["--axes", axes], suffix, marks=pytest.mark.slow)
        for name, axes, suffix in (
            ("boston_apan/driving.mcap", "FRD", ".csv"),
            ("drive_0708/drive_0708.mcap", "BRU", ".mcap"),
            ("drive_0708/drive_0708.mcap", "BRU", ".csv"),
        )
    ),
]


@pytest.mark.parametrize(("name", "options", "suffix"), REAL)
def test_real_logs_twice_are_the_same(shared_data, tmp_path, name, options, suffix) -> None:
    """The clean log of a clean log is the same log; its numbers are those of the first."""
    first, second = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    assert run(shared_data / name, first, *options).exit_code == 0
    assert run(first, second).exit_code == 0
    raw, a, b = read_log(str(shared_data / name)), read_log(str(first)), read_log(str(second))
    assert all(isinstance(log, Log) and log.imu is not None for log in (raw, a, b))
    same(a.imu, b.imu, ("t_ns", "gyro", "accel"))
    same(a.gnss, raw.gnss, ("t_ns", "lat", "lon", "height", "v_n", "sigma_pos"))
    assert np.array_equal(np.sort(np.abs(a.imu.gyro)), np.sort(np.abs(raw.imu.gyro)))
    assert np.array_equal(np.sort(np.abs(a.imu.accel)), np.sort(np.abs(raw.imu.accel)))


def test_axes_and_units_that_the_drive_shows_are_made_clean(shared_data, tmp_path) -> None:
    """boston is FRD in a ROS log: the same file with and without --axes FRD."""
    source = shared_data / "boston_apan/driving.mcap"
    given, alone = tmp_path / "given.mcap", tmp_path / "alone.mcap"
    assert run(source, given, "--axes", "FRD").exit_code == 0
    result = run(source, alone)
    assert result.exit_code == 0
    assert "axes FRD, by departures and arrivals" in result.stderr
    assert given.read_bytes() == alone.read_bytes()


def test_units_are_made_si(tmp_path) -> None:
    """A drive in deg/s and g, said to be rad/s and m/s2, becomes the drive in SI."""
    from tests.test_axes_auto import made, turned

    drive, raw = turned(made(), "FRD"), turned(made(), "FRD", "deg/s", "g")
    for name, log in (("si", drive), ("raw", raw)):
        assert log.imu is not None
        rows = np.column_stack([log.imu.gyro, log.imu.accel]).tolist()
        lines = [
            ",".join([str(t), *map(repr, row)]) for t, row in zip(log.imu.t_ns, rows, strict=True)
        ]
        head = "t_ns,wx,wy,wz,ax,ay,az"
        (tmp_path / f"{name}.csv").write_text("\n".join([head, *lines]) + "\n")
    columns = "gyro_x=wx,gyro_y=wy,gyro_z=wz,accel_x=ax,accel_y=ay,accel_z=az"
    for name in ("si", "raw"):
        target = tmp_path / f"{name}.mcap"
        result = run(tmp_path / f"{name}.csv", target, "--columns", columns)
        assert result.exit_code == 0, result.stderr
    si, raw_back = (read_log(str(tmp_path / f"{name}.mcap")).imu for name in ("si", "raw"))
    assert isinstance(si, Imu)
    assert isinstance(raw_back, Imu)
    np.testing.assert_allclose(raw_back.gyro, si.gyro, rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(raw_back.accel, si.accel, rtol=1e-12, atol=1e-15)
