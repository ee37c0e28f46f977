"""TUM and KITTI: poses in a map frame, East-North-Up at an origin kept in a file beside.

The body of these formats is forward-left-up, as in ROS. ``STEM.origin.json`` holds lat_deg,
lon_deg, height_m of the map's origin and t0_ns, the stamp of the first pose; KITTI, which has no
times, gets ``STEM.times.txt`` with seconds since t0.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.earth import c_en, geodetic_from_local_enu
from vehnav.errors import FormatError
from vehnav.export.atomic import atomic_path
from vehnav.export.columns import velocity_of
from vehnav.export.decimals import Column, column, write_rows
from vehnav.export.text_tables import exact_time
from vehnav.rotation import c_from_quaternion, quaternion_from_c
from vehnav.trajectory import Trajectory

Array = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]
Origin = tuple[float, float, float]

C_B_FLU: Final = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Forward-left-up components to right-forward-up ones."""
POSITION_DECIMALS: Final = 6
ROTATION_DECIMALS: Final = 12
"""Of quaternions and direction cosines: their rounding is 1e-12 rad, 1e-9 m at 1 km."""


def first_position(trajectory: Trajectory) -> Origin:
    """(lat rad, lon rad, height m) of the first state: the default origin of the map."""
    return (float(trajectory.lat[0]), float(trajectory.lon[0]), float(trajectory.height[0]))


def map_poses(trajectory: Trajectory, origin: Origin) -> tuple[Array, Array]:
    """Positions (n, 3) m in the map, and C_map_flu (n, 3, 3): forward-left-up body to map axes.

    The map's axes are East-North-Up at the origin; those of a state are so at its own place.
    """
    c_map_n = c_en(origin[0], origin[1]).T @ c_en(trajectory.lat, trajectory.lon)
    return trajectory.enu(origin), np.asarray(c_map_n @ trajectory.c_nb @ C_B_FLU)


def trajectory_of_poses(
    t_ns: TimeArray, position: Array, c_map_flu: Array, origin: Origin, *, where: str
) -> Trajectory:
    """Inverse of :func:`map_poses`; velocities are differences, ``stopped`` is unknown (False)."""
    if t_ns.size < 2:
        raise FormatError(f"{where}: {t_ns.size} poses; a trajectory has at least two")
    bad = np.flatnonzero(~np.isfinite(position).all(axis=1))
    if bad.size:
        raise FormatError(f"{where}: row {bad[0] + 1}: not finite")
    back = np.flatnonzero(np.diff(t_ns) <= 0)
    if back.size:
        raise FormatError(f"{where}: row {back[0] + 2}: its time is not after the row before")
    lat, lon, height = geodetic_from_local_enu(position, origin=origin)
    c_n_map = np.swapaxes(c_en(lat, lon), 1, 2) @ c_en(origin[0], origin[1])
    return Trajectory(
        t_ns=t_ns,
        lat=lat,
        lon=lon,
        height=height,
        v_n=velocity_of(t_ns, lat, lon, height),
        c_nb=c_n_map @ c_map_flu @ C_B_FLU.T,
        stopped=np.zeros(t_ns.size, bool),
    )


# ---- files beside --------------------------------------------------------------------------------


def beside(path: Path, ending: str) -> Path:
    """``STEM.ending`` in the folder of ``path``."""
    return path.with_name(f"{path.stem}.{ending}")


def write_origin(trajectory: Trajectory, path: Path, origin: Origin) -> None:
    """``STEM.origin.json``."""
    content = {
        "lat_deg": float(np.degrees(origin[0])),
        "lon_deg": float(np.degrees(origin[1])),
        "height_m": origin[2],
        "t0_ns": int(trajectory.t_ns[0]),
    }
    with atomic_path(beside(path, "origin.json")) as temporary:
        temporary.write_text(json.dumps(content) + "\n", encoding="utf-8")


def read_origin(path: Path) -> tuple[Origin, int]:
    """Origin and t0_ns from the file beside; FormatError where it is missing or broken."""
    name = beside(path, "origin.json")
    try:
        content = json.loads(name.read_text(encoding="utf-8"))
        origin = (
            float(np.radians(content["lat_deg"])),
            float(np.radians(content["lon_deg"])),
            float(content["height_m"]),
        )
        return origin, int(content["t0_ns"])
    except FileNotFoundError as error:
        raise FormatError(
            f"{path}: {name.name} is not beside it; poses in metres need lat_deg, lon_deg, "
            "height_m of their origin and t0_ns"
        ) from error
    except (ValueError, KeyError, TypeError) as error:
        raise FormatError(f"{name}: not an origin of vehnav: {error!r}") from error


