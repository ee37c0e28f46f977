"""Runs over the North pole: the filter, the frames, what is written and how it is judged.

Judges: the simulator's truth in Earth-fixed axes, pyproj's geodesics, closed forms.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from pyproj import Geod

from vehnav.config import Config
from vehnav.earth import c_en, ecef_from_geodetic, geodetic_from_ecef, position_difference
from vehnav.evaluation import compare
from vehnav.export.columns import QUASI, velocity_of
from vehnav.export.formats import read_trajectory, write_trajectory
from vehnav.export.load import as_gnss, load_track
from vehnav.pipeline import run
from vehnav.report.mapping import map_of
from vehnav.report.panels import heading_panel, velocity_panel
from vehnav.report.sections import gps_sentence, headline
from vehnav.rotation import c_from_rotvec
from vehnav.simulate import simulate
from vehnav.trajectory import interpolate
from vehnav.units import DEG

POLE = "polar,miss=1,v=30,duration=240"


def ecef(track):
    return ecef_from_geodetic(track.lat, track.lon, track.height)


def apart(found, simulated):
    """(n,) m between a run and the truth, in Earth-fixed axes: nothing is singular there."""
    t = found.trajectory
    true = simulated.truth
    k = np.searchsorted(true.t_ns, t.t_ns)
    return np.linalg.norm(ecef(t) - ecef(true)[k], axis=1)


@pytest.fixture(scope="module")
def crossing():
    return simulate(POLE, sensor="hg1700", seed=4, rate_hz=50.0)


@pytest.fixture(scope="module")
def ideal():
    return simulate(POLE, sensor="ideal", seed=4, rate_hz=50.0, sampling="increments", gnss=None)


@pytest.mark.parametrize("azimuth", ["relative", "absolute"])
def test_minute_without_gps_across_the_pole(crossing, azimuth):
    config = Config(method="smooth", gps="aid", outage=("90:150",), azimuth=azimuth)
    found = run(crossing.log(), config)
    assert {f.code for f in found.findings} >= {"near-pole", "stop-vetoed"}
    assert np.max(apart(found, crossing)[1000:-1000]) < 10.0
    assert found.errors.outages[0].max_m < 10.0


def free_run(ideal, frame, **options):
    """Perfect sensors, given start, no aid."""
    true = ideal.truth
    place = float(true.lat[0]) / DEG, float(true.lon[0]) / DEG, float(true.height[0])
    config = Config(
        method="free", gps="none", axes="RFU", frame=frame, start_position=place,
        start_attitude=(0.0, 0.0, 0.0), **options,
    )  # fmt: skip
    return run(ideal.log(), config)


def near_pole(found):
    return [f for f in found.findings if f.code == "near-pole"]


def test_frame_enu_warns_and_wander_does_not(ideal):
    """T10 on the command's level: a free run has no velocity at its start, so it stays at rest."""
    enu = free_run(ideal, "enu")
    (finding,) = near_pole(enu)
    assert finding.level == "warning"
    assert "--frame wander" in finding.text
    wander = free_run(ideal, "wander")
    (finding,) = near_pole(wander)
    assert finding.level == "info"
    assert enu.trajectory.wander is None
    assert wander.trajectory.wander is not None


@pytest.mark.parametrize(
    ("options", "written"),
    [({}, True), ({"coords": "normal"}, False), ({"coords": "quasi"}, True)],
)
def test_coords_decide_the_columns(crossing, tmp_path, options, written):
    found = run(crossing.log(), Config(method="filter", gps="aid", frame="wander", **options))
    path = tmp_path / "trajectory.csv"
    write_trajectory(found.trajectory, path)
    header = path.read_text().splitlines()[0].split(",")
    assert (set(QUASI) <= set(header)) is written
    assert near_pole(found)[0].level == ("info" if written else "warning")


@pytest.fixture(scope="module")
def city():
    return simulate("city,duration=200,first_stop=30", sensor="hg1700", seed=1, rate_hz=50.0)


@pytest.mark.parametrize(("azimuth", "tolerance"), [("relative", 1e-6), ("absolute", 1e-2)])
def test_stop_method_in_wander_axes_is_that_in_enu(city, azimuth, tolerance):
    """The frames solve one problem. Absolute-free axes turn by 0.1 deg in a stop of 30 s: of the
    tilt taken off in it, 0.2 % is counted about the other axis."""
    enu = run(city.log()).trajectory
    wander = run(city.log(), Config(frame="wander", azimuth=azimuth)).trajectory
    assert np.max(np.linalg.norm(ecef(wander) - ecef(enu), axis=1)) < tolerance


