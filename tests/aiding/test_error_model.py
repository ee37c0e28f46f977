"""Every element of the error matrices against central differences of the mechanization (T12, T29).

The judge: two runs of the nonlinear mechanization with the same sensors, one from the true and one
from a perturbed state; the errors are measured in Earth-fixed axes by their definitions.
"""

from __future__ import annotations

import numpy as np
import pytest

from vehnav.aiding.error_model import (
    error_matrix,
    error_matrix_001,
    total_velocity_error,
    transition,
)
from vehnav.earth import WGS84, curvature_radii, ecef_from_geodetic, geodetic_from_ecef
from vehnav.rotation import c_from_rotvec, c_nb_from_angles, skew
from vehnav.strapdown.enu import mechanize_enu
from vehnav.strapdown.increments import Increments
from vehnav.strapdown.wander import (
    c_nw,
    c_we_from_geodetic,
    curvature,
    earth_axis,
    mat3,
    mechanize_wander,
)
from vehnav.units import DEG

DT = 0.5
STEPS = 10
SIZES = np.array([100.0] * 3 + [0.1] * 3 + [1e-4] * 3 + [1e-2] * 3 + [1e-5] * 3)
"""Perturbations: m, m/s, rad, m/s2, rad/s: large against rounding, small against curvature."""
PLACES = [0.5 * DEG, 55.0 * DEG, 89.5 * DEG, (90.0 - 1e-7) * DEG]


class State:
    """Place, velocity and attitude in Earth-fixed and wander axes."""

    def __init__(self, r_e, v_e, c_eb, c_we):
        self.r_e, self.v_e, self.c_eb, self.c_we = r_e, v_e, c_eb, c_we

    @classmethod
    def of(cls, lat, lon, h, wander, v_w, c_wb):
        c_we = c_we_from_geodetic(lat, lon, wander)
        return cls(ecef_from_geodetic(lat, lon, h), c_we.T @ v_w, c_we.T @ c_wb, c_we)

    @property
    def height(self):
        return float(geodetic_from_ecef(self.r_e)[2])

    @property
    def v_w(self):
        return self.c_we @ self.v_e

    @property
    def c_wb(self):
        return self.c_we @ self.c_eb


def place_at(r_e, near):
    """Place matrix at r_e whose axes are those of ``near`` turned by the shortest way."""
    lat, lon, _ = geodetic_from_ecef(r_e)
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    axis = np.cross(near[2], up)
    return near @ c_from_rotvec(axis * np.arcsin(np.linalg.norm(axis)) /
                                max(np.linalg.norm(axis), 1e-300)).T  # fmt: skip


def curvatures(state):
    return curvature(earth_axis(mat3(state.c_we)), state.height, WGS84)


def measured_errors(computed, true):
    """The nine navigation errors by their definitions (aiding/error_model.py)."""
    y = computed.c_we @ (computed.r_e - true.r_e)
    d_v = computed.v_w - computed.c_wb @ true.c_eb.T @ true.v_e
    c_yb = computed.c_we @ true.c_eb
    turn = computed.c_wb @ c_yb.T  # 1 - [beta x]
    beta = 0.5 * np.array(
        [turn[1, 2] - turn[2, 1], turn[2, 0] - turn[0, 2], turn[0, 1] - turn[1, 0]]
    )
    k11, k12, k22 = curvatures(computed)
    gamma = np.array([-(k12 * y[0] + k22 * y[1]), k11 * y[0] + k12 * y[1], 0.0])
    return np.concatenate([y, d_v, beta + gamma])


def true_state(computed, x):
    """The true state whose errors against ``computed`` are x (9,), up to second order."""
    k11, k12, k22 = curvatures(computed)
    gamma = np.array([-(k12 * x[0] + k22 * x[1]), k11 * x[0] + k12 * x[1], 0.0])
    beta = x[6:9] - gamma
    r_e = computed.r_e - computed.c_we.T @ x[:3]
    c_eb = computed.c_we.T @ c_from_rotvec(beta) @ computed.c_wb
    v_e = c_eb @ computed.c_wb.T @ (computed.v_w - x[3:6])
    return State(r_e, v_e, c_eb, place_at(r_e, computed.c_we))


