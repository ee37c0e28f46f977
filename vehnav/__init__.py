"""vehnav: vehicle dead reckoning from IMU logs.

Conventions, fixed for the whole package
----------------------------------------
Frames
    i inertial, e Earth-fixed, n local **East-North-Up**, w wander (n turned in azimuth),
    q quasi-Greenwich, b vehicle body **right-forward-up**, s sensor case as logged.
Rotation
    ``c_nb`` takes b to n: ``v_n = c_nb @ v_b``; letters cancel: ``c_eb = c_en @ c_nb``;
    ``c_nb`` is the unit matrix when the vehicle is level and heads north. Quaternion ``q_nb`` is
    (w, x, y, z).
Rate
    ``omega_ib_b`` is the rate of b relative to i, in b axes; ``omega_in = omega_ie + omega_en``.
Angles
    heading clockwise from north, pitch nose up, roll right side down; *yaw* only for ROS.
Units
    SI and radians inside; a unit stands in a name only where a number leaves the program.
Time
    int64 nanoseconds in logs and files, float seconds since the start in the mathematics.
Error
    estimate minus truth.

Symbols of the papers
---------------------
=============================  =================================================================
paper                          code
=============================  =================================================================
004 M_CE, 000 Lambda           ``c_nb``; quaternion body to inertial ``q_ib``
004 n, 000 a, 001 n, 003 f     specific force ``f_b``, ``f_n``
004 omega_b, z^omega           gyro output ``omega_ib_b``
004 omega_gamma                ``omega_in_n``: absolute rate of the ENU frame
004 R_phi, R_lambda            ``radius_m``, ``radius_n`` (height included)
000 theta_n, b_n               increments ``dtheta``, ``dvel``
002 k                          ``levelling gain / g``; Delta omega is ``levelling_rate``
003 epsilon                    ``wander``
=============================  =================================================================
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from vehnav._version import __version__

if TYPE_CHECKING:
    from vehnav.config import Config
    from vehnav.errors import ConfigError, Finding, FormatError, LogError, VehnavError
    from vehnav.evaluation import Errors, compare
    from vehnav.export.formats import read_trajectory, write_trajectory
    from vehnav.library import read_log
    from vehnav.logs.log import Gnss, Imu, Log, ReadOptions, Speed
    from vehnav.pipeline import Run, run
    from vehnav.trajectory import Trajectory

_PUBLIC = {
    "Config": "vehnav.config",
    "ConfigError": "vehnav.errors",
    "Errors": "vehnav.evaluation",
    "Finding": "vehnav.errors",
    "FormatError": "vehnav.errors",
    "Gnss": "vehnav.logs.log",
    "Imu": "vehnav.logs.log",
    "Log": "vehnav.logs.log",
    "LogError": "vehnav.errors",
    "ReadOptions": "vehnav.logs.log",
    "Run": "vehnav.pipeline",
    "Speed": "vehnav.logs.log",
    "Trajectory": "vehnav.trajectory",
    "VehnavError": "vehnav.errors",
    "compare": "vehnav.evaluation",
    "read_log": "vehnav.library",
    "read_trajectory": "vehnav.export.formats",
    "run": "vehnav.pipeline",
    "write_trajectory": "vehnav.export.formats",
}
"""Public name -> where it lives; imported when it is first used, so that the help stays light."""

__all__ = [
    "Config",
    "ConfigError",
    "Errors",
    "Finding",
    "FormatError",
    "Gnss",
    "Imu",
    "Log",
    "LogError",
    "ReadOptions",
    "Run",
    "Speed",
    "Trajectory",
    "VehnavError",
    "__version__",
    "compare",
    "read_log",
    "read_trajectory",
    "run",
    "write_trajectory",
]


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'vehnav' has no attribute {name!r}")
    return getattr(importlib.import_module(_PUBLIC[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