def test_quasi_columns_at_55_degrees_only_on_request(city):
    for coords, wanted in (("auto", False), ("quasi", True)):
        found = run(city.log(), Config(method="filter", frame="wander", coords=coords))
        assert (found.trajectory.wander is not None) is wanted


@pytest.mark.parametrize("suffix", ["csv", "parquet", "json"])
def test_quasi_columns_are_read_again(crossing, tmp_path, suffix):
    found = run(crossing.log(), Config(method="filter", gps="aid", frame="wander"))
    path = tmp_path / f"trajectory.{suffix}"
    write_trajectory(found.trajectory, path)
    back = load_track(path).trajectory
    assert np.max(np.linalg.norm(ecef(back) - ecef(found.trajectory), axis=1)) < 1e-3
    turn = np.remainder(back.wander - found.trajectory.wander + np.pi, 2 * np.pi) - np.pi
    assert np.max(np.abs(turn)) < 1e-5 * DEG
    again = tmp_path / f"again.{suffix}"
    write_trajectory(back, again)
    assert np.allclose(read_trajectory(again).wander, back.wander, atol=1e-5 * DEG)


@pytest.mark.parametrize("suffix", ["kml", "gpx", "geojson", "tum", "kitti", "mcap"])
def test_other_formats_take_such_a_track(crossing, tmp_path, suffix):
    found = run(crossing.log(), Config(method="filter", gps="aid", frame="wander"))
    path = tmp_path / f"track.{suffix}"
    write_trajectory(found.trajectory, path)
    assert path.stat().st_size > 0


def test_quasi_heading_hardly_turns_over_the_pole(crossing, tmp_path):
    """The way is straight: the quasi-heading keeps its value while the heading turns round."""
    found = run(crossing.log(), Config(method="smooth", gps="aid", frame="wander"))
    path = tmp_path / "trajectory.parquet"
    write_trajectory(found.trajectory, path)
    table = pd.read_parquet(path)
    later = table.iloc[1500:-500]
    for name in ("qheading_deg", "gyro_heading_deg"):
        turn = np.unwrap(np.radians(later[name]))
        assert np.ptp(turn) < 1.0 * DEG, name
    assert np.ptp(np.unwrap(np.radians(later["heading_deg"]))) > 3.0
    # quasi-coordinates as the Earth-fixed axes say: lat_q = -asin(x / r), lon_q = atan2(y, z)
    r = ecef(found.trajectory)
    assert np.allclose(np.sin(np.radians(table["qlat_deg"])), -r[:, 0] / np.linalg.norm(r, axis=1))
    assert np.allclose(np.tan(np.radians(table["qlon_deg"])), r[:, 1] / r[:, 2], atol=1e-12)


# ---- the report ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def aided(crossing):
    return run(crossing.log(), Config(method="smooth", gps="aid", outage=("90:150",)))


def test_even_motion_from_the_start_is_no_stop_that_gps_waits_for(crossing):
    found = run(crossing.log(), Config(method="filter"))
    assert "stop-vetoed" in {f.code for f in found.findings}
    assert found.gps.until_ns - found.start_ns == pytest.approx(60e9, rel=0.01)
    assert found.errors is not None


def test_report_says_that_gps_aids(crossing, aided):
    assert headline(aided).startswith("At most ")
    assert "1 outage of up to 60 s" in headline(aided)
    assert gps_sentence(aided).startswith("GPS aids all the way")
    start = run(crossing.log(), Config(method="filter"))
    assert "without it" in headline(start)
    assert gps_sentence(start).startswith("GPS aided up to 60")


def test_pole_is_marked_on_the_map_where_the_track_passes_it(aided):
    item = map_of(aided)
    ours = next(track for track in item.tracks if track.role == "ours")
    ((_, place),) = ours.parts
    turned_back = np.diff(place[:, 1]).min()
    assert turned_back > 0.0  # the way is straight: no reflection at the pole
    closest = np.min(np.abs(place[:, 0] - item.pole.east))
    assert closest < 20.0
    assert item.pole.north == pytest.approx(3600.0, abs=20.0)  # half of 240 s at 30 m/s
    assert item.pole.text.startswith("North pole, passed at ")


def test_plots_do_not_turn_round_at_the_pole(aided):
    for panel in (velocity_panel(aided, 0), velocity_panel(aided, 1), heading_panel(aided)):
        assert "a pole is near" in panel.note
        for item in panel.curves:
            y = np.concatenate([y for _, y in item.parts])
            assert np.ptp(y) < 12.0, (panel.title, item.name)  # m/s or deg: noise of GPS


