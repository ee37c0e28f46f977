"""Every format read back, by a reader that is not ours where there is one."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from drives import ORIGIN, T0_NS, gnss_of
from pyproj import Transformer

from vehnav.errors import ConfigError, FormatError, LogError
from vehnav.evaluation import compare
from vehnav.export.formats import FORMATS, read_trajectory, write_trajectory
from vehnav.export.thinning import keep_points
from vehnav.rotation import angles_from_c_nb
from vehnav.trajectory import Trajectory, interpolate_positions

READABLE = [s for f in FORMATS if f.read is not None for s in f.suffixes]
WRITABLE = [s for f in FORMATS for s in f.suffixes]
MICRO_DEGREE = np.radians(1e-6)


def angles(trajectory: Trajectory) -> np.ndarray:
    return np.column_stack(angles_from_c_nb(trajectory.c_nb))


@pytest.mark.parametrize("suffix", READABLE)
def test_read_back(drive: Trajectory, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"drive{suffix}"
    write_trajectory(drive, path)
    back = read_trajectory(path)
    assert np.array_equal(back.t_ns, drive.t_ns)  # int ns, not one lost
    east, north, up = back.enu(ORIGIN).T - drive.enu(ORIGIN).T
    assert np.abs(east).max() < 1e-4  # four decimals of a metre, or better
    assert np.abs(north).max() < 1e-4
    assert np.abs(up).max() < 1e-4
    turn = np.remainder(angles(back) - angles(drive) + np.pi, 2 * np.pi) - np.pi
    assert np.abs(turn).max() < 10 * MICRO_DEGREE
    if suffix in (".tum", ".kitti"):
        # velocities are differences: v' dt / 2 = 2.4 m/s2 * 0.02 s at most
        assert np.abs(back.v_n - drive.v_n).max() < 0.06
    else:
        assert np.abs(back.v_n - drive.v_n).max() < 1e-5
        assert np.array_equal(back.stopped, drive.stopped)
        assert back.sigma_pos == pytest.approx(drive.sigma_pos, abs=1e-4)
        assert back.sigma_heading == pytest.approx(drive.sigma_heading, abs=MICRO_DEGREE * 10)


@pytest.mark.parametrize("suffix", WRITABLE)
def test_nan_is_refused_and_no_file_left(drive: Trajectory, tmp_path: Path, suffix: str) -> None:
    height = drive.height.copy()
    height[7] = np.nan
    with pytest.raises(ValueError, match="height"):
        write_trajectory(replace(drive, height=height), tmp_path / f"drive{suffix}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", WRITABLE)
def test_nothing_but_the_files_is_left(drive: Trajectory, tmp_path: Path, suffix: str) -> None:
    write_trajectory(drive, tmp_path / f"drive{suffix}")
    beside = {".tum": {"drive.origin.json"}, ".kitti": {"drive.origin.json", "drive.times.txt"}}
    expected = {f"drive{suffix}"} | beside.get(suffix, set())
    assert {item.name for item in tmp_path.iterdir()} == expected


def test_csv_is_the_contract(drive: Trajectory, tmp_path: Path) -> None:
    """Header and text by the csv module; no pandas, none of our code."""
    path = tmp_path / "trajectory.csv"
    write_trajectory(drive, path)
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    names = (
        "time_s,lat_deg,lon_deg,height_m,v_east_m_s,v_north_m_s,v_up_m_s,heading_deg,pitch_deg,"
        "roll_deg,stopped,sigma_east_m,sigma_north_m,sigma_up_m,sigma_heading_deg"
    )
    assert ",".join(rows[0]) == names
    assert len(rows) == drive.size
    assert rows[0]["time_s"] == "1711483800.123456789"
    assert float(rows[-1]["lat_deg"]) == pytest.approx(np.degrees(drive.lat[-1]), abs=1e-10)
    assert {row["stopped"] for row in rows} == {"0", "1"}
    heading = [float(row["heading_deg"]) for row in rows]
    assert heading[0] == pytest.approx(90.0, abs=1e-5)
    assert 0.0 <= min(heading) <= max(heading) < 360.0 + 1e-9
    bare = replace(drive, sigma_pos=None, sigma_heading=None)
    write_trajectory(bare, path)
    assert "sigma" not in path.read_text().splitlines()[0]


def test_csv_from_log_start(drive: Trajectory, tmp_path: Path) -> None:
    write_trajectory(
        replace(drive, t_ns=drive.t_ns - drive.t_ns[0]), tmp_path / "a.csv", unix_clock=False
    )
    assert (tmp_path / "a.csv").read_text().splitlines()[1].startswith("0.000000000,")
    assert np.array_equal(read_trajectory(tmp_path / "a.csv").t_ns, drive.t_ns - drive.t_ns[0])


def test_output_rate(drive: Trajectory, tmp_path: Path) -> None:
    """States are chosen, not interpolated; the first and the last are among them."""
    write_trajectory(drive, tmp_path / "a.csv", rate_hz=10.0)
    back = read_trajectory(tmp_path / "a.csv")
    assert np.isin(back.t_ns, drive.t_ns).all()
    assert back.t_ns[0] == drive.t_ns[0]
    assert back.t_ns[-1] == drive.t_ns[-1]
    assert back.size == 601
    assert np.unique(np.diff(back.t_ns[:-1])).tolist() == [100_000_000]


def test_tum_read_by_evo(drive: Trajectory, tmp_path: Path) -> None:
    """Positions judged by pyproj's topocentric transform, axes by their meaning."""
    file_interface = pytest.importorskip("evo.tools.file_interface")
    path = tmp_path / "drive.tum"
    write_trajectory(drive, path)
    theirs = file_interface.read_tum_trajectory_file(str(path))
    assert theirs.timestamps == pytest.approx(drive.t_ns * 1e-9, abs=1e-6)
    lat0, lon0 = float(np.degrees(drive.lat[0])), float(np.degrees(drive.lon[0]))
    h0 = float(drive.height[0])
    judge = Transformer.from_pipeline(
        "+proj=pipeline +step +proj=cart +ellps=WGS84 "
        f"+step +proj=topocentric +ellps=WGS84 +lon_0={lon0!r} +lat_0={lat0!r} +h_0={h0!r}"
    )
    enu = np.column_stack(
        judge.transform(np.degrees(drive.lon), np.degrees(drive.lat), drive.height)
    )
    assert theirs.positions_xyz == pytest.approx(enu, abs=2e-6)
    ok, details = theirs.check()
    assert ok, details
    pose = theirs.poses_se3[0]
    # heading east, nose 0.0212 rad up: the x axis of the body (forward) is east and a little up
    assert pose[:3, 0] == pytest.approx([np.cos(0.02123), 0.0, np.sin(0.02123)], abs=1e-4)
    assert pose[1, 1] > 0.99  # its y axis (left) is north
    assert pose[2, 2] > 0.99  # its z axis is up


