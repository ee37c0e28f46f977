"""Units, axes and mounting from the physics: real logs against their READMEs, made logs against
how they were turned.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.logs_for_tests import straight_log
from vehnav import read_log
from vehnav.clues import GpsMotion
from vehnav.config import Config
from vehnav.errors import LogError
from vehnav.gps_axes import gps_between
from vehnav.logs.log import Imu, Log
from vehnav.mounting import c_bs_from_letters, right_handed_axes, sensor_to_body
from vehnav.pipeline import Run, StopSearch, run, search_stops
from vehnav.simulate import simulate
from vehnav.units import DEG, STANDARD_GRAVITY
from vehnav.units_auto import establish_units

# ---- real logs ---------------------------------------------------------------------------------

YAW_WITHIN, TILT_WITHIN = 4.0, 3.0
"""deg, where there are three or more departures and arrivals."""


@dataclass(frozen=True)
class Real:
    """A real log and what its README says of the sensor.

    ``mount``: (roll, pitch, yaw) deg, None where the README states none or there are too few
    departures; ``source``: what gives forward.
    """

    file: str
    axes: str
    source: str
    accel_axes: str | None = None
    mount: tuple[float, float, float] | None = None
    gps_file: str | None = None


BOSTON, DRIVE = "boston_apan/", "drive_0708/"
EVENTS = "departures and arrivals"
TILTED = (0.0, -6.79, 5.35)
"""deg, of drive_0708: the source's composition, in the senses of --mount."""

REAL = [
    Real(f"{BOSTON}driving.mcap", "FRD", EVENTS, mount=(0.0, 0.0, 0.0)),
    Real(f"{BOSTON}driving_imu.csv", "FRD", EVENTS, mount=(0.0, 0.0, 0.0)),
    Real(f"{DRIVE}drive_0708.mcap", "BRU", EVENTS, mount=TILTED),
    Real(f"{DRIVE}imu.csv", "BRU", EVENTS, mount=TILTED, gps_file=f"{DRIVE}gnss.pos"),
    Real("kitti_oxts/2011_09_30_drive_0018.mcap", "FLU", EVENTS),
    Real("kitti_oxts/2011_09_30_drive_0018_imu.csv", "FLU", EVENTS),
    Real("kitti_oxts/2011_09_30_drive_0027.mcap", "FLU", EVENTS),
    Real("kitti_oxts/2011_09_30_drive_0027_imu.csv", "FLU", EVENTS),
    Real(
        "dresden_balzer/2014-03-26-000-Data.full.csv", "FLU", EVENTS, "BRD",
        mount=(0.0, -11.0, 0.0),
    ),
    Real("mcap_by_others/rhoque_car_circles.mcap", "FRD", "turns", mount=(0.0, -7.0, 0.0)),
    Real(f"{BOSTON}going_in_circles.mcap", "FRD", "turns"),  # never stands
    Real(f"{BOSTON}going_in_circles_imu.csv", "FRD", "turns"),
    Real("kitti_oxts/2011_10_03_drive_0042.mcap", "FLU", "GPS"),  # motorway, no stop
    Real("ugv_robot_localization/imu.csv", "FLU", EVENTS),  # one departure, after 0.9 s
]  # fmt: skip


@pytest.mark.parametrize("case", REAL, ids=lambda case: case.file)
def test_real_logs_show_how_the_sensor_sits(shared_data: Path, case: Real) -> None:
    gps = None if case.gps_file is None else str(shared_data / case.gps_file)
    log = read_log(str(shared_data / case.file), gps_file=gps)
    orientation = search_stops(log).samples.orientation
    evidence = orientation.evidence
    assert orientation.axes == case.axes
    assert orientation.accel_axes == case.accel_axes
    assert evidence.certain
    assert evidence.source == case.source
    assert orientation.units is not None
    assert orientation.units.as_read
    codes = {finding.code for finding in orientation.findings}
    assert "axes-found" in codes
    assert log.imu is not None
    assert not log.imu.axes_declared
    assert ("axes-contradiction" in codes) == (case.accel_axes is not None)
    unusual = log.imu.axes not in ("", case.axes)
    assert ("axes-unusual" in codes) == (unusual and case.accel_axes is None)
    if case.mount is not None:
        found, stated = orientation.matrices()[0], sensor_to_body(
            case.axes, mount=tuple(np.radians(case.mount))
        )[0]  # fmt: skip
        up = np.degrees(np.arccos(np.clip(found[2] @ stated[2], -1.0, 1.0)))
        ahead = found[1] - (found[1] @ stated[2]) * stated[2]
        yaw = np.degrees(np.arctan2(ahead @ stated[0], ahead @ stated[1]))
        assert up < TILT_WITHIN
        assert abs(yaw) < YAW_WITHIN


