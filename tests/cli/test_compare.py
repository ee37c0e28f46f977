"""``vehnav compare``: one screen, one document, bars, and errors that name what is wrong."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from drives import Circle, trajectory_of

from vehnav.cli.main import cli
from vehnav.export.formats import read_trajectory, write_trajectory


def run(*args: object) -> Result:
    return CliRunner().invoke(cli, ["compare", *map(str, args)])


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A drive on a circle, one 3 m east and 4 m north of it, and its fixes at 1 Hz as CSV."""
    tmp_path = tmp_path_factory.mktemp("compare")
    circle = Circle()
    t = np.arange(0.0, 120.005, 0.02)
    paths = {}
    for name, moved in (("good", (0.0, 0.0, 0.0)), ("off", (3.0, 4.0, 0.0))):
        paths[name] = tmp_path / f"{name}.csv"
        made = trajectory_of(t, circle.enu(t) + np.array(moved), circle.v(t), circle.heading(t))
        write_trajectory(made, paths[name])
    fixes = trajectory_of(t, circle.enu(t), circle.v(t), circle.heading(t)).rows(slice(0, None, 50))
    paths["gps"] = tmp_path / "gps.csv"
    rows = zip(fixes.t_ns.tolist(), np.degrees(fixes.lat), np.degrees(fixes.lon), strict=True)
    text = [f"{ns // 10**9}.{ns % 10**9:09d},{lat:.10f},{lon:.10f},30" for ns, lat, lon in rows]
    paths["gps"].write_text("\n".join(["time_s,lat_deg,lon_deg,height_m", *text, ""]))
    return paths


def test_one_screen(files) -> None:
    result = run(files["off"], files["gps"])
    assert result.exit_code == 0, result.stderr
    lines = result.stdout.splitlines()
    assert len(lines) <= 24
    assert "121 of 121 judged" in result.stdout
    row = next(line for line in lines if line.startswith("horizontal m"))
    assert row.split()[2:] == ["5.00"] * 6
    assert "1200 m in 120.0 s" in result.stdout
    assert result.stderr == ""


def test_json_is_one_document(files) -> None:
    result = run(files["off"], files["gps"], "--json")
    document = json.loads(result.stdout)
    assert document["version"] == 1
    (row,) = document["trajectories"]
    assert row["errors"]["horizontal_m"]["rms"] == pytest.approx(5.0, abs=1e-3)
    assert row["errors"]["east_m"]["mean"] == pytest.approx(3.0, abs=1e-3)
    assert row["fixes"]["judged"] == 121
    assert row["errors"]["heading_deg"] is None


def test_several_trajectories_in_one_table(files) -> None:
    result = run(files["good"], files["off"], files["gps"])
    assert result.exit_code == 0
    table = result.stdout.splitlines()[-2:]
    assert float(table[0].split()[1]) < 0.001
    assert float(table[1].split()[1]) == 5.0


def test_a_trajectory_as_truth_judges_heading_and_velocity(files) -> None:
    document = json.loads(run(files["off"], files["good"], "--json").stdout)
    errors = document["trajectories"][0]["errors"]
    assert errors["heading_deg"]["max"] < 1e-4
    assert errors["velocity_m_s"]["max"] < 1e-4
    assert errors["horizontal_m"]["rms"] == pytest.approx(5.0, abs=1e-3)


@pytest.mark.parametrize(
    ("bar", "status"),
    [
        ("horizontal_m.max=5.1", 0),
        ("horizontal_m.max=4.9", 1),
        ("errors.horizontal_m.max=4.9", 1),
        ("cep95_m=4", 1),
        ("heading_deg.max=1", 1),  # undefined: not shown to be met
    ],
)
def test_bars(files, bar: str, status: int) -> None:
    result = run(files["off"], files["gps"], "--max", bar)
    assert result.exit_code == status, result.stderr
    assert ("missed" in result.stderr) == (status == 1)
    assert result.stdout  # the table is printed either way


@pytest.mark.parametrize(
    ("bar", "text"),
    [
        ("horizontl_m.max=5", "did you mean 'horizontal_m.max'"),
        ("horizontal_m=5", "a group: rms"),
        ("horizontal_m.max", "expected METRIC=VALUE"),
        ("horizontal_m.max=x", "not a valid number"),
    ],
)
def test_wrong_bars(files, bar: str, text: str) -> None:
    result = run(files["off"], files["gps"], "--max", bar)
    assert result.exit_code == 2
    assert text in result.stderr


