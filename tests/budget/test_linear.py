"""The linear equations against closed forms, the nonlinear mechanization, and their own laws."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from budget_drives import LEVEL, TOWN, apart, drive, error_of_column, perturbed

from vehnav.budget import (
    Budget,
    Initial,
    Procedure,
    Process,
    drive_of_trajectory,
    sensitivity,
)
from vehnav.budget.linear import chosen_stops
from vehnav.budget.sources import CONSTANT, constant_sigmas
from vehnav.earth import WGS84, c_en, curvature_radii, normal_gravity
from vehnav.sensors import Triad, load_sensor
from vehnav.simulate import ideal_log, make_scenario, stamps
from vehnav.units import DEG, DEG_PER_HOUR, DEG_PER_SQRT_HOUR, M_S_PER_SQRT_HOUR, MILLI_G

HG1700 = load_sensor("hg1700")
TIMES = (60.0, 300.0, 600.0)
CLOSED = 1e-3
"""The closed forms leave out what the Earth rate does within ten minutes."""


@pytest.fixture(scope="module")
def standing():
    return sensitivity(drive(LEVEL), Procedure(), at=TIMES)


def schuler():
    """(R, omega_s) of the north channel at 55 deg, height 0."""
    radius = curvature_radii(55.0 * DEG, 0.0, WGS84)[0]
    return radius, math.sqrt(normal_gravity(55.0 * DEG, 0.0, WGS84) / radius)


def column(name):
    return [source.name for source in CONSTANT].index(name)


@pytest.mark.parametrize("time", TIMES)
def test_closed_forms_of_a_vehicle_at_rest(standing, time):  # T17, spec B 5.4
    radius, w = schuler()
    k, wt = standing.index(time), w * time
    north = standing.columns[k][7]
    accel = MILLI_G * north[column("accel_bias forward")]
    assert accel == pytest.approx(MILLI_G * (1 - math.cos(wt)) / w**2, rel=CLOSED)
    gyro = -DEG_PER_HOUR * north[column("gyro_bias right")]
    assert gyro == pytest.approx(DEG_PER_HOUR * radius * (time - math.sin(wt) / w), rel=CLOSED)
    velocity = 0.05 * north[column("velocity north")]
    assert velocity == pytest.approx(0.05 * math.sin(wt) / w, rel=CLOSED)
    arw = 0.125 * DEG_PER_SQRT_HOUR * math.sqrt(standing.covariance[k, 0, 7, 7])
    spread = 1.5 * time - 2 * math.sin(wt) / w + math.sin(2 * wt) / (4 * w)
    assert arw == pytest.approx(0.125 * DEG_PER_SQRT_HOUR * radius * math.sqrt(spread), rel=CLOSED)
    vrw = 0.02 * M_S_PER_SQRT_HOUR * math.sqrt(standing.covariance[k, 1, 7, 7])
    spread = (time - math.sin(2 * wt) / (2 * w)) / (2 * w * w)
    assert vrw == pytest.approx(0.02 * M_S_PER_SQRT_HOUR * math.sqrt(spread), rel=CLOSED)


def test_changing_biases_of_a_vehicle_at_rest():
    """Walk and Markov bias against their closed forms without Schuler feedback (30 s)."""
    time, tau, g = 30.0, 50.0, normal_gravity(55.0 * DEG, 0.0, WGS84)
    processes = (
        Process("gyro_walk", True, "walk"),
        Process("accel_walk", False, "walk"),
        Process("accel_bias_instability", False, "markov", tau),
    )
    found = sensitivity(drive(LEVEL, 30.0), Procedure(), processes=processes, at=(time,))
    variance = found.covariance[-1, :, 7, 7]
    # integrated white noise of order n after n + 1 more integrals: T^(2n+1) / (n!^2 (2n+1))
    assert variance[0] == pytest.approx(g**2 * time**7 / (36.0 * 7.0), rel=2e-3)
    assert variance[1] == pytest.approx(time**5 / (4.0 * 5.0), rel=2e-3)
    # double integral of exp(-|s-u|/tau) with the lever (T-s)(T-u), by quadrature
    s = (np.arange(3000) + 0.5) * time / 3000
    kernel = np.exp(-np.abs(s[:, None] - s) / tau) * (time - s[:, None]) * (time - s)
    assert variance[2] == pytest.approx(kernel.mean() * time**2, rel=2e-3)


@pytest.mark.parametrize("gyro_from_stops", [False, True])
@pytest.mark.parametrize("triad", ["gyro", "accel"])
def test_a_bias_that_hardly_changes_is_a_constant_one(triad, gyro_from_stops):
    """Two ways to the same covariance, through levelling and resets: columns, and a process."""
    ideal = drive(TOWN, 225.0)
    process = Process(f"{triad}_bias_instability", triad == "gyro", "markov", 1e16)
    procedure = Procedure(stops=ideal.stops, levelled=True, gyro_from_stops=gyro_from_stops)
    found = sensitivity(ideal, procedure, processes=(process,), at=(60.0, 225.0))
    first = 0 if triad == "gyro" else 12
    for time in (60.0, 225.0):
        k = found.index(time)
        columns = found.columns[k][:, first : first + 3]
        whole, other = columns @ columns.T, found.covariance[k, 0]
        size = np.sqrt(np.diagonal(whole))
        size = np.maximum(size, 1e-9 * size.max())  # what cancels to nothing leaves its rounding
        assert np.all(np.abs(other - whole) <= 1e-6 * np.outer(size, size))


@pytest.mark.parametrize("held", [True, False])
def test_every_source_against_the_nonlinear_algorithm(held):  # T14
    ideal = drive(TOWN)
    sigmas = constant_sigmas(HG1700, Initial(), levelled=False, held=held)
    linear = sensitivity(ideal, Procedure(), at=(600.0,), held=held).columns[-1] * sigmas
    base = perturbed(ideal, held=held)
    judged = 0
    for j in np.flatnonzero(sigmas):
        found = apart(error_of_column(ideal, j, sigmas[j], held=held), base)
        off = np.hypot(*(linear[6:8, j] - found))
        assert off < max(2e-3 * np.hypot(*found), 0.05), CONSTANT[j].name
        judged += 1
    assert judged == (31 if held else 33)  # the nine g-sensitivities of this grade are zero


def test_g_sensitivity_against_the_nonlinear_algorithm():
    ideal = drive(TOWN)
    linear = sensitivity(ideal, Procedure(), at=(600.0,)).columns[-1]
    base = perturbed(ideal)
    size = 1.0 * DEG_PER_HOUR / 9.80665
    for j in range(24, 33):
        found = apart(error_of_column(ideal, j, size), base)
        assert np.hypot(*(size * linear[6:8, j] - found)) < max(2e-3 * np.hypot(*found), 0.05)


def test_heading_error_is_linear_to_half_its_size():  # T15: 10 deg -> 8.7 %
    ideal = drive(TOWN)
    linear = sensitivity(ideal, Procedure(), at=(600.0,)).columns[-1][6:8, column("heading")]
    base = perturbed(ideal)
    found = apart(perturbed(ideal, psi=(0.0, 0.0, 10.0 * DEG)), base)
    mismatch = np.hypot(*(10.0 * DEG * linear - found)) / np.hypot(*found)
    assert mismatch == pytest.approx(0.087, abs=0.005)


def test_attitude_error_seen_from_inertial_space():  # T16, 001 eq. 12: Psi_i' = -C_bi d omega
    ideal = drive(TOWN)
    bias = np.array([200.0, -150.0, 100.0]) * DEG_PER_HOUR
    linear = sensitivity(ideal, Procedure(), at=(600.0,)).columns[-1][:3, :3] @ bias
    t = ideal.t
    angle = ideal.lon + ideal.earth.omega_ie * t  # of the meridian against inertial space
    c_in = c_en(ideal.lat, angle)
    c_ib = c_in @ ideal.c_nb
    rate = -0.5 * (c_ib[1:] + c_ib[:-1]) @ bias
    psi_n = c_in[-1].T @ np.sum(rate * np.diff(t)[:, None], axis=0)
    # Psi_n also holds the turn of the computed frame with its position error: Delta omega_ig
    free = sensitivity(ideal, Procedure(), at=(600.0,), model="simplified").columns[-1][:3, :3]
    assert np.linalg.norm(free @ bias - psi_n) < 5e-3 * np.linalg.norm(psi_n)
    assert np.linalg.norm(linear - psi_n) > 5e-3 * np.linalg.norm(psi_n)


def test_models_neglect_what_the_paper_neglects():  # spec B 1.5: held 1-4 %, free 17-22 %
    ideal = drive(TOWN)
    total = {}
    for held in (True, False):
        for model in ("full", "paper", "simplified"):
            found = sensitivity(ideal, Procedure(), at=(600.0,), model=model, held=held)
            total[model, held] = Budget(found, HG1700, Initial()).totals(600.0)["drms"]
    assert abs(total["paper", True] / total["full", True] - 1.0) < 0.04
    assert 0.005 < abs(total["simplified", True] / total["full", True] - 1.0) < 0.05


def test_the_step_of_the_grid_hardly_matters():  # spec B 1.5: 0.06 %, 0.9 % with stops
    ideal = drive(TOWN, 225.0)
    for stops, bar in (((), 2e-3), (ideal.stops, 0.02)):
        drms = [
            Budget(
                sensitivity(ideal, Procedure(stops=stops), at=(225.0,), step=step),
                HG1700,
                Initial(),
            ).totals(225.0)["drms"]
            for step in (0.02, 0.1, 1.0)
        ]
        assert drms[1] == pytest.approx(drms[0], rel=0.1 * bar)
        assert drms[2] == pytest.approx(drms[0], rel=bar)


def test_doubled_sigmas_double_every_total():  # T21
    found = sensitivity(drive(TOWN), Procedure(stops=drive(TOWN).stops), at=TIMES)
    twice = replace(HG1700, gyro=_doubled(HG1700.gyro), accel=_doubled(HG1700.accel))
    start = Initial()
    more = Initial(2 * start.heading, 2 * start.tilt, 2 * start.velocity, 2 * start.position)
    one, two = Budget(found, HG1700, start), Budget(found, twice, more)
    for time in TIMES:
        for name, value in one.totals(time).items():
            assert two.totals(time)[name] == pytest.approx(2.0 * value, rel=1e-12)
        rows = one.rows(time)
        assert sum(row.share for row in rows) == pytest.approx(1.0, rel=1e-9)
        whole = sum(one.by_parameter(time).values())
        np.testing.assert_allclose(whole, one.horizontal(time), rtol=1e-9)


def _doubled(triad: Triad) -> Triad:
    return replace(
        triad, bias=2 * triad.bias, scale=2 * triad.scale, noise=2 * triad.noise,
        misalignment=2 * triad.misalignment,
    )  # fmt: skip


def test_levelled_start_is_what_the_accelerometers_say():
    """Its tilt holds a bias in balance but for the turn of the Earth: u t / 3 in a minute."""
    found = sensitivity(drive(LEVEL), Procedure(levelled=True), at=TIMES)
    plain = sensitivity(drive(LEVEL), Procedure(), at=TIMES)
    for name in ("accel_bias right", "accel_bias forward", "accel_misalignment right by up"):
        j = column(name)
        left, whole = (s.columns[s.index(60.0)][6:8, j] for s in (found, plain))
        assert np.hypot(*left) < 1.5e-3 * np.hypot(*whole)
    tilt = found.columns[0][:2, column("accel_bias forward")]  # but for the Earth rate times T/2
    np.testing.assert_allclose(
        tilt,
        [-1.0 / normal_gravity(55.0 * DEG, 0.0, WGS84), 0.0],
        rtol=1e-9,
        atol=2e-5,  # the Earth turns within the window
    )
    # white noise of the level: VRW^2 / (T g^2) and the drift of the gyros within the window
    window, g = Procedure().window, normal_gravity(55.0 * DEG, 0.0, WGS84)
    assert found.covariance[0, 1, 0, 0] == pytest.approx(1.0 / (window * g * g))
    assert found.covariance[0, 0, 1, 1] == pytest.approx(window / 3.0)


def test_readings_of_a_vehicle_at_rest_are_exact():
    """The turn of the Earth and of the axes under gravity, to rounding."""
    scenario = make_scenario("static", duration=5.0)
    truth, ideal = ideal_log(scenario.motion, stamps(5.0, 100.0), sampling="increments")
    found = drive_of_trajectory(truth, name="static").increments
    np.testing.assert_allclose(found.dtheta, ideal.gyro[1:], rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(found.dvel, ideal.accel[1:], rtol=0.0, atol=1e-12)


def test_readings_from_a_trajectory_are_those_of_the_simulator():
    scenario = make_scenario("city", duration=200.0)
    truth, ideal = ideal_log(scenario.motion, stamps(200.0, 100.0), sampling="increments")
    found = drive_of_trajectory(truth, name="city").increments
    dt = 0.01
    assert np.abs(found.dtheta - ideal.gyro[1:]).max() / dt < 2e-5  # rad/s, with road vibration
    moving = ~(truth.stopped[1:] | truth.stopped[:-1])  # its own idle shaking counts as standing
    off = (found.dvel - ideal.accel[1:])[moving] / dt
    assert np.abs(off.mean(axis=0)).max() < 2e-5  # m/s2
    assert np.sqrt(np.mean(off**2)) < 0.02


def test_stops_at_least_so_far_apart():
    ideal = drive(TOWN)
    assert len(chosen_stops(ideal)) == 8
    assert [round(end) for _, end in chosen_stops(ideal, 150.0)] == [150, 300, 450, 600]
    assert [round(end) for _, end in chosen_stops(ideal, 200.0)] == [225, 450]
    assert chosen_stops(ideal, 700.0) == ()


def test_times_outside_the_drive_are_refused():
    with pytest.raises(ValueError, match="within 0 and 30"):
        sensitivity(drive(LEVEL, 30.0), Procedure(), at=(31.0,))