def test_only_the_inverted_accelerometer_needed_gps(shared_data: Path) -> None:
    """Force is polar, rate axial: without GPS dresden's mirror world is as good (spec C 2)."""
    inverted = read_log(str(shared_data / "dresden_balzer/2014-03-26-000-Data.full.csv"))
    found = run(inverted)
    assert "axes" in found.gps.used_for
    until = found.orientation.evidence.gps_until
    assert until is not None
    assert found.errors is not None
    assert found.errors.t_ns.min() > found.start_ns + until * 1e9  # those fixes judge nothing
    mirrored = search_stops(replace(inverted, gnss=None)).samples.orientation
    assert mirrored.accel_axes is None
    assert c_bs_from_letters(mirrored.axes)[2, 2] == -1.0  # z points down in it
    upright = run(read_log(str(shared_data / f"{BOSTON}driving.mcap")))
    assert "axes" not in upright.gps.used_for


def test_the_mount_found_drives_as_well_as_the_letters_given(shared_data: Path) -> None:
    """boston: 201 m at the end with --axes FRD; found, the same to 1 %."""
    log = read_log(str(shared_data / f"{BOSTON}driving.mcap"))
    found, given = run(log).errors, run(log, Config(axes="FRD")).errors
    assert found is not None
    assert given is not None
    assert found.horizontal[-1] == pytest.approx(given.horizontal[-1], rel=0.01)


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("kitti_oxts/2011_10_03_drive_0042.mcap", r"no stop was found.*--start-attitude"),
        ("boston_ramirez_1hz/imu.csv", r"1\.00 Hz.*50 Hz or more"),
        ("mcap_by_others/rosbagsrs_all_types_no_statistics.mcap", r"2 IMU samples|no IMU"),
        ("mcap_by_others/evo_nav2_turtlebot.mcap", r"no IMU found.*Odometry"),
        ("mcap_by_others/hansmann_navsatfix_50min.mcap", r"no IMU found.*NavSatFix"),
        ("mcap_by_others/foxglove_tutorial.mcap", r"no IMU found; it has battery.*LocationFix"),
        ("mcap_by_others/sarthak_no_messages.mcap", r"no (IMU|messages)"),
        ("mcap_by_others/sarthak_zero_bytes.mcap", r"empty \(0 bytes\)"),
    ],
)
def test_what_cannot_run_says_why_and_what_is_there(shared_data: Path, file, text) -> None:
    with pytest.raises(LogError, match=text):
        run(read_log(str(shared_data / file)))


# ---- one made log on all axes and in all units -------------------------------------------------

MOUNT = (2.5, -5.0, 6.0)
"""deg roll, pitch, yaw of the case in the made log."""
VARIANTS = [(gyro, accel) for gyro in ("rad/s", "deg/s") for accel in ("m/s2", "g", "mg")]
FACTORS = {
    "rad/s": 1.0, "deg/s": 1.0 / DEG,
    "m/s2": 1.0, "g": 1.0 / STANDARD_GRAVITY, "mg": 1000.0 / STANDARD_GRAVITY,
}  # fmt: skip
SAME = 1e-9
"""Relative: rounding of the turn, of the units and of sums in another order."""


@cache
def made() -> Log:
    """Four minutes in town with three stops, at 50 Hz, with GPS."""
    return simulate("city,duration=240,first_stop=15", seed=3, rate_hz=50.0).log()