def test_kitti_read_by_evo(drive: Trajectory, tmp_path: Path) -> None:
    file_interface = pytest.importorskip("evo.tools.file_interface")
    write_trajectory(drive, tmp_path / "a.kitti")
    write_trajectory(drive, tmp_path / "a.tum")
    kitti = file_interface.read_kitti_poses_file(str(tmp_path / "a.kitti"))
    tum = file_interface.read_tum_trajectory_file(str(tmp_path / "a.tum"))
    assert np.array(kitti.poses_se3) == pytest.approx(np.array(tum.poses_se3), abs=1e-9)
    times = np.loadtxt(tmp_path / "a.times.txt")
    assert times == pytest.approx((drive.t_ns - drive.t_ns[0]) * 1e-9, abs=1e-9)
    origin = json.loads((tmp_path / "a.origin.json").read_text())
    assert set(origin) == {"lat_deg", "lon_deg", "height_m", "t0_ns"}
    assert origin["t0_ns"] == int(drive.t_ns[0])


def test_gpx_read_by_gpxpy(drive: Trajectory, tmp_path: Path) -> None:
    gpxpy = pytest.importorskip("gpxpy")
    path = tmp_path / "a & <b>.gpx"
    write_trajectory(drive, path)
    gpx = gpxpy.parse(path.read_text())
    (track,) = gpx.tracks
    assert track.name == "a & <b>"
    points = track.segments[0].points
    assert 5 < len(points) < 60  # 600 states at 10 Hz, thinned
    when = np.array([round(p.time.timestamp() * 1e6) * 1000 for p in points])
    assert np.abs(when[0] - drive.t_ns[0]) <= 1000  # us
    inside = np.clip(when, drive.t_ns[0], drive.t_ns[-1])
    lat, lon, height = interpolate_positions(drive, inside)
    assert np.radians([p.latitude for p in points]) == pytest.approx(lat, abs=1e-9)
    assert np.radians([p.longitude for p in points]) == pytest.approx(lon, abs=1e-9)
    assert [p.elevation for p in points] == pytest.approx(height, abs=1e-3)
    (stop,) = gpx.waypoints
    assert stop.name == "stop 1: 25.1 to 34.7 s"
    write_trajectory(drive, path, unix_clock=False)
    assert gpxpy.parse(path.read_text()).tracks[0].segments[0].points[0].time is None


