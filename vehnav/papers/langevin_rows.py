"""Paper 004's last sentence: its model serves nonlinear filters. Rows of that filter, rerun."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from vehnav.papers.claims import Row, about, between, near
from vehnav.papers.drawn_runs import Way
from vehnav.papers.langevin_runs import Looks, by_direction_cosines, by_error_states, draw_log
from vehnav.parallel import by_threads
from vehnav.units import DEG

Array = npt.NDArray[np.float64]

STATES = 9
"""Degrees of freedom of the errors: position, velocity, attitude."""
SETTLED = 0.4
"""Share of the way after which the start no longer counts."""
ALIKE = 0.05
"""Relative difference of two rms position errors up to which the filters are one."""
HONEST = 3.0
"""Standard deviations of the mean of a chi-square of 9 degrees of freedom over the runs."""
HEADINGS = (2.0, 30.0)
"""deg, 1 sigma, of the heading at the start: known, and hardly known."""


def langevin_rows(*, fast: bool = False) -> list[Row]:
    """The filter on the model (16) beside the error-state filter, on the same logs."""
    duration, runs = (100.0, 6) if fast else (600.0, 20)
    way = Way.of(f"town,duration={duration:g},first_stop=15")
    how = (
        f"town at 55 deg, the paper's sensor noise without bias, a position a second (3 m); "
        f"{runs} runs of {duration:g} s"
    )
    out = []
    for heading in HEADINGS:
        found = by_threads(partial(both, way, heading * DEG), range(runs))
        ours = Figures.of([pair[0] for pair in found])
        errors = Figures.of([pair[1] for pair in found])
        out.append(_row(heading, how, runs, ours, errors, fast=fast))
    return out


def both(way: Way, heading_sigma: float, seed: int) -> tuple[Looks, Looks]:
    """The two filters on one log."""
    log = draw_log(way, heading_sigma, seed)
    return by_direction_cosines(log), by_error_states(log)


@dataclass(frozen=True)
class Figures:
    """What a filter does over some runs.

    Attributes
    ----------
    position, heading : float
        Rms, m and deg, once settled.
    nees : float
        Mean squared error in the metric of the covariance.
    seconds : float
        Least time of a run.
    """

    position: float
    heading: float
    nees: float
    seconds: float

    @classmethod
    def of(cls, runs: list[Looks]) -> Figures:
        """Over all runs."""
        late = runs[0].t > SETTLED * runs[0].t[-1]

        def rms(x: list[Array]) -> float:
            return float(np.sqrt(np.mean([np.mean(one[late] ** 2) for one in x])))

        return cls(
            rms([run.horizontal for run in runs]),
            rms([run.heading for run in runs]) / DEG,
            float(np.mean([run.nees[late].mean() for run in runs])),
            min(run.seconds for run in runs),
        )


def _row(heading: float, how: str, runs: int, ours: Figures, errors: Figures, *, fast: bool) -> Row:
    slack = HONEST * float(np.sqrt(2.0 * STATES / runs))
    honest = between(ours.nees, STATES - slack, STATES + slack)
    alike = near(ours.position, errors.position, relative=ALIKE)
    verdict = honest if alike == "reproduced" else alike
    good = verdict == "reproduced"
    cost = "" if fast else f"; {ours.seconds / errors.seconds:.1f} times the time"
    why = (
        "an extended filter of 15 states, direction cosines made orthonormal after every fix: the "
        "same as nine error states"
        if good
        else "a linear correction of direction cosines cannot turn far; error states are fed back "
        "as a rotation and can"
    )
    return Row(
        "004",
        f"filter-{heading:g}",
        "the model (16) serves nonlinear filters of inertial and satellite data, for estimates "
        f"of high accuracy: start heading known to {heading:g} deg",
        how,
        f"position {ours.position:.2f} m rms, heading {ours.heading:.2f} deg, squared errors over "
        f"variances {about(ours.nees)} of 9; error-state filter {errors.position:.2f} m, "
        f"{errors.heading:.2f} deg, {about(errors.nees)}{cost}",
        verdict,
        f"{why}; bars 5 % of the position and 9 +- {slack:.1f}",
        {
            "position_m": ours.position, "heading_deg": ours.heading, "nees": ours.nees,
            "error_state_position_m": errors.position, "error_state_heading_deg": errors.heading,
            "error_state_nees": errors.nees, "cost_ratio": ours.seconds / errors.seconds,
        },
    )  # fmt: skip
