"""Either side of a comparison from any file: a trajectory, a truth, or a receiver's fixes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.errors import Finding, LogError
from vehnav.export.columns import course_of, velocity_of
from vehnav.export.formats import read_trajectory
from vehnav.logs.log import Gnss, ReadOptions
from vehnav.logs.read import read_gnss
from vehnav.rotation import c_nb_from_angles
from vehnav.trajectory import Trajectory

Array = npt.NDArray[np.float64]

ALWAYS: Final = frozenset({".tum", ".kitti", ".parquet", ".json"})
"""Suffixes that hold nothing but a trajectory of vehnav."""
OWN_COLUMNS: Final = frozenset({"time_s", "lat_deg", "lon_deg"})
ATTITUDE_COLUMNS: Final = frozenset({"heading_deg", "yaw_enu_deg"})
UNIX_FROM_NS: Final = 100_000_000 * 1_000_000_000
"""1973: stamps after it are Unix time."""


@dataclass(frozen=True)
class Track:
    """What a file says about where the vehicle was.

    Attributes
    ----------
    path : str
    trajectory : Trajectory
        Of fixes alone: velocities are the receiver's or differences, attitude is the course.
    gnss : Gnss or None
        The fixes, where the file holds fixes.
    findings : tuple of Finding
    """

    path: str
    trajectory: Trajectory
    gnss: Gnss | None = None
    findings: tuple[Finding, ...] = ()

    @property
    def unix_clock(self) -> bool:
        """Whether its stamps are Unix time."""
        return int(self.trajectory.t_ns[0]) > UNIX_FROM_NS

    def reference(self) -> tuple[Gnss, Array | None]:
        """The fixes that judge another track, and their attitude (m, 3, 3) if it is known."""
        if self.gnss is not None:
            return self.gnss, None
        return as_gnss(self.trajectory, source=self.path), self.trajectory.c_nb


def as_gnss(trajectory: Trajectory, *, source: str = "") -> Gnss:
    """A trajectory as a receiver that follows it: what judges another one as truth."""
    return Gnss(
        t_ns=trajectory.t_ns,
        lat=trajectory.lat,
        lon=trajectory.lon,
        height=trajectory.height,
        v_n=trajectory.v_n,
        sigma_pos=trajectory.sigma_pos,
        source=source,
    )


def as_trajectory(gnss: Gnss) -> Trajectory:
    """Fixes as a trajectory: heading is the course, level, never stopped; ValueError below two."""
    if gnss.t_ns.size < 2:
        raise ValueError("a trajectory needs two fixes")
    v_n = gnss.v_n
    if v_n is None:
        v_n = velocity_of(gnss.t_ns, gnss.lat, gnss.lon, gnss.height)
    return Trajectory(
        t_ns=gnss.t_ns,
        lat=gnss.lat,
        lon=gnss.lon,
        height=gnss.height,
        v_n=v_n,
        c_nb=c_nb_from_angles(course_of(v_n), 0.0, 0.0),
        stopped=np.zeros(gnss.t_ns.size, bool),
        sigma_pos=gnss.sigma_pos,
    )


def _is_own_csv(path: Path) -> bool:
    """Whether a CSV has time, place and attitude under the names of ``trajectory.csv``."""
    if path.suffix.lower() != ".csv" or not path.is_file():
        return False
    with path.open("rb") as file:
        first = file.readline(4096).decode("utf-8", errors="replace")
    names = {name.strip() for name in first.split(",")}
    return names >= OWN_COLUMNS and bool(names & ATTITUDE_COLUMNS)


def is_trajectory(path: str | Path, options: ReadOptions | None = None) -> bool:
    """Whether a file is a trajectory of vehnav, not a recording or a table of fixes.

    By its suffix, for CSV by the names of its columns; ``columns`` or ``preset`` in the options
    say that a CSV is not.
    """
    told = options is not None and (bool(options.columns) or options.preset is not None)
    name = Path(path)
    return name.suffix.lower() in ALWAYS or (not told and _is_own_csv(name))


def load_track(path: str | Path, options: ReadOptions | None = None) -> Track:
    """Read a trajectory, a truth or fixes.

    Parameters
    ----------
    path : path
        Anything that :func:`vehnav.export.read_trajectory` or ``read_gnss`` reads.
    options : ReadOptions or None
        For recordings and tables of fixes; with ``columns`` or ``preset`` a CSV is a table of
        fixes.

    Raises
    ------
    LogError, FormatError, ConfigError
        What is wrong with the file.
    """
    options = options or ReadOptions()
    if is_trajectory(path, options):
        return Track(str(path), read_trajectory(path))
    gnss, findings = read_gnss(str(path), replace(options, gps_file=None, speed_file=None))
    if gnss.t_ns.size < 2:
        raise LogError(f"{path}: {gnss.t_ns.size} fixes; a track has at least two")
    return Track(str(path), as_trajectory(gnss), gnss, tuple(findings))
