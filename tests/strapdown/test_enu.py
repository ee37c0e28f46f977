"""Poisson mechanization in East-North-Up (paper 004): closed forms, exact motions, time reversal.

Numbers of tests are those of specification A, section 6; the closed forms are of its section 5 and
of the inertial literature (Schuler oscillation of a single channel).
"""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from strapdown_motion import (
    NODES,
    car,
    circle,
    distance,
    exact,
    gamma,
    gamma_at,
    horizontal_error,
    radii,
    static,
)

from vehnav.earth import KRASOVSKY, WGS84
from vehnav.rotation import angles_from_c_nb, c_nb_from_angles
from vehnav.strapdown import body_step, enu
from vehnav.strapdown.enu import mechanize_enu
from vehnav.strapdown.increments import Increments, increments_from_rates
from vehnav.units import DEG

LAT = 47.2
MILLI_G = 9.80665e-3
DPH = DEG / 3600.0


def run(truth, **options):
    """Solution from the true start; options replace."""
    start = {
        "increments": truth.increments(),
        "position": tuple(truth.position[0]),
        "v_n": tuple(truth.v_n[0]),
        "c_nb": truth.c_nb[0],
    }
    start |= options
    return mechanize_enu(start.pop("increments"), **start)


def rest(duration, dt=0.1, *, lat=LAT, gyro_bias=(0, 0, 0), accel_bias=(0, 0, 0)):
    """Truth of a vehicle at rest heading north, its sensors biased."""
    truth = exact(static(lat_deg=lat), np.arange(0.0, duration + dt / 2, dt))
    inc = truth.increments()
    inc = Increments(
        inc.t,
        inc.dtheta + np.asarray(gyro_bias) * dt,
        inc.dvel + np.asarray(accel_bias) * dt,
        inc.coast,
    )
    return truth, inc


def schuler(lat_deg, earth=WGS84):
    """(omega_s rad/s, R_M m) of the north channel."""
    lat = np.array(np.radians(lat_deg))
    r_m, _ = radii(lat, np.array(0.0), earth)
    return float(np.sqrt(gamma(lat, earth) / r_m)), float(r_m)


# ---- axes --------------------------------------------------------------------------------------


def test_1_axes_of_the_direction_cosines():
    np.testing.assert_array_equal(c_nb_from_angles(0.0, 0.0, 0.0), np.eye(3))
    east = c_nb_from_angles(np.pi / 2, 0.0, 0.0) @ [0.0, 1.0, 0.0]
    np.testing.assert_allclose(east, [1.0, 0.0, 0.0], atol=1e-15)
    nose_up = c_nb_from_angles(0.0, 0.2, 0.0) @ [0.0, 1.0, 0.0]
    assert nose_up[2] == pytest.approx(np.sin(0.2))
    right_down = c_nb_from_angles(0.0, 0.0, 0.2) @ [1.0, 0.0, 0.0]
    assert right_down[2] == pytest.approx(-np.sin(0.2))


def test_1_angles_round_trip():
    grid = np.meshgrid(
        np.radians(np.arange(0.5, 360.0, 15.0)),
        np.radians(np.arange(-85.0, 86.0, 17.0)),
        np.radians(np.arange(-170.0, 171.0, 20.0)),
    )
    angles = [g.ravel() for g in grid]
    for got, wanted in zip(angles_from_c_nb(c_nb_from_angles(*angles)), angles, strict=True):
        np.testing.assert_allclose(got, wanted, atol=1e-12)


# ---- one equation each -------------------------------------------------------------------------


