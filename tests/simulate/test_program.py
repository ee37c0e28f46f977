"""Driving programs and vibration, judged by finite differences and scipy quadrature."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from vehnav.simulate.program import STEP_PEAK, Program, ProgramBuilder
from vehnav.simulate.vibration import Strength, Tones, draw_tones, shake_tones, vehicle_tones


def example() -> Program:
    way = ProgramBuilder(heading=0.3).hold(5.0)
    way.change_speed(15.0, peak=2.0, grade=0.03).hold(5.0)
    way.turn(1.5, yaw_rate=0.4).hold(5.0).turn(-2.0, yaw_rate=0.3, ease=2.0)
    way.change_speed(0.0, peak=2.5, grade=0.0).hold(10.0)
    return way.build()


@pytest.mark.parametrize(
    ("value", "rate"),
    [
        ("speed", "speed_dot"),
        ("speed_dot", "speed_ddot"),
        ("heading", "yaw_rate"),
        ("yaw_rate", "yaw_rate_dot"),
        ("grade", "grade_dot"),
    ],
)
def test_rates_are_derivatives_before_within_and_after(value, rate):
    program = example()
    t = np.linspace(-2.0, program.duration + 3.0, 7001)
    h = 1e-4
    ahead, behind = program.state(t + h), program.state(t - h)
    difference = (getattr(ahead, value) - getattr(behind, value)) / (2.0 * h)
    # central difference: h^2/6 of a third derivative below 20 rad/s4, and rounding 1e-12 / h
    np.testing.assert_allclose(difference, getattr(program.state(t), rate), atol=1e-7)


def test_jerk_is_continuous():
    program = example()
    t = np.linspace(-1.0, program.duration + 1.0, 200_001)
    dt = t[1] - t[0]
    jerk = program.state(t).speed_ddot
    # snap of a smooth step: at most 52.5 dv / T^3, T the shortest ramp (13.1 s)
    assert np.max(np.abs(np.diff(jerk))) <= 52.5 * 15.0 / 13.0**3 * dt * 1.01


def test_the_time_so_far_is_that_of_the_pieces():
    way, elapsed = ProgramBuilder(), []
    for duration in (0.1, 0.2, 0.3, 1000.0):
        elapsed.append(way.hold(duration).elapsed)
    assert elapsed == [0.1, 0.1 + 0.2, 0.1 + 0.2 + 0.3, 0.1 + 0.2 + 0.3 + 1000.0]
    assert way.build().duration == pytest.approx(elapsed[-1], abs=1e-12)


def test_distance_and_heading_are_integrals():
    program = example()
    joints = list(program.joints[1:-1])
    total, _ = quad(
        lambda s: program.state(np.array([s])).speed[0],
        0.0,
        program.duration,
        points=joints,
        limit=400,
    )
    assert program.distance == pytest.approx(total, rel=1e-9)
    end = program.state(np.array([program.duration + 1.0]))
    assert end.heading[0] == pytest.approx(0.3 + 1.5 - 2.0, abs=1e-12)


def test_builder_keeps_its_peaks():
    program = example()
    s = program.state(np.linspace(0.0, program.duration, 100_001))
    assert np.max(s.speed_dot) == pytest.approx(2.0, rel=1e-6)
    assert np.min(s.speed_dot) == pytest.approx(-2.5, rel=1e-6)
    assert np.max(s.yaw_rate) == pytest.approx(0.4, rel=1e-6)
    assert np.min(s.yaw_rate) == pytest.approx(-0.3, rel=1e-6)
    assert STEP_PEAK == 2.1875


def test_standing():
    program = example()
    joints = program.joints
    t = np.array([-1.0, 1.0, joints[1] + 0.01, joints[-2] - 0.01, joints[-2] + 0.01, 1e4])
    assert program.standing(t).tolist() == [True, True, False, False, True, True]


def test_bad_programs():
    one = np.zeros(2)
    with pytest.raises(ValueError, match="positive duration"):
        Program(np.array([0.0]), one, one, one)
    with pytest.raises(ValueError, match="2 joints"):
        Program(np.array([1.0]), np.zeros(3), one, one)


# ---- vibration ---------------------------------------------------------------------------------


def tones(envelope) -> Tones:
    return draw_tones(
        np.random.default_rng(1),
        band=(0.5, 3.5),
        count=7,
        accel_rms=[0.1, 0.2, 0.3],
        rate_rms=[0.01, 0.02, 0.03],
        envelope=envelope,
    )


def speed(t):
    return 4.0 * np.sin(0.3 * t) ** 2, 2.4 * np.sin(0.3 * t) * np.cos(0.3 * t)


@pytest.mark.parametrize("envelope", ["always", "moving"])
def test_vibration_rate_is_the_derivative(envelope):
    t, h = np.linspace(0.0, 40.0, 4001), 1e-5
    shaking = tones(envelope)

    def value(s):
        return shaking.value_and_rate(s[:, None], *speed(s), even=False)[0]

    _, rate = shaking.value_and_rate(t[:, None], *speed(t), even=False)
    np.testing.assert_allclose((value(t + h) - value(t - h)) / (2 * h), rate, atol=1e-8)


def test_even_rows_equal_single_instants():
    t = np.arange(50)[:, None] * 0.02 + np.array([0.0, 0.003, 0.011])
    v, v_dot = speed(t.ravel())
    for a, b in zip(
        tones("moving").value_and_rate(t, v, v_dot, even=True),
        tones("moving").value_and_rate(t, v, v_dot, even=False),
        strict=True,
    ):
        np.testing.assert_allclose(a, b, atol=1e-14)


def test_strength_is_the_rms_of_acceleration_and_rate():
    t = np.arange(0.0, 4000.0, 0.05)
    _, rate = tones("always").value_and_rate(t[:, None], 0 * t, 0 * t, even=False)
    np.testing.assert_allclose(
        np.sqrt(np.mean(rate**2, axis=0)), [0.1, 0.2, 0.3, 0.01, 0.02, 0.03], rtol=0.01
    )


def test_road_is_silent_at_rest_and_half_at_half_speed():
    t = np.linspace(0.0, 3.0, 301)
    shaking = tones("moving")
    full, _ = tones("always").value_and_rate(t[:, None], 0 * t, 0 * t, even=False)
    rest, rest_rate = shaking.value_and_rate(t[:, None], 0 * t, 0 * t, even=False)
    assert not rest.any()
    assert not rest_rate.any()
    half, _ = shaking.value_and_rate(t[:, None], 0 * t + 0.7, 0 * t, even=False)
    np.testing.assert_allclose(half, 0.5 * full, atol=1e-15)


def test_car_has_slow_and_fast_parts_only():
    parts = vehicle_tones(np.random.default_rng(2), Strength())
    hertz = np.concatenate([p.omega for p in parts]) / (2.0 * math.pi)
    assert np.all((hertz < 4.0) | (hertz > 5.0))
    assert {p.envelope for p in parts} == {"always", "moving"}
    assert vehicle_tones(np.random.default_rng(2), Strength(0, 0, 0, 0)) == ()


def test_shake_is_paper_004s():
    t = np.linspace(0.0, 2.0, 41)
    pitch, roll = (
        shake_tones(amplitude=0.02, frequency=1.5, pitch_phase=0.4, roll_phase=1.2).value_and_rate(
            t[:, None], 0 * t, 0 * t, even=False
        )[0][:, k]
        for k in (4, 5)
    )
    np.testing.assert_allclose(pitch, 0.02 * np.sin(3.0 * math.pi * t + 0.4), atol=1e-15)
    np.testing.assert_allclose(roll, 0.02 * np.sin(3.0 * math.pi * t + 1.2), atol=1e-15)
