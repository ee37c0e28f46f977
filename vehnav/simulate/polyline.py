"""The line of a route on the ellipsoid: offsets, points left out, sharp turns cut in two."""

from __future__ import annotations

import itertools
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.earth import WGS84, Ellipsoid, curvature_radii
from vehnav.simulate.waypoints import Route

Array = npt.NDArray[np.float64]

SHORTEST_LEG: Final = 12.0
"""m: points closer than this to the one before are left out."""
SHARP: Final = math.radians(140.0)
"""A turn by more is driven as two right angles, the legs apart by :data:`SHORTEST_LEG`."""


def offset(
    lat: float, lon: float, lat_to: float, lon_to: float, height: float, earth: Ellipsoid
) -> tuple[float, float]:
    """(east, north), m, of the line of constant heading to a point: radii at mid-latitude."""
    mid = 0.5 * (lat + lat_to)
    r_m, r_n = curvature_radii(mid, height, earth)
    return (lon_to - lon) * r_n * math.cos(mid), (lat_to - lat) * r_m


def moved(
    lat: float, lon: float, east: float, north: float, height: float, earth: Ellipsoid
) -> tuple[float, float]:
    """The point (lat, lon) at an offset; inverse of :func:`offset` to 1e-12."""
    new = lat
    for _ in range(4):
        r_m, _ = curvature_radii(0.5 * (lat + new), height, earth)
        new = lat + north / r_m
    mid = 0.5 * (lat + new)
    _, r_n = curvature_radii(mid, height, earth)
    return new, lon + east / (r_n * math.cos(mid))


def simplified(route: Route, tolerance: float, *, earth: Ellipsoid = WGS84) -> Route:
    """Without points that a car does not notice: nearer than ``tolerance`` m to the line.

    Points with a stop stay. Ramer, Douglas and Peucker's rule, then a shortest leg.
    """
    lat0 = float(np.mean(route.lat))
    r_m, r_n = curvature_radii(lat0, 0.0, earth)
    xy = np.stack([route.lon * r_n * math.cos(lat0), route.lat * r_m], axis=-1)
    keep = np.zeros(route.lat.size, bool)
    keep[[0, -1]] = True
    keep |= route.stop > 0.0
    fixed = np.flatnonzero(keep)
    spans = [(int(a), int(b)) for a, b in itertools.pairwise(fixed)]
    while spans:
        a, b = spans.pop()
        if b - a < 2:
            continue
        away = _distance_to_chord(xy[a + 1 : b], xy[a], xy[b])
        k = int(np.argmax(away))
        if away[k] > tolerance:
            middle = a + 1 + k
            keep[middle] = True
            spans += [(a, middle), (middle, b)]
    index = np.flatnonzero(keep)
    chosen = [int(index[0])]
    for k in index[1:-1]:
        if np.hypot(*(xy[k] - xy[chosen[-1]])) >= SHORTEST_LEG:
            chosen.append(int(k))
    last = int(index[-1])
    while len(chosen) > 1 and np.hypot(*(xy[last] - xy[chosen[-1]])) < SHORTEST_LEG:
        chosen.pop()
    chosen.append(last)
    return taken(route, np.array(chosen))


def _distance_to_chord(points: Array, a: Array, b: Array) -> Array:
    """(n,) m: distance of points (n, 2) to the segment from a to b."""
    along = b - a
    length2 = float(along @ along)
    s = (
        np.clip((points - a) @ along / length2, 0.0, 1.0)
        if length2 > 0.0
        else np.zeros(len(points))
    )
    return np.asarray(np.hypot(*(points - a - s[:, None] * along).T))


def taken(route: Route, index: npt.NDArray[np.int64]) -> Route:
    """Some of the points."""
    height = None if route.height is None else route.height[index]
    return Route(route.lat[index], route.lon[index], height, route.stop[index], route.speed[index])


def without_sharp_turns(route: Route, *, earth: Ellipsoid = WGS84) -> Route:
    """Every turn by more than 140 degrees as two corners, the second to the left of the first."""
    points: list[tuple[float, float, int]] = [(float(route.lat[0]), float(route.lon[0]), 0)]
    for k in range(1, route.lat.size - 1):
        here = (float(route.lat[k]), float(route.lon[k]))
        e0, n0 = offset(*points[-1][:2], *here, 0.0, earth)
        e1, n1 = offset(*here, float(route.lat[k + 1]), float(route.lon[k + 1]), 0.0, earth)
        points.append((*here, k))
        if abs(turn_between(math.atan2(e0, n0), math.atan2(e1, n1))) > SHARP:
            left = SHORTEST_LEG / math.hypot(e0, n0)
            points.append((*moved(*here, -n0 * left, e0 * left, 0.0, earth), k))
    last = route.lat.size - 1
    points.append((float(route.lat[last]), float(route.lon[last]), last))
    thick = taken(route, np.array([p[2] for p in points]))
    stop = thick.stop.copy()
    stop[1:][np.diff([p[2] for p in points]) == 0] = 0.0
    lat, lon = np.array([p[0] for p in points]), np.array([p[1] for p in points])
    return Route(lat, lon, thick.height, stop, thick.speed)


def turn_between(heading: float, new: float) -> float:
    """Turn from one heading to another, rad, within half a turn, clockwise positive."""
    return math.remainder(new - heading, 2.0 * math.pi)