def turned(log: Log, letters: str, gyro_unit: str = "rad/s", accel_unit: str = "m/s2") -> Log:
    """The same drive with the case mounted otherwise, in other units, declared as ROS does."""
    assert log.imu is not None
    c_bs = sensor_to_body(letters, mount=tuple(np.radians(MOUNT)))[0]
    imu = replace(
        log.imu,
        gyro=log.imu.gyro @ c_bs * FACTORS[gyro_unit],  # rows times C_bs: C_sb on columns
        accel=log.imu.accel @ c_bs * FACTORS[accel_unit],
        axes="FLU",
    )
    return replace(log, imu=imu)


@cache
def reference() -> StopSearch:
    return search_stops(turned(made(), "RFU"))


@cache
def reference_run() -> Run:
    return run(turned(made(), "RFU"))


def relative(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(a - b).max() / np.abs(b).max())


def check_track(letters: str, units: tuple[str, str]) -> None:
    found, wanted = run(turned(made(), letters, *units)).trajectory, reference_run().trajectory
    for name in ("lat", "lon", "height", "v_n", "c_nb"):
        assert relative(getattr(found, name), getattr(wanted, name)) < SAME, name


@pytest.mark.parametrize("letters", right_handed_axes())
def test_24_axis_orders_give_the_same_body_without_options(letters: str) -> None:
    units = VARIANTS[right_handed_axes().index(letters) % 6]
    found = search_stops(turned(made(), letters, *units))
    orientation = found.samples.orientation
    assert orientation.axes == letters
    assert orientation.accel_axes is None
    assert orientation.units is not None
    assert (orientation.units.gyro, orientation.units.accel) == units
    codes = [finding.code for finding in found.samples.findings]
    assert ("unit-inferred" in codes) == (units != ("rad/s", "m/s2"))
    assert ("axes-unusual" in codes) == (letters != "FLU")
    assert "axes-contradiction" not in codes
    assert relative(found.samples.omega, reference().samples.omega) < SAME
    assert relative(found.samples.f, reference().samples.f) < SAME
    assert [(s.first, s.last) for s in found.stops] == [
        (s.first, s.last) for s in reference().stops
    ]


@pytest.mark.parametrize(
    ("letters", "units"), list(zip(right_handed_axes()[2::4], VARIANTS, strict=True))
)
def test_axes_and_units_give_the_same_track_without_options(letters, units) -> None:
    check_track(letters, units)


@pytest.mark.slow
@pytest.mark.parametrize("units", VARIANTS, ids="-".join)
@pytest.mark.parametrize("letters", right_handed_axes())
def test_24_axis_orders_and_6_units_give_the_same_track_without_options(letters, units) -> None:
    check_track(letters, units)


def test_the_mount_of_the_made_log_is_found() -> None:
    """Level streets: 0.5 deg of tilt; four departures and arrivals: 4 deg of yaw (spec C 2)."""
    orientation = reference().samples.orientation
    roll, pitch, yaw = np.degrees(orientation.mount)
    assert (roll, pitch) == pytest.approx(MOUNT[:2], abs=0.5)
    assert yaw == pytest.approx(MOUNT[2], abs=4.0)
    assert orientation.evidence.events.count == 4
    assert orientation.evidence.gps_until is None


def test_an_inverted_accelerometer_is_found_by_gps_in_any_order() -> None:
    for letters in ("RFU", "DRB", "BLD"):
        log = turned(made(), letters)
        assert log.imu is not None
        found = search_stops(replace(log, imu=replace(log.imu, accel=-log.imu.accel)))
        orientation = found.samples.orientation
        assert orientation.axes == letters
        assert c_bs_from_letters(orientation.accel_axes) == pytest.approx(
            -c_bs_from_letters(letters)
        )
        assert relative(found.samples.f, reference().samples.f) < SAME


# ---- what the evidence cannot show -------------------------------------------------------------


def no_stops(log: Log) -> Log:
    """The middle of a drive."""
    assert log.imu is not None
    t = (log.imu.t_ns - log.imu.t_ns[0]) * 1e-9
    keep = (t > 20.0) & (t < 60.0)
    imu = replace(
        log.imu, t_ns=log.imu.t_ns[keep], gyro=log.imu.gyro[keep], accel=log.imu.accel[keep]
    )
    return replace(log, imu=imu)


