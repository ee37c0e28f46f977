"""Levelling and velocity reset (paper 002), alone and inside the ENU loop.

Expected values are the closed forms of spec A 4.1 to 4.3: a tilt decays as exp(-k g t), settles at
eps / (k g) under a gyro bias and at b / g under an accelerometer bias.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from strapdown_motion import exact as exact_truth
from strapdown_motion import static

from vehnav.corrections import levelling_rate, velocity_reset
from vehnav.strapdown.enu import Solution, StopControl, mechanize_enu
from vehnav.strapdown.increments import Increments
from vehnav.units import DEG

LAT = 47.2
ARCSEC = DEG / 3600.0
RATE_1_DPH = DEG / 3600.0


def stand(
    duration: float,
    *,
    tilt=(0.0, 0.0, 0.0),
    gain: float = 1.0,
    dt: float = 0.01,
    heading: float = 0.0,
    gyro_bias=(0.0, 0.0, 0.0),
    accel_bias=(0.0, 0.0, 0.0),
    reset: bool = True,
) -> tuple[Solution, np.ndarray]:
    """Solution of a vehicle at rest, levelled throughout, and its tilt alpha (n, 3), rad."""
    truth = exact_truth(static(lat_deg=LAT, heading=heading), np.arange(0.0, duration + dt / 2, dt))
    inc = truth.increments()
    inc = Increments(
        inc.t,
        inc.dtheta + np.asarray(gyro_bias) * dt,
        inc.dvel + np.asarray(accel_bias) * dt,
        inc.coast,
    )
    n = inc.t.size
    control = StopControl(np.zeros(n, dtype=np.int64), np.full(n - 1, gain), reset, 1)
    wrong = Rotation.from_rotvec(-np.asarray(tilt)).as_matrix() @ truth.c_nb[0]
    solution = mechanize_enu(inc, position=tuple(truth.position[0]), c_nb=wrong, control=control)
    return solution, alpha(solution.c_nb, truth.c_nb)


def alpha(c_nb: np.ndarray, c_true: np.ndarray) -> np.ndarray:
    """Rotation of the computed frame about true east, north, up: C' = exp(-alpha x) C."""
    return -Rotation.from_matrix(c_nb @ np.swapaxes(c_true, 1, 2)).as_rotvec()


def test_control_rate_is_as_published():
    """Delta omega_E = -k n_N, Delta omega_N = +k n_E, none about the vertical; k = gain / g."""
    g, a_e, a_n = 9.81, 1e-3, 2e-3
    f_n = Rotation.from_rotvec([-a_e, -a_n, 0.0]).apply([0.0, 0.0, g])
    assert f_n[0] == pytest.approx(-g * a_n, rel=1e-5)  # n_E = -g alpha_N
    assert f_n[1] == pytest.approx(+g * a_e, rel=1e-5)  # n_N = +g alpha_E
    rate = levelling_rate(tuple(f_n), 0.5, g)
    assert rate == pytest.approx((-0.5 * a_e, -0.5 * a_n, 0.0), rel=1e-5)


def test_reset_is_zero():
    assert velocity_reset() == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("gain", [0.1, 1.0])
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_tilt_decays_with_the_time_constant_of_the_gain(gain, axis, heading):
    """Both axes, any heading, within 1 % (spec A test 23); a wrong sign would grow."""
    tilt = np.zeros(3)
    tilt[axis] = 0.1 * DEG
    _, a = stand(3.0 / gain, tilt=tilt, gain=gain, heading=heading)
    k = round(1.0 / gain / 0.01)
    time_constant = 1.0 / gain / np.log(a[k, axis] / a[2 * k, axis])
    assert time_constant == pytest.approx(1.0 / gain, rel=0.01)
    assert np.abs(a[:, 1 - axis]).max() < 2e-3 * tilt[axis]  # only Earth rate mixes the axes


def test_tilt_after_five_seconds():
    """Spec A test 23: 0.1 deg about E and 0.05 deg about N, k g = 1: 402 arcsec to 2.7."""
    _, a = stand(5.0, tilt=(0.1 * DEG, 0.05 * DEG, 0.0))
    start, end = np.hypot(a[[0, -1], 0], a[[0, -1], 1]) / ARCSEC
    assert start == pytest.approx(402.5, abs=0.1)
    assert end == pytest.approx(402.5 * np.exp(-5.0), abs=0.1)


def test_levelling_reports_the_tilt_it_took_away():
    solution, a = stand(10.0, tilt=(0.1 * DEG, -0.05 * DEG, 0.0))
    taken = a[-1, :2] - a[0, :2]
    np.testing.assert_allclose(solution.tilt_correction[0], taken, atol=0.5 * ARCSEC)


def test_gyro_bias_leaves_a_tilt_of_bias_over_gain():
    """1 deg/h at k g = 1: 1 arcsec (spec A test 24)."""
    _, a = stand(15.0, gyro_bias=(RATE_1_DPH, 0.0, 0.0))
    assert abs(a[-1, 0]) == pytest.approx(1.0 * ARCSEC, rel=0.05)
    _, a = stand(15.0, gyro_bias=(RATE_1_DPH, 0.0, 0.0), gain=0.5)
    assert abs(a[-1, 0]) == pytest.approx(2.0 * ARCSEC, rel=0.05)


