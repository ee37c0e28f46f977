"""What happens in body axes over one step, against fine integration by scipy's rotations."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vehnav.strapdown.body_step import (
    coning_factor,
    rotated_velocity_increment,
    rotation_vector,
    sculling,
)
from vehnav.strapdown.quaternion import dcm_of, quaternion_of_rotvec

FINE = 4000


def tuples(*vectors):
    return [tuple(float(x) for x in v) for v in vectors]


@pytest.mark.parametrize("dtheta", np.array([[0.9, -0.5, 0.7], [0.2, 1.1, -0.4], [1e-5, 0, 2e-5]]))
def test_velocity_increment_of_a_constant_rate_and_force(dtheta):
    """The mean over the step of the rotation from its start, by the midpoint rule."""
    dvel = np.array([0.3, 9.7, -2.1])
    s = (np.arange(FINE) + 0.5) / FINE
    wanted = Rotation.from_rotvec(s[:, None] * dtheta).apply(dvel).mean(axis=0)
    found = rotated_velocity_increment(*tuples(dtheta, dvel))
    assert np.allclose(found, wanted, atol=1e-7)


class Uneven:
    """Rate and force linear in time over a step of 0.04 s and one of 0.1 s after it."""

    before, step = 0.04, 0.1
    rate = np.array([0.8, -0.5, 0.3]), np.array([-2.0, 3.0, 4.0])
    force = np.array([1.0, -3.0, 9.8]), np.array([30.0, -20.0, 10.0])

    @classmethod
    def integral(cls, line, begin, end):
        a, b = line
        return a * (end - begin) + 0.5 * b * (end**2 - begin**2)

    @classmethod
    def increments(cls):
        """(now, before) of angle and velocity, those before stretched to the length of now."""
        stretch = cls.step / cls.before
        out = []
        for line in (cls.rate, cls.force):
            out.append(cls.integral(line, 0.0, cls.step))
            out.append(stretch * cls.integral(line, -cls.before, 0.0))
        return out

    @classmethod
    def truth(cls):
        """Rotation of the body and velocity in the axes of the start, by fine steps."""
        t = np.linspace(0.0, cls.step, FINE + 1)
        turn, velocity = Rotation.identity(), np.zeros(3)
        for begin, end in pairwise(t):
            half = Rotation.from_rotvec(0.5 * cls.integral(cls.rate, begin, end))
            velocity += (turn * half).apply(cls.integral(cls.force, begin, end))
            turn = turn * half * half
        return turn.as_rotvec(), velocity


def test_coning_and_sculling_of_linear_rate_and_force():
    dtheta, dtheta_before, dvel, dvel_before = Uneven.increments()
    phi, velocity = Uneven.truth()
    c = coning_factor(Uneven.step, Uneven.before)
    assert coning_factor(0.01, 0.01) == pytest.approx(1.0 / 12.0)
    found = np.array(rotation_vector(*tuples(dtheta, dtheta_before), c))
    without = np.linalg.norm(dtheta - phi)
    assert np.linalg.norm(found - phi) < 0.05 * without  # fourth order left
    now = np.array(rotated_velocity_increment(*tuples(dtheta, dvel)))
    more = np.array(sculling(*tuples(dtheta, dvel, dtheta_before, dvel_before), c))
    assert np.linalg.norm(now + more - velocity) < 0.05 * np.linalg.norm(now - velocity)


# ---- quaternions of a step ---------------------------------------------------------------------


@pytest.mark.parametrize("phi", [[0.036, -0.04, 0.031], [0.02, 0.01, -0.05], [0.7, -0.2, 1.1]])
def test_quaternion_of_a_rotation_vector_on_both_sides_of_the_series(phi):
    x, y, z, w = Rotation.from_rotvec(phi).as_quat()
    assert np.allclose(quaternion_of_rotvec(tuple(phi)), [w, x, y, z], rtol=0.0, atol=4e-16)


def test_attitude_of_a_frame_and_a_quaternion():
    frame, turn = Rotation.from_rotvec([0.4, -1.0, 2.0]), Rotation.from_rotvec([1.5, 0.3, -0.8])
    x, y, z, w = turn.as_quat()
    found = dcm_of(tuple(frame.as_matrix().ravel()), (w, x, y, z))
    assert np.allclose(np.reshape(found, (3, 3)), (frame * turn).as_matrix(), atol=1e-15)
