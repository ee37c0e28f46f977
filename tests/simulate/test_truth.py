"""Ideal sensors judged in the inertial frame (T7 of the error-budget specification).

Positions and attitudes of the truth are turned into the inertial frame with pyproj and scipy;
their finite differences, with gravitation = gravity + centrifugal, must be what the sensors read.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pyproj
import pytest
from scipy.integrate import quad_vec
from scipy.spatial.transform import Rotation

from vehnav.earth import KRASOVSKY, WGS84, normal_gravity
from vehnav.simulate import inertial_states, make_scenario, stamps
from vehnav.simulate.generate import ideal_log
from vehnav.simulate.motion import AIRCRAFT, RIGID, Body, PolarMotion, RoadMotion
from vehnav.simulate.program import Program, ProgramBuilder
from vehnav.simulate.truth import Block, gravity, ideal_record
from vehnav.simulate.vibration import draw_tones

T7 = 5e-5  # m/s2
GYRO = 1e-5  # rad/s: finite differences of the test drive at 0.02 s leave 1.4e-6

SIXTH_FIRST = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60.0
SIXTH_SECOND = np.array([2, -27, 270, -490, 270, -27, 2]) / 180.0


def drive() -> Program:
    way = ProgramBuilder(heading=0.3).hold(2.0).change_speed(15.0, peak=2.0, grade=0.03).hold(2.0)
    way.turn(1.5, yaw_rate=0.4, ease=2.0).hold(1.0).turn(-2.0, yaw_rate=0.3, ease=2.0)
    return way.change_speed(5.0, peak=2.5, grade=-0.02).hold(2.0).build()


def slow_tones():
    return draw_tones(
        np.random.default_rng(3),
        band=(0.3, 1.2),
        count=4,
        accel_rms=[0.2, 0.1, 0.3],
        rate_rms=[0.004, 0.01, 0.012],
        envelope="moving",
    )


def enu_axes(lat, lon):
    """(n, 3, 3) columns east, north, up in Earth axes, by scipy."""
    turn = Rotation.from_euler("ZY", np.stack([lon, -lat], axis=-1)).as_matrix()
    return turn[:, :, [1, 2, 0]]


def judged_readings(t, s, *, ellps, earth):
    """(omega_ib_b, f_b) inside the span, from positions and attitudes alone."""
    to_ecef = pyproj.Transformer.from_pipeline(f"+proj=cart {ellps}")
    r_e = np.stack(to_ecef.transform(s.lon, s.lat, s.height, radians=True), axis=-1)
    axes = enu_axes(s.lat, s.lon)
    spin = np.array([0.0, 0.0, earth.omega_ie])
    turn = Rotation.from_rotvec(np.outer(t, spin))
    magnitude = [normal_gravity(a, h, earth) for a, h in zip(s.lat, s.height, strict=True)]
    plumb = -np.array(magnitude)[:, None] * axes[:, :, 2]
    gravitation = turn.apply(plumb + np.cross(spin, np.cross(spin, r_e)))
    r_i = turn.apply(r_e)
    c_ib = turn.as_matrix() @ axes @ s.c_nb
    h, n = t[1] - t[0], t.size

    def difference(x, weights):
        return sum(w * x[k : n - 6 + k] for k, w in enumerate(weights))

    inside = slice(3, n - 3)
    f_i = difference(r_i, SIXTH_SECOND) / h**2 - gravitation[inside]
    c_mid = c_ib[inside]
    skew = np.einsum("nji,njk->nik", c_mid, difference(c_ib, SIXTH_FIRST) / h)
    omega = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=-1)
    return omega, np.einsum("nij,ni->nj", c_mid, f_i)


def check(motion, t, *, ellps="+ellps=WGS84"):
    s = ideal_record(motion, t, increments=False).states
    omega, f = judged_readings(t, s, ellps=ellps, earth=motion.earth)
    assert np.max(np.abs(f - s.f_b[3:-3])) < T7
    assert np.max(np.abs(omega - s.omega_ib_b[3:-3])) < GYRO
    assert np.max(np.ptp(s.f_b, axis=0)) > 0.0 or motion.duration == 0.0


@pytest.mark.parametrize("lat", [0.0, 47.2, -33.0, 71.0, 88.9])
@pytest.mark.parametrize("body", [RIGID, Body(), AIRCRAFT], ids=["rigid", "car", "aircraft"])
def test_drive_in_the_inertial_frame(lat, body):
    motion = RoadMotion(drive(), (math.radians(lat), 2.5, 300.0), body)
    check(motion, np.arange(0.0, motion.duration, 0.02))


@pytest.mark.parametrize("lat", [-10.0, 55.75])
def test_vibration_in_the_inertial_frame(lat):
    motion = RoadMotion(drive(), (math.radians(lat), -3.0, 0.0), Body(), (slow_tones(),))
    check(motion, np.arange(0.0, motion.duration, 0.02))


def test_krasovsky_in_the_inertial_frame():
    earth = KRASOVSKY
    motion = RoadMotion(drive(), (0.97, 0.6, 0.0), Body(), earth=earth)
    check(motion, np.arange(0.0, 20.0, 0.02), ellps=f"+a={earth.a} +es={earth.e2}")


@pytest.mark.parametrize(
    ("speed", "miss"), [(30.0, 0.0), (30.0, 1.0), (30.0, 1000.0), (1500.0, 1e6), (1500.0, 4e6)]
)
def test_pole_in_the_inertial_frame(speed, miss):
    """Fast ones as well: the flattening adds 2e-3 m/s2 there, 1e-6 at the speed of a car."""
    motion = PolarMotion(speed=speed, miss=miss, duration=40.0, height=200.0)
    check(motion, np.arange(0.0, 40.0 + 1e-9, 0.05))


def test_flight_in_the_inertial_frame():
    motion = make_scenario("flight").motion
    s = np.arange(395.0, 480.0, 0.04)  # climb and a turn begin in it
    states = ideal_record(motion, s, increments=False).states
    omega, f = judged_readings(s, states, ellps="+ellps=WGS84", earth=WGS84)
    assert np.max(np.abs(f - states.f_b[3:-3])) < T7
    assert np.max(np.abs(omega - states.omega_ib_b[3:-3])) < GYRO


def test_standing_is_gravity_and_earth_rate():
    motion = make_scenario("static,lat=50,heading=90,duration=10").motion
    s = ideal_record(motion, np.arange(0.0, 10.0), increments=False).states
    w, lat = 7.292115e-5, math.radians(50.0)
    s2, s2_double = math.sin(lat) ** 2, math.sin(2.0 * lat) ** 2
    g = 9.780327 * (1.0 + 0.0053024 * s2 - 0.0000058 * s2_double)  # good to 3e-6
    g -= (3.08770e-6 - 4.4e-9 * s2) * 150.0
    assert s.f_b[3] == pytest.approx([0.0, 0.0, g], abs=4e-6)
    # heading east: right is south, forward is east
    assert s.omega_ib_b[3] == pytest.approx([-w * math.cos(lat), 0.0, w * math.sin(lat)], abs=1e-15)


@pytest.mark.parametrize("heading", [0.0, 63.0, 90.0])
def test_way_on_the_ellipsoid_by_pyproj(heading):
    program = Program(np.array([600.0]), np.full(2, 20.0), np.zeros(2), np.zeros(2))
    program = replace(program, heading=math.radians(heading))
    motion = RoadMotion(program, (math.radians(55.0), math.radians(37.0), 0.0))
    s = ideal_record(motion, np.arange(0.0, 600.5, 1.0), increments=False).states
    geod = pyproj.Geod(ellps="WGS84")
    lon, lat = np.degrees(s.lon), np.degrees(s.lat)
    # 12 km as 600 chords; a rhumb line bends by 1e-5 rad within one, its chord is 1e-9 shorter
    assert geod.line_length(lon, lat) == pytest.approx(12_000.0, abs=1e-4)
    azimuth, _, _ = geod.inv(lon[:-1], lat[:-1], lon[1:], lat[1:])
    middle = azimuth + 0.5 * np.degrees(np.diff(s.lon)) * np.sin(s.lat[:-1])
    np.testing.assert_allclose(middle, heading, atol=1e-6)


@pytest.mark.parametrize("dt", [0.1, 0.03])
def test_increments_are_integrals_of_the_rates(dt):
    motion = RoadMotion(drive(), (0.9, 0.2, 100.0), Body(), (slow_tones(),))
    t = np.array([12.0, 12.0 + dt, 12.0 + 2 * dt])
    edges = np.concatenate([[0.0], t])
    block = ideal_record(motion, edges, increments=True)
    start = tuple(float(getattr(block.states, k)[1]) for k in ("lat", "lon", "height"))
    moved = replace(motion, origin=start)

    def readings(s):
        """Rates at one instant; the position moves by metres, which is nothing at 1e-11."""
        p = moved.prepare(np.array([[s]]), even=False)
        from vehnav.simulate.truth import inertial_readings

        lat, h = np.array([start[0]]), np.array([start[2]])
        return np.concatenate(
            inertial_readings(p.course(lat, h), lat, h, earth=moved.earth), axis=1
        )[0]

    for k in (0, 1):
        expected, _ = quad_vec(readings, t[k], t[k + 1], epsabs=1e-13)
        np.testing.assert_allclose(block.dtheta[k + 1], expected[:3], atol=2e-12)
        np.testing.assert_allclose(block.dvel[k + 1], expected[3:], atol=3e-7 * dt)


def test_fast_vibration_in_long_steps_is_integrated():
    motion = make_scenario("city,duration=200").motion
    coarse = ideal_record(motion, np.arange(90.0) * 1.0, increments=True)
    fine = ideal_record(motion, np.arange(0.0, 89.001, 0.005), increments=True)
    # 18 Hz within 1 s: 200 steps of 0.005 s each have another quadrature
    np.testing.assert_allclose(
        coarse.dtheta, fine.dtheta.reshape(-1, 200, 3).sum(axis=1), atol=1e-9
    )
    np.testing.assert_allclose(coarse.states.lat[-1], fine.states.lat[-1], atol=1e-13)


def test_uneven_steps_and_even_steps_meet():
    motion = RoadMotion(drive(), (0.9, 0.2, 100.0), Body(), (slow_tones(),))
    even = ideal_record(motion, np.arange(0.0, 20.0, 0.01), increments=True)
    rng = np.random.default_rng(4)
    t = np.unique(np.concatenate([[0.0, 10.0], rng.uniform(0.0, 10.0, 700)]))
    uneven = ideal_record(motion, t, increments=True)
    for name in ("lat", "lon", "height", "v_n", "f_b", "omega_ib_b"):
        a, b = getattr(even.states, name)[1000], getattr(uneven.states, name)[-1]
        np.testing.assert_allclose(a, b, atol=1e-10)
    np.testing.assert_allclose(uneven.dvel.sum(axis=0), even.dvel[:1000].sum(axis=0), atol=1e-9)


def test_first_increment_covers_the_step_before_the_start():
    motion = make_scenario("circle,duration=10").motion
    t_ns = stamps(10.0, 10.0)
    truth, imu = ideal_log(motion, t_ns, sampling="increments")
    _, rates = ideal_log(motion, t_ns, sampling="rates")
    assert imu.gyro.shape == rates.gyro.shape
    np.testing.assert_allclose(imu.gyro[0], 0.1 * rates.gyro[0], atol=1e-9)
    assert (truth.lat[0], truth.height[0]) == (motion.origin[0], motion.origin[2])


def test_inertial_states_by_pyproj_and_scipy():
    motion = RoadMotion(drive(), (0.9, 1.2, 100.0), Body())
    t = np.arange(0.0, 20.0, 0.02)
    s = ideal_record(motion, t, increments=False).states
    r_i, v_i, c_ib = inertial_states(t, s.lat, s.lon, s.height, s.v_n, s.c_nb, earth=WGS84)
    to_ecef = pyproj.Transformer.from_pipeline("+proj=cart +ellps=WGS84")
    r_e = np.stack(to_ecef.transform(s.lon, s.lat, s.height, radians=True), axis=-1)
    turn = Rotation.from_rotvec(np.outer(t, [0.0, 0.0, WGS84.omega_ie]))
    np.testing.assert_allclose(r_i, turn.apply(r_e), atol=1e-7)
    v = sum(w * r_i[k : t.size - 6 + k] for k, w in enumerate(SIXTH_FIRST)) / 0.02
    np.testing.assert_allclose(v_i[3:-3], v, atol=2e-6)
    np.testing.assert_allclose(c_ib, turn.as_matrix() @ enu_axes(s.lat, s.lon) @ s.c_nb, atol=1e-14)


def test_gravity_of_arrays_is_the_kernels():
    lat, h = np.linspace(-1.5, 1.5, 31), np.linspace(0.0, 9000.0, 31)
    expected = [normal_gravity(a, b, WGS84) for a, b in zip(lat, h, strict=True)]
    np.testing.assert_allclose(gravity(lat, h, earth=WGS84), expected, rtol=1e-15)


def test_blocks_do_not_show(monkeypatch):
    motion = RoadMotion(drive(), (0.9, 0.2, 100.0), Body(), (slow_tones(),))
    t = np.arange(0.0, 10.0, 0.02)
    whole = ideal_record(motion, t, increments=True)
    monkeypatch.setattr("vehnav.simulate.truth._BLOCK", 37)
    parts = ideal_record(motion, t, increments=True)
    assert isinstance(parts, Block)
    np.testing.assert_allclose(parts.states.lat, whole.states.lat, atol=1e-15)
    np.testing.assert_allclose(parts.dvel, whole.dvel, atol=1e-13)


def test_velocity_is_that_of_the_course():
    road = RoadMotion(drive(), (0.9, 0.2, 100.0), Body(), (slow_tones(),))
    for motion in (road, PolarMotion(speed=30.0, miss=5.0, duration=20.0)):
        t = np.arange(0.0, 20.0, 0.5)
        states = ideal_record(motion, t, increments=False).states
        velocity = motion.prepare(t[:, None], even=False).velocity()
        np.testing.assert_allclose(velocity, states.v_n, atol=1e-12)
