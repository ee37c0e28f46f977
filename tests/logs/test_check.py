"""Cleaning: what was put wrong into a sound record is found, counted and taken out again."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vehnav.errors import Finding, LogError
from vehnav.logs.check import NO_TIME, clean_gnss, clean_imu, clean_speed
from vehnav.units import DEG

T0 = 1_700_000_000_000_000_000
MS = 1_000_000
METRE = 1.0 / 6_371_000.0  # rad of latitude


def imu_columns(n=50, seed=1):
    rng = np.random.default_rng(seed)
    return T0 + 10 * MS * np.arange(n), rng.normal(size=(n, 3)), rng.normal(size=(n, 3)) + 9.8


def clean(t, gyro, accel, **more):
    return clean_imu(t, gyro, accel, source="/imu", where="x.csv: IMU", **more)


def codes(findings: list[Finding]) -> dict[str, Finding]:
    return {f.code: f for f in findings}


def test_sound_samples_pass_untouched():
    t, gyro, accel = imu_columns()
    imu, findings = clean(t, gyro, accel, frame_id="imu_link")
    assert findings == []
    assert (imu.source, imu.frame_id, imu.sampling) == ("/imu", "imu_link", "rates")
    np.testing.assert_array_equal(imu.t_ns, t)
    np.testing.assert_array_equal(imu.gyro, gyro)
    np.testing.assert_array_equal(imu.accel, accel)


def test_rows_that_are_not_finite_are_dropped_and_named():
    t, gyro, accel = imu_columns()
    gyro[7, 1], accel[9, 2], accel[30, 0] = np.nan, np.inf, -np.inf
    t_missing = t.copy()
    t_missing[20] = NO_TIME
    imu, findings = clean(t_missing, gyro, accel)
    kept = np.setdiff1d(np.arange(50), [7, 9, 20, 30])
    np.testing.assert_array_equal(imu.t_ns, t[kept])
    np.testing.assert_array_equal(imu.accel, accel[kept])
    (finding,) = findings
    assert (finding.code, finding.level) == ("non-finite", "error")
    assert (finding.start_ns, finding.end_ns) == (t[7], t[30])
    assert "4 of 50 rows" in finding.text
    assert "row 8" in finding.text


def test_nothing_finite_is_an_error():
    t, gyro, accel = imu_columns()
    with pytest.raises(LogError, match=r"x\.csv: IMU: none of 50 rows"):
        clean(t, gyro * np.nan, accel)


def test_backward_stamps_are_sorted():
    t, gyro, accel = imu_columns()
    shuffled = np.arange(50)
    shuffled[[10, 11, 12]] = [12, 10, 11]  # one sample came 20 ms early in the file
    imu, findings = clean(t[shuffled], gyro[shuffled], accel[shuffled])
    np.testing.assert_array_equal(imu.t_ns, t)
    np.testing.assert_array_equal(imu.gyro, gyro)
    (finding,) = findings
    assert (finding.code, finding.level) == ("backward-stamps", "warning")
    assert "2 of 50 stamps" in finding.text
    assert "0.02 s" in finding.text
    assert (finding.start_ns, finding.end_ns) == (t[10], t[11])


def test_a_clock_that_was_set_back_is_an_error_level_finding():
    t, gyro, accel = imu_columns()
    t = t.copy()
    t[25:] -= 3_605_000 * MS
    imu, findings = clean(t, gyro, accel)
    assert imu.t_ns.size == 50
    assert codes(findings)["backward-stamps"].level == "error"


@pytest.mark.parametrize(("sampling", "divisor"), [("rates", 3.0), ("increments", 1.0)])
def test_repeated_stamps_are_merged(sampling, divisor):
    t, gyro, accel = imu_columns()
    t = t.copy()
    t[[4, 5]] = t[3]
    imu, findings = clean(t, gyro, accel, sampling=sampling)
    assert imu.t_ns.size == 48
    assert imu.sampling == sampling
    np.testing.assert_allclose(imu.gyro[3], (gyro[3] + gyro[4] + gyro[5]) / divisor, rtol=1e-15)
    np.testing.assert_allclose(imu.accel[3], (accel[3] + accel[4] + accel[5]) / divisor, rtol=1e-15)
    np.testing.assert_array_equal(imu.gyro[4:], gyro[6:])
    (finding,) = findings
    assert (finding.code, finding.level) == ("duplicate-stamps", "warning")
    assert "2 of 50 rows" in finding.text


def test_a_jump_forward_stays():
    t, gyro, accel = imu_columns()
    t = t.copy()
    t[25:] += 7_000 * MS
    imu, findings = clean(t, gyro, accel)
    assert findings == []
    np.testing.assert_array_equal(imu.t_ns, t)


@settings(max_examples=60, derandomize=True, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 30), st.booleans()), min_size=1, max_size=40))
def test_any_order_conserves_increments(rows):
    """Whatever the order and the repeats, the sum of the finite increments survives."""
    t = np.array([T0 + k * MS for k, _ in rows])
    good = np.array([ok for _, ok in rows])
    gyro = np.where(good, 1.0, np.nan)[:, np.newaxis] * np.array([1.0, 2.0, 4.0])
    if not good.any():
        with pytest.raises(LogError):
            clean(t, gyro, np.ones_like(gyro), sampling="increments")
        return
    imu, findings = clean(t, gyro, np.ones_like(gyro), sampling="increments")
    assert np.all(np.diff(imu.t_ns) > 0)
    np.testing.assert_array_equal(imu.gyro.sum(axis=0), good.sum() * np.array([1.0, 2.0, 4.0]))
    assert ("non-finite" in codes(findings)) == (not good.all())
    assert set(imu.t_ns) == set(t[good])


# ---- fixes -----------------------------------------------------------------------------------


def drive(n=60, speed=10.0, rate_hz=1.0):
    """A drive to the north from 42 N, 71 W with exact columns."""
    t = T0 + (np.arange(n) / rate_hz * 1e9).astype(np.int64)
    lat = 42.0 * DEG + speed * METRE * np.arange(n) / rate_hz
    return {"t_ns": t, "lat": lat, "lon": np.full(n, -71.0 * DEG), "height": np.full(n, 20.0)}


def clean_fixes(columns, **more):
    return clean_gnss(**columns, **more, source="/gps", where="x.csv: GPS")


def test_sound_fixes_pass_bit_for_bit():
    columns = drive()
    v_n = np.tile([0.0, 10.0, 0.0], (60, 1))
    gnss, findings = clean_fixes(columns, v_n=v_n, sigma_pos=v_n + 1, sigma_vel=v_n + 0.1)
    assert findings == []
    for name, value in columns.items():
        np.testing.assert_array_equal(getattr(gnss, name), value)
    np.testing.assert_array_equal(gnss.v_n, v_n)
    np.testing.assert_array_equal(gnss.sigma_pos, v_n + 1)
    np.testing.assert_array_equal(gnss.sigma_vel, v_n + 0.1)


def test_each_reason_is_counted_once():
    columns = drive()
    lat, lon = columns["lat"], columns["lon"]
    lat[3] = np.nan
    lat[5] = lon[5] = 0.0
    lat[8] = 91.0 * DEG
    lat[20] += 2000.0 * METRE
    status = np.zeros(60, np.int8)
    status[[30, 31]] = -1
    status[40] = -2
    gnss, findings = clean_fixes(columns, status=status)
    bad = [3, 5, 8, 20, 30, 31, 40]
    np.testing.assert_array_equal(gnss.t_ns, np.delete(columns["t_ns"], bad))
    (finding,) = findings
    assert (finding.code, finding.level) == ("gps-rejected", "warning")
    assert "7 of 60 fixes" in finding.text
    for words in (
        "1 not finite",
        "1 position (0, 0)",
        "1 latitude",
        "1 impossible jump",
        "2 status no fix",
        "1 status unknown",
    ):
        assert words in finding.text
    assert (finding.start_ns, finding.end_ns) == (columns["t_ns"][3], columns["t_ns"][40])


def test_a_driver_that_never_fills_the_status_is_not_rejected():
    gnss, findings = clean_fixes(drive(), status=np.full(60, -2, np.int8))
    assert gnss.t_ns.size == 60
    assert findings == []
    gnss, findings = clean_fixes(drive(), status=np.full(60, -1, np.int8))
    assert gnss is None
    assert "60 status no fix" in findings[0].text


def test_a_false_stretch_of_fixes_goes_but_a_tunnel_stays():
    columns = drive()
    columns["lat"][20:24] += 5000.0 * METRE  # four fixes in another town
    gnss, findings = clean_fixes(columns)
    np.testing.assert_array_equal(gnss.t_ns, np.delete(columns["t_ns"], np.arange(20, 24)))
    assert "4 impossible jump" in findings[0].text
    columns = drive()
    for name, value in columns.items():
        columns[name] = np.delete(value, np.arange(20, 40))  # 20 s without a fix, 200 m on
    gnss, findings = clean_fixes(columns)
    assert gnss.t_ns.size == 40
    assert findings == []


@pytest.mark.parametrize("bad", [0, 59])
def test_a_false_fix_at_an_end(bad):
    columns = drive()
    columns["lat"][bad] += 9000.0 * METRE
    gnss, _ = clean_fixes(columns)
    np.testing.assert_array_equal(gnss.t_ns, np.delete(columns["t_ns"], bad))


def test_stale_repeats_while_moving_are_rejected():
    columns = drive()
    columns["lat"][[30, 31]] = columns["lat"][29]
    gnss, findings = clean_fixes(columns)
    np.testing.assert_array_equal(gnss.t_ns, np.delete(columns["t_ns"], [30, 31]))
    assert "2 stale repeat while moving" in findings[0].text


def test_static_hold_is_kept():
    """Brake at 3 m/s2, stand 20 s with the position held, start at 2 m/s2: nothing is stale."""
    t = np.arange(60.0)
    v = np.clip(np.minimum(np.maximum(12.0 - 3.0 * (t - 15.0), 0.0) + 99.0 * (t > 38), 12.0), 0, 12)
    v = np.where(t > 38, np.minimum(2.0 * (t - 38.0), 12.0), v)
    columns = drive()
    columns["lat"] = 42.0 * DEG + METRE * np.cumsum(v)
    assert np.sum(np.diff(columns["lat"]) == 0.0) >= 19
    gnss, findings = clean_fixes(columns)
    assert gnss.t_ns.size == 60
    assert findings == []


def test_covariance_garbage_gives_no_sigma():
    garbage = np.full((60, 3), np.sqrt(4e-322))
    gnss, findings = clean_fixes(drive(), sigma_pos=garbage)
    assert gnss.sigma_pos is None
    assert findings[0].code == "gps-sigma-invalid"
    mixed = np.tile([1.0, 2.0, 3.0], (60, 1))
    mixed[4] = [0.0, np.nan, -1.0]
    mixed[5] = [7.0, 8.0, 9.0]
    gnss, findings = clean_fixes(drive(), sigma_pos=mixed)
    np.testing.assert_array_equal(gnss.sigma_pos[4], [7.0, 8.0, 9.0])
    assert "1 of 60" in findings[0].text


def test_missing_velocity_and_height():
    columns = drive()
    v_n = np.column_stack([np.arange(60.0), np.ones(60), np.zeros(60)])
    holes = v_n.copy()
    holes[10] = np.nan
    columns["height"][7] = np.nan
    gnss, findings = clean_fixes(columns, v_n=holes)
    np.testing.assert_allclose(gnss.v_n, v_n, rtol=1e-12)
    assert gnss.height[7] == pytest.approx(20.0)
    assert set(codes(findings)) == {"gps-velocity-missing", "gps-height-missing"}
    holes[20:40] = np.nan
    gnss, _ = clean_fixes(drive(), v_n=holes, sigma_vel=np.ones((60, 3)))
    assert gnss.v_n is None
    assert gnss.sigma_vel is None


def test_order_repeats_and_longitudes_of_fixes():
    columns = drive()
    columns["lon"] += 360.0 * DEG  # 0..360 convention
    order = np.arange(60)
    order[[10, 11]] = [11, 10]
    order = np.insert(order, 30, 29)
    gnss, findings = clean_fixes({name: value[order] for name, value in columns.items()})
    assert set(codes(findings)) == {"backward-stamps", "duplicate-stamps"}
    np.testing.assert_array_equal(gnss.t_ns, columns["t_ns"])
    np.testing.assert_allclose(gnss.lon, -71.0 * DEG, rtol=1e-12)


def test_speed():
    t = T0 + 100 * MS * np.arange(20)
    speed = np.linspace(0.0, 19.0, 20)
    dirty_t, dirty = np.append(t, t[4]), np.append(speed, 10.0)
    dirty[7], dirty[9] = np.nan, 900.0
    record, findings = clean_speed(dirty_t, dirty, source="/odom", where="x: /odom")
    assert record is not None
    np.testing.assert_array_equal(record.t_ns, np.delete(t, [7, 9]))
    assert record.speed[4] == 7.0  # mean of 4 and 10
    assert set(codes(findings)) == {
        "non-finite",
        "speed-rejected",
        "backward-stamps",
        "duplicate-stamps",
    }
    assert clean_speed(t, speed * np.nan, source="", where="x")[0] is None
