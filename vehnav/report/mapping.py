"""The map of a run as plain data: tracks, stops, expected ellipses, in metres east and north."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.earth import WGS84, local_enu
from vehnav.export.thinning import keep_points, thin
from vehnav.pipeline import Run
from vehnav.report.circle import ELLIPSE_95
from vehnav.report.figures import LEGEND, gps_window, inside, log_seconds, others, own_name
from vehnav.report.scale import between_gaps
from vehnav.report.summary import metres
from vehnav.trajectory import Trajectory, interpolate
from vehnav.units import NS

Array = npt.NDArray[np.float64]
Box = tuple[float, float, float, float]
POLE_NOTE: Final = (
    "The map is the plane that touches the Earth at the start; up is north there, and at the pole "
    "(ring) every way leads away from it."
)

GPS_TOLERANCE: Final = 0.2
"""m: as for the tracks of the exports."""
GPS_GAP: Final = 10.0
"""s without a fix over which no line is drawn."""
MARGIN: Final = 0.06
"""Of the larger side, free around the tracks."""
ASPECT: Final = (0.85, 1.7)
"""Narrowest and widest map: width over height."""
ELLIPSE_ROOM: Final = 0.2
"""Of the tracks' extent that an expected ellipse may add to the map."""
LARGE: Final = 0.75
"""Of the map's width above which an ellipse would only tint the map: said, not drawn."""
SMALL: Final = 0.006
"""Of the map's width below which an ellipse is not drawn."""


@dataclass(frozen=True)
class Track:
    """A line on the map: parts of (t (n,) s, place (n, 2) m), cut at gaps."""

    name: str
    role: str
    parts: tuple[tuple[Array, Array], ...]
    shown: bool = True


@dataclass(frozen=True)
class Place:
    """A stop (its number) or an end of the track (``start``, ``end``): m east and north, s."""

    label: str
    text: str
    east: float
    north: float
    t: float


@dataclass(frozen=True)
class Ellipse:
    """What the position lies inside with 95 % probability: centre and half axes, m.

    ``last``: at an end of the track, not at a stop.
    """

    east: float
    north: float
    a_east: float
    a_north: float
    last: bool


@dataclass(frozen=True)
class Map:
    """All that is on the map; ``box`` is west, south, east, north, m.

    ``too_large``: how many ellipses are larger than the map. ``scale_side``: the lower corner,
    ``left`` or ``right``, that the tracks leave free for the scale bar. ``equal``: no track is the
    vehicle's own, the cursor shows all of them. ``note``: stands under the map.
    ``pole``: where a geographic pole lies, if it is on the map.
    """

    box: Box
    tracks: tuple[Track, ...]
    stops: tuple[Place, ...]
    ends: tuple[Place, ...]
    ellipses: tuple[Ellipse, ...]
    too_large: int
    used: Track | None
    miss: tuple[tuple[float, float], tuple[float, float]] | None
    local: bool
    north_known: bool
    scale_side: str
    equal: bool = False
    note: str = ""
    pole: Place | None = None


def map_of(run: Run) -> Map:
    """The map: origin at the first state of the solution's start."""
    origin = run.alignment.position
    tracks = [_own(run, origin)]
    gps, used = _gps(run, origin)
    for name, role in others(run, ("as_published", "free")):
        tracks.insert(0, _track(LEGEND[name], role, run.variants[name], run, origin, False))
    if gps is not None:
        tracks.insert(0, gps)
    stops = _stops(run, origin)
    ellipses = _ellipses(run, origin)
    seen = [p for track in tracks if track.role in ("ours", "gps") for _, p in track.parts]
    box = box_around(np.concatenate(seen), ellipses)
    width = box[2] - box[0]
    pole = None if run.alignment.local else _pole(run, origin, box)
    drawn = [e for e in ellipses if SMALL * width < max(e.a_east, e.a_north) < LARGE * width]
    return Map(
        box=box,
        tracks=tuple(tracks),
        stops=stops,
        ends=_ends(run, origin),
        ellipses=tuple(drawn),
        too_large=sum(max(e.a_east, e.a_north) >= LARGE * width for e in ellipses),
        used=used,
        miss=_miss(run, origin),
        local=run.alignment.local,
        north_known=run.alignment.heading_from != "none",
        scale_side=free_side(np.concatenate(seen), box),
        note="" if pole is None else POLE_NOTE,
        pole=pole,
    )


def _pole(run: Run, origin: tuple[float, float, float], box: Box) -> Place | None:
    """The pole of the start's hemisphere, if it lies on the map."""
    sign = 1.0 if origin[0] > 0.0 else -1.0
    east, north, up = (float(x) for x in local_enu(sign * np.pi / 2, 0.0, 0.0, origin=origin))
    if up < -0.1 * WGS84.a or not (box[0] < east < box[2] and box[1] < north < box[3]):
        return None
    near = run.trajectory.enu(origin)[:, :2] - [east, north]
    k = int(np.argmin(np.hypot(near[:, 0], near[:, 1])))
    away = float(np.hypot(near[k, 0], near[k, 1]))
    t = float(log_seconds(run, run.trajectory.t_ns[[k]])[0])
    name = "North pole" if sign > 0.0 else "South pole"
    return Place("pole", f"{name}, passed at {metres(away)} at {t:.1f} s", east, north, t)


def _own(run: Run, origin: tuple[float, float, float]) -> Track:
    return _track(own_name(run), "ours", run.trajectory, run, origin, True)


