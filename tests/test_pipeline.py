"""The order of the steps: a made drive whose truth is known in closed form, and its troubles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.logs_for_tests import ORIGIN, START_NS, speed_profile, straight_log
from vehnav.choices import METHODS
from vehnav.config import Config
from vehnav.errors import ConfigError, LogError
from vehnav.logs.log import Gnss, Imu, Log
from vehnav.mounting import c_bs_from_letters, right_handed_axes
from vehnav.pipeline import run
from vehnav.prepare import split_log
from vehnav.units import DEG, DEG_PER_HOUR

BIAS = tuple(np.array([30.0, -50.0, 80.0]) * DEG_PER_HOUR)


@pytest.fixture(scope="module")
def mems() -> Log:
    """Biases of a MEMS sensor: 30 to 80 deg/h, 20 mm/s2 across, 0.1 m/s2 up."""
    return straight_log(gyro_bias=BIAS, accel_bias=(0.02, -0.01, 0.1))


@pytest.fixture(scope="module")
def mems_run(mems):
    return run(mems)


def dropped(log: Log, first_s: float, last_s: float) -> Log:
    """The log without the IMU between two times."""
    assert log.imu is not None
    t = (log.imu.t_ns - START_NS) * 1e-9
    keep = (t < first_s - 1e-4) | (t > last_s + 1e-4)
    imu = replace(
        log.imu, t_ns=log.imu.t_ns[keep], gyro=log.imu.gyro[keep], accel=log.imu.accel[keep]
    )
    return replace(log, imu=imu)


# ---- alignment and methods ---------------------------------------------------------------------


def test_the_start_is_found(mems_run) -> None:
    alignment = mems_run.alignment
    assert alignment.position_from == "gps"
    assert alignment.heading_from == "gps"
    heading = np.remainder(alignment.heading / DEG + 180.0, 360.0) - 180.0
    assert abs(heading) < 1.0  # due north
    assert alignment.gyro_bias / DEG_PER_HOUR == pytest.approx([30.0, -50.0, 80.0], abs=25.0)
    assert alignment.rest_force == pytest.approx(alignment.gravity + 0.1, abs=0.01)


def test_the_methods_stand_in_the_order_of_the_paper(mems_run) -> None:
    """Spec A test 30: each procedure lies between nothing and both; ours is not worse."""
    end = {name: float(e.horizontal[-1]) for name, e in mems_run.method_errors.items()}
    assert list(end) == list(METHODS)
    assert end["as_published"] < end["reset"] < end["free"]
    assert end["as_published"] < end["levelling"] < end["free"]
    assert end["default"] < 0.2 * end["free"]


@pytest.mark.slow
def test_the_default_is_better_than_the_published_method_over_seeds() -> None:
    """Medians of the end error over 9 draws of biases and noise."""
    ends = []
    for seed in range(9):
        rng = np.random.default_rng(100 + seed)
        log = straight_log(
            gyro_bias=tuple(rng.normal(size=3) * 60.0 * DEG_PER_HOUR),
            accel_bias=tuple(rng.normal(size=3) * 0.03),
            seed=seed,
        )
        errors = run(log).method_errors
        ends.append([errors[k].horizontal[-1] for k in ("as_published", "default")])
    published, default = np.median(ends, axis=0)
    assert default < 0.75 * published


def test_velocity_is_zero_and_position_stands_in_every_stop(mems_run) -> None:
    """Spec A test 26, on the default's own trajectory."""
    track, stopped = mems_run.trajectory, mems_run.trajectory.stopped
    assert np.all(track.v_n[stopped] == 0.0)
    for stop in mems_run.stops:
        inside = slice(stop.first + 1, stop.last + 1)
        for x in (track.lat, track.lon, track.height):
            assert np.ptp(x[inside]) == 0.0