def test_rotated_increment_equals_quadrature_of_the_rotating_force():
    """Equation (16) of paper 000: force and rate constant in body axes; 40 Gauss nodes."""
    theta, dvel = np.array([0.5, -0.8, 0.3]), np.array([1.0, 2.0, -3.0])
    x, w = np.polynomial.legendre.leggauss(40)
    turned = Rotation.from_rotvec(np.outer(0.5 * (x + 1.0), theta)).apply(dvel)
    wanted = 0.5 * w @ turned
    got = body_step.rotated_velocity_increment(tuple(theta), tuple(dvel))
    np.testing.assert_allclose(got, wanted, atol=1e-13)
    small = 1e-3 * theta  # the series branch
    turned = Rotation.from_rotvec(np.outer(0.5 * (x + 1.0), small)).apply(dvel)
    got = body_step.rotated_velocity_increment(tuple(small), tuple(dvel))
    np.testing.assert_allclose(got, 0.5 * w @ turned, atol=1e-15)


@pytest.mark.parametrize("ratio", [1.0, 0.5, 2.0])
def test_coning_and_sculling_are_exact_to_their_order_for_linear_signals(ratio):
    """Rate a + b t, force p + q t over two uneven steps; errors fall with the fifth power.

    Judge: attitude by scipy over 2000 sub-steps of the rate at their middle (error 1e-7 of the
    angle of the step), force by quadrature through that attitude.
    """
    a, b = np.array([0.4, -0.3, 0.5]), np.array([2.0, 3.0, -1.0])
    p, q = np.array([1.0, -2.0, 9.8]), np.array([20.0, 5.0, -30.0])

    def step_errors(h):
        before, sub = h * ratio, 2000
        t = (np.arange(sub) + 0.5) * h / sub
        turn, dvel = Rotation.identity(), np.zeros(3)
        small = Rotation.from_rotvec((a + np.outer(t, b)) * h / sub)
        half = Rotation.from_rotvec((a + np.outer(t, b)) * h / sub / 2)
        for k in range(sub):
            dvel = dvel + (turn * half[k]).apply(p + q * t[k]) * h / sub
            turn = turn * small[k]
        theta, vel = a * h + b * h * h / 2, p * h + q * h * h / 2
        theta0 = (a * before - b * before**2 / 2) / ratio
        vel0 = (p * before - q * before**2 / 2) / ratio
        c = body_step.coning_factor(h, before)
        phi = body_step.rotation_vector(tuple(theta), tuple(theta0), c)
        dv = np.add(
            body_step.rotated_velocity_increment(tuple(theta), tuple(vel)),
            body_step.sculling(tuple(theta), tuple(vel), tuple(theta0), tuple(vel0), c),
        )
        plain = np.linalg.norm(theta - turn.as_rotvec())
        return (
            np.linalg.norm(phi - turn.as_rotvec()),
            np.linalg.norm(dv - dvel),
            plain,
        )

    coarse, fine = step_errors(0.2), step_errors(0.1)
    assert coarse[0] < 0.05 * coarse[2]  # without coning: 20 times worse
    assert np.log2(coarse[0] / fine[0]) > 4.5
    assert np.log2(coarse[1] / fine[1]) > 3.7  # sculling leaves the fourth order of the force


def test_coriolis_of_each_velocity():
    """A body thrown east at the equator is lifted; north at mid latitude it veers east."""
    spin = (0.0, WGS84.omega_ie, 0.0)
    still = (0.0, 0.0, 0.0)
    assert enu.coriolis((100.0, 0.0, 0.0), spin, still)[2] == pytest.approx(200 * WGS84.omega_ie)
    at_45 = (0.0, WGS84.omega_ie * np.sqrt(0.5), WGS84.omega_ie * np.sqrt(0.5))
    assert enu.coriolis((0.0, 100.0, 0.0), at_45, still)[0] == pytest.approx(
        200 * WGS84.omega_ie * np.sqrt(0.5)
    )
    turning = (0.0, 0.0, 1e-3)
    assert enu.coriolis((0.0, 10.0, 0.0), still, turning)[0] == pytest.approx(1e-2)


# ---- closed forms ------------------------------------------------------------------------------


@pytest.mark.parametrize("lat", [0.0, 47.2, 80.0])
def test_4_ideal_sensors_at_rest(lat):
    truth, inc = rest(900.0, 0.01, lat=lat)
    solution = run(truth, increments=inc)
    assert distance(solution.position, truth.position) < 1e-6
    assert np.abs(solution.v_n).max() < 1e-8


