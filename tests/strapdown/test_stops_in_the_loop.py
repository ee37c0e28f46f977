"""Stops through detector, levelling and mechanization, on simulated drives (spec A, section 6).

Tests 26, 29 and 31 are in tests/test_pipeline.py; here 27 (departure) and 28 (detector).
"""

from __future__ import annotations

import numpy as np
import pytest

from vehnav.classic import Drive, Start, dead_reckon
from vehnav.earth import WGS84, position_difference
from vehnav.rest import runs
from vehnav.simulate.generate import SimulatedLog, simulate
from vehnav.stops import Stop, StopRule, find_stops, stopped_mask
from vehnav.strapdown.increments import increments_from_rates
from vehnav.units import DEG, NS


@pytest.mark.parametrize(("late", "least", "most"), [(0.0, 0.0, 0.05), (1.8, 10.0, 1e4)])
def test_27_levelling_ends_before_departure(late, least, most):
    """Ideal sensors, car off with 2 m/s2: 60 s later the error is under 0.05 m.

    A stop that ends 1.8 s late, so that levelling goes on for 1.5 s of the departure, costs tens of
    metres even with its gentle start: the guard before the end of a stop is what the test sees.
    """
    way = "straight,duration=150,v=15,first_stop=40,last_stop=20"
    simulated = simulate(way, sensor="ideal", rate_hz=100.0, sampling="rates", gnss=None)
    truth = simulated.truth
    t = (truth.t_ns - truth.t_ns[0]) * NS
    last = int(runs(truth.stopped)[0, 1]) + round(late * 100)
    stop = Stop(0, last, 0.0, float(t[last]), 0.0, 0.0, 0.0, 0.0)
    gyro, accel = simulated.imu.gyro, simulated.imu.accel
    increments = increments_from_rates(t, gyro, accel, max_gap=0.5)
    drive = Drive(t, gyro, accel, increments, [stop], WGS84, levelling_rate=1.0)
    place = float(truth.lat[0]), float(truth.lon[0]), float(truth.height[0])
    start = Start(place, truth.c_nb[0], np.zeros(3), np.zeros(3))
    solution = dead_reckon(drive, start, levelling=True, reset=False)
    later = np.searchsorted(t, t[last] + 60.0)
    east_north = position_difference(
        solution.position[later, 0], solution.position[later, 1], truth.lat[later], truth.lon[later]
    )
    assert least <= np.hypot(*east_north) < most


@pytest.fixture(scope="module")
def city() -> SimulatedLog:
    return simulate(
        "city,duration=900,seed=11,stop_every=66", sensor="hg1700", seed=11, rate_hz=50.0,
        sampling="rates", gnss=None,
    )  # fmt: skip


@pytest.mark.parametrize("offset", [0.0, 1.5], ids=["no offset", "1.5 deg/s on the gyros"])
def test_28_detector_against_the_truth(city, offset):
    """Precision, recall, missed stops, worst speed; a zero offset of the gyros changes nothing."""
    t = (city.imu.t_ns - city.imu.t_ns[0]) * NS
    found = find_stops(t, city.imu.gyro + offset * DEG, city.imu.accel, StopRule())
    flagged, standing = stopped_mask(t.size, found), city.truth.stopped
    speed = np.linalg.norm(city.truth.v_n, axis=1)
    still = standing | (speed < 0.05)  # the body settles for a moment after the wheels
    assert np.mean(still[flagged]) >= 0.95
    assert np.mean(flagged[standing]) >= 0.88
    assert speed[flagged].max() <= 2.0
    true_stops = runs(standing)
    long = [(a, b) for a, b in true_stops if t[b] - t[a] >= 3.0]
    missed = [1 for a, b in long if not flagged[a : b + 1].any()]
    assert len(long) >= 8
    assert len(missed) <= 0.03 * len(long)
    without = find_stops(t, city.imu.gyro, city.imu.accel, StopRule())
    assert np.mean(stopped_mask(t.size, without) != flagged) < 0.005
