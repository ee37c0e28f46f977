"""How far a receiver drove, judged by drives whose length is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from drives import gnss_of

from vehnav.evaluation.reference import course, path_distance, standing


def drive_stand_drive(dt: float, speed: float = 12.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """60 s east, 300 s standing, 60 s north: positions and velocities; 1440 m at 12 m/s."""
    t = np.arange(0.0, 420.0 + dt / 2, dt)
    east = speed * np.minimum(t, 60.0)
    north = speed * np.maximum(t - 360.0, 0.0)
    enu = np.column_stack([east, north, 0.0 * t])
    v = np.column_stack([speed * (t < 60.0), speed * (t > 360.0), 0.0 * t])
    return t, enu, v


@pytest.mark.parametrize("dt", [0.1, 0.25, 1.0])
@pytest.mark.parametrize("with_velocity", [False, True])
def test_noise_of_a_standing_receiver_adds_no_distance(dt: float, with_velocity: bool) -> None:
    """1 m of white noise summed step by step adds 500 m in these five minutes at 1 Hz alone."""
    rng = np.random.default_rng(5)
    t, enu, v = drive_stand_drive(dt)
    noisy = enu + rng.normal(0.0, 1.0, enu.shape)
    v_noisy = v + rng.normal(0.0, 0.1, v.shape)
    gnss = gnss_of(t, noisy, v_noisy if with_velocity else None)
    summed = np.hypot(*np.diff(noisy[:, :2], axis=0).T).sum()
    assert summed > 1440.0 + 300.0  # the naive sum, so that this test means something
    assert path_distance(gnss)[-1] == pytest.approx(1440.0, rel=0.03)
    middle = (t > 80.0) & (t < 340.0)
    assert np.mean(standing(gnss)[middle]) > 0.95


def test_wandering_static_hold_adds_little() -> None:
    """A receiver that wanders 3 m while it stands (multipath) has not driven 300 s of it."""
    t = np.arange(0.0, 300.0)
    wander = 3.0 * np.column_stack([np.sin(t / 40.0), np.cos(t / 55.0), 0.0 * t])
    assert path_distance(gnss_of(t, wander))[-1] < 3.0


@pytest.mark.parametrize("with_velocity", [False, True])
@pytest.mark.parametrize("dt", [0.1, 1.0])
def test_circle_has_its_length_and_course(circle, with_velocity: bool, dt: float) -> None:
    t = np.arange(0.0, 120.0 + dt / 2, dt)
    gnss = gnss_of(t, circle.enu(t), circle.v(t) if with_velocity else None)
    # a chord of 10 m on a radius of 100 m is 0.042 % shorter than its arc
    assert path_distance(gnss)[-1] == pytest.approx(1200.0, rel=1e-3)
    assert np.all(np.diff(path_distance(gnss)) >= 0.0)
    error = np.remainder(course(gnss) - circle.heading(t) + np.pi, 2 * np.pi) - np.pi
    inner = slice(20, -20) if dt < 1.0 else slice(2, -2)  # the window is one-sided at the ends
    assert np.max(np.abs(error[inner])) < np.radians(0.5)


def test_velocity_that_contradicts_the_positions_is_not_used(circle) -> None:
    """A driver that fills the velocity with zeros must not make the distance zero."""
    t = np.arange(0.0, 121.0)
    gnss = gnss_of(t, circle.enu(t), 0.0 * circle.v(t))
    assert path_distance(gnss)[-1] == pytest.approx(1200.0, rel=2e-3)


def test_course_is_held_while_standing() -> None:
    t, enu, v = drive_stand_drive(1.0)
    for gnss in (gnss_of(t, enu, v), gnss_of(t, enu)):
        way = np.degrees(course(gnss))
        assert way[30] == pytest.approx(90.0, abs=0.01)
        assert way[200] == pytest.approx(90.0, abs=0.01)
        assert way[-1] == pytest.approx(0.0, abs=0.01)


def test_one_fix_has_driven_nowhere() -> None:
    gnss = gnss_of(np.array([0.0]), np.zeros((1, 3)))
    assert path_distance(gnss).tolist() == [0.0]
    assert course(gnss).tolist() == [0.0]


def test_real_receiver_at_the_stops_of_boston(shared_data) -> None:
    """README of the log: 2577 m of raw steps, 0.19 m text resolution, 12 stops of 236 s."""
    pandas = pytest.importorskip("pandas")
    table = pandas.read_csv(shared_data / "boston_apan" / "driving_gps.csv")
    from vehnav.logs.log import Gnss

    gnss = Gnss(
        t_ns=np.rint(table.t_log.to_numpy() * 1e9).astype(np.int64),
        lat=np.radians(table.lat.to_numpy()),
        lon=np.radians(table.lon.to_numpy()),
        height=table.alt.to_numpy(float),
    )
    assert 2400.0 < path_distance(gnss)[-1] < 2600.0
    assert 180.0 < standing(gnss).sum() < 300.0  # s at 1 Hz
