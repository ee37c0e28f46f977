"""Several trajectories against one reference as plain data: one map, one set of plots."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.earth import geodetic_from_local_enu, local_enu
from vehnav.errors import ConfigError, Finding
from vehnav.evaluation import Errors
from vehnav.export.load import Track as Loaded
from vehnav.export.thinning import thin
from vehnav.logs.log import Gnss
from vehnav.report.figures import ROOM, Curve, Panel, Span, curve
from vehnav.report.mapping import Box, Map, Place, Track, box_around, fix_lines, free_side
from vehnav.report.panels import off_picture, over_distance
from vehnav.report.summary import metres
from vehnav.trajectory import Trajectory
from vehnav.units import NS

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

ROLES: Final = (
    "ours", "free", "published", "second", "levelling", "sixth", "seventh", "eighth"
)  # fmt: skip
"""Colours of the trajectories in their order."""
READABLE: Final = 5.0
"""Times the largest error of the next better trajectory that a curve may stretch the axis."""
SMALL: Final = 0.02
"""Of the distance driven: an error below it is always shown whole."""
LONGEST: Final = 28
"""Characters of a name in legends; of a longer one the ends are kept."""
AROUND: Final = 0.5
"""Of the reference's extent that trajectories may add to the map on each side."""


@dataclass(frozen=True)
class Entry:
    """A trajectory that is compared: its short name, colour, file, states and errors."""

    name: str
    role: str
    path: str
    trajectory: Trajectory
    errors: Errors


@dataclass(frozen=True)
class Comparison:
    """All that is compared.

    Attributes
    ----------
    entries : tuple of Entry
    reference : Gnss
        What judges, on its own clock.
    path : str
        File of the reference.
    against : str
        What the reference is called: ``GPS``, or ``the reference`` where it is a trajectory.
    findings : tuple of Finding
        About all files, none twice; the name of the trajectory stands in front.
    start_ns : int
        Zero of all times: the start of the earliest trajectory.
    unix_clock : bool
    """

    entries: tuple[Entry, ...]
    reference: Gnss
    path: str
    against: str
    findings: tuple[Finding, ...]
    start_ns: int
    unix_clock: bool


def check_number(count: int) -> None:
    """ConfigError if there are more trajectories than colours."""
    if count > len(ROLES):
        raise ConfigError(
            f"{count} trajectories in one picture: its colours tell {len(ROLES)} apart; compare "
            "fewer, or leave out --html and --plots"
        )


def comparison(tracks: Sequence[Loaded], results: Sequence[Errors]) -> Comparison:
    """What is shown of ``tracks``, the last of which judges the others with ``results``.

    Raises
    ------
    ConfigError
        More trajectories than colours.
    """
    check_number(len(results))
    judge, judged = tracks[-1], tracks[:-1]
    names = short_names([track.path for track in judged])
    entries = tuple(
        Entry(name, role, track.path, track.trajectory, errors)
        for name, role, track, errors in zip(names, ROLES, judged, results, strict=False)
    )
    found = [(judge.path, f) for f in judge.findings]
    for entry, track in zip(entries, judged, strict=True):
        found += [(entry.name, f) for f in (*track.findings, *entry.errors.findings)]
    return Comparison(
        entries=entries,
        reference=judge.reference()[0],
        path=judge.path,
        against="GPS" if judge.gnss is not None else "the reference",
        findings=_told_once(found),
        start_ns=min(int(track.trajectory.t_ns[0]) for track in judged),
        unix_clock=judge.unix_clock,
    )


def _told_once(found: Sequence[tuple[str, Finding]]) -> tuple[Finding, ...]:
    """Each finding with the names of the files that it is about."""
    names: dict[Finding, list[str]] = {}
    for name, finding in found:
        names.setdefault(finding, []).append(name)
    told = []
    for finding, who in names.items():
        about = ", ".join(dict.fromkeys(who))
        text = finding.text if finding.text.startswith(who[0]) else f"{about}: {finding.text}"
        told.append(replace(finding, text=text))
    return tuple(told)