def test_kml_read_by_fastkml(drive: Trajectory, tmp_path: Path) -> None:
    """Coloured by error: the worst stretch is the last, for the error grows."""
    fastkml = pytest.importorskip("fastkml")
    t = np.arange(1.0, 60.0)
    fixes = drive.rows(np.searchsorted(drive.t_ns, T0_NS + (t * 1e9).astype(np.int64)))
    gnss = gnss_of(t, fixes.enu(ORIGIN) + np.outer(0.5 * t, [1.0, 0.0, 0.0]))
    gnss = replace(gnss, t_ns=fixes.t_ns)
    path = tmp_path / "a.kml"
    write_trajectory(drive, path, errors=compare(drive, gnss))
    (document,) = fastkml.KML.parse(path).features
    marks = list(document.features)
    lines = [m for m in marks if m.geometry.geom_type == "LineString"]
    stops = [m for m in marks if m.geometry.geom_type == "Point"]
    assert len(stops) == 1
    assert len(lines) == 8  # one for each colour of the ramp
    assert lines[0].style_url.url == "#c1a9850"
    assert lines[-1].style_url.url == "#ca50026"
    ends = [(line.geometry.coords[0], line.geometry.coords[-1]) for line in lines]
    assert all(a[1] == b[0] for a, b in pairwise(ends))
    lon, lat, _ = ends[-1][1]
    assert lat == pytest.approx(np.degrees(drive.lat[-1]), abs=1e-8)
    assert lon == pytest.approx(np.degrees(drive.lon[-1]), abs=1e-8)