def test_from_and_to(files) -> None:
    result = run(files["off"], files["gps"], "--from", 60, "--to", "2024-03-26T20:11:30Z", "--json")
    (row,) = json.loads(result.stdout)["trajectories"]
    # 20:10:00 + 90 s is the last one; 60 the first
    assert row["fixes"]["judged"] == 31
    assert row["duration_s"] == pytest.approx(30.0)
    assert row["errors"]["distance_m"] == pytest.approx(300.0, rel=5e-3)


def test_gps_time_offset(files) -> None:
    late = json.loads(run(files["good"], files["gps"], "--gps-time-offset", 1, "--json").stdout)
    (row,) = late["trajectories"]
    assert row["time_offset_s"] == 1.0
    # the fixes stand 10 m of arc behind the trajectory: a chord of 200 sin(0.05)
    assert row["errors"]["horizontal_m"]["rms"] == pytest.approx(200 * np.sin(0.05), abs=1e-3)


def test_lever_arm(files) -> None:
    arm = run(files["good"], files["gps"], "--lever-arm", "1.5,0,0", "--json")
    errors = json.loads(arm.stdout)["trajectories"][0]["errors"]
    assert errors["cross_m"]["mean"] == pytest.approx(1.5, abs=0.02)


def test_align_is_said(files) -> None:
    result = run(files["off"], files["gps"], "--align", "yaw+translation")
    assert "ALIGNED   yaw+translation" in result.stdout
    row = next(line for line in result.stdout.splitlines() if line.startswith("horizontal m"))
    assert float(row.split()[2]) < 0.01
    document = json.loads(run(files["off"], files["gps"], "--align", "yaw", "--json").stdout)
    assert document["trajectories"][0]["errors"]["align"] == "yaw"


def test_outages(files) -> None:
    result = run(files["off"], files["gps"], "--outage", "20:40", "--outage", "60:70", "--json")
    first, second = json.loads(result.stdout)["trajectories"][0]["errors"]["outages"]
    assert (first["start_s"], first["length_s"], first["fixes"]) == (20.0, 20.0, 21)
    assert first["distance_m"] == pytest.approx(200.0, rel=1e-2)
    assert second["max_m"] == pytest.approx(5.0, abs=1e-3)
    text = run(files["off"], files["gps"], "--outage", "20:40").stdout
    assert "outage       20 s, 20 s long, 200 m: rms 5.00" in text
    assert run(files["off"], files["gps"], "--outage", "40:20").exit_code == 2


def test_offset_auto_on_a_circle_tells_nothing(files) -> None:
    """Constant speed on a constant radius: a delay looks like a turn; it must say so."""
    result = run(files["good"], files["gps"], "--gps-time-offset", "auto")
    assert result.exit_code == 0
    assert "+0.000 s added" in result.stdout
    assert "gps-delay" in result.stderr


def test_what_the_screen_says_of_stops_sigmas_and_noise(files, tmp_path: Path) -> None:
    """Standing at 0-20 s, then 20 m north of the fixes, sigma 30 m, fixes good to 0.5 m."""
    made = read_trajectory(files["good"])
    t = (made.t_ns - made.t_ns[0]) * 1e-9
    lat = made.lat + np.where(t > 20.0, (t - 20.0) * 0.2, 0.0) / 6.37e6
    sigma, angle = np.full((made.size, 3), 30.0), np.full(made.size, 0.01)
    told = replace(made, lat=lat, stopped=t <= 20.0, sigma_pos=sigma, sigma_heading=angle)
    write_trajectory(told, tmp_path / "told.csv")
    rows = files["gps"].read_text().splitlines()
    head = rows[0] + ",sigma_east_m,sigma_north_m,sigma_up_m"
    text = "\n".join([head, *(f"{row},0.3,0.4,1" for row in rows[1:]), ""])
    (tmp_path / "sure.csv").write_text(text)
    shown = run(tmp_path / "told.csv", tmp_path / "sure.csv").stdout
    assert "0.500 m uncertain" in shown
    # 0.2 m/s since the end of the stop: 2, 6, 12 m after 10, 30, 60 s (meridian radius 6.36e6)
    drift = next(line for line in shown.splitlines() if line.startswith("drift after"))
    found = [float(x) for x in re.findall(r"s ([0-9.]+) m", drift)]
    assert found == pytest.approx([2.0, 6.0, 12.0], rel=5e-3)
    assert drift.endswith("(medians of 1 legs)")
    assert "in 1,2,3 sigma 100 / 100 / 100 %" in shown
    against_truth = json.loads(run(tmp_path / "told.csv", files["good"], "--json").stdout)
    calibration = against_truth["trajectories"][0]["errors"]["calibration"]
    assert calibration["rms"]["heading"] < 1e-3
    bad = run(tmp_path / "told.csv", tmp_path / "sure.csv", "--gps-time-offset", "soon")
    assert bad.exit_code == 2


