"""Paper 001 (Rudyk): the linear error model, forward and back, judged by its figure 1b."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from vehnav.budget.inverse import Requirement, solve
from vehnav.budget.linear import Procedure
from vehnav.budget.sources import Initial
from vehnav.budget.study import Study
from vehnav.budget_source import RATE_HZ, scenario_drive
from vehnav.papers.claims import Row, between
from vehnav.sensors import load_sensor
from vehnav.units import DEG

SENSOR: Final = load_sensor("hg1700")
START: Final = Initial(heading=0.1 * DEG, tilt=0.02 * DEG, velocity=0.0, position=0.0)
TIME: Final = 600.0
REQUIRED: Final = 100.0
"""m, radius of the 95 % circle."""
WHAT: Final = "HG1700, town of 600 s, 8 stops; tilt 0.02 deg, heading 0.1 deg"
AGREE: Final = 0.10
"""Of the DRMS, between linear and drawn errors of 200 runs (their own scatter: 4 to 5 %)."""
MEETS: Final = 0.12
"""Of the requirement, of the drawn CEP95 of 200 runs."""
QUANTILE: Final = 0.73
"""Relative standard error of a CEP95 from one run: sqrt(0.95 0.05) / (r^2 exp(-r^2/2)), r 2.45."""
COARSE_HZ: Final = 5.0
"""Of the readings of a fast rerun: the budget moves by 1e-4 of itself, the draws within their
scatter."""
NEGLECT: Final = 0.04
"""Of the DRMS: what the paper's neglects may cost within ten minutes, the height held."""


def rows(*, fast: bool = False) -> list[Row]:
    """The claims of paper 001; ``fast`` draws 100 sensors instead of 200, at 5 Hz."""
    runs = 100 if fast else 200
    slack = AGREE if runs >= 200 else 3.0 * 0.5 / np.sqrt(runs)
    rate = COARSE_HZ if fast else RATE_HZ
    town = scenario_drive(f"town,T={TIME:g}", rate_hz=rate)
    free = Study(town, Procedure(), START, (TIME,))
    stopping = replace(free, procedure=Procedure(stops=town.stops), _known={})
    return [
        _forward(free, "forward", "no correction", runs, slack),
        _forward(stopping, "forward-stops", "reset and levelling at 8 stops", runs, slack),
        _neglects(free),
        _dynamics(free, rate),
        _inverse(stopping, runs),
    ]


def _forward(study: Study, key: str, what: str, runs: int, slack: float) -> Row:
    linear = study.budget(SENSOR).totals(TIME)
    drawn = study.monte_carlo(SENSOR, study.initial, runs=runs, seed=1).totals(TIME)
    ratio = linear["drms"] / drawn["drms"]
    return Row(
        "001",
        key,
        "the linear error model gives the errors of the navigation from those of the sensors",
        f"{WHAT}; {what}; {runs} drawn sensors",
        f"DRMS {linear['drms']:.1f} m linear, {drawn['drms']:.1f} m by ideal and perturbed "
        f"algorithm (ratio {ratio:.2f}); CEP95 {linear['cep95']:.1f} and {drawn['cep95']:.1f} m",
        between(ratio, 1.0 - slack, 1.0 + slack),
        f"figure 1b of the paper run as it stands; bar {100.0 * slack:.0f} %",
        {"linear_m": linear["drms"], "drawn_m": drawn["drms"], "ratio": ratio},
    )


def _neglects(study: Study) -> Row:
    full = study.budget(SENSOR).totals(TIME)["drms"]
    paper = replace(study, model="paper", _known={}).budget(SENSOR).totals(TIME)["drms"]
    bare = replace(study, model="simplified", _known={}).budget(SENSOR).totals(TIME)["drms"]
    off = paper / full - 1.0
    return Row(
        "001",
        "neglects",
        "the errors of the compensated terms (Delta w) may be neglected",
        f"{WHAT}; height held",
        f"DRMS {100.0 * off:+.1f} % with the paper's neglects, {100.0 * (bare / full - 1.0):+.1f} "
        "% without the rate of the frame as well",
        between(off, -NEGLECT, NEGLECT),
        "true of ten minutes with the height held; a free height needs all terms",
        {"paper": off, "simplified": bare / full - 1.0},
    )


def _dynamics(study: Study, rate: float) -> Row:
    found = {"town": study.budget(SENSOR).totals(TIME)["drms"]}
    for name in ("static", "straight", "circle,radius=500,v=15"):
        drive = scenario_drive(f"{name},T={TIME:g},lat=55", rate_hz=rate)
        other = replace(study, drive=drive, _known={})
        found[name.split(",")[0]] = other.budget(SENSOR).totals(TIME)["drms"]
    ratio = found["straight"] / found["circle"]
    listed = ", ".join(f"{name} {drms:.0f} m" for name, drms in found.items())
    return Row(
        "001",
        "dynamics",
        "the errors depend on the dynamics of motion (figure 4)",
        "HG1700, 600 s without corrections; circle of 500 m radius at 15 m/s",
        f"DRMS: {listed}",
        between(ratio, 1.5, 10.0),
        f"turning averages errors fixed to the body: {ratio:.1f} times on the circle",
        {f"{name}_m": drms for name, drms in found.items()},
    )


def _inverse(study: Study, runs: int) -> Row:
    need = Requirement(REQUIRED, "cep95", TIME)
    found = solve(study.budget(SENSOR), need, "equal")
    drawn = study.monte_carlo(found.sensor, found.initial, runs=runs, seed=2).totals(TIME)
    allowed = {a.parameter: a for a in found.allowed}
    listed = ", ".join(
        f"{allowed[name].value:.2g} {allowed[name].unit}"
        for name in ("gyro_bias", "accel_bias", "arw")
    )
    slack = MEETS if runs >= 200 else 3.0 * QUANTILE / np.sqrt(runs)
    return Row(
        "001",
        "inverse",
        "the accuracy wanted gives the requirements on the sensors",
        f"{REQUIRED:g} m CEP95 at {TIME:g} s, {WHAT}; reset and levelling; equal shares; {runs} "
        "drawn sensors",
        f"{listed} and six more; drawn sensors of that kind: CEP95 {drawn['cep95']:.0f} m",
        between(drawn["cep95"] / REQUIRED, 1.0 - slack, 1.0 + slack),
        f"bar {100.0 * slack:.0f} %",
        {"drawn_m": drawn["cep95"], **{n: a.value for n, a in allowed.items()}},
    )
