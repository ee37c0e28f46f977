"""Way-points: readers, and drives that follow them."""

from __future__ import annotations

import itertools
import json
import math

import numpy as np
import pyproj
import pytest

from vehnav.earth import WGS84
from vehnav.errors import ConfigError, FormatError
from vehnav.simulate import ideal_log, make_scenario, stamps
from vehnav.simulate.polyline import moved, offset, simplified, turn_between, without_sharp_turns
from vehnav.simulate.program import ProgramBuilder
from vehnav.simulate.route import RouteHabits, plan_corners, turn_reach
from vehnav.simulate.waypoints import read_route

LAT0, LON0 = 48.1, 11.5
GEOD = pyproj.Geod(ellps="WGS84")


def street(corners):
    """(lat, lon) degrees of points each 10 m along legs (heading deg, length m), by pyproj."""
    lat, lon = [LAT0], [LON0]
    for heading, length in corners:
        for _ in range(round(length / 10.0)):
            x, y, _ = GEOD.fwd(lon[-1], lat[-1], heading, 10.0)
            lat.append(y)
            lon.append(x)
    return np.array(lat), np.array(lon)


TOWN = [(20, 300), (110, 250), (110, 10), (65, 200), (335, 400), (20, 150), (110, 350)]
"""Legs with corners of 90, 0, -45, -90, 45 and 90 degrees."""


def gpx(lat, lon, ele=None):
    points = []
    for k, (a, b) in enumerate(zip(lat, lon, strict=True)):
        height = "" if ele is None else f"<ele>{ele[k]:.3f}</ele>"
        points.append(f'<trkpt lat="{a:.9f}" lon="{b:.9f}">{height}</trkpt>')
    space = "http://www.topografix.com/GPX/1/1"
    track = f"<trk><trkseg>{''.join(points)}</trkseg></trk>"
    return f'<?xml version="1.0"?><gpx xmlns="{space}">{track}</gpx>'


# ---- readers -----------------------------------------------------------------------------------


def test_three_formats_say_the_same(tmp_path):
    lat, lon = street([(20, 50), (80, 50)])
    ele = 500.0 + np.arange(lat.size)
    (tmp_path / "a.gpx").write_text(gpx(lat, lon, ele))
    line = {
        "type": "Feature",
        "properties": {},
        "geometry": {
            "type": "LineString",
            "coordinates": [[b, a, e] for a, b, e in zip(lat, lon, ele, strict=True)],
        },
    }
    (tmp_path / "a.geojson").write_text(
        json.dumps({"type": "FeatureCollection", "features": [line]})
    )
    rows = [f"{a:.9f};{b:.9f};{e}" for a, b, e in zip(lat, lon, ele, strict=True)]
    (tmp_path / "a.csv").write_text("Latitude;Longitude;Ele\n" + "\n".join(rows) + "\n")
    for suffix in (".gpx", ".geojson", ".csv"):
        route = read_route(tmp_path / f"a{suffix}")
        np.testing.assert_allclose(np.degrees(route.lat), lat, atol=1e-9)
        np.testing.assert_allclose(np.degrees(route.lon), lon, atol=1e-9)
        np.testing.assert_allclose(route.height, ele, atol=1e-3)
        assert not route.stop.any()
        assert np.all(np.isinf(route.speed))


def test_stops_and_speeds_of_points(tmp_path):
    text = "lat,lon,stop_s,speed_m_s\n48,11,,10\n48.001,11,25,\n48.001,11,25,\n48.002,11,,\n"
    (tmp_path / "a.csv").write_text(text)
    route = read_route(tmp_path / "a.csv")
    assert route.stop.tolist() == [0.0, 25.0, 0.0]  # the repeated point is one
    assert route.speed.tolist() == [10.0, math.inf, math.inf]
    assert route.height is None
    point = {"type": "Point", "coordinates": [11, 48]}
    features = [
        {"type": "Feature", "properties": {"stop_s": 5}, "geometry": point},
        {"type": "Feature", "properties": None, "geometry": {**point, "coordinates": [11, 49]}},
    ]
    (tmp_path / "a.json").write_text(
        json.dumps({"type": "FeatureCollection", "features": features})
    )
    assert read_route(tmp_path / "a.json").stop.tolist() == [5.0, 0.0]


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.gpx", "<gpx", "not XML"),
        ("a.gpx", "<gpx></gpx>", "two different points, found 0"),
        ("a.gpx", '<gpx><wpt lat="48" lon="x"/></gpx>', "lon of wpt 1 is 'x'"),
        ("a.gpx", '<gpx><wpt lat="4800" lon="11"/><wpt lat="48" lon="11"/></gpx>', "point 1 is at"),
        ("a.geojson", "{", "not JSON"),
        ("a.geojson", "[]", "not a GeoJSON object"),
        ("a.geojson", '{"type": "LineString", "coordinates": [[1]]}', "not \\[lon, lat\\]"),
        ("a.csv", "x,y\n1,2\n", "no columns lat and lon; found x, y"),
        ("a.csv", "lat,lon\n48,\n", "lon of row 2"),
        ("a.csv", "lat,lon,stop_s\n48,11,-3\n", "at least 0"),
        ("a.csv", "lat,lon\n48,11\n48,11\n", "found 1"),
    ],
)
def test_bad_files(name, text, says, tmp_path):
    (tmp_path / name).write_text(text)
    with pytest.raises(FormatError, match=says) as error:
        read_route(tmp_path / name)
    assert name in str(error.value)