def test_position_and_velocity_are_one_motion(mems_run) -> None:
    """The trapezoid of the velocity is the position, over every step and every stop."""
    track = mems_run.trajectory
    dt = np.diff(track.t_ns)[:, None] * 1e-9
    moved = np.sum(0.5 * (track.v_n[1:] + track.v_n[:-1]) * dt, axis=0)
    enu = track.enu(ORIGIN)
    # the tangent plane turns by 1e-4 rad over a kilometre
    assert enu[-1, :2] - enu[0, :2] == pytest.approx(moved[:2], abs=0.15)
    jumps = np.abs(np.diff(track.v_n, axis=0)).max()
    assert jumps < 0.25  # m/s: no step of the velocity at a stop


def test_attitude_stays_a_rotation_without_steps(mems_run) -> None:
    c_nb = mems_run.trajectory.c_nb
    assert np.abs(c_nb @ c_nb.transpose(0, 2, 1) - np.eye(3)).max() < 1e-9
    turn = np.degrees(np.abs(c_nb[1:] - c_nb[:-1]).max())
    assert turn < 0.2  # deg a step: the levels of the stops are reached smoothly


def test_true_errors_lie_inside_the_expected_ones(mems_run) -> None:
    errors = mems_run.errors
    sigma = errors.states.sigma_pos[:, :2]
    scaled = np.hypot(errors.east / sigma[:, 0], errors.north / sigma[:, 1])
    assert np.mean(scaled < 2.4477) > 0.9
    assert np.all(np.diff(sigma[:, 0]) > -1e-9)  # it never shrinks on the way


@pytest.mark.parametrize("frame", ["enu", "eci"])
def test_ideal_sensors_give_the_true_track(frame) -> None:
    """Closed loop: what is left is the transport rate that the made log leaves out (0.1 m)."""
    log = straight_log(noise=0.0, rate=50.0)
    found = run(log, Config(frame=frame))
    assert found.errors is not None
    assert found.errors.horizontal.max() < 1.0


def test_axes_do_not_matter(mems) -> None:
    """Spec A test 31: the same motion on other axes gives the same trajectory, bit for bit."""
    assert mems.imu is not None
    reference = run(mems, Config(axes="RFU")).trajectory
    for letters in ("FLU", "FRD", "BRU"):
        assert letters in right_handed_axes()
        c_sb = c_bs_from_letters(letters).T
        imu = replace(
            mems.imu, gyro=mems.imu.gyro @ c_sb.T, accel=mems.imu.accel @ c_sb.T, axes=letters
        )
        track = run(replace(mems, imu=imu), Config(axes=letters)).trajectory
        assert np.array_equal(track.lat, reference.lat)
        assert np.array_equal(track.c_nb, reference.c_nb)


def test_causal_uses_nothing_ahead(mems) -> None:
    """The track up to the last stop is the same when what follows is cut off."""
    whole = run(mems, Config(causal=True, start_heading=0.0))
    cut = run(mems, Config(causal=True, start_heading=0.0, end=130.0))
    n = cut.trajectory.size - 200  # a stop needs a second and a half to be seen
    assert np.array_equal(whole.trajectory.lat[:n], cut.trajectory.lat[:n])
    assert whole.trajectory.t_ns[0] == whole.alignment.time_ns  # nothing before the first stop


def test_levelling_ends_before_departure(mems_run) -> None:
    """Spec A test 27: never in the last 0.3 s of a stop, nor outside."""
    from vehnav.classic import GUARD, levelling_gain
    from vehnav.stops import SETTLE

    t = np.arange(0.0, 160.0, 0.01)
    gain = levelling_gain(t, mems_run.stops, None)
    active = np.flatnonzero(gain > 0.0)
    for k in active[::50]:
        assert any(s.settled <= t[k] and t[k + 1] <= s.end - GUARD for s in mems_run.stops)
    assert all(stop.settled >= stop.start + SETTLE for stop in mems_run.stops)
    assert np.all(levelling_gain(t, mems_run.stops, 1.0)[active] == 1.0)