def test_no_pole_on_other_maps(city):
    found = run(city.log())
    assert map_of(found).pole is None
    assert "pole" not in velocity_panel(found, 0).note


# ---- judging -----------------------------------------------------------------------------------


def test_position_difference_at_the_pole_is_the_geodesic():
    rng = np.random.default_rng(8)
    colat = 10.0 ** rng.uniform(-7, -1, (2, 500))  # deg: a centimetre to 11 km
    lat, lon = 90.0 - colat, rng.uniform(-180.0, 180.0, (2, 500))
    found = position_difference(lat[0] * DEG, lon[0] * DEG, lat[1] * DEG, lon[1] * DEG)
    azimuth, _, distance = Geod(ellps="WGS84").inv(lon[1], lat[1], lon[0], lat[0])
    expected = distance[:, None] * np.column_stack(
        [np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth))]
    )
    # the chord's level part is short by d (d / R)^2 / 6 against the geodesic: 2 cm over 22 km
    assert np.max(np.abs(found - expected)) < 0.02
    near = distance < 1000.0
    assert np.max(np.abs(found - expected)[near]) < 1e-5


def test_interpolation_over_the_pole(ideal):
    """States 2 s apart, one on each side of the pole, against the truth between them."""
    true = ideal.truth
    few = true.rows(np.arange(0, true.size, 100))
    inside = true.rows(np.arange(0, few.size * 100 - 100, 7))
    found = interpolate(few, inside.t_ns)
    assert np.max(np.linalg.norm(ecef(found) - ecef(inside), axis=1)) < 1e-3
    v, v_true = (np.einsum("kij,kj->ki", c_en(x.lat, x.lon), x.v_n) for x in (found, inside))
    assert np.max(np.abs(v - v_true)) < 1e-3
    c, c_true = (c_en(x.lat, x.lon) @ x.c_nb for x in (found, inside))
    assert np.max(np.abs(c - c_true)) < 1e-4


def test_velocities_from_positions_alone(ideal):
    true = ideal.truth
    few = true.rows(np.arange(0, true.size, 50))
    found = velocity_of(few.t_ns, few.lat, few.lon, few.height)
    assert np.max(np.abs(found - few.v_n)[1:-1][np.abs(few.lat[1:-1] - np.pi / 2) > 2e-5]) < 0.01
    # at the metre of closest approach the axes turn by 180 degrees within a step: speed alone
    assert np.max(np.abs(np.hypot(*found[1:-1, :2].T) - 30.0)) < 0.01


def test_compare_judges_distance_velocity_and_heading_at_the_pole(ideal):
    """A track displaced by (3, 4) m and turned by 1 deg as a whole, in axes that do not turn."""
    true = ideal.truth.rows(np.arange(0, ideal.truth.size, 10))
    turn = c_from_rotvec(np.array([0.0, 0.0, 1.0]) * DEG)  # about the pole, where up is z
    r_e = ecef(true) + np.array([3.0, 4.0, 0.0])
    lat, lon, height = geodetic_from_ecef(r_e)
    c_ne = np.swapaxes(c_en(lat, lon), 1, 2)
    c_eb = turn @ c_en(true.lat, true.lon) @ true.c_nb
    v_e = np.einsum("kij,kj->ki", c_en(true.lat, true.lon), true.v_n)
    other = replace(
        true, lat=lat, lon=lon, height=height, c_nb=c_ne @ c_eb,
        v_n=np.einsum("kij,kj->ki", c_ne, v_e),
    )  # fmt: skip
    errors = compare(other, as_gnss(true), c_nb_reference=true.c_nb)
    assert np.max(np.abs(errors.horizontal - 5.0)) < 1e-3
    assert np.max(np.abs(errors.velocity)) < 1e-4
    assert np.max(np.abs(errors.heading + 1.0 * DEG)) < 1e-4  # counter-clockwise
    assert errors.distance[-1] == pytest.approx(240.0 * 30.0, rel=1e-3)


def test_course_and_path_of_fixes_without_velocity(ideal):
    true = ideal.truth.rows(np.arange(0, ideal.truth.size, 50))  # 1 Hz
    fixes = replace(as_gnss(true), v_n=None)
    errors = compare(true, fixes)
    assert errors.distance[-1] == pytest.approx(240.0 * 30.0, rel=1e-3)
    course = np.arctan2(true.v_n[:, 0], true.v_n[:, 1])
    off = np.remainder(errors.course - course + np.pi, 2 * np.pi) - np.pi
    far = np.pi / 2 - np.abs(true.lat) > 1e-5  # 64 m: two of the fixes lie nearer
    assert np.max(np.abs(off[far])) < 0.5 * DEG