def test_4_long_steps_at_rest():
    """At 0.1 s the average of two rotations leaves (omega dt)^2 g / 12: 2e-5 m in 900 s."""
    truth, inc = rest(900.0, 0.1)
    left = (WGS84.omega_ie * 0.1) ** 2 * 9.81 / 12 * 900.0**2 / 2
    assert distance(run(truth, increments=inc).position, truth.position) < left < 2e-5


def test_12_schuler_oscillation():
    """1 m/s of velocity error at the equator: 84.29 min, 804.9 m at a quarter of it."""
    w, _ = schuler(0.0)
    period = 2.0 * np.pi / w
    assert period / 60.0 == pytest.approx(84.29, abs=0.01)
    truth, inc = rest(period / 2, 0.25, lat=0.0)
    solution = run(truth, increments=inc, v_n=(0.0, 1.0, 0.0))
    quarter, half = (np.argmin(np.abs(truth.t - f * period)) for f in (0.25, 0.5))
    assert solution.v_n[quarter, 1] == pytest.approx(0.0, abs=0.002)
    assert solution.v_n[half, 1] == pytest.approx(-1.0, abs=0.001)
    north = horizontal_error(solution.position, truth.position)[:, 1]
    assert north[quarter] == pytest.approx(1.0 / w, rel=0.002)
    assert north[quarter] == pytest.approx(804.9, rel=0.002)


def test_13_east_gyro_bias():
    truth, inc = rest(900.0, gyro_bias=(DPH, 0.0, 0.0))
    north = horizontal_error(run(truth, increments=inc).position, truth.position)[:, 1]
    w, r = schuler(LAT)
    wanted = -r * DPH * (truth.t - np.sin(w * truth.t) / w)
    assert wanted[-1] == pytest.approx(-5423.0, rel=0.002)
    assert north[-1] == pytest.approx(wanted[-1], rel=0.002)
    assert north[3000] == pytest.approx(-212.5, abs=0.5)


def test_13_north_gyro_bias_moves_east():
    truth, inc = rest(900.0, gyro_bias=(0.0, DPH, 0.0))
    east = horizontal_error(run(truth, increments=inc).position, truth.position)[:, 0]
    assert east[-1] == pytest.approx(+5423.0, rel=0.01)  # other radius: 0.36 % longer


def test_14_accelerometer_bias():
    truth, inc = rest(900.0, accel_bias=(0.0, MILLI_G, 0.0))
    north = horizontal_error(run(truth, increments=inc).position, truth.position)[:, 1]
    w, _ = schuler(LAT)
    wanted = MILLI_G / w**2 * (1.0 - np.cos(w * truth.t))
    assert north[3000] == pytest.approx(436.2, rel=0.001)
    assert north[-1] == pytest.approx(3573.0, rel=0.001)
    assert north[-1] == pytest.approx(wanted[-1], rel=0.0015)


def test_15_tilt_and_azimuth():
    """alpha_E = +1 mrad, C' = exp(-alpha x) C, drives north; azimuth leaks Earth rate."""
    truth, inc = rest(900.0)
    tilted = Rotation.from_rotvec([-1e-3, 0.0, 0.0]).as_matrix() @ truth.c_nb[0]
    north = horizontal_error(
        run(truth, increments=inc, c_nb=tilted).position, truth.position
    )[:, 1]  # fmt: skip
    # 1 mrad of g = 9.8076 m/s2 instead of 1 mg of 9.80665: 436.2 either way
    assert north[3000] == pytest.approx(436.2, rel=0.002)
    assert north[-1] == pytest.approx(3570.7, rel=0.002)
    turned = Rotation.from_rotvec([0.0, 0.0, -1e-3]).as_matrix() @ truth.c_nb[0]
    north = horizontal_error(
        run(truth, increments=inc, c_nb=turned).position, truth.position
    )[:, 1]  # fmt: skip
    w, r = schuler(LAT)
    leak = 1e-3 * WGS84.omega_ie * np.cos(LAT * DEG)
    assert abs(north[-1]) == pytest.approx(r * leak * (900.0 - np.sin(w * 900.0) / w), rel=0.005)
    assert abs(north[-1]) == pytest.approx(55.4, rel=0.005)
    # the gyros see +alpha_h Omega cos(lat) about computed east: the tilt grows to alpha_E < 0
    assert north[-1] < 0.0


