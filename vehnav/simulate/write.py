"""A simulated log becomes files: the recording, and the truth beside it."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from vehnav.errors import ConfigError
from vehnav.logs.log import Imu
from vehnav.simulate.generate import SimulatedLog
from vehnav.simulate.text_file import write_gnss, write_imu, write_speed, write_truth
from vehnav.trajectory import Trajectory


def forward_left_up(imu: Imu) -> Imu:
    """The IMU turned from right-forward-up to forward-left-up, the axes of ROS (REP 103)."""

    def turned(x: np.ndarray) -> np.ndarray:
        return np.stack([x[:, 1], -x[:, 0], x[:, 2]], axis=-1)

    return replace(imu, gyro=turned(imu.gyro), accel=turned(imu.accel))


def write_log(simulated: SimulatedLog, path: str | Path, *, truth_every: int = 1) -> list[Path]:
    """Write the recording to ``path`` and the truth to ``STEM.truth.csv`` beside it.

    The suffix decides. ``.mcap``: everything in one file, axes forward-left-up. ``.csv``: the IMU,
    axes right-forward-up; fixes and speed beside it in ``STEM.gps.csv`` and ``STEM.speed.csv``.
    ``truth_every`` thins the truth; 0 leaves it out. Returns the files, the recording first. Each
    is complete before it takes its name. ConfigError for another suffix or a missing folder.
    """
    path = Path(path)
    check_target(path)
    jobs: list[tuple[Path, Callable[[Path], None]]] = []
    gnss, speed = simulated.gnss, simulated.speed
    if path.suffix.lower() == ".mcap":
        jobs.append((path, lambda p: _write_mcap(p, simulated)))
    else:
        jobs.append((path, lambda p: write_imu(p, simulated.imu)))
        if gnss is not None:
            jobs.append((path.with_suffix(".gps.csv"), lambda p: write_gnss(p, gnss)))
        if speed is not None:
            jobs.append((path.with_suffix(".speed.csv"), lambda p: write_speed(p, speed)))
    if truth_every > 0:
        truth = simulated.truth.rows(slice(None, None, truth_every))
        jobs.append((path.with_suffix(".truth.csv"), lambda p: write_truth(p, truth)))
    for target, work in jobs:
        _replaced(target, work)
    return [target for target, _ in jobs]


def write_runs(
    runs: Iterable[SimulatedLog], path: str | Path, *, count: int, truth_every: int = 1
) -> Iterator[tuple[SimulatedLog, list[Path]]]:
    """Write ``count`` runs as ``STEM-001.mcap``, ..., the common truth as ``STEM.truth.csv``.

    A single run is written to ``path`` itself. Yields each run with its files.
    """
    path = Path(path)
    check_target(path)
    digits = max(3, len(str(count)))
    for simulated in runs:
        if count == 1:
            yield simulated, write_log(simulated, path, truth_every=truth_every)
            continue
        target = path.with_stem(f"{path.stem}-{simulated.run + 1:0{digits}d}")
        files = write_log(simulated, target, truth_every=0)
        if simulated.run == 0 and truth_every > 0:
            truth = simulated.truth.rows(slice(None, None, truth_every))
            files.append(path.with_suffix(".truth.csv"))
            _replaced(files[-1], functools.partial(_truth_to, truth))
        yield simulated, files


def check_target(path: Path) -> None:
    """ConfigError unless a log can be written there."""
    if path.suffix.lower() not in (".mcap", ".csv"):
        raise ConfigError(f"{path}: a log is written as .mcap or .csv")
    if not path.parent.is_dir():
        raise ConfigError(f"{path}: there is no folder {path.parent}")


def _truth_to(truth: Trajectory, path: Path) -> None:
    write_truth(path, truth)


def _replaced(target: Path, work: Callable[[Path], None]) -> None:
    """Write under a temporary name, then rename; nothing half-written stays."""
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        work(temporary)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def _write_mcap(path: Path, simulated: SimulatedLog) -> None:
    from vehnav.simulate.mcap_file import gnss_topic, imu_topic, speed_topic, write_mcap

    topics = [imu_topic(forward_left_up(simulated.imu))]
    if simulated.gnss is not None and simulated.gnss.t_ns.size:
        topics.append(gnss_topic(simulated.gnss))
    if simulated.speed is not None:
        topics.append(speed_topic(simulated.speed))
    write_mcap(path, topics)
