"""The motions that judge the strapdown are judged themselves, in the inertial frame."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from strapdown_motion import car, circle, exact, gamma_at

from vehnav.earth import WGS84, c_en, ecef_from_geodetic

STEP = 0.02
"""s; five-point differences of r_i: truncation and rounding both stay under 5e-5 m/s2."""


@pytest.mark.parametrize("motion", [car(), circle(shake=0.002)], ids=["car", "shaken circle"])
def test_ideal_sensors_equal_differences_in_the_inertial_frame(motion):
    t = np.arange(0.0, 40.0, STEP)
    truth = exact(motion, t, gravity_at="height")
    lat, lon, h = truth.position.T
    turn = Rotation.from_rotvec(np.outer(WGS84.omega_ie * t, [0.0, 0.0, 1.0]))
    r_i = turn.apply(ecef_from_geodetic(lat, lon, h))
    c_ie, frame = turn.as_matrix(), c_en(lat, lon)
    c_ib = c_ie @ frame @ truth.c_nb

    a_i = (-r_i[4:] + 16 * r_i[3:-1] - 30 * r_i[2:-2] + 16 * r_i[1:-3] - r_i[:-4]) / (12 * STEP**2)
    plumb_i = np.einsum("kij,kj->ki", c_ie @ frame, np.outer(gamma_at(lat, h, WGS84), [0, 0, -1]))
    spin = np.array([0.0, 0.0, WGS84.omega_ie])
    gravitation_i = plumb_i + np.cross(spin, np.cross(spin, r_i))
    f_i = np.einsum("kij,kj->ki", c_ib, truth.f_b)
    assert np.abs(a_i - (f_i + gravitation_i)[2:-2]).max() < 5e-5  # spec B, T7

    turns = Rotation.from_matrix(np.swapaxes(c_ib[:-2], 1, 2) @ c_ib[2:]).as_rotvec()
    omega = turns / (2 * STEP)
    third_order = STEP**2 * np.abs(np.gradient(np.gradient(truth.omega_ib_b, STEP, axis=0), STEP,
                                               axis=0)).max()  # fmt: skip
    assert np.abs(omega - truth.omega_ib_b[1:-1]).max() < third_order


def test_increments_integrate_the_rates():
    """Simpson over half steps, three orders finer than any test needs."""
    motion, t = car(), np.arange(0.0, 5.0, 0.01)
    coarse, fine = exact(motion, t), exact(motion, np.arange(0.0, 5.0 - 0.0075, 0.005))
    n = (fine.t.size - 1) // 2
    for name, rate in (("dtheta", "omega_ib_b"), ("dvel", "f_b")):
        y = getattr(fine, rate)
        simpson = 0.01 / 6 * (y[0 : 2 * n : 2] + 4 * y[1 : 2 * n : 2] + y[2 : 2 * n + 1 : 2])
        assert np.abs(getattr(coarse, name)[:n] - simpson).max() < 1e-9