def short_names(paths: Sequence[str]) -> list[str]:
    """Names for legends: the part of the paths that tells them apart.

    >>> short_names(["x/a.csv", "y/b.tum"])
    ['a.csv', 'b.tum']
    >>> short_names(["out/city.vehnav/trajectory.csv", "out/free.vehnav/trajectory.csv"])
    ['city.vehnav', 'free.vehnav']
    >>> short_names(["drive_of_the_12th_with_the_new_sensor.csv"])
    ['drive_of_the_…new_sensor.csv']
    >>> short_names(["a.csv", "a.csv"])
    ['a.csv', 'a.csv (2)']
    """
    parts = [PurePath(path).parts or (path,) for path in paths]
    last = [part[-1] for part in parts]
    if len(set(last)) < len(last) and len(set(parts)) > 1:
        least = min(len(part) for part in parts)
        head = next(k for k in range(least + 1) if len({part[: k + 1] for part in parts}) > 1)
        tail = next(
            k
            for k in range(least + 1)
            if k == least or len({p[len(p) - k - 1 :] for p in parts}) > 1
        )
        last = ["/".join(p[head : len(p) - tail] or p[-1:]) for p in parts]
    seen: Counter[str] = Counter()
    names = []
    for whole in last:
        half = (LONGEST - 1) // 2
        name = whole if len(whole) <= LONGEST else f"{whole[:half]}…{whole[half + 1 - LONGEST :]}"
        seen[name] += 1
        names.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return names


# ---- the map -----------------------------------------------------------------------------------


def comparison_map(item: Comparison) -> Map:
    """The map: the reference below, the first trajectory on top; origin at the first fix.

    A trajectory that was aligned is drawn as it was judged.
    """
    t, place, origin = _reference(item)
    gps = Track(_legend_name(item), "gps", fix_lines(t, place))
    tracks = [_on_ground(item, entry, origin) for entry in item.entries]
    box = _box(place, tracks)
    seen = np.concatenate([place, *(p for track in tracks for _, p in track.parts)])
    ends = ((item.against, "start", 0), (item.against, "end", -1))
    return Map(
        box=box,
        tracks=(gps, *reversed(tracks)),
        stops=(),
        ends=tuple(
            Place(
                end,
                f"{end} of {who}, {t[k]:.1f} s",
                float(place[k, 0]),
                float(place[k, 1]),
                float(t[k]),
            )
            for who, end, k in ends
        ),
        ellipses=(),
        too_large=0,
        used=None,
        miss=None,
        local=False,
        north_known=True,
        scale_side=free_side(seen, box),
        equal=True,
        note=_off_map(item, tracks, box),
    )


def _legend_name(item: Comparison) -> str:
    return item.against.removeprefix("the ")


def _reference(item: Comparison) -> tuple[Array, Array, tuple[float, float, float]]:
    """Times (m,) s and places (m, 2) m of the fixes within the trajectories; the origin."""
    gnss = item.reference
    offset = item.entries[0].errors.time_offset
    t = np.asarray((gnss.t_ns - item.start_ns) * NS + offset)
    last = max(int(entry.trajectory.t_ns[-1]) for entry in item.entries)
    within = (t >= 0.0) & (t <= (last - item.start_ns) * NS)
    k = int(np.flatnonzero(within)[0])
    origin = (float(gnss.lat[k]), float(gnss.lon[k]), float(gnss.height[k]))
    place = local_enu(gnss.lat[within], gnss.lon[within], gnss.height[within], origin=origin)
    return t[within], place[:, :2], origin


def _on_ground(item: Comparison, entry: Entry, origin: tuple[float, float, float]) -> Track:
    few, fit = thin(entry.trajectory), entry.errors.fit
    lat, lon, height = few.lat, few.lon, few.height
    if fit is not None:
        moved = few.enu(fit.origin) @ fit.c.T + fit.d
        lat, lon, height = geodetic_from_local_enu(moved, origin=fit.origin)
    place = local_enu(lat, lon, height, origin=origin)[:, :2]
    t = np.asarray((few.t_ns - item.start_ns) * NS)
    return Track(entry.name, entry.role, ((t, place),))


def _box(place: Array, tracks: Sequence[Track]) -> Box:
    """Around the reference and as much of the trajectories as leaves it readable."""
    low, high = place.min(axis=0), place.max(axis=0)
    room = AROUND * max(float((high - low).max()), 10.0)
    near = [place]
    for track in tracks:
        for _, p in track.parts:
            near.append(np.clip(p, low - room, high + room))
    return box_around(np.concatenate(near), [])