def test_geojson_follows_rfc_7946(drive: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / "a.geojson"
    write_trajectory(drive, path)
    content = json.loads(path.read_text())
    line, stop = content["features"]
    assert line["geometry"]["type"] == "LineString"
    lon, lat, height = line["geometry"]["coordinates"][0]
    assert lat == pytest.approx(np.degrees(drive.lat[0]), abs=1e-8)
    assert lon == pytest.approx(np.degrees(drive.lon[0]), abs=1e-8)
    assert height == pytest.approx(drive.height[0], abs=1e-3)
    assert len(line["properties"]["coordTimes"]) == len(line["geometry"]["coordinates"])
    first = datetime.fromisoformat(line["properties"]["coordTimes"][0])
    assert first == datetime(2024, 3, 26, 20, 10, 0, 123456, tzinfo=UTC)
    assert stop["geometry"]["type"] == "Point"
    write_trajectory(drive, path, unix_clock=False)
    assert "coordTimes" not in path.read_text()


def test_mcap_read_by_mcap(drive: Trajectory, tmp_path: Path) -> None:
    """The official reader with CRC checks; the messages valid under the schemas they carry."""
    make_reader = pytest.importorskip("mcap.reader").make_reader
    jsonschema = pytest.importorskip("jsonschema")
    gnss = gnss_of(np.arange(1.0, 50.0), np.zeros((49, 3)))
    path = tmp_path / "a.mcap"
    write_trajectory(drive, path, gnss=gnss)
    seen: dict[str, list[tuple[int, dict]]] = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        for schema, channel, message in reader.iter_messages():
            assert schema.encoding == "jsonschema"
            assert channel.message_encoding == "json"
            content = json.loads(message.data)
            if channel.topic not in seen:
                jsonschema.validate(content, json.loads(schema.data))
            seen.setdefault(channel.topic, []).append((message.log_time, content))
    assert set(seen) == {"/vehnav/track", "/vehnav/fix", "/tf", "/gps/fix"}
    assert len(seen["/vehnav/fix"]) == 601  # 10 Hz and the last state
    assert len(seen["/gps/fix"]) == 49
    t_ns, fix = seen["/vehnav/fix"][-1]
    assert t_ns == drive.t_ns[-1]
    stamp = fix["timestamp"]
    assert stamp["sec"] * 1_000_000_000 + stamp["nsec"] == drive.t_ns[-1]
    assert fix["latitude"] == pytest.approx(np.degrees(drive.lat[-1]), abs=1e-12)
    assert fix["position_covariance"][4] == pytest.approx(drive.sigma_pos[-1, 1] ** 2)
    assert fix["position_covariance_type"] == 2
    move = seen["/tf"][-1][1]
    assert [move["translation"][a] for a in "xyz"] == pytest.approx(
        drive.enu((drive.lat[0], drive.lon[0], drive.height[0]))[-1], abs=1e-9
    )
    q = [move["rotation"][a] for a in "wxyz"]
    assert np.linalg.norm(q) == pytest.approx(1.0)
    track = json.loads(seen["/vehnav/track"][0][1]["geojson"])
    assert track["features"][0]["geometry"]["type"] == "LineString"


def test_parquet_read_by_pyarrow(drive: Trajectory, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    write_trajectory(drive, tmp_path / "a.parquet")
    table = parquet.read_table(tmp_path / "a.parquet")
    assert table["t_ns"].to_pylist() == drive.t_ns.tolist()
    assert table["stopped"].to_pylist() == drive.stopped.tolist()
    assert np.array_equal(table["lat_deg"].to_numpy(), np.degrees(drive.lat))


def test_thinned_track_is_within_its_tolerance_at_all_times(drive: Trajectory) -> None:
    t = (drive.t_ns - drive.t_ns[0]) * 1e-9
    position = drive.enu(ORIGIN)
    for tolerance in (0.05, 0.2, 2.0):
        kept = keep_points(t, position, tolerance)
        even = np.column_stack([np.interp(t, t[kept], position[kept, k]) for k in range(3)])
        off = np.linalg.norm(even - position, axis=1)
        assert off.max() <= tolerance * (1 + 1e-9)
        assert off.max() > 0.3 * tolerance  # and not many points too many
    assert kept.size < 25  # of 3000


# ---- wrong files --------------------------------------------------------------------------------

HEAD = "time_s,lat_deg,lon_deg,height_m\n"
WRONG = [
    ("a.csv", HEAD + "1,2,3,4\n2,2,3,\n", "row 2: height_m is missing"),
    ("a.csv", HEAD + "1,2,3,4\n1,2,3,4\n", "row 2.*not after"),
    ("a.csv", HEAD + "1,2,3,4\n2,95,3,4\n", "row 2.*swapped"),
    ("a.csv", HEAD + "1,2,3,4\n", "1 rows"),
    ("a.csv", HEAD + "1,2,3,4\nx,2,3,4\n", "not a table of numbers"),
    ("a.csv", "time_s,gyro_x\n1,2\n", "no column lat_deg"),
    ("a.csv", "t,x\n1,2\n", "no column time_s"),
    ("a.csv", "", "empty"),
    ("a.json", "{}", "format key"),
    ("a.json", "nonsense", "not JSON"),
    ("a.json", '{"format": "vehnav.trajectory", "columns": {"t_ns": [1, null]}}', "broken"),
    ("a.parquet", "nonsense", "not Parquet"),
    ("a.tum", "1 2 3 4 0 0 0 1\n2 2 3 4 0 0 0 1\n", "origin.json is not beside"),
    ("a.txt", "1 2", "no trajectory format"),
    ("a.gpx", "<gpx/>", "GPX holds no trajectory"),
]


@pytest.mark.parametrize(("name", "text", "message"), WRONG)
def test_wrong_files_are_named(tmp_path: Path, name: str, text: str, message: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises((FormatError, LogError, ConfigError), match=message):
        read_trajectory(tmp_path / name)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no such file"):
        read_trajectory(tmp_path / "a.csv")


BROKEN_POSES = [
    ("a.tum", "1 2 3 4 0 0 0 1\n1 2 3 4 0 0 0 1\n", "not after"),
    ("a.tum", "1 2 3 4 0 0 0 1\n2 2 3 4 0 0 0 2\n", "length 2"),
    ("a.tum", "1 2 3\n2 2 3\n", "3 numbers in a row; expected 8"),
    ("a.tum", "1 2 3 4 0 0 0 1\n2 nan 3 4 0 0 0 1\n", "row 2"),
    ("a.kitti", "1 0 0 0 0 1 0 0 0 0 1 0\n" * 2, "times.txt is not beside"),
]


@pytest.mark.parametrize(("name", "text", "message"), BROKEN_POSES)
def test_broken_poses_are_named(tmp_path: Path, name: str, text: str, message: str) -> None:
    (tmp_path / name).write_text(text)
    origin = {"lat_deg": 42.0, "lon_deg": -71.0, "height_m": 0.0, "t0_ns": 0}
    (tmp_path / "a.origin.json").write_text(json.dumps(origin))
    with pytest.raises(FormatError, match=message):
        read_trajectory(tmp_path / name)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1711483800.5", 1_711_483_800_500_000_000),
        ("1711483800", 1_711_483_800_000_000_000),
        ("1711483800.123456789", 1_711_483_800_123_456_789),
        ("-0.25", -250_000_000),
        ("1.711483800e9", 1_711_483_800_000_000_000),
    ],
)
def test_times_of_other_writers(tmp_path: Path, text: str, expected: int) -> None:
    (tmp_path / "a.csv").write_text(f"{HEAD}{text},2,3,4\n1811483800.25,2,3,4\n")
    assert read_trajectory(tmp_path / "a.csv").t_ns.tolist() == [
        expected,
        1_811_483_800_250_000_000,
    ]


def test_minimal_csv_gets_velocity_and_course(tmp_path: Path) -> None:
    """Ten metres north a second: 9.0e-5 deg of latitude (pyproj: 111 082 m per degree at 42)."""
    rows = "".join(f"{k},{42.0 + k * 10.0 / 111_082.0:.12f},-71\n" for k in range(10))
    (tmp_path / "a.csv").write_text("time_s,lat_deg,lon_deg\n" + rows)
    back = read_trajectory(tmp_path / "a.csv")
    assert back.v_n[:, 1] == pytest.approx(10.0, abs=0.01)
    heading, _, _ = angles_from_c_nb(back.c_nb)
    assert np.sin(heading) == pytest.approx(0.0, abs=1e-6)
    assert np.cos(heading) == pytest.approx(1.0)