def advance(state, dtheta, dvel, absolute, held, gravity):
    """Nonlinear mechanization over DT in STEPS steps."""
    t = np.linspace(0.0, DT, STEPS + 1)
    inc = Increments(t, np.tile(dtheta / STEPS, (STEPS, 1)), np.tile(dvel / STEPS, (STEPS, 1)),
                     np.zeros(STEPS, bool))  # fmt: skip
    out = mechanize_wander(
        inc, c_we=state.c_we, height=state.height, v_w=state.v_w, c_wb=state.c_wb,
        azimuth="absolute" if absolute else "relative", vertical="clamp" if held else "free",
        gravity_reference=gravity,
    )  # fmt: skip
    c_we, h = out.c_we[-1], out.height[-1]
    up = c_we[2]
    r_n = WGS84.a / np.sqrt(1 - WGS84.e2 * up[2] ** 2)
    r_e = up * np.array([r_n + h, r_n + h, (1 - WGS84.e2) * r_n + h])
    return State(r_e, c_we.T @ out.v_w[-1], c_we.T @ out.c_wb[-1], c_we)


@pytest.mark.parametrize("absolute", [False, True])
@pytest.mark.parametrize("lat", PLACES)
def test_every_element_by_central_differences(lat, absolute):
    c_wb = c_nb_from_angles(0.7, 0.05, -0.03)
    v_w = np.array([20.0, -11.0, 0.5])
    computed = State.of(lat, 0.3, 120.0, 0.4, v_w, c_wb)
    omega = np.array([0.002, -0.003, 0.01])
    force = np.array([0.3, 0.5, 9.8])
    dtheta, dvel = omega * DT, force * DT

    def errors_after(x):
        true = true_state(computed, x[:9])
        ahead = advance(computed, dtheta, dvel, absolute, False, "height")
        sensors = (dtheta - x[12:15] * DT, dvel - x[9:12] * DT)
        before = measured_errors(computed, true)
        after = measured_errors(ahead, advance(true, *sensors, absolute, False, "height"))
        return after - before

    measured = np.stack(
        [
            (errors_after(d) - errors_after(-d)) / (2 * SIZES[j])
            for j, d in enumerate(np.diag(SIZES))
        ],
        axis=1,
    ) / DT  # fmt: skip
    ahead = advance(computed, dtheta, dvel, absolute, False, "height")
    f = 0.5 * sum(
        error_matrix(
            c_we=s.c_we, height=s.height, v_w=s.v_w, c_wb=s.c_wb, absolute=absolute, held=False
        )
        for s in (computed, ahead)
    )
    predicted = (transition(f, DT)[:9] - np.eye(9, 15)) / DT
    # 1/s, each element in units of its row and column
    mismatch = np.abs(measured - predicted) / (SIZES[:9, None] / SIZES[None, :])
    assert np.max(mismatch) < 1e-6, np.argwhere(mismatch > 1e-6)


def test_total_velocity_error_by_definition():
    c_wb = c_nb_from_angles(-0.4, 0.02, 0.03)
    computed = State.of(0.9, 0.1, 50.0, 0.2, np.array([12.0, 9.0, -0.4]), c_wb)
    x = 1e-2 * SIZES[:9]
    true = true_state(computed, x)
    difference = computed.v_w - computed.c_we @ true.v_e
    found = total_velocity_error(x, computed.v_w, curvatures(computed))
    assert np.allclose(found, difference, atol=1e-9)


def test_heading_error_is_clockwise():
    computed = State.of(0.9, 0.1, 0.0, 0.0, np.zeros(3), c_nb_from_angles(0.5, 0.0, 0.0))
    true = State.of(0.9, 0.1, 0.0, 0.0, np.zeros(3), c_nb_from_angles(0.49, 0.0, 0.0))
    assert measured_errors(computed, true)[8] == pytest.approx(0.01, rel=1e-4)
    assert np.allclose(c_nw(0.0), np.eye(3))


