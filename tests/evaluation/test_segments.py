"""KITTI segments on a case worked by hand."""

from __future__ import annotations

import numpy as np
import pytest

from vehnav.evaluation.segments import angle_between, lengths_for, segment_ends, segment_errors
from vehnav.rotation import c_nb_from_angles

T = np.arange(26.0)
NORTH = np.column_stack([0.0 * T, 10.0 * T, 0.0 * T])
"""250 m north at 10 m/s, a fix a second."""
LENGTH = 110.0
"""m: a segment of 100 m ends at the first fix beyond it, eleven fixes on."""


def rows(*args: object, **kwargs: object) -> dict[float, object]:
    return {row.length_m: row for row in segment_errors(*args, **kwargs)}


def test_ends() -> None:
    first, last = segment_ends(T, 10.0 * T, 100.0)
    assert first.tolist() == list(range(15))  # 14 + 11 = 25 is the last fix
    assert (last - first).tolist() == [11] * 15


def test_starts_are_a_second_apart_at_any_rate() -> None:
    t = np.arange(0.0, 25.0, 0.01)
    first, _ = segment_ends(t, 10.0 * t, 100.0)
    assert first.tolist() == list(range(0, 1500, 100))


def test_scale_of_two_percent_without_attitude() -> None:
    """Each displacement of 110 m is 2.2 m too long; over the nominal 100 m that is 2.2 %."""
    row = rows(T, 10.0 * T, 1.02 * NORTH, NORTH)[100.0]
    assert row.percent == pytest.approx(2.2)
    assert row.deg_per_m is None
    assert row.count == 15


def test_heading_that_drifts() -> None:
    """0.1 deg/s: 1.1 deg over a segment, 0.011 deg/m; perfect positions, a turning body."""
    drifting = c_nb_from_angles(np.radians(0.1 * T), 0.0, 0.0)
    truth = c_nb_from_angles(0.0 * T, 0.0, 0.0)
    row = rows(T, 10.0 * T, NORTH, NORTH, c_nb=drifting, c_nb_reference=truth)[100.0]
    assert row.deg_per_m == pytest.approx(0.011)
    # the displacement of 110 m seen from a body turned by 0.1 k deg: 2 sin(half) of it is missed
    missed = 2.0 * LENGTH * np.sin(np.radians(0.05 * np.arange(15)))
    assert row.percent == pytest.approx(missed.mean())


def test_a_turned_track_is_no_segment_error_with_attitude() -> None:
    """5 deg of heading at the start turn track and body alike: KITTI sees nothing, the map does."""
    turn = np.radians(5.0)
    turned = np.column_stack([10.0 * T * np.sin(turn), 10.0 * T * np.cos(turn), 0.0 * T])
    c_est = c_nb_from_angles(turn + 0.0 * T, 0.0, 0.0)
    c_ref = c_nb_from_angles(0.0 * T, 0.0, 0.0)
    with_attitude = rows(T, 10.0 * T, turned, NORTH, c_nb=c_est, c_nb_reference=c_ref)[100.0]
    assert with_attitude.percent == pytest.approx(0.0, abs=1e-9)
    assert with_attitude.deg_per_m == pytest.approx(0.0, abs=1e-9)
    on_the_map = rows(T, 10.0 * T, turned, NORTH)[100.0]
    assert on_the_map.percent == pytest.approx(2.0 * LENGTH * np.sin(turn / 2.0))


def test_lengths() -> None:
    assert lengths_for(1000.0) == (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)
    assert lengths_for(250.0) == (5.0, 10.0, 20.0, 50.0, 100.0, 200.0)
    assert lengths_for(4.0) == ()


def test_angle_between_keeps_its_digits() -> None:
    for angle in (1e-9, 1e-3, 1.0, 3.0):
        a = c_nb_from_angles(0.3, 0.1, -0.2)
        b = a @ c_nb_from_angles(angle, 0.0, 0.0)
        assert angle_between(a[None], b[None])[0] == pytest.approx(angle, rel=1e-6)