def _off_map(item: Comparison, tracks: Sequence[Track], box: Box) -> str:
    notes = []
    for entry, track in zip(item.entries, tracks, strict=True):
        p = np.concatenate([p for _, p in track.parts])
        if np.any((p < box[:2]) | (p > box[2:])):
            far = metres(float(entry.errors.horizontal.max()))
            notes.append(f"{entry.name} leaves the map: up to {far} from {item.against}")
    return "; ".join(notes)


# ---- the plots ---------------------------------------------------------------------------------


def comparison_panels(item: Comparison) -> list[Panel]:
    """Errors of every trajectory over time and over distance."""
    sizes = [_over_time(item, entry, entry.errors.horizontal) for entry in item.entries]
    panels = [
        _panel(item, "error", f"Horizontal error against {item.against}", sizes),
        _distance_panel(item),
    ]
    for key, title in SIGNED:
        series = [getattr(entry.errors, key) for entry in item.entries]
        curves = [_over_time(item, e, y) for e, y in zip(item.entries, series, strict=True)]
        panels.append(_panel(item, f"error-{key}", title, curves))
    return panels


SIGNED: Final = (
    ("along", "Error along the track, ahead positive"),
    ("cross", "Error across the track, right positive"),
    ("up", "Height error"),
)
"""Series of the errors beside the horizontal one, and the titles of their plots."""


def _times(item: Comparison, entry: Entry) -> Array:
    return np.asarray((entry.errors.t_ns - item.start_ns) * NS)


def _over_time(item: Comparison, entry: Entry, y: Array) -> Curve:
    return curve(entry.name, entry.role, _times(item, entry), y)


def _driven(item: Comparison) -> float:
    return max(float(entry.errors.distance[-1]) for entry in item.entries)


def readable(curves: Sequence[Curve], small: float) -> list[Curve]:
    """The curves that the axis shows whole: each at most five times as large as the one before.

    What is not larger than ``small`` is always shown.
    """
    ordered = sorted(curves, key=lambda c: c.largest)
    shown = ordered[:1]
    for item in ordered[1:]:
        if item.largest > max(READABLE * shown[-1].largest, small):
            break
        shown.append(item)
    return shown


def _y_range(curves: Sequence[Curve], small: float) -> tuple[float, float]:
    shown = readable(curves, small)
    low = min(0.0, *(c.bounds[0] for c in shown))
    high = max(0.0, *(c.bounds[1] for c in shown))
    room = (ROOM - 1.0) * max(high - low, 1e-3)
    return (low - room if low < 0.0 else 0.0), high + room


def _panel(item: Comparison, key: str, title: str, curves: list[Curve]) -> Panel:
    y_range = _y_range(curves, SMALL * _driven(item))
    t = np.concatenate([_times(item, entry)[[0, -1]] for entry in item.entries])
    x_range = (float(t.min()), max(float(t.max()), float(t.min()) + 1.0))
    return Panel(
        key, title, "m", "s", x_range, y_range, tuple(curves), (),
        _stops(item), off_picture(curves, y_range, "m", "s"),
    )  # fmt: skip


def _distance_panel(item: Comparison) -> Panel:
    curves = [
        over_distance(_times(item, entry), entry.errors, entry.name, entry.role)
        for entry in item.entries
    ]
    y_range = _y_range(curves, SMALL * _driven(item))
    return Panel(
        "error-distance", "Horizontal error over distance", "m", "m",
        (0.0, max(_driven(item), 1.0)), y_range, tuple(curves), (), (),
        off_picture(curves, y_range, "m", "m"),
    )  # fmt: skip


def _stops(item: Comparison) -> tuple[Span, ...]:
    """Where the first trajectory that knows of stops stands."""
    for entry in item.entries:
        stopped: Bools = entry.trajectory.stopped
        if stopped.any():
            edges = np.flatnonzero(np.diff(np.concatenate([[False], stopped, [False]])))
            t = (entry.trajectory.t_ns - item.start_ns) * NS
            return tuple(
                Span("stop", float(t[a]), float(t[b - 1]))
                for a, b in zip(edges[::2], edges[1::2], strict=True)
            )
    return ()
