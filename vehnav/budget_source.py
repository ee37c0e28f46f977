"""Where the drive of an error budget comes from: a scenario, a trajectory file, or a log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from vehnav.budget.drive import IdealDrive, drive_of_trajectory, standing_spans
from vehnav.errors import ConfigError
from vehnav.export.load import is_trajectory, load_track
from vehnav.simulate import SCENARIOS, ideal_log, make_scenario, stamps
from vehnav.strapdown.increments import Increments
from vehnav.units import NS

if TYPE_CHECKING:
    from vehnav.pipeline import Run

SCENARIO: Final = "scenario:"
RATE_HZ: Final = 100.0
"""Of the readings on a scenario."""


def scenario_drive(text: str, *, rate_hz: float = RATE_HZ) -> IdealDrive:
    """``town,duration=900,v=12`` (or with ``T=900``): the simulator's exact readings and states.

    ``rate_hz``: of the readings. ConfigError for an unknown scenario or parameter.
    """
    motion = make_scenario(text).motion
    truth, ideal = ideal_log(motion, stamps(motion.duration, rate_hz), sampling="increments")
    t = (truth.t_ns - truth.t_ns[0]) * NS
    return IdealDrive(
        name=text,
        increments=Increments(t, ideal.gyro[1:], ideal.accel[1:], np.zeros(t.size - 1, bool)),
        lat=truth.lat,
        lon=truth.lon,
        height=truth.height,
        v_n=truth.v_n,
        c_nb=truth.c_nb,
        stops=standing_spans(t, truth.stopped),
        earth=motion.earth,
        start_ns=int(truth.t_ns[0]),
    )


def file_drive(path: str) -> IdealDrive | None:
    """The drive of a trajectory file; None where the file is a recording.

    LogError or FormatError for a trajectory that cannot be read, ConfigError for the bare name of
    a scenario.
    """
    if not is_trajectory(path):
        if path.partition(",")[0] in SCENARIOS and not Path(path).exists():
            raise ConfigError(f"{path}: no such file; did you mean {SCENARIO}{path}?")
        return None
    if not Path(path).is_file():
        raise ConfigError(f"{path}: no such file")
    return drive_of_trajectory(load_track(path).trajectory, name=path)


def run_drive(found: Run) -> IdealDrive:
    """The drive of a run: the readings that lead along its trajectory."""
    return drive_of_trajectory(found.trajectory, name=found.log.path)