def test_no_file_and_wrong_suffix(tmp_path):
    with pytest.raises(ConfigError, match="no such file"):
        read_route(tmp_path / "none.gpx")
    with pytest.raises(ConfigError, match=r"\.gpx, \.geojson"):
        read_route(tmp_path / "a.kml")


# ---- geometry ----------------------------------------------------------------------------------


@pytest.mark.parametrize("azimuth", [0.0, 37.0, 90.0, 200.0])
def test_offset_by_pyproj(azimuth):
    lon, lat, _ = GEOD.fwd(LON0, LAT0, azimuth, 500.0)
    r = np.radians
    east, north = offset(r(LAT0), r(LON0), r(lat), r(lon), 0.0, WGS84)
    assert math.hypot(east, north) == pytest.approx(500.0, abs=1e-5)  # geodesic against rhumb line
    turn = 0.5 * (lon - LON0) * math.sin(math.radians(LAT0))  # convergence of half the way
    assert math.degrees(turn_between(math.atan2(east, north), r(azimuth + turn))) == pytest.approx(
        0.0, abs=1e-4
    )
    back = moved(r(LAT0), r(LON0), east, north, 0.0, WGS84)
    assert back == pytest.approx((r(lat), r(lon)), abs=1e-14)


@pytest.mark.parametrize("angle", [-1.9, -0.8, 0.05, 0.4, 1.57, 2.3])
def test_turn_leaves_and_meets_the_legs(angle):
    """Driving reach + turn + reach from a corner's legs ends on the second leg: by a fine sum."""
    program = ProgramBuilder(speed=6.0).turn(angle, yaw_rate=0.4, ease=1.2).build()
    t = np.linspace(0.0, program.duration, 200_001)
    heading = program.state(t).heading
    dt = t[1]
    x = np.sum(6.0 * np.sin(heading[:-1] + 0.5 * np.diff(heading))) * dt
    y = np.sum(6.0 * np.cos(heading[:-1] + 0.5 * np.diff(heading))) * dt
    reach = turn_reach(angle, 6.0, 0.4, 1.2)
    assert x == pytest.approx(reach * math.sin(angle), abs=1e-6)
    assert y == pytest.approx(reach + reach * math.cos(angle), abs=1e-6)


def test_dense_points_are_thinned_to_the_corners(tmp_path):
    lat, lon = street(TOWN)
    (tmp_path / "a.gpx").write_text(gpx(lat, lon))
    route = simplified(read_route(tmp_path / "a.gpx"), 3.0)
    assert route.lat.size == 7  # ends and the five corners that turn


def test_u_turn_becomes_two_corners(tmp_path):
    lat, lon = street([(20, 200), (200, 150)])
    (tmp_path / "a.gpx").write_text(gpx(lat, lon))
    route = without_sharp_turns(simplified(read_route(tmp_path / "a.gpx"), 3.0))
    assert route.lat.size == 4
    legs = [
        offset(route.lat[k], route.lon[k], route.lat[k + 1], route.lon[k + 1], 0.0, WGS84)
        for k in range(3)
    ]
    angles = [turn_between(math.atan2(*a), math.atan2(*b)) for a, b in itertools.pairwise(legs)]
    assert all(-2.0 < a < -1.4 for a in angles)  # to the left, twice


def test_speeds_can_be_reached(tmp_path):
    lat, lon = street(TOWN)
    (tmp_path / "a.gpx").write_text(gpx(lat, lon))
    route = simplified(read_route(tmp_path / "a.gpx"), 3.0)
    habits = RouteHabits(stop_every=0.0)
    speeds = [c.speed for c in plan_corners(route, habits)]
    sharp = [abs(a) for a in (90, -45, -90, 45, 90)]
    for v, angle in zip(speeds, sharp, strict=True):
        assert 1.5 <= v <= 13.9
        assert (v > 5.0) == (angle == 45)


