"""Alignment on request: what it takes out of the errors, and that it is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drives import Circle, gnss_of, trajectory_of

from vehnav.errors import LogError
from vehnav.evaluation import compare


def turned(circle: Circle, *, angle: float, moved: tuple[float, float, float]):
    """The drive turned clockwise by ``angle`` about its start, then moved."""
    t = np.arange(0.0, 50.0, 0.05)
    s, c = np.sin(angle), np.cos(angle)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return trajectory_of(
        t, circle.enu(t) @ turn.T + np.array(moved), circle.v(t) @ turn.T, circle.heading(t) + angle
    )


def test_yaw_takes_out_a_wrong_heading(circle, circle_gnss) -> None:
    trajectory = turned(circle, angle=np.radians(7.0), moved=(0.0, 0.0, 0.0))
    gnss = circle_gnss(49.0)
    plain = compare(trajectory, gnss)
    assert plain.horizontal.max() == pytest.approx(200.0 * 2 * np.sin(np.radians(3.5)), rel=1e-3)
    errors = compare(trajectory, gnss, align="yaw")
    assert errors.horizontal.max() < 1e-5
    assert np.abs(errors.velocity).max() < 1e-3  # v chord of 50 ms
    assert errors.fit is not None
    assert np.degrees(errors.fit.turned) == pytest.approx(-7.0, abs=1e-4)
    assert errors.to_dict()["align"] == "yaw"
    assert plain.to_dict()["align"] == "none"


def test_translation_is_left_by_yaw_and_taken_by_the_next(circle, circle_gnss) -> None:
    trajectory = turned(circle, angle=np.radians(7.0), moved=(30.0, -40.0, 5.0))
    gnss = circle_gnss(49.0)
    assert compare(trajectory, gnss, align="yaw").horizontal[0] == pytest.approx(50.0, abs=1e-3)
    errors = compare(trajectory, gnss, align="yaw+translation")
    assert errors.horizontal.max() < 1e-3  # planes of places 50 m apart
    assert np.abs(errors.up).max() < 1e-3


def test_a_local_trajectory_is_compared_by_its_shape(circle, circle_gnss) -> None:
    trajectory = turned(circle, angle=np.radians(50.0), moved=(0.0, 0.0, 0.0))
    local = replace(trajectory, lat=trajectory.lat - trajectory.lat[0] + 0.7)
    with pytest.raises(LogError, match=r"--align yaw\+translation"):
        compare(local, circle_gnss(49.0))
    errors = compare(local, circle_gnss(49.0), align="yaw+translation")
    # 2.2 deg of latitude away the metres of a radian differ by 3 %: shape, not place
    assert errors.horizontal.max() < 10.0


def test_full_takes_out_a_tilt(circle) -> None:
    t = np.arange(0.0, 50.0, 0.05)
    s, c = np.sin(0.1), np.cos(0.1)
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    trajectory = trajectory_of(t, circle.enu(t) @ tilt.T, circle.v(t) @ tilt.T, circle.heading(t))
    gnss = gnss_of(t[::20], circle.enu(t[::20]))
    assert np.abs(compare(trajectory, gnss, align="yaw+translation").up).max() > 5.0
    errors = compare(trajectory, gnss, align="full")
    assert np.abs(errors.up).max() < 1e-3
    assert errors.horizontal.max() < 1e-3
