"""RTKLIB solutions: every form of the format, GPS time against the leap seconds of tzdata."""

from __future__ import annotations

import importlib.resources
import re

import numpy as np
import pytest
from pyproj import Transformer

from vehnav.errors import FormatError, LogError
from vehnav.logs.gpstime import LEAP_DATES, gps_from_week, unix_from_gps
from vehnav.logs.pos import read_pos
from vehnav.logs.read import identify

# 2025-07-08 19:34:18 UTC by the calendar alone
UTC_NS = int(np.datetime64("2025-07-08T19:34:18", "ns").astype(np.int64))
COLUMNS = [
    "latitude(deg)",
    "longitude(deg)",
    "height(m)",
    "Q",
    "ns",
    "sdn(m)",
    "sde(m)",
    "sdu(m)",
    "sdne(m)",
    "sdeu(m)",
    "sdun(m)",
    "age(s)",
    "ratio",
    "vn(m/s)",
    "ve(m/s)",
    "vu(m/s)",
    "sdvn",
    "sdve",
    "sdvu",
    "sdvne",
    "sdveu",
    "sdvun",
]
VALUES = [
    "40.0966268",
    "-105.1474483",
    "1601.474",
    "1",
    "21",
    "0.0100",
    "0.0200",
    "0.0300",
    "0.0010",
    "0.0020",
    "0.0030",
    "0.00",
    "9.9",
    "1.5",
    "2.5",
    "-0.5",
    "0.05",
    "0.06",
    "0.07",
    "0",
    "0",
    "0",
]


def solution(path, *, clock="GPST", stamp="2025/07/08 19:34:36.000", sep=" ", names=COLUMNS,
             values=VALUES, rows=5):  # fmt: skip
    head = "% program   : RTKPOST ver.demo5\n% inp file  : rover.obs\n%\n"
    lines = [f"%  {clock:22}{sep}" + sep.join(names)]
    for k in range(rows):
        lines.append(stamp.replace(":36.", f":{36 + k}.") + sep + sep.join(values))
    path.write_text(head + "\n".join(lines) + "\n")
    return str(path)


def assert_fixes(gnss, rows=5):
    assert gnss.t_ns.size == rows
    np.testing.assert_allclose(np.degrees(gnss.lat), 40.0966268, rtol=1e-15)
    np.testing.assert_allclose(np.degrees(gnss.lon), -105.1474483, rtol=1e-15)
    np.testing.assert_allclose(gnss.height, 1601.474)
    np.testing.assert_allclose(gnss.v_n, np.tile([2.5, 1.5, -0.5], (rows, 1)))
    np.testing.assert_allclose(gnss.sigma_pos, np.tile([0.02, 0.01, 0.03], (rows, 1)))
    np.testing.assert_allclose(gnss.sigma_vel, np.tile([0.06, 0.05, 0.07], (rows, 1)))


@pytest.mark.parametrize(
    ("clock", "stamp"),
    [
        ("GPST", "2025/07/08 19:34:36.000"),  # 18 leap seconds since 1980
        ("UTC", "2025/07/08 19:34:18.000"),
        ("JST", "2025/07/09 04:34:18.000"),
        ("GPST", "2025/07/08 19:34:36"),
    ],
)
@pytest.mark.parametrize("sep", [" ", ",", "   "])
def test_calendar_times(tmp_path, clock, stamp, sep):
    gnss, findings = read_pos(
        solution(tmp_path / "x.pos", clock=clock, stamp=stamp, sep=sep, rows=1)
    )
    assert findings == []
    assert gnss.t_ns[0] == UTC_NS
    assert_fixes(gnss, rows=1)