def _track(
    name: str,
    role: str,
    trajectory: Trajectory,
    run: Run,
    origin: tuple[float, float, float],
    shown: bool,
) -> Track:
    few = thin(trajectory)
    return Track(name, role, ((log_seconds(run, few.t_ns), few.enu(origin)[:, :2]),), shown)


def _gps(run: Run, origin: tuple[float, float, float]) -> tuple[Track | None, Track | None]:
    """The fixes as a line, and the stretch of them that was used for the start."""
    gnss = run.log.gnss
    if gnss is None or run.alignment.local:
        return None, None
    within = inside(run, gnss)
    if not within.any():
        return None, None
    place = local_enu(gnss.lat, gnss.lon, gnss.height, origin=origin)[within, :2]
    t = log_seconds(run, gnss.t_ns[within])
    parts, used = fix_lines(t, place), []
    begin, until = gps_window(run)
    for x, p in parts:
        early = (x >= begin) & (x <= until)
        if np.count_nonzero(early) > 1 and run.gps.fixes_used:
            used.append((x[early], p[early]))
    highlight = Track("GPS used for the start", "used", tuple(used)) if used else None
    return Track("GPS", "gps", parts), highlight


def fix_lines(t: Array, place: Array) -> tuple[tuple[Array, Array], ...]:
    """Fixes at t (m,) s and place (m, 2) m as thinned lines between the gaps."""
    parts = []
    for part in between_gaps(t, least=GPS_GAP):
        x, p = t[part], place[part]
        keep = keep_points(x, p, GPS_TOLERANCE) if x.size > 1 else np.arange(x.size)
        parts.append((x[keep], p[keep]))
    return tuple(parts)


def _at(run: Run, t: float, origin: tuple[float, float, float]) -> tuple[float, float]:
    track = run.trajectory
    stamp = np.clip(run.start_ns + round(t / NS), track.t_ns[0], track.t_ns[-1])
    place = interpolate(track, np.array([stamp], np.int64)).enu(origin)[0]
    return float(place[0]), float(place[1])


def _stops(run: Run, origin: tuple[float, float, float]) -> tuple[Place, ...]:
    return tuple(
        Place(
            str(k + 1),
            f"stop {k + 1}: {stop.start:.1f} to {stop.end:.1f} s",
            *_at(run, 0.5 * (stop.start + stop.end), origin),
            0.5 * (stop.start + stop.end),
        )
        for k, stop in enumerate(run.stops)
    )


def _ends(run: Run, origin: tuple[float, float, float]) -> tuple[Place, ...]:
    t = log_seconds(run, run.trajectory.t_ns[[0, -1]])
    names = ("start", "end")
    return tuple(
        Place(name, f"{name} of the track, {x:.1f} s", *_at(run, float(x), origin), float(x))
        for name, x in zip(names, t, strict=True)
    )


def _ellipses(run: Run, origin: tuple[float, float, float]) -> list[Ellipse]:
    """At every stop and at both ends."""
    track = run.trajectory
    if track.sigma_pos is None:
        return []
    middle = [run.start_ns + round(0.5 * (s.start + s.end) / NS) for s in run.stops]
    stamps = np.array(sorted({int(track.t_ns[0]), *middle, int(track.t_ns[-1])}), np.int64)
    rows = np.clip(np.searchsorted(track.t_ns, stamps), 0, track.size - 1)
    states = track.rows(rows)
    place, sigma = states.enu(origin), track.sigma_pos[rows, :2] * ELLIPSE_95
    last = [k in (0, track.size - 1) for k in rows]
    return [
        Ellipse(float(p[0]), float(p[1]), float(s[0]), float(s[1]), end)
        for p, s, end in zip(place, sigma, last, strict=True)
    ]


def _miss(
    run: Run, origin: tuple[float, float, float]
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """From the last judged state to the fix that judges it."""
    errors = run.errors
    if errors is None:
        return None
    own = errors.states.rows(slice(-1, None)).enu(origin)[0]
    fix = local_enu(errors.lat[-1], errors.lon[-1], errors.height[-1], origin=origin)
    return (float(own[0]), float(own[1])), (float(fix[0]), float(fix[1]))


def free_side(places: Array, box: Box) -> str:
    """The lower corner with fewer points of the tracks: 12 % of the height, 35 % of the width."""
    west, south, east, north = box
    low = places[places[:, 1] < south + 0.12 * (north - south), 0]
    left = np.count_nonzero(low < west + 0.35 * (east - west))
    right = np.count_nonzero(low > east - 0.35 * (east - west))
    return "right" if right < left else "left"


def box_around(places: Array, ellipses: Sequence[Ellipse]) -> Box:
    """Around the tracks, widened for the ellipses a little, and not too narrow either way."""
    low, high = places.min(axis=0), places.max(axis=0)
    room = ELLIPSE_ROOM * max(float((high - low).max()), 10.0)
    for e in ellipses:
        centre, half = np.array([e.east, e.north]), np.array([e.a_east, e.a_north])
        low = np.maximum(np.minimum(low, centre - half), places.min(axis=0) - room)
        high = np.minimum(np.maximum(high, centre + half), places.max(axis=0) + room)
    side = max(float((high - low).max()), 10.0)
    low, high = low - MARGIN * side, high + MARGIN * side
    width, height = high - low
    wanted = np.clip(width / height, *ASPECT)
    grow = np.array([max(width, wanted * height) - width, max(height, width / wanted) - height])
    low, high = low - 0.5 * grow, high + 0.5 * grow
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])
