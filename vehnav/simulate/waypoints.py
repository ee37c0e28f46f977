"""Way-points from GPX, GeoJSON or CSV files."""

from __future__ import annotations

import csv
import json
import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.errors import ConfigError, FormatError
from vehnav.units import DEG

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Waypoint:
    """One point of a route as the file has it.

    Attributes
    ----------
    lat, lon : float
        Degrees.
    height : float or None
        m.
    stop : float
        s to stand here; 0: none.
    speed : float or None
        Limit from here on, m/s.
    """

    lat: float
    lon: float
    height: float | None = None
    stop: float = 0.0
    speed: float | None = None


@dataclass(frozen=True)
class Route:
    """Points to drive along.

    Attributes
    ----------
    lat, lon : (n,)
        rad.
    height : (n,) or None
        m; None where the file has none.
    stop : (n,)
        s to stand at a point.
    speed : (n,)
        Limit from a point on, m/s; inf: none.
    """

    lat: Array
    lon: Array
    height: Array | None
    stop: Array
    speed: Array


def read_route(path: str | Path) -> Route:
    """Read a route; the suffix decides.

    GPX: the points of the tracks, else of the routes, else the way-points. GeoJSON: lines, or
    points in their order with the properties ``stop_s`` and ``speed_m_s``. CSV: columns ``lat``
    and ``lon`` (degrees), and where wanted ``height``, ``stop_s``, ``speed_m_s``.

    Raises
    ------
    ConfigError
        No such file, or another suffix.
    FormatError
        The file is not what its suffix says, or has fewer than two different points.
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise ConfigError(f"{path}: a route is one of {', '.join(READERS)}")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except UnicodeDecodeError as error:
        raise FormatError(f"{path}: not a text file: {error}") from error
    try:
        points = list(reader(text))
    except FormatError as error:
        raise FormatError(f"{path}: {error}") from None
    for k, point in enumerate(points):
        if not (abs(point.lat) <= 89.0 and abs(point.lon) <= 360.0):
            raise FormatError(
                f"{path}: point {k + 1} is at lat {point.lat:g}, lon {point.lon:g}; expected "
                "degrees, within 89 of the equator"
            )
    return _assembled(points, path)


def _assembled(points: list[Waypoint], path: Path) -> Route:
    kept = [p for k, p in enumerate(points) if k == 0 or _apart(points[k - 1], p)]
    if len(kept) < 2:
        raise FormatError(f"{path}: a route needs two different points, found {len(kept)}")
    heights = [p.height for p in kept if p.height is not None]
    return Route(
        lat=np.array([p.lat for p in kept]) * DEG,
        lon=np.unwrap(np.array([p.lon for p in kept]) * DEG),
        height=np.array(heights) if len(heights) == len(kept) else None,
        stop=np.array([p.stop for p in kept]),
        speed=np.array([math.inf if p.speed is None else p.speed for p in kept]),
    )


def _apart(a: Waypoint, b: Waypoint) -> bool:
    return (a.lat, a.lon) != (b.lat, b.lon)


def _number(value: Any, what: str, *, at_least: float = -math.inf) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise FormatError(f"{what} is {value!r}, not a number") from None
    if not (math.isfinite(number) and number >= at_least):
        raise FormatError(f"{what} is {value!r}; expected a finite number of at least {at_least}")
    return number


# ---- GPX ---------------------------------------------------------------------------------------


def _gpx(text: str) -> Iterator[Waypoint]:
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise FormatError(f"not XML: {error}") from error
    for tag in ("trkpt", "rtept", "wpt"):
        found = [e for e in root.iter() if _local(e.tag) == tag]
        if found:
            for k, element in enumerate(found):
                yield _gpx_point(element, f"{tag} {k + 1}")
            return


def _local(tag: str) -> str:
    return tag.rpartition("}")[2]


def _gpx_point(element: ET.Element, what: str) -> Waypoint:
    height = next((e.text for e in element if _local(e.tag) == "ele"), None)
    return Waypoint(
        lat=_number(element.get("lat"), f"lat of {what}"),
        lon=_number(element.get("lon"), f"lon of {what}"),
        height=None if height is None else _number(height, f"ele of {what}"),
    )


# ---- GeoJSON -----------------------------------------------------------------------------------


def _geojson(text: str) -> Iterator[Waypoint]:
    try:
        document = json.loads(text)
    except json.JSONDecodeError as error:
        raise FormatError(f"not JSON: {error}") from error
    for geometry, properties in _geometries(document):
        kind, coordinates = geometry.get("type"), geometry.get("coordinates")
        lines: Iterable[Any]
        if kind == "Point":
            lines = [[coordinates]]
        elif kind in ("LineString", "MultiPoint"):
            lines = [coordinates]
        elif kind == "MultiLineString":
            lines = coordinates if isinstance(coordinates, list) else [coordinates]
        else:
            continue
        for line in lines:
            if not isinstance(line, list):
                raise FormatError(f"coordinates of a {kind} are {line!r}")
            yield from (_geojson_point(position, properties) for position in line)


def _geometries(document: Any) -> Iterator[tuple[Mapping[str, Any], Mapping[str, Any]]]:
    if not isinstance(document, dict):
        raise FormatError("not a GeoJSON object")
    if document.get("type") == "FeatureCollection":
        for feature in document.get("features") or ():
            yield from _geometries(feature)
    elif document.get("type") == "Feature":
        geometry = document.get("geometry")
        if isinstance(geometry, dict):
            properties = document.get("properties")
            yield geometry, properties if isinstance(properties, dict) else {}
    else:
        yield document, {}


def _geojson_point(position: Any, properties: Mapping[str, Any]) -> Waypoint:
    if not isinstance(position, list) or len(position) < 2:
        raise FormatError(f"position {position!r} is not [lon, lat]")
    return Waypoint(
        lat=_number(position[1], "latitude"),
        lon=_number(position[0], "longitude"),
        height=_number(position[2], "height") if len(position) > 2 else None,
        stop=_number(properties.get("stop_s") or 0.0, "stop_s", at_least=0.0),
        speed=_speed(properties.get("speed_m_s")),
    )


def _speed(value: Any) -> float | None:
    if value is None or value == "":
        return None
    return _number(value, "speed_m_s", at_least=1.0)


# ---- CSV ---------------------------------------------------------------------------------------

_COLUMNS: Final = {
    "lat": ("lat", "lat_deg", "latitude"),
    "lon": ("lon", "lon_deg", "lng", "longitude"),
    "height": ("height", "height_m", "ele", "elevation", "alt", "altitude"),
    "stop": ("stop_s", "stop"),
    "speed": ("speed_m_s", "speed"),
}


def _csv(text: str) -> Iterator[Waypoint]:
    first = text.partition("\n")[0]
    rows = csv.DictReader(text.splitlines(), delimiter=";" if ";" in first else ",")
    names = {(name or "").strip().lower(): name for name in rows.fieldnames or ()}
    found = {
        quantity: next((names[alias] for alias in aliases if alias in names), None)
        for quantity, aliases in _COLUMNS.items()
    }
    if found["lat"] is None or found["lon"] is None:
        raise FormatError(f"no columns lat and lon; found {', '.join(names) or 'none'}")
    for k, row in enumerate(rows):
        cells = {q: row.get(name) if name is not None else None for q, name in found.items()}
        where = f"of row {k + 2}"
        height = cells["height"]
        yield Waypoint(
            lat=_number(cells["lat"], f"lat {where}"),
            lon=_number(cells["lon"], f"lon {where}"),
            height=_number(height, f"height {where}") if height else None,
            stop=_number(cells["stop"] or 0.0, f"stop_s {where}", at_least=0.0),
            speed=_speed(cells["speed"]),
        )


READERS: Final[Mapping[str, Callable[[str], Iterator[Waypoint]]]] = MappingProxyType(
    {".gpx": _gpx, ".geojson": _geojson, ".json": _geojson, ".csv": _csv}
)
"""Suffix -> reader."""
