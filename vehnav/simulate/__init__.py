"""Truth trajectories become IMU, GPS and wheel-speed logs.

``simulate("city", sensor="hg1700", seed=3)`` gives a :class:`SimulatedLog`; ``write_log`` puts it
into a file with the truth beside it. The ideal sensors are exact: motions are smooth to jerk and
known in closed form, and nothing here is shared with the integration that they judge but the Earth
and the rotations. Body axes are right-forward-up; ROS files are written forward-left-up.
"""

from __future__ import annotations

from vehnav.simulate.generate import (
    START_NS,
    Setup,
    SimulatedLog,
    ideal_log,
    simulate,
    simulate_runs,
    stamps,
)
from vehnav.simulate.receivers import GnssModel, WheelModel
from vehnav.simulate.scenarios import SCENARIOS, Scenario, make_scenario, scenario_parameters
from vehnav.simulate.truth import inertial_states
from vehnav.simulate.write import write_log, write_runs

__all__ = [
    "SCENARIOS",
    "START_NS",
    "GnssModel",
    "Scenario",
    "Setup",
    "SimulatedLog",
    "WheelModel",
    "ideal_log",
    "inertial_states",
    "make_scenario",
    "scenario_parameters",
    "simulate",
    "simulate_runs",
    "stamps",
    "write_log",
    "write_runs",
]