def test_forward_that_is_not_shown_is_the_declared_one_and_said() -> None:
    """A straight drive without a stop: up agrees with RFU, nothing shows forward."""
    log = no_stops(straight_log(gps=False, seed=3))
    orientation = search_stops(log).samples.orientation
    assert orientation.axes == "RFU"
    assert not orientation.evidence.certain
    assert "axes-unverified" in [f.code for f in orientation.findings]


@pytest.mark.parametrize(
    ("axes", "declared", "code", "level"),
    [
        ("FLU", True, "axes-contradiction", "warning"),
        ("FLU", False, "axes-unusual", "info"),
        ("", False, None, ""),
        ("BRU", True, None, ""),
    ],
)
def test_a_declaration_is_contradicted_a_custom_is_not(axes, declared, code, level) -> None:
    """A drive that shows BRU; ROS asks for FLU (REP 103), which is no statement of this file."""
    log = turned(made(), "BRU")
    assert log.imu is not None
    imu = replace(log.imu, axes=axes, axes_declared=declared)
    orientation = search_stops(replace(log, imu=imu)).samples.orientation
    assert orientation.axes == "BRU"
    said = [f for f in orientation.findings if f.code in ("axes-contradiction", "axes-unusual")]
    assert [(f.code, f.level) for f in said] == ([] if code is None else [(code, level)])


@pytest.mark.parametrize(
    ("axes", "declared", "words"),
    [
        ("RFU", True, "axes RFU as the format declares"),
        ("RFU", False, "axes RFU as usual for such files"),
        ("", False, "axes FLU assumed, for the file does not say"),
    ],
)
def test_axes_that_nothing_shows_are_said_to_be_so(axes, declared, words) -> None:
    log = no_stops(straight_log(gps=False, seed=3))
    assert log.imu is not None
    imu = replace(log.imu, axes=axes, axes_declared=declared)
    (finding,) = (
        f
        for f in search_stops(replace(log, imu=imu)).samples.findings
        if f.code == "axes-unverified"
    )
    assert words in finding.text
    assert finding.level == "warning"


def test_given_axes_win_and_the_log_is_heard() -> None:
    log = turned(made(), "FLU")
    found = search_stops(log, Config(axes="BRU")).samples
    assert found.orientation.axes == "BRU"
    (finding,) = [f for f in found.findings if f.code == "axes-contradiction"]
    assert "BRU were given, but the log shows FLU" in finding.text
    right = search_stops(log, Config(axes="FLU")).samples
    assert "axes-contradiction" not in [f.code for f in right.findings]
    assert right.orientation.mount == (0.0, 0.0, 0.0)


def test_gps_that_must_not_be_used_is_not() -> None:
    log = turned(made(), "FLU")
    assert log.imu is not None
    inverted = replace(log, imu=replace(log.imu, accel=-log.imu.accel))
    orientation = search_stops(inverted, Config(gps="none")).samples.orientation
    assert orientation.evidence.gps is None
    assert orientation.accel_axes is None


def test_velocity_between_two_instants_owes_nothing_to_other_fixes() -> None:
    log = made()
    assert log.gnss is not None
    gnss = log.gnss
    late = gnss.t_ns > log.start_ns + 60 * 10**9
    other = replace(gnss, lat=np.where(late, 0.1, gnss.lat))
    for one in (gnss, other):
        motion = gps_between(one, log.start_ns)(20.0, 60.0)
        assert motion is not None
        assert motion.t[-1] <= 60.0
        if one is gnss:
            kept = motion
    assert np.array_equal(kept.v, motion.v)
    assert gps_between(gnss, log.start_ns)(20.0, 22.0) is None
    assert gps_between(None, 0) is None


def test_a_gyro_whose_signs_are_turned_is_doubted() -> None:
    """The force agrees with GPS and the gyro does not: no accelerometer to be inverted."""
    log = turned(made(), "FLU")
    assert log.imu is not None
    found = search_stops(replace(log, imu=replace(log.imu, gyro=-log.imu.gyro))).samples
    assert found.orientation.accel_axes is None
    assert any("signs of the gyro" in f.text for f in found.findings if f.code == "axes-doubt")


# ---- units -------------------------------------------------------------------------------------


def scaled(log: Log, *, gyro: float = 1.0, accel: float = 1.0) -> Log:
    assert log.imu is not None
    return replace(log, imu=replace(log.imu, gyro=log.imu.gyro * gyro, accel=log.imu.accel * accel))