# ---- drives ------------------------------------------------------------------------------------


def driven(path, **more):
    motion = make_scenario(str(path), road=0.0, idle=0.0, **more).motion
    return ideal_log(motion, stamps(motion.duration, 20.0), sampling="rates")


def distance_to_line(lat, lon, line_lat, line_lon):
    """(n,) m: distance of points to a polyline, in the azimuthal plane of pyproj at the start."""
    plane = pyproj.Proj(proj="aeqd", lat_0=LAT0, lon_0=LON0)
    p = np.stack(plane(lon, lat), axis=-1)
    q = np.stack(plane(line_lon, line_lat), axis=-1)
    best = np.full(len(p), np.inf)
    for a, b in itertools.pairwise(q):
        ab = b - a
        if not ab.any():
            continue
        s = np.clip((p - a) @ ab / (ab @ ab), 0.0, 1.0)
        best = np.minimum(best, np.hypot(*(p - a - s[:, None] * ab).T))
    return best


def test_the_drive_follows_the_street(tmp_path):
    lat, lon = street(TOWN)
    ele = 500.0 + 12.0 * np.sin(np.arange(lat.size) / 25.0)
    (tmp_path / "street.gpx").write_text(gpx(lat, lon, ele))
    t, imu = driven(tmp_path / "street.gpx", stop_every=60.0)
    track = np.degrees(t.lat), np.degrees(t.lon)
    # corners are cut by 4 m of an arc, a little more with its easing; 20 Hz of samples
    assert np.max(distance_to_line(*track, lat, lon)) < 5.0
    moving = np.flatnonzero(~t.stopped)[::10]
    assert np.max(distance_to_line(lat, lon, track[0][moving], track[1][moving])) < 5.0
    end = GEOD.inv(track[1][-1], track[0][-1], lon[-1], lat[-1])[2]
    assert end < 0.5
    assert abs(t.height[-1] - ele[-1]) < 2.0
    speed = np.linalg.norm(t.v_n, axis=1)
    assert np.max(speed) <= 13.9 + 1e-9
    assert np.max(speed) > 12.0
    across = np.abs(imu.accel[:, 0])
    assert np.max(across) < 2.5 + 0.5  # side acceleration, and gravity by leaning 1 deg
    assert np.max(np.abs(imu.accel[:, 1])) < 4.0
    starts = np.count_nonzero(np.diff(t.stopped.astype(int)) == -1)
    assert starts >= 2


def test_stop_of_a_point_is_made_before_it(tmp_path):
    lat, lon = street([(20, 300), (110, 300)])
    stop = np.where(np.arange(lat.size) == 30, "22", "")
    rows = [f"{a:.9f},{b:.9f},{c}" for a, b, c in zip(lat, lon, stop, strict=True)]
    (tmp_path / "a.csv").write_text("lat,lon,stop_s\n" + "\n".join(rows) + "\n")
    t, _ = driven(tmp_path / "a.csv", stop_every=0.0, first_stop=10.0, last_stop=10.0)
    change = np.flatnonzero(np.diff(t.stopped.astype(int)))
    assert change.size == 4  # off, stand, off, stand
    begin, end = change[1], change[2]
    assert (t.t_ns[end] - t.t_ns[begin]) * 1e-9 == pytest.approx(22.0, abs=0.2)
    k = int(begin) + 5
    away = GEOD.inv(np.degrees(t.lon[k]), np.degrees(t.lat[k]), lon[30], lat[30])[2]
    assert 2.0 < away < 30.0


def test_limits_of_the_points_hold(tmp_path):
    lat, lon = street([(20, 600)])
    rows = [f"{a:.9f},{b:.9f},8" for a, b in zip(lat, lon, strict=True)]
    (tmp_path / "a.csv").write_text("lat,lon,speed_m_s\n" + "\n".join(rows) + "\n")
    t, _ = driven(tmp_path / "a.csv")
    assert np.max(np.linalg.norm(t.v_n, axis=1)) == pytest.approx(8.0, abs=1e-6)


def test_too_short_a_route(tmp_path):
    (tmp_path / "a.csv").write_text("lat,lon\n48,11\n48.00005,11\n")
    with pytest.raises(FormatError, match="shorter than"):
        make_scenario(str(tmp_path / "a.csv"))