# ---- exact motions -----------------------------------------------------------------------------


@pytest.mark.parametrize("earth", [WGS84, KRASOVSKY], ids=["wgs84", "krasovsky"])
@pytest.mark.parametrize("heading", [0.0, 2.1])
def test_8_circle_with_exact_increments(earth, heading):
    """Experiment E1 at 0.1 s for 900 s: under 2e-4 m."""
    truth = exact(circle(heading=heading), np.arange(0.0, 900.05, 0.1), earth=earth)
    solution = run(truth, earth=earth)
    assert distance(solution.position, truth.position, earth=earth) < 2e-4
    np.testing.assert_allclose(solution.v_n, truth.v_n, atol=2e-6)


def test_full_circle_with_exact_increments():
    """12567 s at 0.1 s: 3.8e-4 m in spec A 5.1, and the height does not move at all."""
    truth = exact(circle(), np.arange(0.0, 12567.0, 0.1))
    solution = run(truth)
    assert distance(solution.position, truth.position) < 1e-3
    assert np.all(solution.position[:, 2] == truth.position[0, 2])
    assert not solution.v_n[:, 2].any()


@pytest.mark.parametrize("gravity_at", ["height", "reference"])
def test_car_with_exact_increments(gravity_at):
    """900 s at 0.01 s with the height free: spec A 5.4 has 5.8e-4 m for another car."""
    truth = exact(car(), np.arange(0.0, 900.0, 0.01), gravity_at=gravity_at)
    solution = run(truth, vertical="free", gravity_at=gravity_at)
    assert distance(solution.position, truth.position) < 1e-3
    assert np.abs(solution.position[:, 2] - truth.position[:, 2]).max() < 3e-3
    heading, pitch, roll = (
        np.abs(np.sin(g - w)).max()
        for g, w in zip(angles_from_c_nb(solution.c_nb), angles_from_c_nb(truth.c_nb), strict=True)
    )
    assert max(heading, pitch, roll) < 2e-8


def test_height_enters_radii_and_gravity():
    """At 3000 m a start at sea level would be off by h / R; gravity at height by 2 h / R of g."""
    motion = car()
    motion = type(motion)((motion.start[0], motion.start[1], 3000.0), motion.v_n, motion.dv_n,
                          motion.angles, motion.rates)  # fmt: skip
    truth = exact(motion, np.arange(0.0, 300.0, 0.01), gravity_at="height")
    solution = run(truth, vertical="free", gravity_at="height")
    assert distance(solution.position, truth.position) < 1e-3
    assert np.abs(solution.position[:, 2] - truth.position[:, 2]).max() < 1e-3
    lat, h = truth.position[0, 0], np.array(3000.0)
    free_air = float(gamma_at(lat, h, WGS84) - gamma_at(lat, np.array(0.0), WGS84))
    assert free_air == pytest.approx(-3.086e-6 * 3000.0, rel=0.002)  # 0.3086 mGal per metre


def test_order_of_convergence_on_a_lively_car():
    """Halving the step divides the error by 4 at least (the method is of second order)."""
    errors = []
    for dt in (0.04, 0.02):
        truth = exact(car(), np.arange(0.0, 200.0, dt), gravity_at="reference")
        solution = run(truth, vertical="free")
        errors.append(distance(solution.position, truth.position))
    assert np.log2(errors[0] / errors[1]) > 1.9


