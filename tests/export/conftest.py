"""A drive with a stop, a bend, tilt and sigmas: everything that a format can lose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drives import trajectory_of

from vehnav.rotation import c_nb_from_angles
from vehnav.trajectory import Trajectory


@pytest.fixture
def drive() -> Trajectory:
    """60 s at 50 Hz: east, 10 s standing, then a bend; 200 m up a slope."""
    t = np.arange(0.0, 60.0, 0.02) + 0.123456789
    speed = np.interp(t, [0, 5, 20, 25, 35, 40, 60], [0, 8, 8, 0, 0, 12, 12])
    heading = np.interp(t, [0, 40, 55], [np.pi / 2, np.pi / 2, -1.0])
    v = np.column_stack([speed * np.sin(heading), speed * np.cos(heading), 0.02 * speed])
    enu = np.cumsum(v, axis=0) * 0.02
    made = trajectory_of(t, enu, v, heading)
    return replace(
        made,
        c_nb=c_nb_from_angles(heading, 0.02 + 0.01 * np.sin(t), -0.03 * np.cos(t)),
        stopped=(t > 25.2) & (t < 34.8),
        sigma_pos=np.column_stack([0.01 * t, 0.02 * t, 0.5 + 0 * t]),
        sigma_heading=np.radians(0.1 + 0.001 * t),
    )
