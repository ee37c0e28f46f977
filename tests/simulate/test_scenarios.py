"""Named scenarios: frozen, described truthfully, and refused with reasons."""

from __future__ import annotations

import hashlib
import math
from dataclasses import replace

import numpy as np
import pytest

from vehnav.errors import ConfigError
from vehnav.simulate import SCENARIOS, ideal_log, make_scenario, scenario_parameters, stamps
from vehnav.simulate.motion import RoadMotion
from vehnav.simulate.truth import ideal_record

FROZEN = {
    "static": "49b049ff2bc041f6",
    "straight": "e63dc88e87a9b098",
    "circle": "a9d3864d34644aea",
    "shake": "154164b5936beb77",
    "town": "48e2d5bcdc6b5bfb",
    "city": "35cb4467deb3ac0c",
    "paper002": "abe2935d4daad699",
    "motorway": "f9b32f14ae83d26b",
    "polar": "e1aa21be33f5ab03",
    "flight": "fa88b4382992b7c8",
}
"""Digest of the truth of every scenario, as :func:`digest` makes it.

A change here moves every figure that is bound to the scenario: say so under Changes.
"""


def digest(name: str) -> str:
    """SHA-256 of the truth each 10 s, rounded to a centimetre, a mm/s and 1e-6 rad, and the tones.

    The way is taken without the vibration, whose tones are rounded to nine figures instead, so that
    the last digit of a machine's sine cannot turn a rounding.
    """
    motion = make_scenario(name).motion
    parts = []
    if isinstance(motion, RoadMotion):
        for tones in motion.tones:
            parts += [tones.omega, tones.cosine, tones.sine]
            parts.append(np.array([ord(c) for c in tones.envelope]))
        parts = [np.array([float(f"{x:.9g}") for x in p.ravel()]) for p in parts]
        motion = replace(motion, tones=())
    t = np.arange(0.0, motion.duration, 10.0)
    s = ideal_record(motion, t, increments=False).states
    radius = 6.4e6
    parts += [
        np.rint(np.stack([s.lat * radius, s.lon * radius, s.height], axis=-1) * 100.0),
        np.rint(s.v_n * 1e3),
        np.rint(s.c_nb * 1e6),
        motion.standing(t).astype(float),
    ]
    text = b"".join((np.asarray(p, float) + 0.0).astype("<f8").tobytes() for p in parts)
    return hashlib.sha256(text).hexdigest()[:16]


@pytest.mark.parametrize("name", sorted(set(SCENARIOS) - {"route"}))
def test_frozen(name):
    assert digest(name) == FROZEN[name]


def truth(text, *, rate=10.0, **more):
    motion = make_scenario(text, **more).motion
    return ideal_log(motion, stamps(motion.duration, rate), sampling="rates")


def departures(trajectory):
    stopped = trajectory.stopped.astype(int)
    return int(np.count_nonzero(np.diff(stopped) == -1))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_paper_002_drive_is_as_described(seed):
    t, _ = truth("paper002", rate=2.0, seed=seed, road=0.0, idle=0.0)
    assert (t.t_ns[-1] - t.t_ns[0]) * 1e-9 == pytest.approx(4538.0)  # 1 h 15 min 38 s
    assert t.path_length() == pytest.approx(33_000.0, rel=0.05)
    assert 40 <= departures(t) <= 52  # about 47 stops
    enu = t.enu((t.lat[0], t.lon[0], t.height[0]))
    assert np.max(np.ptp(enu[:, :2], axis=0)) < 5200.0


def test_circle_is_paper_004s():
    t, imu = truth("circle,lat=55.75,heading=20,duration=1256.64", rate=1.0)
    turned = np.unwrap(np.arctan2(t.v_n[:, 0], t.v_n[:, 1]))
    assert turned[-1] - turned[0] == pytest.approx(2.0 * math.pi / 10.0, rel=1e-3)
    np.testing.assert_allclose(np.linalg.norm(t.v_n, axis=1), 25.0, rtol=1e-12)
    # centripetal acceleration to the right, less Coriolis: 2 Omega v sin(lat) to the right too
    expected = 25.0**2 / 50_000.0 - 2.0 * 7.292115e-5 * 25.0 * math.sin(t.lat[0])
    assert np.median(imu.accel[:50, 0]) == pytest.approx(expected, abs=2e-4)


def test_shake_is_on_pitch_and_roll_only():
    t, _ = truth("shake,amplitude=1,frequency=0.5,pitch_phase=0,roll_phase=90,duration=20")
    s = (t.t_ns - t.t_ns[0]) * 1e-9
    pitch, roll = np.arcsin(t.c_nb[:, 2, 1]), np.arctan2(-t.c_nb[:, 2, 0], t.c_nb[:, 2, 2])
    np.testing.assert_allclose(pitch, math.radians(1.0) * np.sin(math.pi * s), atol=1e-12)
    np.testing.assert_allclose(roll, math.radians(1.0) * np.cos(math.pi * s), atol=1e-12)


def test_town_is_as_described():
    t, _ = truth("town,duration=600", rate=50.0)
    s = (t.t_ns - t.t_ns[0]) * 1e-9
    cycle = np.remainder(s, 75.0)
    assert np.all(t.stopped[(cycle > 60.01) & (cycle < 74.99)])
    assert departures(t) == 7  # the first begins at once
    speed = np.linalg.norm(t.v_n, axis=1)
    assert np.max(speed) == pytest.approx(15.0, abs=1e-6)
    grade = np.degrees(np.arcsin(t.c_nb[:, 2, 1]))
    assert np.max(np.abs(grade)) < 2.0 + 0.4 * 3.01  # slope, and pitch by braking
    roll = np.degrees(np.arcsin(-t.c_nb[:, 2, 0]))
    assert 1.4 < np.max(np.abs(roll)) < 1.6