# ---- paper 001 -----------------------------------------------------------------------------------


def enu_errors(computed, true):
    """Psi, Delta v, Delta r in East-North-Up of two (position, v_n, c_nb)."""
    (p, v, c), (p0, v0, c0) = computed, true
    turn = c @ c0.T
    psi = 0.5 * np.array(
        [turn[1, 2] - turn[2, 1], turn[2, 0] - turn[0, 2], turn[0, 1] - turn[1, 0]]
    )
    r_m, r_e = curvature_radii(p0[0], p0[2], WGS84)
    dr = [(p[1] - p0[1]) * r_e * np.cos(p0[0]), (p[0] - p0[0]) * r_m, p[2] - p0[2]]
    return np.concatenate([psi, v - v0, dr])


@pytest.mark.parametrize("lat", [0.5 * DEG, 55.0 * DEG, 75.0 * DEG])
def test_model_001_by_central_differences(lat):
    position = np.array([lat, 0.2, 80.0])
    v_n, c_nb = np.array([14.0, 21.0, 0.7]), c_nb_from_angles(0.6, 0.04, -0.05)
    omega, force = np.array([0.002, -0.001, 0.02]), np.array([0.4, 0.6, 9.8])
    sizes = np.array([1e-4] * 3 + [0.1] * 3 + [100.0] * 3)
    dt, steps = 0.2, 10
    t = np.linspace(0.0, dt, steps + 1)
    inc = Increments(t, np.tile(omega * dt / steps, (steps, 1)),
                     np.tile(force * dt / steps, (steps, 1)), np.zeros(steps, bool))  # fmt: skip

    def perturbed(x):
        r_m, r_e = curvature_radii(position[0], position[2], WGS84)
        p = position + [x[7] / r_m, x[6] / (r_e * np.cos(position[0])), x[8]]
        return p, v_n + x[3:6], (c_from_rotvec(-x[:3])) @ c_nb

    def ahead(x):
        p, v, c = perturbed(x)
        out = mechanize_enu(inc, position=tuple(p), v_n=tuple(v), c_nb=c, vertical="free",
                            gravity_at="height")  # fmt: skip
        return out.position[-1], out.v_n[-1], out.c_nb[-1]

    def rate(x):
        plus = enu_errors(ahead(x), ahead(0 * x)) - enu_errors(perturbed(x), perturbed(0 * x))
        return plus / dt

    found = np.stack(
        [(rate(d) - rate(-d)) / (2 * sizes[j]) for j, d in enumerate(np.diag(sizes))], axis=1
    )

    def matrix(state):
        p, v, c = state
        return error_matrix_001(lat=p[0], height=p[2], v_n=v, f_n=c @ force, held=False)

    f = 0.5 * (matrix(perturbed(np.zeros(9))) + matrix(ahead(np.zeros(9))))
    predicted = (transition(f, dt) - np.eye(9)) / dt
    mismatch = np.abs(found - predicted) / (sizes[:, None] / sizes[None, :])
    assert np.max(mismatch) < 2e-5


def test_variants_of_001_neglect_what_the_paper_neglects():
    more = {"lat": 0.9, "height": 10.0, "v_n": [10.0, 5.0, 0.0], "f_n": [0.1, 0.2, 9.8]}
    full = error_matrix_001(**more, held=False)
    paper = error_matrix_001(**more, model="paper", held=False)
    simplified = error_matrix_001(**more, model="simplified", held=False)
    assert np.array_equal(full[:3], paper[:3])
    assert np.array_equal(paper[6:], np.eye(9)[3:6])
    assert np.array_equal(paper[3:6, 3:], np.zeros((3, 6)))
    assert np.array_equal(simplified[:3, 3:], np.zeros((3, 6)))
    assert np.array_equal(simplified[3:6, :3], skew([0.1, 0.2, 9.8]))
    assert not np.any(error_matrix_001(**more)[[5, 8]])