def test_gps_in_any_format(files, tmp_path: Path) -> None:
    """Our own exports come back as references: GPX (thinned to 0.2 m), Foxglove's MCAP, TUM."""
    for suffix, within in ((".gpx", 0.01), (".mcap", 1e-3), (".tum", 1e-3), (".kitti", 1e-3)):
        write_trajectory(read_trajectory(files["good"]), tmp_path / f"a{suffix}")
        document = json.loads(run(files["off"], tmp_path / f"a{suffix}", "--json").stdout)
        errors = document["trajectories"][0]["errors"]
        assert errors["horizontal_m"]["rms"] == pytest.approx(5.0, abs=within), suffix
        assert document["reference"]["file"].endswith(suffix)


def test_what_the_reader_rejects_is_named(files, tmp_path: Path) -> None:
    """A jump of 5 km and back in one second is no fix; it is counted, and does not judge."""
    rows = files["gps"].read_text().splitlines()
    fields = rows[50].split(",")
    fields[1] = f"{float(fields[1]) + 0.045:.10f}"
    (tmp_path / "jump.csv").write_text("\n".join([*rows[:50], ",".join(fields), *rows[51:], ""]))
    result = run(files["off"], tmp_path / "jump.csv", "--json")
    document = json.loads(result.stdout)
    assert document["trajectories"][0]["fixes"]["total"] == 120
    assert document["trajectories"][0]["errors"]["horizontal_m"]["max"] < 5.01
    assert any("jump" in f["text"] for f in document["reference"]["findings"])
    assert "jump" in result.stderr


def test_wrong_inputs(files, tmp_path: Path) -> None:
    assert run(files["gps"]).exit_code == 2
    missing = run(tmp_path / "none.csv", files["gps"])
    assert missing.exit_code == 2
    assert "none.csv: no such file" in missing.stderr
    (tmp_path / "empty.csv").touch()
    assert run(files["good"], tmp_path / "empty.csv").exit_code == 2
    text = files["gps"].read_text().splitlines()
    (tmp_path / "two.csv").write_text("\n".join(text[:3]) + "\n")
    two = run(files["good"], tmp_path / "two.csv")
    assert two.exit_code == 2
    assert "only 2 GPS fixes" in two.stderr
    assert "two.csv" in two.stderr


def test_every_kind_of_file_on_both_sides(files, tmp_path: Path, shared_data: Path) -> None:
    """Real files: RTKLIB text, MCAP, truth CSV; a file against itself has no error."""
    drive = shared_data / "drive_0708"
    document = json.loads(run(drive / "gnss.pos", drive / "drive_0708.mcap", "--json").stdout)
    errors = document["trajectories"][0]["errors"]
    assert errors["horizontal_m"]["max"] < 1e-3  # the same fixes, once as text
    assert 3950 < errors["distance_m"] < 4150  # README of the log: 4.05 km
    assert errors["reference_sigma_m"] < 0.2  # mostly RTK
    truth = shared_data / "kitti_oxts" / "2011_09_30_drive_0018_truth.csv"
    itself = json.loads(run(truth, truth, "--json").stdout)["trajectories"][0]["errors"]
    assert itself["heading_deg"]["max"] < 1e-9
    assert 2150 < itself["distance_m"] < 2250  # README: 2.2 km
