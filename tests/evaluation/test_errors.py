"""Errors against GPS, judged by drives moved by a known vector, by pyproj, and by hand."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from drives import T0_NS, gnss_of, stamps, trajectory_of
from pyproj import Geod

from vehnav.errors import LogError
from vehnav.evaluation import compare, statistics
from vehnav.logs.log import Gnss
from vehnav.rotation import c_nb_from_angles
from vehnav.trajectory import Trajectory

S = 1_000_000_000


def test_statistics_by_hand() -> None:
    s = statistics([3.0, -4.0, 1.0, -2.0])
    assert s is not None
    assert s.rms == pytest.approx(np.sqrt(30.0 / 4.0))
    assert s.mean == pytest.approx(-0.5)
    assert s.median == pytest.approx(-0.5)
    assert s.max == 4.0
    assert s.p95 == pytest.approx(3.0 + 0.85)  # 0.95 of the way along 1, 2, 3, 4
    assert s.end == -2.0
    assert statistics([]) is None


def test_a_perfect_trajectory_has_no_error(circle_trajectory, circle_gnss) -> None:
    errors = compare(circle_trajectory(), circle_gnss())
    # 1e-6 m: geodetic coordinates near 1 rad resolve 1e-9 m, Hermite over 10 ms adds less
    assert errors.horizontal.max() < 1e-6
    assert np.abs(errors.up).max() < 1e-6
    assert np.abs(errors.velocity).max() < 1e-3  # chord of 10 ms: v (w dt)^2 / 8 = 1.3e-6
    assert errors.counts["judged"] == 121


def test_a_moved_trajectory_has_the_vector_as_its_error(circle_trajectory, circle_gnss) -> None:
    tree = compare(circle_trajectory(moved=(3.0, -4.0, 2.0)), circle_gnss()).to_dict()
    # the tangent plane of the fixture against metres on the ellipsoid: 1e-5 over 200 m
    for figure in ("rms", "mean", "median", "p95", "max", "end"):
        assert tree["horizontal_m"][figure] == pytest.approx(5.0, abs=1e-3)
    assert tree["east_m"]["mean"] == pytest.approx(3.0, abs=1e-3)
    assert tree["north_m"]["mean"] == pytest.approx(-4.0, abs=1e-3)
    assert tree["north_m"]["max"] == pytest.approx(4.0, abs=1e-3)
    assert tree["up_m"]["end"] == pytest.approx(2.0, abs=1e-3)
    assert tree["cep50_m"] == pytest.approx(5.0, abs=1e-3)
    assert tree["cep95_m"] == pytest.approx(5.0, abs=1e-3)
    assert tree["percent_of_distance"]["end"] == pytest.approx(5.0 / 12.0, rel=1e-3)
    assert tree["percent_of_distance"]["max"] == pytest.approx(2.5, rel=1e-2)  # at 200 m
    assert tree["heading_deg"] is None


def test_the_horizontal_rms_is_that_of_the_statistics(circle_trajectory, circle_gnss) -> None:
    errors = compare(circle_trajectory(), circle_gnss())
    errors = replace(errors, east=np.array([3.0, 0.0]), north=np.array([4.0, -1.0]))
    assert errors.horizontal_rms == pytest.approx(np.sqrt((25.0 + 1.0) / 2.0))
    assert errors.horizontal_rms == statistics(errors.horizontal).rms


def test_along_and_cross_by_the_course(circle, circle_gnss) -> None:
    """A trajectory that lags 0.5 s is 5 m behind on the arc; one on a larger circle is outside."""
    t = np.arange(0.0, 120.0, 0.01)
    late = trajectory_of(t, circle.enu(t - 0.5), circle.v(t - 0.5), circle.heading(t - 0.5))
    tree = compare(late, circle_gnss()).to_dict()
    chord = 200.0 * np.sin(0.025)
    assert tree["along_m"]["mean"] == pytest.approx(-chord * np.cos(0.025), abs=0.01)
    assert tree["cross_m"]["mean"] == pytest.approx(chord * np.sin(0.025), abs=0.01)
    right = np.column_stack([np.cos(circle.heading(t)), -np.sin(circle.heading(t)), 0 * t])
    inside = trajectory_of(t, circle.enu(t) + 2.0 * right, circle.v(t), circle.heading(t))
    tree = compare(inside, circle_gnss()).to_dict()
    assert tree["cross_m"]["mean"] == pytest.approx(2.0, abs=0.01)
    assert tree["along_m"]["rms"] < 0.01


def test_east_north_against_the_geodesic() -> None:
    """Two random tracks kilometres apart: size and direction of the error by pyproj."""
    rng = np.random.default_rng(1)
    t = np.arange(0.0, 50.0)
    a = np.cumsum(rng.normal(0.0, 20.0, (50, 3)), axis=0)
    b = np.cumsum(rng.normal(0.0, 20.0, (50, 3)), axis=0)
    trajectory, gnss = trajectory_of(t, a, 0.0 * a, 0.0 * t), gnss_of(t, b)
    errors = compare(trajectory, gnss)
    azimuth, _, length = Geod(ellps="WGS84").inv(
        np.degrees(gnss.lon), np.degrees(gnss.lat), *np.degrees([trajectory.lon, trajectory.lat])
    )
    # heights of some 100 m scale the metres by h/R; the geodesic is at height 0
    scale = 1.0 + gnss.height / 6.37e6
    assert errors.horizontal == pytest.approx(length * scale, rel=1e-5)
    bearing = np.degrees(np.arctan2(errors.east, errors.north))
    assert np.remainder(bearing - azimuth + 180, 360) - 180 == pytest.approx(0.0, abs=0.01)


def test_velocity_error_is_the_horizontal_vector(circle_trajectory, circle_gnss) -> None:
    trajectory = circle_trajectory()
    trajectory = replace(trajectory, v_n=trajectory.v_n + np.array([0.3, 0.4, 5.0]))
    errors = compare(trajectory, circle_gnss())
    assert errors.statistics()["velocity_m_s"].rms == pytest.approx(0.5, abs=1e-4)
    assert compare(trajectory, circle_gnss(velocity=False)).to_dict()["velocity_m_s"] is None


def test_attitude_error_against_truth_wraps(circle, circle_gnss, circle_trajectory) -> None:
    gnss = circle_gnss()
    t = (gnss.t_ns - T0_NS) * 1e-9
    c_ref = c_nb_from_angles(circle.heading(t) - np.radians(2.0), np.radians(1.0), np.radians(-3.0))
    errors = compare(circle_trajectory(), gnss, c_nb_reference=c_ref)
    assert errors.to_dict()["heading_deg"]["mean"] == pytest.approx(2.0, abs=1e-6)
    assert np.degrees(errors.pitch) == pytest.approx(-1.0, abs=1e-6)
    assert np.degrees(errors.roll) == pytest.approx(3.0, abs=1e-6)


def test_judging_starts_after_the_gps_window(circle_trajectory, circle_gnss) -> None:
    errors = compare(circle_trajectory(), circle_gnss(), judge_from_ns=T0_NS + 60 * S)
    assert errors.counts["before"] == 60
    assert errors.t_ns[0] == T0_NS + 60 * S
    assert errors.distance[0] == pytest.approx(0.0, abs=1e-6)
    assert errors.distance[-1] == pytest.approx(600.0, rel=1e-3)


def test_excluded_fixes_do_not_judge(circle_trajectory, circle_gnss) -> None:
    errors = compare(circle_trajectory(), circle_gnss(), exclude=[(T0_NS + 10 * S, T0_NS + 19 * S)])
    assert errors.counts == {
        "total": 121, "judged": 111, "outside": 0, "before": 0, "excluded": 10,
        "uncertain": 0, "in_gaps": 0,
    }  # fmt: skip
    assert errors.distance[-1] == pytest.approx(1200.0, rel=1e-3)


@pytest.mark.parametrize(
    ("only", "seconds"),
    [
        ([(50, 60), (10, 20), (15, 30), (52, 55)], [*range(10, 31), *range(50, 61)]),  # overlap
        ([(10, 20), (20, 30)], range(10, 31)),
        ([(10, 20), (21, 21), (22, 30)], range(10, 31)),
        ([(0, 2)], range(3)),
    ],
)
def test_only_fixes_inside_the_intervals_judge(
    circle_trajectory, circle_gnss, only: list[tuple[int, int]], seconds: Sequence[int]
) -> None:
    """A fix a second; both ends belong to an interval."""
    spans = [(T0_NS + a * S, T0_NS + b * S) for a, b in only]
    errors = compare(circle_trajectory(), circle_gnss(), only=spans)
    assert ((errors.t_ns - T0_NS) // S).tolist() == list(seconds)
    assert errors.counts["excluded"] == 121 - len(seconds)


def test_a_nanosecond_inside_an_interval_judges(circle_trajectory, circle_gnss) -> None:
    spans = [(T0_NS + 10 * S + 1, T0_NS + 20 * S - 1), (T0_NS + 20 * S + 1, T0_NS + 30 * S)]
    errors = compare(circle_trajectory(), circle_gnss(), only=spans)
    assert ((errors.t_ns - T0_NS) // S).tolist() == [*range(11, 20), *range(21, 31)]


def test_excluded_fixes_do_not_judge_inside_the_intervals_either(
    circle_trajectory, circle_gnss
) -> None:
    exclude, only = [(T0_NS + 12 * S, T0_NS + 13 * S)], [(T0_NS + 10 * S, T0_NS + 20 * S)]
    errors = compare(circle_trajectory(), circle_gnss(), exclude=exclude, only=only)
    assert ((errors.t_ns - T0_NS) // S).tolist() == [10, 11, *range(14, 21)]


def test_without_an_interval_no_fix_judges(circle_trajectory, circle_gnss) -> None:
    with pytest.raises(LogError, match="only 0 GPS fixes can judge"):
        compare(circle_trajectory(), circle_gnss(), only=[])


def test_fixes_in_a_gap_of_the_trajectory_are_left_out(circle_trajectory, circle_gnss) -> None:
    whole = circle_trajectory()
    t = (whole.t_ns - T0_NS) * 1e-9
    holed = whole.rows((t < 30.005) | (t > 39.995))
    errors = compare(holed, circle_gnss())
    assert errors.counts["in_gaps"] == 9  # 31 ... 39; 30 and 40 are states themselves
    assert errors.horizontal.max() < 1e-6


def test_a_slow_trajectory_has_no_gaps(circle_trajectory, circle_gnss) -> None:
    """One state every 2 s: the steps are the rate, not gaps."""
    errors = compare(circle_trajectory(dt=2.0), circle_gnss())
    assert errors.counts["in_gaps"] == 0
    # Hermite on a circle: error (w h)^4 / 384 times the radius
    assert errors.horizontal.max() < 100.0 * 0.2**4 / 384.0 * 1.5


def test_fixes_outside_the_trajectory_are_counted(circle_trajectory, circle_gnss) -> None:
    errors = compare(circle_trajectory(duration=50.0), circle_gnss())
    assert errors.counts["outside"] == 70
    assert errors.counts["judged"] == 51


def test_time_offset_is_added_to_the_gps(circle, circle_trajectory) -> None:
    """A receiver stamps 0.6 s late: the fix of instant t carries t + 0.6."""
    t = np.arange(0.0, 120.0)
    gnss = gnss_of(t + 0.6, circle.enu(t), circle.v(t))
    assert compare(circle_trajectory(), gnss).horizontal.max() > 5.0
    assert compare(circle_trajectory(), gnss, time_offset=-0.6).horizontal.max() < 1e-6


def test_lever_arm(circle, circle_trajectory) -> None:
    """An antenna 1 m right, 2 m ahead, 1.5 m up; its velocity includes the turning."""
    t = np.arange(0.0, 120.0)
    h = circle.heading(t)
    forward = np.column_stack([np.sin(h), np.cos(h), 0 * h])
    right = np.column_stack([np.cos(h), -np.sin(h), 0 * h])
    antenna = circle.enu(t) + right + 2.0 * forward + np.array([0, 0, 1.5])
    rate = circle.speed / circle.radius
    v = circle.v(t) + rate * (2.0 * right - forward)
    gnss = gnss_of(t, antenna, v)
    errors = compare(circle_trajectory(), gnss, lever_arm=(1.0, 2.0, 1.5))
    # axes of the fixture's plane against the local ones 200 m away: 2.7 m * 200 m / R * sqrt(2)
    assert errors.horizontal.max() < 2e-4
    assert np.abs(errors.up).max() < 2e-4
    # central differences over 2 s of an arm that turns 0.1 rad/s: 1 - sinc(0.1) = 0.17 %
    assert np.abs(errors.velocity[1:-1]).max() < 1e-3


def test_outages_are_judged_one_by_one(circle, circle_gnss) -> None:
    t = np.arange(0.0, 120.01, 0.01)
    drift = np.where((t >= 40.0) & (t <= 60.0), 0.5 * (t - 40.0), 0.0)
    moved = circle.enu(t) + np.column_stack([drift, 0 * t, 0 * t])
    trajectory = trajectory_of(t, moved, circle.v(t), circle.heading(t))
    cut = [(T0_NS + 40 * S, T0_NS + 60 * S), (T0_NS + 80 * S, T0_NS + 90 * S)]
    first, second = compare(trajectory, circle_gnss(), outages=cut).to_dict()["outages"]
    assert first["start_s"] == pytest.approx(40.0)
    assert first["length_s"] == pytest.approx(20.0)
    assert first["distance_m"] == pytest.approx(200.0, rel=1e-3)
    assert first["max_m"] == pytest.approx(10.0, abs=1e-2)
    assert first["end_m"] == pytest.approx(10.0, abs=1e-2)
    assert first["percent"] == pytest.approx(5.0, abs=1e-2)
    assert first["rms_m"] == pytest.approx(np.sqrt(np.mean((0.5 * np.arange(21.0)) ** 2)), abs=1e-2)
    assert second["max_m"] < 1e-3


def test_the_tree_is_plain_json(circle_trajectory, circle_gnss) -> None:
    static = gnss_of(np.arange(5.0), np.zeros((5, 3)))
    t = np.arange(0.0, 5.0, 0.1)
    still = trajectory_of(t, np.zeros((50, 3)), np.zeros((50, 3)), 0 * t)
    for errors in (compare(circle_trajectory(), circle_gnss()), compare(still, static)):
        text = json.dumps(errors.to_dict(), allow_nan=False)
        assert "NaN" not in text
    tree = compare(still, static).to_dict()
    assert tree["percent_of_distance"] == {"end": None, "max": None}


# ---- wrong inputs, named for what they are ------------------------------------------------------


def shifted(gnss: Gnss, seconds: float) -> Gnss:
    return replace(gnss, t_ns=gnss.t_ns + np.int64(seconds * 1e9))


WRONG: list[tuple[str, Callable[[Gnss], Gnss], str]] = [
    ("weeks", lambda g: shifted(g, 2 * 604_800), "2 weeks off: --gps-time-offset -1209600"),
    ("week back", lambda g: shifted(g, -604_800), "1 week off"),
    ("week and leap", lambda g: shifted(g, 604_800 + 18 + 110), "1 week off"),
    ("days", lambda g: shifted(g, 3 * 86_400), "3 days off"),
    ("zone", lambda g: shifted(g, -5 * 3600), "5 hours off: --gps-time-offset 18000"),
    ("GPS epoch", lambda g: shifted(g, -315_964_800 + 18), "GPS epoch"),
    ("log start", lambda g: shifted(g, -T0_NS // S), "start of a recording"),
    ("another day", lambda g: shifted(g, 5_000_300), "same drive"),
    ("elsewhere", lambda g: replace(g, lat=g.lat + 0.002), "km apart"),
    ("swapped", lambda g: replace(g, lat=g.lon, lon=g.lat), "swapped"),
    ("west lost", lambda g: replace(g, lon=-g.lon), "west is negative"),
    ("south lost", lambda g: replace(g, lat=-g.lat), "south is negative"),
    (
        "three fixes",
        lambda g: Gnss(g.t_ns[[0, 50]], g.lat[[0, 50]], g.lon[[0, 50]], g.height[[0, 50]]),
        "only 2 GPS fixes",
    ),
    (
        "none",
        lambda g: Gnss(g.t_ns[:0], g.lat[:0], g.lon[:0], g.height[:0]),
        "nothing to compare",
    ),
]


@pytest.mark.parametrize(("name", "spoil", "text"), WRONG, ids=[w[0] for w in WRONG])
def test_wrong_input_is_named(name, spoil, text, circle_trajectory, circle_gnss) -> None:
    with pytest.raises(LogError, match=text):
        compare(circle_trajectory(), spoil(circle_gnss()))


def test_a_local_trajectory_is_named(circle, circle_gnss) -> None:
    t = np.arange(0.0, 120.0, 0.1)
    local = trajectory_of(t, circle.enu(t), circle.v(t), circle.heading(t))
    local = replace(local, lat=local.lat - local.lat[0], lon=local.lon - local.lon[0])
    with pytest.raises(LogError, match="local"):
        compare(local, circle_gnss())


def stop_and_go(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """East at 8 + 6 sin(t/7) m/s: positions and velocities in closed form."""
    east = 8.0 * t - 42.0 * (np.cos(t / 7.0) - 1.0)
    v = 8.0 + 6.0 * np.sin(t / 7.0)
    return np.column_stack([east, 0 * t, 0 * t]), np.column_stack([v, 0 * t, 0 * t])


@pytest.mark.parametrize("shift", [18.0, -18.0, 37.0])
@pytest.mark.parametrize("drifting", [False, True])
def test_leap_seconds_are_a_finding(shift: float, drifting: bool) -> None:
    t = np.arange(0.0, 300.0, 0.1)
    enu, v = stop_and_go(t)
    if drifting:  # 1 % of speed and 3 deg of heading must not hide it
        enu = 1.01 * enu @ np.array([[0.9986, 0.0523, 0], [-0.0523, 0.9986, 0], [0, 0, 1]])
    trajectory = trajectory_of(t, enu, v, 0 * t + np.pi / 2)
    tf = np.arange(0.0, 300.0)
    gnss = gnss_of(tf + shift, stop_and_go(tf)[0])
    (finding,) = compare(trajectory, gnss).findings
    assert finding.level == "warning"
    assert finding.code == ("leap-seconds" if abs(shift) == 18.0 else "clock-offset")
    assert f"{-shift:+.0f}" in finding.text


def test_no_clock_finding_where_the_clocks_agree() -> None:
    t = np.arange(0.0, 300.0, 0.1)
    enu, v = stop_and_go(t)
    trajectory: Trajectory = trajectory_of(t, enu, v, 0 * t)
    tf = np.arange(0.0, 300.0)
    assert compare(trajectory, gnss_of(tf + 0.6, stop_and_go(tf)[0])).findings == ()
    assert stamps(np.array([1.0]))[0] == T0_NS + S