# ---- what GPS was used for ---------------------------------------------------------------------


def test_fixes_that_were_used_judge_nothing(mems, mems_run) -> None:
    gps, errors = mems_run.gps, mems_run.errors
    assert gps.used_for == ("position", "heading")
    assert gps.until_ns is not None
    assert errors.t_ns.min() > gps.until_ns
    assert mems.gnss is not None
    # the fix at 0 s lies before the first stop: it is judged there
    assert gps.fixes_used + errors.t_ns.size == mems.gnss.t_ns.size - 1
    assert gps.window_s == pytest.approx(60.0)


def test_gps_after_the_window_does_not_touch_the_track(mems, mems_run) -> None:
    """Moving the later fixes by 100 m changes the errors and not the track."""
    gnss = mems.gnss
    assert gnss is not None
    later = gnss.t_ns > mems_run.gps.until_ns
    wrong = replace(mems, gnss=replace(gnss, lat=gnss.lat + np.where(later, 100.0 / 6.37e6, 0.0)))
    found = run(wrong)
    assert np.array_equal(found.trajectory.lat, mems_run.trajectory.lat)
    assert found.errors.north[-1] == pytest.approx(mems_run.errors.north[-1] - 100.0, abs=0.5)


def test_gps_none_uses_nothing_and_still_judges(mems) -> None:
    lat, lon, height = ORIGIN
    given = Config(gps="none", start_position=(lat / DEG, lon / DEG, height), start_heading=0.0)
    found = run(mems, given)
    assert found.gps.used_for == ()
    assert mems.gnss is not None
    assert found.errors is not None
    assert found.errors.t_ns.size >= mems.gnss.t_ns.size - 1
    assert not found.alignment.local


def test_without_gps_the_frame_is_local_and_says_so() -> None:
    found = run(straight_log(gps=False))
    assert found.alignment.local
    assert found.errors is None
    assert "local-frame" in [f.code for f in found.findings]
    v, _ = speed_profile(np.arange(0.0, 160.0, 0.01))
    assert found.trajectory.path_length() == pytest.approx(v.sum() * 0.01, rel=0.02)


def test_a_heading_window_without_driving_is_refused(mems) -> None:
    """Under 20 m of GPS path: the heading is unknown, and it is said."""
    gnss = mems.gnss
    assert gnss is not None
    still = Gnss(gnss.t_ns, np.full_like(gnss.lat, ORIGIN[0]), gnss.lon, gnss.height)
    found = run(replace(mems, gnss=still))
    assert found.alignment.heading_from == "none"
    assert "heading-unknown" in [f.code for f in found.findings]


def test_the_part_before_the_first_stop_is_integrated_backward() -> None:
    """A log that starts rolling: 40 s of it lie before the first stop."""
    found = run(straight_log(noise=0.2), Config(start=25.0))
    assert found.trajectory.t_ns[0] == START_NS + 25 * 10**9
    assert found.alignment.time_ns > found.trajectory.t_ns[0]
    assert found.errors_before is not None
    assert found.errors_before.horizontal.max() < 10.0
    assert found.trajectory.v_n[0, 1] == pytest.approx(
        speed_profile(np.array([25.0]))[0][0], abs=0.5
    )


# ---- gaps --------------------------------------------------------------------------------------


def test_a_short_gap_is_bridged_and_said(mems) -> None:
    found = run(dropped(mems, 100.0, 100.3))
    (gap,) = [f for f in found.findings if f.code == "gap"]
    assert gap.level == "info"
    assert found.errors.horizontal[-1] < 30.0


def test_a_long_gap_coasts_with_the_speed_held(mems) -> None:
    found = run(dropped(mems, 100.0, 104.0), Config(as_published=True))
    (gap,) = [f for f in found.findings if f.code == "gap"]
    assert gap.level == "warning"
    assert (gap.start_ns - START_NS) * 1e-9 == pytest.approx(100.0, abs=0.02)
    k = int(np.argmax(np.diff(found.trajectory.t_ns)))
    speed = np.linalg.norm(found.trajectory.v_n[k : k + 2], axis=1)
    assert speed[1] == pytest.approx(speed[0], rel=1e-3)  # the clamp takes the vertical part