def test_gravity_that_was_removed_is_refused_with_the_source() -> None:
    log = made()
    assert log.imu is not None
    flat = replace(log, imu=replace(log.imu, accel=log.imu.accel - log.imu.accel.mean(axis=0)))
    with pytest.raises(LogError, match=r"gravity was removed.*--columns"):
        search_stops(flat)
    with pytest.raises(LogError, match="neither m/s2 nor g nor mg"):
        search_stops(scaled(made(), accel=7.0))


def test_a_force_that_is_off_by_a_fifth_is_said() -> None:
    found = search_stops(scaled(made(), accel=1.2)).samples
    assert "unit-doubt" in [f.code for f in found.findings]
    rhoque = search_stops(scaled(made(), accel=1.067)).samples  # 6.7 % too much is a real log
    assert "unit-doubt" not in [f.code for f in rhoque.findings]


def test_increments_that_call_themselves_rates_are_known() -> None:
    log = made()
    assert log.imu is not None
    dt = np.diff(log.imu.t_ns, prepend=log.imu.t_ns[0] - 20_000_000)[:, None] * 1e-9
    imu = replace(log.imu, gyro=log.imu.gyro * dt, accel=log.imu.accel * dt)
    found = search_stops(replace(log, imu=imu)).samples
    assert found.orientation.units is not None
    assert found.orientation.units.increments
    assert relative(found.omega, search_stops(log).samples.omega) < SAME


def test_a_car_that_circles_fast_is_not_in_degrees() -> None:
    """Half a radian a second all the time: the force in turns, v w, says rad/s at 4 m/s."""
    t = np.arange(0.0, 60.0, 0.02)
    rate, speed = 0.8 + 0.1 * np.sin(0.3 * t), 4.0
    gyro = np.stack([0.0 * t, 0.0 * t, rate], axis=1)
    standing = (t < 5.0)[:, None]
    gyro[standing[:, 0]] = 0.0
    force = np.stack([0.0 * t, speed * gyro[:, 2], 0.0 * t + 9.81], axis=1)  # FLU
    rng = np.random.default_rng(5)
    force += 0.3 * rng.normal(size=force.shape) * ~standing
    t_ns = np.round(t * 1e9).astype(np.int64)
    found = search_stops(Log("circles", Imu(t_ns, gyro, force))).samples.orientation
    assert found.units is not None
    assert found.units.gyro == "rad/s"
    assert found.axes == "FLU"
    assert found.evidence.source == "turns"
    degrees = Log("circles", Imu(t_ns, gyro / DEG, force))
    again = search_stops(degrees).samples.orientation
    assert again.units is not None
    assert again.units.gyro == "deg/s"


@pytest.mark.parametrize(("amplitude", "unit"), [(0.6, "rad/s"), (1.0 * DEG, "deg/s")])
def test_gps_tells_the_unit_where_nothing_else_does(amplitude: float, unit: str) -> None:
    """Both read about 0.5 in motion, and the force does not show the turns: the GPS course does."""
    t = np.arange(0.0, 150.0, 0.02)
    rate, heading = amplitude * np.sin(0.2 * t), amplitude / 0.2 * (1.0 - np.cos(0.2 * t))
    rng = np.random.default_rng(4)
    slow = np.stack([np.interp(t, np.arange(151.0), rng.normal(size=151)) for _ in range(2)])
    force = np.stack([slow[0], slow[1], np.full(t.size, 9.81)], axis=1)
    gyro = np.stack([0.0 * t, 0.0 * t, rate * FACTORS[unit]], axis=1)
    asked = []

    def gps(first: float, last: float) -> GpsMotion:
        asked.append((first, last))
        inside = slice(0, int(last * 50), 10)
        track = np.stack([np.cos(heading[inside]), np.sin(heading[inside])], axis=1)
        return GpsMotion(t[inside], 5.0 * track)

    units = establish_units(t, gyro, force, gps=gps)
    assert units.gyro == unit
    assert units.doubt == ""
    assert asked == [(0.0, 120.0)]
    assert units.gps_until == pytest.approx(119.8)
    assert establish_units(t, gyro, force).doubt != ""