@pytest.mark.parametrize("gain", [0.5, 1.0])
def test_accelerometer_bias_leaves_a_tilt_of_bias_over_gravity(gain):
    """1 mg: 206 arcsec whatever the gain (spec A test 24)."""
    _, a = stand(15.0 / gain, accel_bias=(0.0, 9.80665e-3, 0.0), gain=gain)
    assert abs(a[-1, 0]) / ARCSEC == pytest.approx(206.3, rel=0.01)
    _, a = stand(15.0 / gain, accel_bias=(9.80665e-3, 0.0, 0.0), gain=gain)
    assert abs(a[-1, 1]) / ARCSEC == pytest.approx(206.3, rel=0.01)


def test_heading_is_left_alone():
    """Spec A test 25: beyond the Earth rate, under 1e-6 rad in 60 s.

    A tilt alpha_N leaks Omega cos(lat) into the azimuth: at most alpha_N Omega cos(lat) / (k g).
    """
    tilt = (0.1 * DEG, 0.05 * DEG, 0.0)
    _, a = stand(60.0, tilt=tilt)
    assert np.abs(a[:, 2] - a[0, 2]).max() < 1e-6
    heading_error = (0.0, 0.0, 1e-3)
    _, a = stand(60.0, tilt=heading_error)
    assert np.abs(a[:, 2] - 1e-3).max() < 1e-6


@pytest.mark.parametrize(("gain", "dt"), [(1.0, 1.0), (100.0, 0.01), (150.0, 0.01)])
def test_gain_that_cannot_settle_is_refused(gain, dt):
    with pytest.raises(ValueError, match="below 1"):
        stand(3.0, gain=gain, dt=dt)


def test_levelling_works_in_backward_time_too():
    """A run backward through a stop levels as well: the tilt decays in the order of the steps."""
    dt = 0.01
    truth = exact_truth(static(lat_deg=LAT), np.arange(0.0, 5.0 + dt / 2, dt))
    n = truth.t.size
    control = StopControl(np.zeros(n, dtype=np.int64), np.full(n - 1, 1.0), True, 1)
    tilt = np.array([0.1 * DEG, 0.0, 0.0])
    wrong = Rotation.from_rotvec(-tilt).as_matrix() @ truth.c_nb[-1]
    back = mechanize_enu(
        truth.increments().reversed(),
        position=tuple(truth.position[-1]),
        c_nb=wrong,
        control=control.reversed(),
    )
    a = alpha(back.c_nb, truth.c_nb)
    assert a[-1, 0] == pytest.approx(0.1 * DEG * np.exp(-5.0), rel=0.05)


def test_reset_holds_velocity_and_position_through_the_stop():
    """V := 0 at the instants of a stop only; what was there before is kept for the report."""
    dt = 0.01
    truth = exact_truth(static(lat_deg=LAT), np.arange(0.0, 10.0, dt))
    n = truth.t.size
    stop_id = np.full(n, -1, dtype=np.int64)
    stop_id[200:501], stop_id[700:] = 0, 1
    control = StopControl(stop_id, np.zeros(n - 1), True, 2)
    v0 = (0.3, -0.2, 0.0)
    solution = mechanize_enu(
        truth.increments(), position=tuple(truth.position[0]), v_n=v0, c_nb=truth.c_nb[0],
        control=control,
    )  # fmt: skip
    assert not solution.v_n[200:501].any()
    np.testing.assert_allclose(solution.v_before_reset[0], v0, atol=1e-4)
    np.testing.assert_allclose(solution.v_n[199], v0, atol=1e-4)
    assert np.ptp(solution.position[200:501], axis=0).max() == 0.0
    leaked = 3e-6  # m/s: 0.72 m driven before tilt the frame by 1e-7 rad; 2 s of g times it
    assert np.abs(solution.v_n[501:]).max() < leaked
    assert np.abs(solution.v_before_reset[1]).max() < leaked
    no_reset = StopControl(stop_id, np.zeros(n - 1), False, 2)
    free = mechanize_enu(
        truth.increments(), position=tuple(truth.position[0]), v_n=v0, c_nb=truth.c_nb[0],
        control=no_reset,
    )  # fmt: skip
    np.testing.assert_allclose(free.v_n[-1], v0, atol=2e-3)


def test_log_that_begins_in_a_stop_is_reset_at_once():
    truth = exact_truth(static(lat_deg=LAT), np.arange(0.0, 0.1, 0.01))
    n = truth.t.size
    control = StopControl(np.zeros(n, dtype=np.int64), np.zeros(n - 1), True, 1)
    solution = mechanize_enu(
        truth.increments(), position=tuple(truth.position[0]), v_n=(1.0, 2.0, 0.0),
        c_nb=truth.c_nb[0], control=control,
    )  # fmt: skip
    assert not solution.v_n.any()
    assert solution.v_before_reset[0].tolist() == [1.0, 2.0, 0.0]


def test_part_of_a_log_keeps_the_numbers_of_its_stops():
    """A part that begins after stop 0 still reports the velocity found at stop 1."""
    truth = exact_truth(static(lat_deg=LAT), np.arange(0.0, 1.0, 0.01))
    stop_id = np.full(truth.t.size, -1, dtype=np.int64)
    stop_id[:20], stop_id[60:80] = 0, 1
    control = StopControl(stop_id, np.zeros(truth.t.size - 1), True, 2).part(30, 90)
    solution = mechanize_enu(
        truth.increments().part(30, 90), position=tuple(truth.position[0]), v_n=(0.5, -0.25, 0.0),
        c_nb=truth.c_nb[0], control=control,
    )  # fmt: skip
    np.testing.assert_allclose(solution.v_before_reset, [[0, 0, 0], [0.5, -0.25, 0]], atol=1e-4)