@pytest.mark.parametrize("sep", [" ", ","])
def test_week_and_seconds(tmp_path, sep):
    """2025-07-08 is day 2 of GPS week 2374 (week 0 began on 1980-01-06)."""
    days = (np.datetime64("2025-07-08") - np.datetime64("1980-01-06")).astype(int)
    assert (days // 7, days % 7) == (2374, 2)
    tow = 2 * 86400 + 19 * 3600 + 34 * 60 + 36
    path = solution(tmp_path / "x.pos", stamp=f"2374{sep}{tow}.000", sep=sep, rows=1)
    gnss, _ = read_pos(path)
    assert gnss.t_ns[0] == UTC_NS
    assert_fixes(gnss, rows=1)


def test_five_rows_and_kind(tmp_path):
    path = solution(tmp_path / "renamed.txt")
    assert identify(path).name == "RTKLIB solution"
    gnss, _ = read_pos(path)
    assert_fixes(gnss)
    np.testing.assert_array_equal(gnss.t_ns, UTC_NS + 10**9 * np.arange(5))


def test_degrees_minutes_seconds(tmp_path):
    names = ["latitude(d'\")", "longitude(d'\")", *COLUMNS[2:]]
    values = ["40", "05", "47.85648", "-105", "08", "50.81388", *VALUES[2:]]
    gnss, _ = read_pos(solution(tmp_path / "x.pos", names=names, values=values))
    np.testing.assert_allclose(np.degrees(gnss.lat), 40.0966268, rtol=1e-13)
    np.testing.assert_allclose(np.degrees(gnss.lon), -105.1474483, rtol=1e-13)


def test_ecef(tmp_path):
    """Positions and velocities against pyproj; a covariance turned there and back."""
    to_ecef = Transformer.from_crs("EPSG:4979", "EPSG:4978")
    r_e = np.array(to_ecef.transform(40.0966268, -105.1474483, 1601.474))
    # a vector is turned as the difference of two near points
    step = 1e-3
    moved = np.array(
        to_ecef.transform(40.0966268 + np.degrees(step / 6.36e6), -105.1474483, 1601.474)
    )
    north = (moved - r_e) / np.linalg.norm(moved - r_e)
    v_e = 2.0 * north
    covariance = 0.02**2 * np.outer(north, north) + 1e-4**2 * 4 * np.eye(3)
    root = np.sign(covariance) * np.sqrt(np.abs(covariance))
    names = [
        "x-ecef(m)",
        "y-ecef(m)",
        "z-ecef(m)",
        "Q",
        "ns",
        "sdx(m)",
        "sdy(m)",
        "sdz(m)",
        "sdxy(m)",
        "sdyz(m)",
        "sdzx(m)",
        "age(s)",
        "ratio",
        "vx(m/s)",
        "vy(m/s)",
        "vz(m/s)",
    ]
    values = [f"{v:.6f}" for v in r_e] + ["1", "9"]
    values += [f"{root[j, k]:.9f}" for j, k in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))]
    values += ["0", "0", *(f"{v:.9f}" for v in v_e)]
    gnss, _ = read_pos(solution(tmp_path / "x.pos", names=names, values=values))
    metre = 1.0 / 6.37e6
    np.testing.assert_allclose(np.degrees(gnss.lat), 40.0966268, atol=np.degrees(1e-6 * metre))
    np.testing.assert_allclose(gnss.height, 1601.474, atol=2e-6)
    np.testing.assert_allclose(gnss.v_n[0], [0.0, 2.0, 0.0], atol=1e-5)  # mm steps of pyproj
    np.testing.assert_allclose(gnss.sigma_pos[0], [2e-4, 0.02, 2e-4], rtol=0.02)


def test_trouble(tmp_path):
    baseline = ["e-baseline(m)", "n-baseline(m)", "u-baseline(m)", "Q", "ns"]
    path = solution(tmp_path / "b.pos", names=baseline, values=["1", "2", "3", "1", "9"])
    with pytest.raises(LogError, match="relative to a base station"):
        read_pos(path)
    (tmp_path / "n.pos").write_text("% program : RTKPOST\n% no columns\n")
    with pytest.raises(FormatError, match="no line"):
        read_pos(str(tmp_path / "n.pos"))
    with pytest.raises(FormatError, match="no rows"):
        read_pos(solution(tmp_path / "h.pos", rows=0))
    bad = list(VALUES)
    bad[3] = "0"  # Q = 0: no solution
    with pytest.raises(LogError, match=r"no usable fix in 5 rows.*5 status no fix"):
        read_pos(solution(tmp_path / "q.pos", values=bad))


def test_leap_seconds_against_tzdata():
    resource = importlib.resources.files("tzdata") / "zoneinfo" / "leapseconds"
    lines = re.findall(r"^Leap\s+(\d+)\s+(\w+)\s+(\d+)\s", resource.read_text(), re.MULTILINE)
    after = [f"{int(y) + 1}-01-01" if m == "Dec" else f"{y}-07-01" for y, m, _ in lines]
    assert [day for day in after if day > "1980-01-06"] == list(LEAP_DATES)


def test_gps_time_around_a_leap_second():
    """GPST runs on through 2016-12-31 23:59:60: 17 s before, 18 s after."""
    midnight = int(np.datetime64("2017-01-01", "ns").astype(np.int64))
    gps = midnight + 10**9 * np.array([16, 17, 18, 19])
    # 23:59:59 and 23:59:60 share the Unix number of the former plus one (POSIX repeats a second)
    np.testing.assert_array_equal((unix_from_gps(gps) - midnight) // 10**9, [-1, 0, 0, 1])
    zero = gps_from_week(np.array([0]), np.array([0]))
    assert unix_from_gps(zero)[0] == int(np.datetime64("1980-01-06", "ns").astype(np.int64))


def test_drive_0708(shared_data):
    gnss, findings = read_pos(str(shared_data / "drive_0708" / "gnss.pos"))
    assert gnss.t_ns.size == 2197
    first = np.datetime64("2025-07-08T19:34:18.499", "ns").astype(np.int64)
    assert gnss.t_ns[0] == first - 18 * 10**9
    assert findings == []
    # the receiver's velocity is the rate of its positions: 1 cm fixes at 4 Hz
    north = np.gradient(gnss.lat * 6.36e6, gnss.t_ns * 1e-9)
    assert np.median(np.abs(north - gnss.v_n[:, 1])) < 0.05
