"""GPX against gpxpy."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest

from vehnav.errors import FormatError, LogError
from vehnav.logs.gpx import read_gpx
from vehnav.logs.read import identify, read_gnss

gpxpy = pytest.importorskip("gpxpy")
gpxpy_gpx = pytest.importorskip("gpxpy.gpx")

START = datetime(2025, 7, 8, 12, 0, 0, tzinfo=UTC)


def made_by_gpxpy(n=30, *, version="1.1", **point):
    gpx = gpxpy_gpx.GPX()
    gpx.tracks.append(gpxpy_gpx.GPXTrack())
    for part in range(2):
        segment = gpxpy_gpx.GPXTrackSegment()
        gpx.tracks[0].segments.append(segment)
        for k in range(part * n // 2, (part + 1) * n // 2):
            segment.points.append(
                gpxpy_gpx.GPXTrackPoint(
                    50.0 + 1e-5 * k,
                    14.5 - 2e-5 * k,
                    elevation=200.0 + 0.1 * k,
                    time=START + timedelta(seconds=0.5 * k),
                    **point,
                )
            )
    return gpx.to_xml(version=version)


def put(path, text):
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_against_gpxpy(tmp_path):
    text = made_by_gpxpy()
    path = put(tmp_path / "drive.gpx", text)
    assert identify(path).name == "GPX"
    gnss, findings = read_gnss(path)
    assert findings == []
    points = [p for s in gpxpy.parse(text).tracks[0].segments for p in s.points]
    np.testing.assert_array_equal(gnss.t_ns, [round(p.time.timestamp() * 1e9) for p in points])
    np.testing.assert_allclose(np.degrees(gnss.lat), [p.latitude for p in points], rtol=1e-15)
    np.testing.assert_allclose(np.degrees(gnss.lon), [p.longitude for p in points], rtol=1e-15)
    np.testing.assert_allclose(gnss.height, [p.elevation for p in points], rtol=1e-15)
    assert gnss.v_n is None


def test_speed_and_course_of_gpx_1_0(tmp_path):
    text = made_by_gpxpy(version="1.0", speed=12.0).replace(
        "<speed>", "<course>270.0</course><speed>"
    )
    gnss, _ = read_gpx(put(tmp_path / "x.gpx", text))
    np.testing.assert_allclose(gnss.v_n, np.tile([-12.0, 0.0, 0.0], (30, 1)), atol=1e-14)


def one_point(time):
    return (
        '<?xml version="1.0"?><gpx xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>'
        f'<trkpt lat="50" lon="14"><ele>1</ele>{time}</trkpt></trkseg></trk></gpx>'
    )


@pytest.mark.parametrize(
    ("text", "moment", "more_ns"),
    [
        ("2025-07-08T12:00:00Z", START, 0),
        ("2025-07-08T12:00:00", START, 0),
        (
            "2025-07-08T14:00:00.5+02:00",
            START.astimezone(timezone(timedelta(hours=2))),
            500_000_000,
        ),
        ("2025-07-08T12:00:00.123456789Z", START, 123_456_789),
    ],
)
def test_times(tmp_path, text, moment, more_ns):
    gnss, _ = read_gpx(put(tmp_path / "x.gpx", one_point(f"<time>{text}</time>")))
    assert gnss.t_ns[0] == int(moment.timestamp()) * 10**9 + more_ns


def test_trouble(tmp_path):
    with pytest.raises(LogError, match="without time"):
        read_gpx(put(tmp_path / "route.gpx", one_point("")))
    with pytest.raises(LogError, match="no track point"):
        read_gpx(put(tmp_path / "e.gpx", "<gpx></gpx>"))
    with pytest.raises(FormatError, match="not XML"):
        read_gpx(put(tmp_path / "b.gpx", "<gpx><trk"))
    with pytest.raises(FormatError, match="document type"):
        read_gpx(put(tmp_path / "d.gpx", '<!DOCTYPE gpx [<!ENTITY a "b">]><gpx/>'))
    with pytest.raises(LogError, match="1 not finite"):
        read_gpx(put(tmp_path / "t.gpx", one_point("<time>noon</time>")))


def test_a_file_that_breaks_off(tmp_path):
    text = made_by_gpxpy()
    cut = text.index("<trkpt", int(len(text) * 0.7)) + 20
    gnss, findings = read_gpx(put(tmp_path / "x.gpx", text[:cut]))
    assert gnss.t_ns.size == text[:cut].count("</trkpt>")
    (finding,) = findings
    assert (finding.code, finding.level) == ("bad-rows", "error")


def test_points_without_time_or_height(tmp_path):
    text = made_by_gpxpy()
    text = text.replace("<ele>200.0</ele>", "", 1)
    first = text.index("<time>", text.index("<ele>200.5"))
    text = text[:first] + text[text.index("</time>", first) + len("</time>") :]
    gnss, findings = read_gpx(put(tmp_path / "x.gpx", text))
    assert gnss.t_ns.size == 29
    assert [f.code for f in findings] == ["gps-rejected", "gps-height-missing"]
