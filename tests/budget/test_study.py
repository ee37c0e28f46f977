"""Sources of a drive, the start from a file, intervals of stops, the pictures."""

from __future__ import annotations

import re
from functools import cache
from xml.etree import ElementTree

import numpy as np
import pytest
from budget_drives import TOWN, drive

from vehnav.budget import Budget, Initial, Procedure
from vehnav.budget.study import Study, interval_sweep, load_initial
from vehnav.budget_source import file_drive, scenario_drive
from vehnav.errors import ConfigError, FormatError
from vehnav.export.formats import write_trajectory
from vehnav.report.budget_page import check_output, html_file, spread, svg_file
from vehnav.report.budget_picture import growth_picture, sweep_picture
from vehnav.sensors import CATALOGUE, load_sensor
from vehnav.simulate import ideal_log, make_scenario, stamps
from vehnav.units import DEG


@cache
def study(times=(600.0,)) -> Study:
    ideal = drive(TOWN)
    return Study(ideal, Procedure(stops=ideal.stops), Initial(), times)


def test_scenario_takes_the_short_names():
    ideal = scenario_drive("town,T=150,v=12,lat=47,seed=3")
    assert ideal.duration == pytest.approx(150.0)
    assert np.hypot(*ideal.v_n[:, :2].T).max() == pytest.approx(12.0, rel=1e-3)
    assert ideal.lat[0] == pytest.approx(47.0 * DEG)
    with pytest.raises(ConfigError, match="no scenario 'twon'"):
        scenario_drive("twon,T=150")


def test_a_trajectory_file_gives_the_budget_of_its_scenario(tmp_path):
    """Through the decimals of the file and the inverse mechanization, to half a per cent."""
    motion = make_scenario(TOWN, duration=225.0).motion
    truth, _ = ideal_log(motion, stamps(225.0, 20.0), sampling="increments")
    path = tmp_path / "town.csv"
    write_trajectory(truth, path, unix_clock=True)
    found = file_drive(str(path))
    assert found is not None
    sensor = load_sensor("hg1700")
    totals = []
    for ideal in (found, drive(TOWN, 225.0)):
        way = Study(ideal, Procedure(stops=ideal.stops), Initial(), (225.0,))
        totals.append(way.budget(sensor).totals(225.0)["drms"])
    assert totals[0] == pytest.approx(totals[1], rel=5e-3)


def test_files_that_are_no_trajectory(tmp_path):
    assert file_drive("sample_logs/city.mcap") is None
    with pytest.raises(ConfigError, match="no such file"):
        file_drive(str(tmp_path / "missing.tum"))
    broken = tmp_path / "broken.csv"
    broken.write_text("time_s,lat_deg,lon_deg,heading_deg\n0,55,37,0\n1,x,37,0\n")
    with pytest.raises(FormatError, match=r"broken\.csv"):
        file_drive(str(broken))


def test_start_from_a_file(tmp_path):
    path = tmp_path / "start.toml"
    path.write_text("[initial]\nheading = 0.5\ntilt = 0.1\nvelocity = 0.2\nposition = 3\n")
    assert load_initial(path) == (Initial(0.5 * DEG, 0.1 * DEG, 0.2, 3.0), False)
    path.write_text("[initial]\nheading = 1\n")
    assert load_initial(path) == (Initial(heading=1.0 * DEG), True)
    path.write_text("[sensor]\narw = 1\n")
    assert load_initial(path) is None
    for text, words in (
        ("[initial]\nheding = 1\n", "unknown key 'heding'"),
        ("[initial]\ntilt = -1\n", r"tilt must be a number >= 0 \(deg\)"),
        ("[initial\n", "not a readable TOML"),
    ):
        path.write_text(text)
        with pytest.raises(ConfigError, match=words):
            load_initial(path)


def test_fewer_stops_are_worse():
    sweep = interval_sweep(study(), load_sensor("hg1700"), (150.0, 300.0))
    assert [item.stops for item in sweep] == [8, 4, 2, 0]
    assert [round(item.longest) for item in sweep] == [60, 135, 285, 600]
    drms = [item.budget.totals(600.0)["drms"] for item in sweep]
    assert drms == sorted(drms)
    # a leg's error grows with the square (accelerometers) to the cube (gyros) of its time, and
    # half as many independent legs add up
    ratio, legs = 285.0 / 135.0, 2.0**-0.5
    assert 0.9 * legs * ratio**2 < drms[2] / drms[1] < legs * ratio**3