def _numbers(path: Path, width: int) -> Array:
    """(n, width) floats of a text file, one row a line, ``#`` starts a comment."""
    import pandas as pd

    try:
        frame = pd.read_csv(path, sep=r"\s+", header=None, comment="#", dtype=float)
    except (ValueError, UnicodeDecodeError) as error:
        raise FormatError(f"{path}: not a table of numbers: {error}") from error
    if frame.shape[1] != width:
        raise FormatError(f"{path}: {frame.shape[1]} numbers in a row; expected {width}")
    values = frame.to_numpy()
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if bad.size:
        raise FormatError(f"{path}: row {bad[0] + 1}: a number is missing or not finite")
    return np.asarray(values)


# ---- TUM -----------------------------------------------------------------------------------------


def write_tum(
    trajectory: Trajectory, path: Path, *, final: Path, origin: Origin | None = None, **_: Any
) -> None:
    """``timestamp tx ty tz qx qy qz qw`` a line; the time in seconds with nine decimals."""
    origin = origin or first_position(trajectory)
    position, c_map_flu = map_poses(trajectory, origin)
    q = quaternion_from_c(c_map_flu)
    columns = [
        Column("timestamp", trajectory.t_ns, 9),
        *(column(f"t{a}", position[:, k], POSITION_DECIMALS) for k, a in enumerate("xyz")),
        *(column(f"q{a}", q[:, k], ROTATION_DECIMALS) for k, a in ((1, "x"), (2, "y"), (3, "z"))),
        column("qw", q[:, 0], ROTATION_DECIMALS),
    ]
    write_rows(path, columns, separator=" ")
    write_origin(trajectory, final, origin)


def read_tum(path: Path) -> Trajectory:
    """A TUM file with ``STEM.origin.json`` beside it."""
    origin, _ = read_origin(path)
    rows = _numbers(path, 8)
    length = np.linalg.norm(rows[:, 4:8], axis=1)
    bad = np.flatnonzero(np.abs(length - 1.0) > 1e-2)
    if bad.size:
        raise FormatError(f"{path}: row {bad[0] + 1}: the quaternion has length {length[bad[0]]}")
    c_map_flu = c_from_quaternion(rows[:, [7, 4, 5, 6]])
    t_ns = exact_time(path, 0, separator=r"\s+")
    return trajectory_of_poses(t_ns, rows[:, 1:4], c_map_flu, origin, where=str(path))


# ---- KITTI ---------------------------------------------------------------------------------------


def write_kitti(
    trajectory: Trajectory, path: Path, *, final: Path, origin: Origin | None = None, **_: Any
) -> None:
    """The upper three rows of the pose matrix, row by row, 12 numbers a line."""
    origin = origin or first_position(trajectory)
    position, c_map_flu = map_poses(trajectory, origin)
    pose = np.concatenate([c_map_flu, position[:, :, None]], axis=2).reshape(-1, 12)
    columns = [
        column(f"p{k}", pose[:, k], POSITION_DECIMALS if k % 4 == 3 else ROTATION_DECIMALS)
        for k in range(12)
    ]
    write_rows(path, columns, separator=" ")
    since = Column("time", trajectory.t_ns - trajectory.t_ns[0], 9)
    with atomic_path(beside(final, "times.txt")) as temporary:
        write_rows(temporary, [since])
    write_origin(trajectory, final, origin)


def read_kitti(path: Path) -> Trajectory:
    """A KITTI pose file with ``STEM.origin.json`` and ``STEM.times.txt`` (or times.txt) beside."""
    origin, t0_ns = read_origin(path)
    pose = _numbers(path, 12).reshape(-1, 3, 4)
    names = [beside(path, "times.txt"), path.with_name("times.txt")]
    times = next((name for name in names if name.is_file()), None)
    if times is None:
        raise FormatError(f"{path}: {names[0].name} is not beside it; its poses have no times")
    t_ns = t0_ns + exact_time(times, 0, separator=r"\s+")
    if t_ns.size != pose.shape[0]:
        raise FormatError(f"{path}: {pose.shape[0]} poses, but {t_ns.size} times in {times.name}")
    c_map_flu = pose[:, :, :3]
    skewed = np.abs(np.linalg.det(c_map_flu) - 1.0)
    if skewed.max() > 1e-3:
        raise FormatError(f"{path}: row {int(np.argmax(skewed)) + 1}: not a rotation matrix")
    return trajectory_of_poses(t_ns, pose[:, :, 3], c_map_flu, origin, where=str(path))
