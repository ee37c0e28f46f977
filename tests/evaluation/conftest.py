"""The drive on a circle as fixtures."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from drives import Circle, gnss_of, trajectory_of

from vehnav.logs.log import Gnss
from vehnav.trajectory import Trajectory


@pytest.fixture
def circle() -> Circle:
    return Circle()


@pytest.fixture
def circle_trajectory(circle: Circle) -> Callable[..., Trajectory]:
    """The drive on the circle as a trajectory, moved by a constant vector."""

    def make(
        duration: float = 120.0, dt: float = 0.01, moved: tuple[float, ...] = (0, 0, 0)
    ) -> Trajectory:
        t = np.arange(0.0, duration + dt / 2, dt)
        return trajectory_of(t, circle.enu(t) + np.array(moved), circle.v(t), circle.heading(t))

    return make


@pytest.fixture
def circle_gnss(circle: Circle) -> Callable[..., Gnss]:
    """Perfect fixes of the drive on the circle."""

    def make(duration: float = 120.0, dt: float = 1.0, *, velocity: bool = True) -> Gnss:
        t = np.arange(0.0, duration + dt / 2, dt)
        return gnss_of(t, circle.enu(t), circle.v(t) if velocity else None)

    return make