def test_grades_are_ranked():
    ranked = study().ranked([s for n, s in CATALOGUE.items() if n != "ideal"], "cep95")
    figures = [budget.totals(600.0)["cep95"] for budget in ranked]
    assert figures == sorted(figures)
    assert ranked[0].sensor.name == "hg1700"


def test_gyro_bias_from_stops_helps_a_biased_sensor():
    sensor = load_sensor("mems-industrial")
    plain, better = study(), study().with_gyro_from_stops()
    bias = [way.budget(sensor).by_parameter(600.0)["gyro_bias"] for way in (plain, better)]
    before_first_stop = study((60.0,)).budget(sensor).by_parameter(60.0)["gyro_bias"]
    assert np.trace(bias[1]) < 0.6 * np.trace(bias[0])
    # what is left came about before the first stop ended at 75 s
    assert np.trace(bias[1]) == pytest.approx(np.trace(before_first_stop), rel=0.25)


def test_validity_follows_the_attitude_error():  # T23
    for grade, verdict in (
        ("hg1700", "valid"),
        ("mems-tactical", "valid"),
        ("mems-industrial", "invalid"),
    ):
        made = study().budget(load_sensor(grade))
        assert made.validity(600.0).verdict == verdict
        assert (made.valid_until() < 600.0) == (verdict == "invalid")
    industrial = study().budget(load_sensor("mems-industrial"))
    assert industrial.validity(200.0).verdict == "doubtful"
    assert "use --mc" in industrial.validity(600.0).text


def test_the_sensitivities_of_a_drive_are_found_once():
    ideal = drive(TOWN, 75.0)
    way = Study(ideal, Procedure(), Initial(), (75.0,))
    first, second = (way.budget(load_sensor(n)) for n in ("hg1700", "mems-tactical"))
    assert first.sensitivity is second.sensitivity
    assert isinstance(first, Budget)


# ---- pictures ----------------------------------------------------------------------------------


def lines_of(svg: str) -> list[np.ndarray]:
    root = ElementTree.fromstring(svg)
    paths = [p.get("d") or "" for p in root.iter() if p.get("class") == "line"]
    return [np.array([[float(x) for x in pair.split()] for pair in re.split("[ML]", d) if pair])
            for d in paths]  # fmt: skip


def test_growth_is_drawn_where_the_linear_equations_hold():
    way = study()
    ranked = way.ranked([load_sensor(n) for n in ("hg1700", "mems-industrial")], "cep95")
    item = growth_picture(way, ranked, "cep95")
    good, bad = lines_of(svg_file(item))
    assert good[-1, 0] == pytest.approx(616.0, abs=0.1)
    assert bad[-1, 0] < 600.0
    assert item.lines[1].ended
    assert len(item.spans) == 8
    # the drawn height is the logarithm of the figure
    decades = np.log10(item.lines[0].y[-1] / item.lines[0].y[100])
    per_decade = (good[100, 1] - good[-1, 1]) / decades
    again = np.log10(item.lines[0].y[-1] / item.lines[0].y[250])
    assert (good[250, 1] - good[-1, 1]) / again == pytest.approx(per_decade, rel=0.02)


def test_page_holds_the_figures_and_loads_nothing():
    way = study((300.0, 600.0))
    page = html_file(growth_picture(way, [way.budget(load_sensor("hg1700"))], "drms"))
    assert "hg1700" in page
    assert "300\u00a0s" in page
    assert "src=" not in page
    assert "http" not in page.replace("http-equiv", "")


def test_sweep_is_drawn_with_its_points():
    sweep = interval_sweep(study(), load_sensor("hg1700"), (150.0,))
    item = sweep_picture(study(), sweep, "cep95")
    text = svg_file(item)
    assert text.count('class="ring"') == 3
    assert [row[1] for row in item.rows] == ["8", "4", "0"]


def test_names_of_lines_do_not_overlap():
    placed = spread([100.0, 101.0, 102.0, 400.0, 95.0])
    assert np.min(np.diff(np.sort(placed))) >= 14.0 - 1e-9
    assert placed[3] == 400.0


def test_what_can_be_written():
    check_output("a/b.html")
    with pytest.raises(ConfigError, match=r"expected one of \.json"):
        check_output("budget.xlsx")
