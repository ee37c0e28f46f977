"""GPX, KML and GeoJSON: the track thinned to what a map can show, the stops as points."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
import numpy.typing as npt

from vehnav.evaluation import Errors
from vehnav.export.thinning import stops_of, stretches, thin
from vehnav.trajectory import Trajectory
from vehnav.units import NS


def iso_times(t_ns: npt.NDArray[np.int64]) -> list[str]:
    """UTC texts with microseconds, from integer ns.

    >>> iso_times(np.array([1_500_000_000]))
    ['1970-01-01T00:00:01.500000Z']
    """
    stamps = t_ns.astype("datetime64[ns]").astype("datetime64[us]")
    return [text + "Z" for text in np.datetime_as_string(stamps, unit="us").tolist()]


def _degrees(trajectory: Trajectory) -> list[tuple[float, float, float]]:
    """(lon deg, lat deg, height m) of each state, rounded to 1 mm."""
    lon = np.round(np.degrees(trajectory.lon), 8).tolist()
    lat = np.round(np.degrees(trajectory.lat), 8).tolist()
    return list(zip(lon, lat, np.round(trajectory.height, 3).tolist(), strict=True))


def _stop_rows(trajectory: Trajectory) -> list[tuple[str, tuple[float, float, float]]]:
    """Text and place of every stop; seconds count from the first state."""
    rows: list[tuple[str, tuple[float, float, float]]] = []
    for a, b in stops_of(trajectory):
        start = (trajectory.t_ns[a] - trajectory.t_ns[0]) * NS
        end = (trajectory.t_ns[b] - trajectory.t_ns[0]) * NS
        place = _degrees(trajectory.rows(slice(a, a + 1)))[0]
        rows.append((f"stop {len(rows) + 1}: {start:.1f} to {end:.1f} s", place))
    return rows


def _write(path: Path, parts: Iterable[str]) -> None:
    path.write_text("".join(parts), encoding="utf-8")


def write_gpx(
    trajectory: Trajectory,
    path: Path,
    *,
    final: Path,
    unix_clock: bool = True,
    rate_hz: float | None = None,
    **_: Any,
) -> None:
    """GPX 1.1: one track; times only where the clock is UTC; stops as way-points."""
    track = thin(trajectory, rate_hz=rate_hz)
    times = [f"<time>{t}</time>" for t in iso_times(track.t_ns)] if unix_clock else None
    out = [
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<gpx version="1.1" creator="vehnav" xmlns="http://www.topografix.com/GPX/1/1">\n'
    ]
    for text, (lon, lat, height) in _stop_rows(trajectory):
        out.append(
            f'<wpt lat="{lat:.8f}" lon="{lon:.8f}"><ele>{height:.3f}</ele>'
            f"<name>{escape(text)}</name></wpt>\n"
        )
    out.append(f"<trk><name>{escape(final.stem)}</name><trkseg>\n")
    for k, (lon, lat, height) in enumerate(_degrees(track)):
        time = times[k] if times else ""
        out.append(
            f'<trkpt lat="{lat:.8f}" lon="{lon:.8f}"><ele>{height:.3f}</ele>{time}</trkpt>\n'
        )
    out.append("</trkseg></trk>\n</gpx>\n")
    _write(path, out)


def _kml_colour(rgb: str) -> str:
    """KML writes opacity, blue, green, red."""
    return f"ff{rgb[4:6]}{rgb[2:4]}{rgb[0:2]}"


def write_kml(
    trajectory: Trajectory,
    path: Path,
    *,
    final: Path,
    errors: Errors | None = None,
    rate_hz: float | None = None,
    **_: Any,
) -> None:
    """KML 2.2: the track as lines on the ground, coloured by its horizontal error if known."""
    track = thin(trajectory, rate_hz=rate_hz, errors=errors)
    places = [f"{lon:.8f},{lat:.8f},{height:.3f}" for lon, lat, height in _degrees(track)]
    runs = stretches(track, errors)
    out = [
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<kml xmlns="http://www.opengis.net/kml/2.2"><Document>\n'
        f"<name>{escape(final.stem)}</name>\n"
    ]
    out += [
        f'<Style id="c{rgb}"><LineStyle><color>{_kml_colour(rgb)}</color><width>4</width>'
        "</LineStyle></Style>\n"
        for rgb in sorted({run.colour for run in runs})
    ]
    for run in runs:
        name = "track" if run.error is None else f"error {run.error[0]:.1f} to {run.error[1]:.1f} m"
        line = " ".join(places[run.start : run.end + 1])
        out.append(
            f"<Placemark><name>{name}</name><styleUrl>#c{run.colour}</styleUrl><LineString>"
            f"<tessellate>1</tessellate><coordinates>{line}</coordinates></LineString></Placemark>\n"
        )
    for text, (lon, lat, height) in _stop_rows(trajectory):
        out.append(
            f"<Placemark><name>{escape(text)}</name><Point><coordinates>{lon:.8f},{lat:.8f},"
            f"{height:.3f}</coordinates></Point></Placemark>\n"
        )
    out.append("</Document></kml>\n")
    _write(path, out)


def geojson(
    trajectory: Trajectory,
    *,
    unix_clock: bool,
    errors: Errors | None = None,
    rate_hz: float | None = None,
) -> dict[str, Any]:
    """A FeatureCollection: lines (``stroke`` by error, ``coordTimes`` where UTC), stops as points.

    Coordinates are longitude, latitude, height (RFC 7946).
    """
    track = thin(trajectory, rate_hz=rate_hz, errors=errors)
    places = [list(place) for place in _degrees(track)]
    times = iso_times(track.t_ns) if unix_clock else None
    features: list[dict[str, Any]] = []
    for run in stretches(track, errors):
        properties: dict[str, Any] = {"stroke": f"#{run.colour}", "stroke-width": 4}
        if run.error is not None:
            properties["error_m"] = [round(x, 3) for x in run.error]
        if times is not None:
            properties["coordTimes"] = times[run.start : run.end + 1]
        line = {"type": "LineString", "coordinates": places[run.start : run.end + 1]}
        features.append({"type": "Feature", "properties": properties, "geometry": line})
    for text, place in _stop_rows(trajectory):
        point = {"type": "Point", "coordinates": list(place)}
        features.append({"type": "Feature", "properties": {"name": text}, "geometry": point})
    return {"type": "FeatureCollection", "features": features}


def write_geojson(
    trajectory: Trajectory,
    path: Path,
    *,
    unix_clock: bool = True,
    errors: Errors | None = None,
    rate_hz: float | None = None,
    **_: Any,
) -> None:
    """The collection of :func:`geojson`."""
    content = geojson(trajectory, unix_clock=unix_clock, errors=errors, rate_hz=rate_hz)
    path.write_text(json.dumps(content, allow_nan=False), encoding="utf-8")
