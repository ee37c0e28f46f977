"""Linear error budget of a drive: what unit sources do, and what a sensor makes of it (001)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from vehnav.aiding.error_model import MODELS
from vehnav.budget.drive import GRID_STEP, IdealDrive, grid_of
from vehnav.budget.propagate import Rules, propagate
from vehnav.budget.sources import Process

Array = npt.NDArray[np.float64]
Model = Literal["full", "paper", "simplified"]

PSI: Final = slice(0, 3)
PLACE: Final = slice(6, 9)
CURVE_POINTS: Final = 400
"""Instants of the growth curve."""
LEVELLING_WINDOW: Final = 3.0
"""s at the end of a stop over which the level is averaged (spec B 2)."""
WHITE: Final = (Process("arw", True, "white"), Process("vrw", False, "white"))


@dataclass(frozen=True)
class Procedure:
    """What is done with the errors on the way.

    Attributes
    ----------
    stops : tuple of (start, end)
        s; where velocity is reset and the platform levelled.
    levelled : bool
        Whether the start is levelled by the accelerometers.
    window : float
        s of the mean of the level.
    gyro_from_stops : bool
        Whether the gyro bias seen in a stop is taken off until the next.
    """

    stops: tuple[tuple[float, float], ...] = ()
    levelled: bool = False
    window: float = LEVELLING_WINDOW
    gyro_from_stops: bool = False


@dataclass(frozen=True)
class Sensitivity:
    """What unit sources do to a drive; no sensor is in it yet.

    Attributes
    ----------
    t : (q,)
        s: instants of the growth curve and those asked for.
    columns : (q, 9, COLUMNS)
        Psi, velocity and position error per unit of each constant source
        (:data:`vehnav.budget.sources.CONSTANT`), SI.
    processes : tuple of Process
    covariance : (q, p, 9, 9)
        Of the errors, for unit sigma of each process.
    procedure : Procedure
    model : str
    held : bool
    """

    t: Array
    columns: Array
    processes: tuple[Process, ...]
    covariance: Array
    procedure: Procedure
    model: Model
    held: bool

    def index(self, time: float) -> int:
        """The instant nearest to a time, s."""
        return int(np.argmin(np.abs(self.t - time)))


def sensitivity(
    drive: IdealDrive,
    procedure: Procedure,
    *,
    processes: Sequence[Process] = WHITE,
    at: Sequence[float] = (),
    model: Model = "full",
    held: bool = True,
    step: float = GRID_STEP,
    points: int = CURVE_POINTS,
) -> Sensitivity:
    """Integrate the error equations of paper 001 along a drive.

    Parameters
    ----------
    drive : IdealDrive
    procedure : Procedure
        Stops with reset and levelling; how the start is levelled.
    processes : sequence of Process
        Random processes, of unit sigma.
    at : sequence of float
        Times, s, that must be among the instants.
    model : {"full", "paper", "simplified"}
        How much of the model is kept (:func:`vehnav.aiding.error_model.error_matrix_001`).
    held : bool
        Whether height and vertical velocity come from outside.
    step : float
        s, of the intervals.
    points : int
        Instants of the growth curve.

    Raises
    ------
    ValueError
        A time lies outside the drive.
    """
    wanted = np.asarray(at, float)
    if wanted.size and (wanted.min() < 0.0 or wanted.max() > drive.duration + 1e-6):
        raise ValueError(f"times must lie within 0 and {drive.duration:g} s")
    grid = grid_of(drive, procedure.stops, step=step)
    times = np.concatenate([np.linspace(0.0, drive.duration, max(points, 2)), wanted])
    after = np.clip(np.searchsorted(grid.t, times), 1, grid.size)
    nearer = times - grid.t[after - 1] < grid.t[after] - times
    index = np.unique(after - nearer).astype(np.int64)
    rules = Rules(
        MODELS[model], held, procedure.levelled, procedure.window, procedure.gyro_from_stops
    )
    columns, covariance = propagate(grid, tuple(processes), rules, index, earth=drive.earth)
    return Sensitivity(grid.t[index], columns, tuple(processes), covariance, procedure, model, held)


def chosen_stops(drive: IdealDrive, every: float | None = None) -> tuple[tuple[float, float], ...]:
    """The stops of a drive that are used; with ``every`` those at least that far apart, s.

    The first is the first that ends ``every`` s or more after the start.
    """
    if every is None:
        return drive.stops
    out, last = [], 0.0
    for start, end in drive.stops:
        if end - last >= every - 0.5:
            out.append((start, end))
            last = end
    return tuple(out)