def test_uneven_steps_cost_little():
    """Steps that jitter by 30 %: 2 mm in 120 s at 0.02 s."""
    t = np.arange(0.0, 120.0, 0.02)
    t[1:-1] += 0.02 * np.random.default_rng(5).uniform(-0.15, 0.15, t.size - 2)
    truth = exact(car(), t)
    assert distance(run(truth, vertical="free").position, truth.position) < 2e-3


def test_32_point_samples_by_cubic_quadrature():
    """A rates log at 0.01 s: under 5 mm in 900 s; at 0.1 s the trapezoid is 10 times worse."""
    truth = exact(car(rocking=0.25), np.arange(0.0, 900.0, 0.01))
    inc = increments_from_rates(truth.t, truth.omega_ib_b, truth.f_b, max_gap=0.5)
    fine = distance(run(truth, increments=inc, vertical="free").position, truth.position)
    assert fine < 0.005
    truth = exact(car(rocking=0.25), np.arange(0.0, 900.0, 0.1))
    errors = {}
    for holding in ("cubic", "trapezoid"):
        inc = increments_from_rates(
            truth.t, truth.omega_ib_b, truth.f_b, max_gap=0.5, holding=holding
        )
        solution = run(truth, increments=inc, vertical="free")
        errors[holding] = distance(solution.position, truth.position)
    assert errors["trapezoid"] > 10.0 * errors["cubic"]


# ---- vertical channel --------------------------------------------------------------------------


def test_11_clamp_holds_and_free_air_runs_away():
    """Full circle with held samples: clamped to the metre it started from; free it diverges."""
    truth = exact(circle(), np.arange(0.0, 12567.0, 0.1))
    inc = increments_from_rates(
        truth.t, truth.omega_ib_b, truth.f_b, max_gap=0.5, holding="left"
    )  # fmt: skip
    clamped = run(truth, increments=inc)
    assert np.all(clamped.position[:, 2] == 0.0)
    free = run(truth, increments=inc, vertical="free", gravity_at="height")
    assert abs(free.position[-1, 2]) > 1e5
    steady = run(truth, increments=inc, vertical="free", gravity_at="reference")
    assert np.abs(steady.position[:, 2]).max() < 20.0  # spec A 1.3: 5.1 m


# ---- time reversal, gaps, rounding -------------------------------------------------------------


@pytest.mark.parametrize("vertical", ["clamp", "free"])
def test_forward_then_backward_returns_to_the_start(vertical):
    """Biased sensors, so that the way is not the true one; back along it within 1 mm."""
    truth = exact(car(), np.arange(0.0, 300.0, 0.01))
    inc = truth.increments().corrected([2e-5, -3e-5, 1e-4], [0.0, 0.0, 5e-3])
    there = run(truth, increments=inc, vertical=vertical, gravity_at="height")
    assert distance(there.position, truth.position) > 10.0
    back = mechanize_enu(
        inc.reversed(), position=tuple(there.position[-1]), v_n=tuple(there.v_n[-1]),
        c_nb=there.c_nb[-1], vertical=vertical, gravity_at="height",
    )  # fmt: skip
    no_coning = 5e-8  # rad: the first step backward has no step before it
    assert distance(back.position[::-1], there.position) < 9.81 * no_coning * 300.0**2 / 2
    np.testing.assert_allclose(back.c_nb[::-1], there.c_nb, rtol=0.0, atol=no_coning)
    np.testing.assert_allclose(back.v_n[::-1], there.v_n, atol=2e-4)


