"""Rotations against scipy.spatial.transform, spec A test 1, and the laws of the group."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from vehnav import rotation
from vehnav.rotation import (
    angles_from_c_nb,
    c_from_quaternion,
    c_from_rotvec,
    c_nb_from_angles,
    quaternion_from_c,
    skew,
)

EPS = np.finfo(float).eps
ROUNDING = 1e-15
"""A few roundings of numbers of size one."""

repeatable = settings(derandomize=True, deadline=None, max_examples=200)
component = st.floats(-1e3, 1e3, allow_subnormal=False)
vector = st.tuples(component, component, component)
turn = st.tuples(*[st.floats(-4, 4, allow_subnormal=False)] * 3)


def plain(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """The Python source of a kernel (that it equals the compiled one is tested in test_kernel)."""
    return getattr(kernel, "py_func", kernel)


def nine(matrix: np.ndarray) -> tuple[float, ...]:
    return tuple(float(x) for x in matrix.ravel())


# ---- heading, pitch, roll ----------------------------------------------------------------------


def test_level_and_north_is_the_unit_matrix() -> None:
    assert np.array_equal(c_nb_from_angles(0.0, 0.0, 0.0), np.eye(3))


@pytest.mark.parametrize(
    ("angles", "body", "enu"),
    [
        ((90, 0, 0), (0, 1, 0), (1, 0, 0)),  # heading east: forward is east
        ((90, 0, 0), (1, 0, 0), (0, -1, 0)),  # and right is south
        ((0, 90, 0), (0, 1, 0), (0, 0, 1)),  # nose up: forward is up
        ((0, 0, 90), (1, 0, 0), (0, 0, -1)),  # right side down
        ((0, 0, 90), (0, 0, 1), (1, 0, 0)),  # the roof leans to the right
        ((180, 0, 90), (0, 0, 1), (-1, 0, 0)),
    ],
)
def test_senses_of_the_angles(
    angles: tuple[float, float, float], body: tuple[float, ...], enu: tuple[float, ...]
) -> None:
    heading, pitch, roll = np.deg2rad(angles)
    assert np.abs(c_nb_from_angles(heading, pitch, roll) @ body - enu).max() < ROUNDING


def test_order_of_the_angles_is_that_of_scipy() -> None:
    """Heading about down, pitch about right, roll about forward: intrinsic z, x, y."""
    rng = np.random.default_rng(0)
    heading, pitch, roll = rng.uniform(-np.pi, np.pi, (3, 500))
    wanted = Rotation.from_euler("ZXY", np.stack([-heading, pitch, roll], -1)).as_matrix()
    assert np.abs(c_nb_from_angles(heading, pitch, roll) - wanted).max() < ROUNDING


def test_angles_come_back_on_a_grid() -> None:
    heading, pitch, roll = np.deg2rad(
        np.meshgrid(np.arange(0, 360, 15.0), np.arange(-89, 90, 8.9), np.arange(-175, 180, 25.0))
    )
    got = angles_from_c_nb(c_nb_from_angles(heading, pitch, roll))
    assert np.all((got[0] >= 0) & (got[0] < 2 * np.pi))
    off = np.remainder(got[0] - heading + np.pi, 2 * np.pi) - np.pi
    assert np.abs(off).max() < 1e-12
    assert np.abs(got[1] - pitch).max() < 1e-12
    assert np.abs(got[2] - roll).max() < 1e-12


def test_straight_up_gives_the_pitch() -> None:
    for sign in (1.0, -1.0):
        matrix = c_nb_from_angles(0.4, sign * np.pi / 2, 0.0)
        assert angles_from_c_nb(matrix)[1] == pytest.approx(sign * np.pi / 2, abs=ROUNDING)


# ---- rotation vectors --------------------------------------------------------------------------


def sizes() -> np.ndarray:
    """Rotation angles on both sides of every switch between series and closed form."""
    return np.array([0.0, 1e-300, 1e-12, 1e-8, 0.9e-4, 1.1e-4, 0.9e-2, 1.1e-2, 0.099999, 0.100001,
                     0.5, 1.0, math.pi - 1e-9, math.pi, 3.5, 6.0])  # fmt: skip


def test_rotation_vectors_equal_scipy_and_the_matrix_exponential() -> None:
    rng = np.random.default_rng(1)
    for size in sizes():
        axes = rng.normal(size=(20, 3))
        phi = size * axes / np.linalg.norm(axes, axis=1)[:, None]
        wanted = Rotation.from_rotvec(phi).as_matrix()
        assert np.abs(c_from_rotvec(phi) - wanted).max() < ROUNDING, size
        by_kernel = [plain(rotation.dcm_from_rotvec)(tuple(row)) for row in phi]
        assert np.abs(np.array(by_kernel).reshape(-1, 3, 3) - wanted).max() < ROUNDING, size
        assert np.abs(c_from_rotvec(phi[0]) - expm(skew(phi[0]))).max() < 20 * ROUNDING, size


def test_rotation_coefficients_equal_long_series() -> None:
    """sum (-t^2)^k / (2k+n)! with n = 1, 2, 3, summed until nothing moves."""
    for t in (0.0, 1e-9, 0.01, 0.0999999, 0.1, 0.1000001, 0.5, 1.5):
        got = plain(rotation.rotation_coefficients)(t * t)
        for n, value in zip((1, 2, 3), got, strict=True):
            series = math.fsum((-t * t) ** k / math.factorial(2 * k + n) for k in range(25))
            # the closed forms divide a rounding of 1 by t^2: up to 300 roundings at 0.1
            digits = EPS if t < 0.1 else EPS * (1.0 + 0.5 / (t * t * series))
            assert value == pytest.approx(series, rel=digits, abs=0.0), (t, n)


# ---- quaternions -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "near",
    [(1, 0.1, -0.2, 0.1), (0.1, 1, 0.2, -0.1), (-0.1, 0.2, 1, 0.1), (0.2, -0.1, 0.1, 1),
     (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1), (1, 1, 1, 1), (1, -1, -1, 1)],
)  # fmt: skip
def test_quaternion_by_every_branch(near: tuple[float, ...]) -> None:
    """Each component in turn the largest (Shepperd), half turns and ties."""
    w, x, y, z = np.array(near) / np.linalg.norm(near)
    matrix = Rotation.from_quat([x, y, z, w]).as_matrix()
    q = quaternion_from_c(matrix)
    wanted = np.array([w, x, y, z]) * (-1.0 if w < 0 else 1.0)
    assert min(np.abs(q - wanted).max(), np.abs(q + wanted).max() if w == 0 else 9) < ROUNDING
    assert q[0] >= 0


def test_quaternions_equal_scipy() -> None:
    turned = Rotation.random(2000, rng=np.random.default_rng(2))
    x, y, z, w = turned.as_quat().T
    wanted = np.stack([w, x, y, z], axis=-1) * np.where(w < 0, -1.0, 1.0)[:, None]
    q = quaternion_from_c(turned.as_matrix())
    assert np.abs(q - wanted).max() < 2 * ROUNDING
    assert np.abs(c_from_quaternion(-3.0 * q) - turned.as_matrix()).max() < 2 * ROUNDING
    assert quaternion_from_c(turned.as_matrix().reshape(40, 50, 3, 3)).shape == (40, 50, 4)


# ---- kernels equal numpy -----------------------------------------------------------------------


@given(vector, vector, component)
@repeatable
def test_vector_kernels(a: Any, b: Any, k: float) -> None:
    size = max(map(abs, (*a, *b, k, 1.0))) ** 2
    for kernel, wanted in [
        (rotation.cross, np.cross(a, b)),
        (rotation.add, np.add(a, b)),
        (rotation.subtract, np.subtract(a, b)),
    ]:
        assert np.abs(plain(kernel)(a, b) - wanted).max() <= 2 * EPS * size
    assert np.abs(plain(rotation.scale)(k, a) - k * np.array(a)).max() <= EPS * size
    assert abs(plain(rotation.dot)(a, b) - np.dot(a, b)) <= 6 * EPS * size
    assert np.abs(skew(a) @ b - np.cross(a, b)).max() <= 4 * EPS * size


@given(turn, turn, vector)
@repeatable
def test_matrix_kernels(phi: Any, psi: Any, v: Any) -> None:
    a, b = Rotation.from_rotvec(phi).as_matrix(), Rotation.from_rotvec(psi).as_matrix()
    size = 1.0 + max(map(abs, v))
    assert np.abs(plain(rotation.mat_vec)(nine(a), v) - a @ v).max() < 8 * EPS * size
    assert np.abs(plain(rotation.mat_t_vec)(nine(a), v) - a.T @ v).max() < 8 * EPS * size
    product = np.reshape(plain(rotation.mat_mat)(nine(a), nine(b)), (3, 3))
    assert np.abs(product - a @ b).max() < 8 * EPS


# ---- laws --------------------------------------------------------------------------------------


@given(turn)
@repeatable
def test_a_rotation_is_orthonormal_and_right_handed(phi: Any) -> None:
    c = c_from_rotvec(phi)
    assert np.abs(c @ c.T - np.eye(3)).max() < 20 * EPS
    assert np.linalg.det(c) == pytest.approx(1.0, abs=20 * EPS)
    assert np.abs(c @ phi - phi).max() < 40 * EPS * (1 + np.abs(phi).max())
    assert np.abs(c_from_rotvec(-np.array(phi)) - c.T).max() < 4 * EPS


@given(turn, st.floats(-2, 2), st.floats(-2, 2))
@repeatable
def test_turns_about_one_axis_add(axis: Any, a: float, b: float) -> None:
    axis = np.array(axis)
    added = c_from_rotvec((a + b) * axis)
    size = 1 + np.abs(axis).max() * (abs(a) + abs(b))
    assert np.abs(c_from_rotvec(a * axis) @ c_from_rotvec(b * axis) - added).max() < 40 * EPS * size


@given(st.floats(-10, 10), st.floats(-1.55, 1.55), st.floats(-3.1, 3.1))
@repeatable
def test_angles_come_back(heading: float, pitch: float, roll: float) -> None:
    got = angles_from_c_nb(c_nb_from_angles(heading, pitch, roll))
    # near the vertical heading and roll lose digits as 1 / cos(pitch), at most 50
    off = math.remainder(float(got[0]) - heading, 2 * math.pi)
    assert abs(off) < 1e-13
    assert float(got[1]) == pytest.approx(pitch, abs=1e-13)
    assert float(got[2]) == pytest.approx(roll, abs=1e-13)


@given(turn)
@repeatable
def test_quaternion_and_matrix_are_one_rotation(phi: Any) -> None:
    c = c_from_rotvec(phi)
    q = quaternion_from_c(c)
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=4 * EPS)
    assert q[0] >= 0
    assert np.abs(c_from_quaternion(q) - c).max() < 20 * EPS