def test_motorway_has_no_stop_on_the_way():
    t, _ = truth("motorway", rate=5.0, road=0.0, idle=0.0)
    assert departures(t) == 1
    assert np.median(np.linalg.norm(t.v_n, axis=1)[~t.stopped]) > 22.0
    assert departures(truth("motorway,stop_every=150,road=0,idle=0", rate=5.0)[0]) > 3


@pytest.mark.parametrize("miss", [0.0, 1.0, 100.0])
def test_polar_passes_at_its_distance(miss):
    t, _ = truth("polar,duration=60", rate=10.0, miss=miss)
    distance = (math.pi / 2.0 - t.lat) * 6_399_593.6258  # c = a^2 / b of WGS84
    assert np.min(distance) == pytest.approx(miss, abs=1e-6)
    assert int(np.argmin(distance)) == 300
    np.testing.assert_allclose(np.linalg.norm(t.v_n, axis=1), 30.0, rtol=1e-9)


def test_flight_is_as_described():
    motion = make_scenario("flight").motion
    t, _ = truth("flight", rate=1.0)
    speed = np.linalg.norm(t.v_n, axis=1)
    assert motion.duration == pytest.approx(2050.0)
    assert speed[70] == pytest.approx(85.0)
    assert speed[400] == pytest.approx(230.0)
    np.testing.assert_allclose(t.v_n[[500, 1100, 1700], 2], [12.0, 6.0, -9.0], rtol=1e-6)
    bank = np.degrees(np.arctan2(-t.c_nb[:, 2, 0], t.c_nb[:, 2, 2]))
    assert 20.0 < np.max(bank) < 25.0  # right side down in a right turn
    assert -25.0 < np.min(bank) < -20.0
    course = np.degrees(np.unwrap(np.arctan2(t.v_n[1:, 0], t.v_n[1:, 1])))
    assert course[-1] - course[0] == pytest.approx(90.0 - 180.0 + 60.0 + 120.0, abs=1e-6)


def slow_deviation(x, rate):
    """Vector sd over 2 s of 0.25 s means, at every sample (spec C section 1)."""

    def mean(y, n):
        total = np.cumsum(np.concatenate([np.zeros((1, y.shape[1])), y]), axis=0)
        return (total[n:] - total[:-n]) / n

    fine = mean(x, round(0.25 * rate))
    n = round(2.0 * rate)
    return np.sqrt(np.maximum(mean(fine**2, n) - mean(fine, n) ** 2, 0.0).sum(axis=1))


def test_vibration_is_as_real_cars_have_it():
    """Spec C 1: rest p50 0.01-0.09 deg/s, moving 0.1 % 0.10-0.45; f 0.004-0.011, 0.07-0.13 m/s2."""
    rate = 100.0
    t, imu = truth("city,duration=300,first_stop=60", rate=rate)
    w, f = slow_deviation(np.degrees(imu.gyro), rate), slow_deviation(imu.accel, rate)
    first = (imu.t_ns.size - w.size) // 2
    speed = np.linalg.norm(t.v_n, axis=1)[first : first + w.size]
    moving, rest = speed > 2.5, t.stopped[first : first + w.size]
    rest &= np.roll(rest, 150) & np.roll(rest, -150)
    assert 0.01 < np.median(w[rest]) < 0.09
    assert 0.004 < np.median(f[rest]) < 0.012
    assert 0.30 < np.percentile(w[moving], 0.1) < 0.55
    assert 0.07 < np.percentile(f[moving], 0.1) < 0.17
    standing = np.degrees(imu.gyro[100:5000])
    fast = np.sqrt(np.sum(np.var(standing, axis=0)))
    assert 0.05 < fast < 1.9  # engine: rms of the rate


# ---- names and parameters ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("citty", "did you mean 'city'"),
        ("nowhere", "there are static"),
        ("city,sede=3", "did you mean 'seed'"),
        ("city,seed", "not KEY=VALUE"),
        ("city,seed=two", "must be a number"),
        ("circle,v=inf", "must be finite"),
        ("circle,turn=up", "left or right"),
        ("circle,radius=0", "must be positive"),
        ("static,lat=90", "scenario polar"),
        ("static,ellipsoid=sphere", "choose one of wgs84"),
        ("straight,duration=60", "needs .* s more"),
        ("city,duration=100", "no time to drive"),
        ("town,leg=20", "needs .* s more"),
        ("route", "needs file="),
        ("town,T=1e9", r"town: duration must be at most 604800 s .* 1e\+05 million samples"),
    ],
)
def test_refused_with_the_reason(text, says):
    with pytest.raises(ConfigError, match=says):
        make_scenario(text)


def test_parameters_are_those_of_the_function():
    assert scenario_parameters("polar")["miss"] == 1.0
    assert make_scenario("polar,miss=7", miss=3.0).motion.miss == 3.0


@pytest.mark.parametrize("duration", [200.0, 450.0])
def test_every_seed_fills_its_duration(duration):
    for seed in range(1, 41):
        motion = make_scenario("city", duration=duration, seed=seed, road=0.0, idle=0.0).motion
        assert motion.duration == pytest.approx(duration, abs=1e-6)
        motion = make_scenario("motorway", duration=duration + 100.0, seed=seed, road=0.0).motion
        assert motion.duration == pytest.approx(duration + 100.0, abs=1e-6)


def test_t_is_the_duration_on_every_command() -> None:
    assert make_scenario("town,T=150").motion.duration == 150.0
