"""The table of formats: which suffix is written and read by what."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol

import numpy as np

from vehnav.errors import ConfigError, LogError
from vehnav.evaluation import Errors
from vehnav.export import foxglove, maps, poses, text_tables
from vehnav.export.atomic import atomic_path
from vehnav.export.columns import decimate
from vehnav.export.poses import Origin
from vehnav.logs.log import Gnss
from vehnav.trajectory import Trajectory


class Writer(Protocol):
    """Writes a trajectory to ``path``; ``final`` is the name that the file will have."""

    def __call__(
        self,
        trajectory: Trajectory,
        path: Path,
        /,
        *,
        final: Path,
        unix_clock: bool,
        rate_hz: float | None,
        origin: Origin | None,
        errors: Errors | None,
        gnss: Gnss | None,
    ) -> None:
        """Write; ValueError for what the format cannot hold."""


@dataclass(frozen=True)
class Format:
    """A row of the table.

    Attributes
    ----------
    name : str
    suffixes : tuple of str
    write : Writer
    read : callable or None
        Path -> Trajectory; None where the format holds less than a trajectory.
    thins : bool
        Whether the writer itself chooses which states it shows.
    """

    name: str
    suffixes: tuple[str, ...]
    write: Writer
    read: Callable[[Path], Trajectory] | None = None
    thins: bool = False


FORMATS: Final = (
    Format("CSV", (".csv",), text_tables.write_csv, text_tables.read_csv),
    Format("Parquet", (".parquet",), text_tables.write_parquet, text_tables.read_parquet),
    Format("JSON", (".json",), text_tables.write_json, text_tables.read_json),
    Format("TUM", (".tum",), poses.write_tum, poses.read_tum),
    Format("KITTI", (".kitti",), poses.write_kitti, poses.read_kitti),
    Format("GPX", (".gpx",), maps.write_gpx, thins=True),
    Format("KML", (".kml",), maps.write_kml, thins=True),
    Format("GeoJSON", (".geojson",), maps.write_geojson, thins=True),
    Format("MCAP", (".mcap",), foxglove.write_mcap, thins=True),
)
BY_SUFFIX: Final = {suffix: row for row in FORMATS for suffix in row.suffixes}


def format_of(path: str | Path) -> Format:
    """The row of a path's suffix; ConfigError names the suffixes that there are."""
    suffix = Path(path).suffix.lower()
    if suffix not in BY_SUFFIX:
        known = " ".join(BY_SUFFIX)
        raise ConfigError(f"{path}: no trajectory format has the suffix {suffix!r}; known: {known}")
    return BY_SUFFIX[suffix]


def _refuse_nan(trajectory: Trajectory) -> None:
    for name in ("lat", "lon", "height", "v_n", "c_nb", "sigma_pos", "sigma_heading", "wander"):
        values = getattr(trajectory, name)
        if values is not None and not np.all(np.isfinite(values)):
            raise ValueError(f"trajectory: {name} is not finite: refused, nothing is written")


def write_trajectory(
    trajectory: Trajectory,
    path: str | Path,
    *,
    unix_clock: bool = True,
    rate_hz: float | None = None,
    origin: Origin | None = None,
    errors: Errors | None = None,
    gnss: Gnss | None = None,
) -> None:
    """Write a trajectory in the format of the suffix of ``path``; it appears whole or not at all.

    Parameters
    ----------
    trajectory : Trajectory
        At least one state.
    path : path
        ``.csv .parquet .json .tum .kitti .gpx .kml .geojson .mcap``.
    unix_clock : bool
        Whether the stamps are Unix time; map formats carry no times otherwise.
    rate_hz : float or None
        States a second; None: all (maps are thinned to 0.2 m, MCAP to 10 Hz).
    origin : (lat rad, lon rad, height m) or None
        Of the map frame of TUM and KITTI; None: the first state.
    errors : Errors or None
        Colours KML and GeoJSON.
    gnss : Gnss or None
        Goes into MCAP beside the trajectory.

    Raises
    ------
    ConfigError
        Unknown suffix.
    ValueError
        A number that is not finite, or no state.
    """
    row = format_of(path)
    if trajectory.size == 0:
        raise ValueError("trajectory: no state: refused, nothing is written")
    _refuse_nan(trajectory)
    chosen = trajectory if row.thins else decimate(trajectory, rate_hz)
    with atomic_path(path) as temporary:
        row.write(
            chosen,
            temporary,
            final=Path(path),
            unix_clock=unix_clock,
            rate_hz=rate_hz,
            origin=origin,
            errors=errors,
            gnss=gnss,
        )


def read_trajectory(path: str | Path) -> Trajectory:
    """Read a trajectory of vehnav: CSV, Parquet, JSON, TUM or KITTI with the files beside it.

    Raises
    ------
    LogError
        No such file, or its format holds no trajectory.
    FormatError
        The file does not follow its format; row and column are named.
    """
    row = format_of(path)
    if row.read is None:
        readable = " ".join(s for f in FORMATS if f.read is not None for s in f.suffixes)
        raise LogError(f"{path}: {row.name} holds no trajectory that can be read; {readable} do")
    if not Path(path).is_file():
        raise LogError(f"{path}: no such file")
    if Path(path).stat().st_size == 0:
        raise LogError(f"{path}: the file is empty (0 bytes)")
    return row.read(Path(path))