def test_long_gap_holds_body_velocity_and_attitude_rate():
    """What the accelerometers said over the gap is not used; the turn rate goes on."""
    motion = circle(speed=20.0, rate=0.05)
    t = np.concatenate([np.arange(0.0, 10.0, 0.01), 12.0 + np.arange(0.0, 5.0, 0.01)])
    truth = exact(motion, t)
    rates = truth.f_b.copy()
    inc = increments_from_rates(t, truth.omega_ib_b, rates, max_gap=0.5)
    (gap,) = inc.coast.nonzero()[0]
    results = []
    for spoil in (0.0, 50.0):
        dvel = inc.dvel.copy()
        dvel[gap] += spoil
        spoiled = Increments(inc.t, inc.dtheta, dvel, inc.coast)
        results.append(run(truth, increments=spoiled, vertical="free"))
    np.testing.assert_array_equal(results[0].position, results[1].position)
    np.testing.assert_array_equal(results[0].v_n, results[1].v_n)
    solution = results[0]
    v_b = np.einsum("kji,kj->ki", solution.c_nb, solution.v_n)
    np.testing.assert_allclose(v_b[gap + 1], v_b[gap], atol=1e-12)
    assert np.linalg.norm(solution.v_n[gap + 1]) == pytest.approx(20.0, abs=1e-3)
    heading = angles_from_c_nb(solution.c_nb)[0]
    assert heading[gap + 1] == pytest.approx(angles_from_c_nb(truth.c_nb)[0][gap + 1], abs=1e-6)
    # chord of an arc of 0.1 rad by the trapezoid: x^2 / 12 of 40 m
    assert distance(solution.position, truth.position) < 40.0 * 0.1**2 / 12 * 1.2


def test_direction_cosines_stay_orthonormal_over_a_million_steps():
    """At most one rounding unit per step: 1e6 times 2.2e-16."""
    truth = exact(circle(shake=0.01, frequency=1.2), np.arange(0.0, 1000.05, 0.01))
    inc, c_nb = truth.increments(), truth.c_nb[0]
    for _ in range(10):
        c_nb = run(truth, increments=inc, c_nb=c_nb).c_nb[-1]
    assert np.abs(c_nb.T @ c_nb - np.eye(3)).max() < 1e6 * np.finfo(float).eps


PLAIN = """
import sys
import numpy as np
from vehnav.kernel import numba
from vehnav.strapdown.enu import StopControl, integrate_enu, mechanize_enu
from vehnav.strapdown.increments import Increments

assert hasattr(integrate_enu, "signatures") == (sys.argv[1] == "compiled")
rng = np.random.default_rng(1)
n = 400
t = np.cumsum(rng.uniform(0.008, 0.012, n))
t[200:] += 2.0
coast = np.diff(t) > 1.0
stop_id = np.full(n, -1, dtype=np.int64)
stop_id[50:100], stop_id[300:360] = 0, 1
inc = Increments(t, rng.normal(0.0, 0.02, (n - 1, 3)),
                 rng.normal(0.0, 0.02, (n - 1, 3)) + [0.0, 0.0, 0.098], coast)
out = []
for vertical, gravity_at in (("clamp", "reference"), ("free", "height")):
    s = mechanize_enu(
        inc, position=(0.9, 0.4, 250.0), v_n=(3.0, -4.0, 0.1), c_nb=np.eye(3),
        control=StopControl(stop_id, np.where(stop_id[1:] >= 0, 1.0, 0.0), True, 2),
        vertical=vertical, gravity_at=gravity_at,
    )
    out += [s.position, s.v_n, s.c_nb, s.v_before_reset, s.tilt_correction]
sys.stdout.buffer.write(b"".join(x.tobytes() for x in out))
"""


def test_compiled_equals_plain_python_bit_for_bit():
    outputs = []
    for mode, disable in (("compiled", "0"), ("plain", "1")):
        done = subprocess.run(
            [sys.executable, "-c", PLAIN, mode],
            env={**os.environ, "NUMBA_DISABLE_JIT": disable},
            capture_output=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr.decode()
        outputs.append(done.stdout)
    assert len(outputs[0]) == 2 * 8 * (400 * 15 + 2 * 5)
    assert np.isfinite(np.frombuffer(outputs[0])).all()
    assert outputs[0] == outputs[1]


def test_nodes_of_the_judge_are_enough():
    """Two more collocation nodes change the true position by rounding only."""
    assert NODES >= 5
    truth = exact(car(), np.arange(0.0, 60.0, 0.1))
    fine = exact(car(), np.arange(0.0, 60.0, 0.02))
    n = truth.t.size
    assert distance(truth.position, fine.position[::5][:n]) < 1e-7
