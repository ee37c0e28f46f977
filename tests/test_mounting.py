"""Axis letters, mounting angles, gravity as evidence: judged by geometry worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from vehnav.errors import ConfigError
from vehnav.mounting import (
    c_bs_from_letters,
    gravity_contradiction,
    right_handed_axes,
    sensor_to_body,
)
from vehnav.rotation import c_nb_from_angles

X, Y, Z = np.eye(3)


@pytest.mark.parametrize(
    ("letters", "forward", "up"),
    [("FLU", X, Z), ("FRD", X, -Z), ("RFU", Y, Z), ("BRU", -X, Z), ("UFR", Y, X)],
)
def test_letters_say_where_the_sensor_axes_point(letters, forward, up) -> None:
    c_bs = c_bs_from_letters(letters)
    assert (c_bs @ forward).tolist() == [0.0, 1.0, 0.0]
    assert (c_bs @ up).tolist() == [0.0, 0.0, 1.0]


def test_the_24_right_handed_orders_are_rotations() -> None:
    axes = right_handed_axes()
    assert len(axes) == len(set(axes)) == 24
    for letters in axes:
        c = c_bs_from_letters(letters)
        assert np.array_equal(c @ c.T, np.eye(3))
        assert np.linalg.det(c) == pytest.approx(1.0)


@pytest.mark.parametrize("letters", ["FLF", "FL", "XYZ", "FBU", ""])
def test_impossible_letters_are_refused(letters) -> None:
    with pytest.raises(ConfigError, match="expected three letters"):
        c_bs_from_letters(letters)


def test_a_left_handed_gyro_is_refused_and_an_inverted_accelerometer_is_not() -> None:
    with pytest.raises(ConfigError, match="left-handed"):
        sensor_to_body("FRU")
    gyro, accel = sensor_to_body("FLU", accel_axes="BRD")  # all three signs turned
    assert np.array_equal(accel, -gyro)
    with pytest.raises(ConfigError, match="left-handed"):
        sensor_to_body("FLU", accel_axes="FRU")


def test_mount_turns_the_case_by_yaw_pitch_roll() -> None:
    mount = (0.02, -0.1, 0.05)
    gyro, _ = sensor_to_body("RFU", mount=mount)
    assert gyro == pytest.approx(c_nb_from_angles(0.05, -0.1, 0.02), abs=1e-15)
    nose_up, _ = sensor_to_body("RFU", mount=(0.0, 0.1, 0.0))
    assert (nose_up @ Y)[2] == pytest.approx(np.sin(0.1))  # the case's forward points up


def test_gravity_agrees_or_names_the_axes_that_fit() -> None:
    assert gravity_contradiction(np.array([0.5, -0.3, 9.8]), "FLU") is None
    tilted = 9.81 * np.array([np.sin(0.5), 0.0, np.cos(0.5)])  # 29 deg: a steep ramp
    assert gravity_contradiction(tilted, "FLU") is None
    text = gravity_contradiction(np.array([0.1, 0.2, -9.8]), "FLU")
    assert text is not None
    assert "FRD" in text
    assert "-z" in text
    for letters in text.rpartition(":")[2].replace(" ", "").split(","):
        assert gravity_contradiction(np.array([0.1, 0.2, -9.8]), letters) is None
    assert gravity_contradiction(np.zeros(3), "FLU") is not None