def test_a_hole_of_over_10_s_needs_split(mems) -> None:
    holed = dropped(mems, 100.0, 112.0)
    with pytest.raises(LogError, match=r"made\.csv: no IMU between 100\.0 and 112\.0 s.*--split"):
        run(holed)
    parts = split_log(holed)
    assert [part.imu.t_ns.size for part in parts] == [10000, 4799]
    for part in parts:
        assert run(part).trajectory.size > 4000


# ---- refusals ----------------------------------------------------------------------------------


def test_no_stop_is_refused_with_the_quietest_moment_and_a_way_on(mems) -> None:
    driving = Config(start=88.0, end=130.0)
    with pytest.raises(LogError, match=r"no stop was found.*deg/s.*--start-attitude"):
        run(mems, driving)
    found = run(mems, replace(driving, start_attitude=(0.0, 0.0, 0.0)))
    assert found.stops == []
    assert found.alignment.heading_from == "attitude option"


def test_gravity_that_contradicts_the_declared_axes_is_refused(mems) -> None:
    """Where nothing tells the other axes apart; what the drive tells, test_axes_auto has."""
    assert mems.imu is not None
    upside = replace(mems.imu, gyro=mems.imu.gyro * [1, -1, -1], accel=mems.imu.accel * [1, -1, -1])
    standing = Config(end=15.0)
    with pytest.raises(LogError, match=r"up is the sensor's -z.*FRD.*--axes"):
        run(replace(mems, imu=upside), standing)
    found = run(
        replace(mems, imu=upside), replace(standing, axes="FLU")
    )  # given: runs, and is said
    assert "axes-contradiction" in [f.code for f in found.findings]


def test_a_slow_imu_is_refused(mems) -> None:
    assert mems.imu is not None
    every = slice(None, None, 100)
    slow = Imu(mems.imu.t_ns[every], mems.imu.gyro[every], mems.imu.accel[every])
    with pytest.raises(LogError, match=r"1\.00 Hz.*50 Hz or more"):
        run(replace(mems, imu=slow))


def test_a_log_without_imu_says_what_it_has() -> None:
    gps_only = Log("gps.mcap", None, contents=({"name": "/fix", "type": "NavSatFix"},))
    with pytest.raises(LogError, match=r"gps\.mcap: no IMU found; it has /fix \(NavSatFix\)"):
        run(gps_only)


def test_start_and_end_choose_a_part(mems) -> None:
    found = run(mems, Config(end=90.0))
    assert found.trajectory.t_ns[-1] <= START_NS + 90 * 10**9
    with pytest.raises(LogError, match="at least 5 s"):
        run(mems, Config(start=10.0, end=12.0))
    with pytest.raises(ConfigError, match="not after"):
        Config(start=10.0, end=5.0)


def test_increments_give_the_same_track_as_rates(mems) -> None:
    """Spec A test 32 in the small: mean increments of the same samples."""
    assert mems.imu is not None
    imu = mems.imu
    half = 0.5 * 0.01
    dtheta = np.concatenate([imu.gyro[:1] * 0.01, half * (imu.gyro[1:] + imu.gyro[:-1])])
    dvel = np.concatenate([imu.accel[:1] * 0.01, half * (imu.accel[1:] + imu.accel[:-1])])
    log = replace(mems, imu=replace(imu, gyro=dtheta, accel=dvel, sampling="increments"))
    a, b = run(mems, Config(as_published=True)), run(log, Config(as_published=True))
    apart = np.hypot(*(a.trajectory.enu(ORIGIN)[-1] - b.trajectory.enu(ORIGIN)[-1])[:2])
    assert apart < 0.05 * a.errors.horizontal[-1] + 1.0
