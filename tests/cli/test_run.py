"""``vehnav run`` and ``vehnav stops``: outputs, exit status and words of the contract."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import jsonschema
import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner, Result

from tests.logs_for_tests import straight_log
from vehnav.cli.main import cli
from vehnav.report.schema import schema

HEADER = (
    "time_s lat_deg lon_deg height_m v_east_m_s v_north_m_s v_up_m_s heading_deg pitch_deg "
    "roll_deg stopped"
)


def vehnav(*args: object) -> Result:
    return CliRunner().invoke(cli, [str(a) for a in args])


def table(seconds: float = 160.0, rate: float = 50.0) -> pd.DataFrame:
    """The made drive as vehnav's own CSV, with its GPS in the same file."""
    log = straight_log(seconds=seconds, rate=rate)
    assert log.imu is not None
    data = {"t_ns": log.imu.t_ns}
    for k, axis in enumerate("xyz"):
        data[f"gyro_{axis}"] = log.imu.gyro[:, k]
        data[f"accel_{axis}"] = log.imu.accel[:, k]
    return pd.DataFrame(data)


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """drive.csv and, beside it, its fixes."""
    folder = tmp_path_factory.mktemp("drive")
    table().to_csv(folder / "drive.csv", index=False)
    gnss = straight_log(rate=50.0).gnss
    assert gnss is not None
    rows = {"t_ns": gnss.t_ns, "lat_deg": np.degrees(gnss.lat), "lon_deg": np.degrees(gnss.lon)}
    pd.DataFrame({**rows, "height_m": gnss.height}).to_csv(folder / "drive.gps.csv", index=False)
    return folder / "drive.csv"


@pytest.fixture(scope="module")
def done(drive, tmp_path_factory) -> tuple[Result, Path]:
    out = tmp_path_factory.mktemp("out") / "drive.vehnav"
    return vehnav("run", drive, "--out-dir", out), out


# ---- what it writes and prints -----------------------------------------------------------------


def test_the_three_files_and_one_screen(done) -> None:
    result, out = done
    assert result.exit_code == 0, result.output
    assert sorted(p.name for p in out.iterdir()) == ["report.html", "report.json", "trajectory.csv"]
    lines = result.stdout.splitlines()
    assert len(lines) <= 24
    assert all(len(line) <= 120 for line in lines if str(out) not in line and "/" not in line)
    for word in ("stops", "free (no correction)", "both, as published", "default", "% of the"):
        assert word in result.stdout
    assert "none of them judges" in result.stdout  # what GPS was used for


def test_trajectory_csv_is_the_contract(done) -> None:
    _, out = done
    with (out / "trajectory.csv").open() as file:
        rows = list(csv.reader(file))
    assert rows[0][:11] == HEADER.split()
    assert rows[0][11:] == ["sigma_east_m", "sigma_north_m", "sigma_up_m", "sigma_heading_deg"]
    assert len(rows) == 160 * 50 + 1
    assert rows[1][0] == "1700000000.000000000"  # nine decimals, from int ns
    assert {row[10] for row in rows[1:]} == {"0", "1"}


def test_report_json_fits_its_schema(done) -> None:
    _, out = done
    document = json.loads((out / "report.json").read_text())
    jsonschema.validate(document, schema())
    broken = {**document, "version": 2}
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(broken, schema())
    methods = list(document["errors"]["methods"])
    assert methods == ["free", "levelling", "reset", "as_published", "default"]
    assert document["gps"]["used_for"] == ["position", "heading"]
    assert document["gps"]["fixes_judged"] > 50
    assert document["input"]["axes"] == "RFU"
    default = document["errors"]["methods"]["default"]["horizontal_m"]
    assert default == document["errors"]["horizontal_m"]


def test_json_prints_the_same_document_and_nothing_else(drive, done, tmp_path) -> None:
    result = vehnav("run", drive, "--json", "--out-dir", tmp_path)
    printed = json.loads(result.stdout)
    written = json.loads((done[1] / "report.json").read_text())
    assert printed == written


def test_outputs_by_suffix_and_rate(drive, tmp_path) -> None:
    outputs = [tmp_path / f"track{s}" for s in (".tum", ".gpx", ".geojson", ".json", ".html")]
    named = [x for path in outputs for x in ("-o", path)]
    result = vehnav(
        "run", drive, *named, "--output-rate", 5, "--out-dir", tmp_path / "r", "--quiet"
    )
    assert result.exit_code == 0, result.output
    assert result.stdout == ""
    assert all(path.stat().st_size > 0 for path in outputs)
    assert len((tmp_path / "track.tum").read_text().splitlines()) == pytest.approx(801, abs=1)


@pytest.mark.parametrize(
    ("name", "said"),
    [("track.docx", ".docx"), ("results", "--out-dir"), ("no/track.csv", "no folder")],
)
def test_outputs_that_cannot_be_written_are_refused_before_the_work(
    drive, tmp_path, name, said
) -> None:
    wrong = vehnav("run", drive, "-o", tmp_path / name, "--out-dir", tmp_path / "q")
    assert wrong.exit_code == 2
    assert said in wrong.stderr
    assert not (tmp_path / "q").exists()


def test_two_logs_get_a_folder_each(drive, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("a", "b"):
        shutil.copy(drive, f"{name}.csv")
        shutil.copy(drive.with_name("drive.gps.csv"), f"{name}.gps.csv")
    result = vehnav("run", "a.csv", "b.csv", "--quiet")
    assert result.exit_code == 0
    assert Path("a.vehnav/report.json").is_file()
    assert Path("b.vehnav/report.json").is_file()


@pytest.mark.parametrize(
    ("option", "method"),
    [
        (("--as-published",), "as_published"),
        (("--no-reset",), "levelling"),
        (("--no-levelling",), "reset"),
        (("--method", "free"), "free"),
        ((), "default"),
    ],
)
def test_every_method_of_the_table_can_be_the_result(drive, tmp_path, option, method) -> None:
    result = vehnav("run", drive, *option, "--json", "--out-dir", tmp_path)
    errors = json.loads(result.stdout)["errors"]
    assert errors["horizontal_m"]["end"] == pytest.approx(
        errors["methods"][method]["horizontal_m"]["end"], abs=1e-9
    )


def test_levelling_rate_too_high_for_the_step_is_refused(drive, tmp_path) -> None:
    result = vehnav("run", drive, "--levelling-rate", 60, "--out-dir", tmp_path)
    assert result.exit_code == 2
    assert "levelling" in result.stderr


def test_a_sensor_weighs_the_stops_and_sets_their_threshold(drive, tmp_path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('[sensor]\nbase = "hg1700"\ngyro_walk = 60.0\nstop_threshold = 0.001\n')
    default = json.loads(vehnav("run", drive, "--json", "--out-dir", tmp_path / "a").stdout)
    named = vehnav("run", drive, "--sensor", "hg1700", "--json", "--out-dir", tmp_path / "b")
    assert named.exit_code == 0, named.stderr
    noise = json.loads(named.stdout)["noise"]
    assert noise["accel_bias_m_s2"] == pytest.approx(9.80665e-3)  # 1 mg
    assert default["noise"]["accel_bias_m_s2"] == pytest.approx(0.02)
    strict = vehnav("run", drive, "--sensor", file, "--out-dir", tmp_path / "c")
    assert strict.exit_code == 2  # no stop under its threshold
    assert "threshold 0.00" in strict.stderr
    given = vehnav(
        "run", drive, "--sensor", file, "--stop-threshold", 0.3, "--out-dir", tmp_path / "d"
    )
    assert given.exit_code == 0
    walk = json.loads((tmp_path / "d" / "report.json").read_text())["noise"]
    assert walk["gyro_bias_walk_deg_s_sqrt_s"] == pytest.approx(60.0 / 3600.0 / 60.0)
    assert vehnav("run", drive, "--sensor", "nonsense", "--out-dir", tmp_path).exit_code == 2


def test_the_delay_of_the_gps_is_taken_out_on_request(sample_logs, tmp_path) -> None:
    """Fixes stamped 0.8 s late: the track says so, auto takes it out and says what it used."""
    late = pd.read_csv(sample_logs / "city.gps.csv")
    late["t_ns"] += 800_000_000
    late.to_csv(tmp_path / "late.csv", index=False)
    common = ("run", sample_logs / "city.csv", "--gps-file", tmp_path / "late.csv", "--json")
    plain = json.loads(vehnav(*common, "--out-dir", tmp_path / "a").stdout)
    auto = json.loads(
        vehnav(*common, "--gps-time-offset", "auto", "--out-dir", tmp_path / "b").stdout
    )
    assert "gps-delay" in {f["code"] for f in plain["input"]["findings"]}
    assert plain["gps"]["offset_s"] == 0.0
    assert auto["gps"]["offset_s"] == pytest.approx(-0.8, abs=0.2)
    assert auto["gps"]["used_for"] == ["position", "heading", "time offset"]
    jsonschema.validate(auto, schema())
    refused = vehnav("stops", sample_logs / "city.csv", "--gps-time-offset", "auto")
    assert refused.exit_code == 2
    assert "needs a track" in refused.stderr


# ---- bad input ---------------------------------------------------------------------------------


def changed(tmp_path: Path, frame: pd.DataFrame) -> Path:
    path = tmp_path / "changed.csv"
    frame.to_csv(path, index=False)
    return path


def test_missing_empty_and_wrong_files(tmp_path) -> None:
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "text.mcap").write_text("not an mcap\n" * 100)
    (tmp_path / "random.bin").write_bytes(bytes(range(256)) * 20)
    for name, said in (
        ("missing.mcap", "no such file"),
        ("empty.mcap", "0 bytes"),
        ("text.mcap", "text"),
        ("random.bin", "neither text nor"),
    ):
        result = vehnav("run", tmp_path / name, "--out-dir", tmp_path / "out")
        assert result.exit_code == 2, name
        assert said in result.stderr
        assert name in result.stderr
        assert "Traceback" not in result.stderr
    assert not (tmp_path / "out").exists()


def test_a_table_without_gyro_says_what_it_has(tmp_path) -> None:
    frame = table().drop(columns=["gyro_x", "gyro_y", "gyro_z"])
    result = vehnav("run", changed(tmp_path, frame), "--out-dir", tmp_path / "out")
    assert result.exit_code == 2
    assert "accel_x" in result.stderr
    assert "--columns" in result.stderr


def test_other_names_and_units_by_columns(tmp_path, drive) -> None:
    frame = table().rename(columns=lambda c: c.replace("gyro_", "w").replace("accel_", "a"))
    for axis in "xyz":
        frame[f"w{axis}"] = np.degrees(frame[f"w{axis}"])
        frame[f"a{axis}"] /= 9.80665
    columns = "t_ns=t_ns," + ",".join(
        f"{long}_{axis}={short}{axis}"
        for long, short in (("gyro", "w"), ("accel", "a"))
        for axis in "xyz"
    )
    result = vehnav(
        "run", changed(tmp_path, frame), "--columns", columns, "--gyro-unit", "deg/s",
        "--accel-unit", "g", "--axes", "RFU", "--gps-file", drive.with_name("drive.gps.csv"),
        "--json", "--out-dir", tmp_path / "out",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    end = json.loads(result.stdout)["errors"]["horizontal_m"]["end"]
    reference = vehnav("run", drive, "--json", "--out-dir", tmp_path / "ref")
    assert end == pytest.approx(json.loads(reference.stdout)["errors"]["horizontal_m"]["end"], 1e-4)


def codes(result: Result) -> dict[str, dict]:
    return {row["code"]: row for row in json.loads(result.stdout)["input"]["findings"]}


def test_troubled_rows_become_findings(tmp_path) -> None:
    """NaN rows, repeated and backward stamps: counted, timed, survived."""
    frame = table()
    frame.loc[3000:3002, "gyro_y"] = np.nan
    frame.loc[5000, "t_ns"] = frame.loc[4999, "t_ns"]
    swapped = frame.loc[6000, "t_ns"], frame.loc[6001, "t_ns"]
    frame.loc[6001, "t_ns"], frame.loc[6000, "t_ns"] = swapped
    result = vehnav("run", changed(tmp_path, frame), "--json", "--out-dir", tmp_path / "out")
    assert result.exit_code in (0, 3), result.stderr
    found = codes(result)
    assert "3" in found["non-finite"]["text"]
    assert found["non-finite"]["start_s"] == pytest.approx(60.0, abs=0.1)
    assert "duplicate-stamps" in found
    assert "backward-stamps" in found
    assert "NaN" not in (tmp_path / "out" / "trajectory.csv").read_text()
    assert "nan" not in (tmp_path / "out" / "trajectory.csv").read_text()
    strict = vehnav("run", tmp_path / "changed.csv", "--strict", "--out-dir", tmp_path / "s")
    assert strict.exit_code == 1


def test_errors_after_a_long_gap_are_given_separately(tmp_path, drive) -> None:
    frame = table()
    t = (frame.t_ns - frame.t_ns[0]) * 1e-9
    path = changed(tmp_path, frame[(t < 100.0) | (t > 103.0)])
    shutil.copy(drive.with_name("drive.gps.csv"), tmp_path / "changed.gps.csv")
    result = vehnav("run", path, "--json", "--out-dir", tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    document = json.loads(result.stdout)
    (gap,) = document["errors"]["after_gaps"]
    assert gap["start_s"] == pytest.approx(99.98, abs=0.05)
    next_stop = min(s["start_s"] for s in document["stops"] if s["start_s"] > 100.0)
    assert gap["start_s"] + gap["length_s"] == pytest.approx(next_stop, abs=0.05)
    assert gap["fixes"] > 30
    screen = vehnav("run", path, "--out-dir", tmp_path / "out").stdout
    assert "from the gap at 100.0 s to the next stop" in screen
    jsonschema.validate(document, schema())


def test_a_slow_imu_is_refused_with_the_reason(tmp_path, shared_data) -> None:
    result = vehnav(
        "run", shared_data / "boston_ramirez_1hz" / "imu.csv", "--out-dir", tmp_path / "o"
    )
    assert result.exit_code == 2
    assert "1.00 Hz" in result.stderr


def test_a_log_without_imu_names_its_topics(tmp_path, shared_data) -> None:
    log = shared_data / "mcap_by_others" / "hansmann_navsatfix_50min.mcap"
    result = vehnav("run", log, "--out-dir", tmp_path / "o")
    assert result.exit_code == 2
    assert "sensor_msgs/msg/NavSatFix" in result.stderr


def test_a_folder_that_cannot_be_written_is_named(drive, tmp_path) -> None:
    (tmp_path / "file").touch()
    result = vehnav("run", drive, "--out-dir", tmp_path / "file" / "out")
    assert result.exit_code == 2
    assert "file" in result.stderr


# ---- stops -------------------------------------------------------------------------------------


def test_stops_lists_and_scores_them(drive) -> None:
    result = vehnav("stops", drive)
    assert result.exit_code == 0
    assert "3 stops" in result.stdout
    assert "found" in result.stdout
    document = json.loads(vehnav("stops", drive, "--json").stdout)
    assert len(document["stops"]) == 3
    assert document["gps_score"]["wrong"] == 0.0
    assert document["threshold_deg_s"] == pytest.approx(0.30)


def test_stops_with_another_threshold_and_statistic(drive) -> None:
    tight = json.loads(vehnav("stops", drive, "--stop-threshold", 0.001, "--json").stdout)
    assert tight["stops"] == []
    assert tight["quietest"]["rate_deg_s"] > 0.001
    paper = json.loads(vehnav("stops", drive, "--stop-statistic", "rms", "--json").stdout)
    assert paper["statistic"] == "rms"
    assert len(paper["stops"]) == 3


def test_config_file_and_print_config(drive, tmp_path) -> None:
    config = tmp_path / "vehnav.toml"
    config.write_text("[method]\nas_published = true\n[stops]\nstop_dwell = 2.0\n")
    shown = vehnav("run", "--config", config, "--print-config")
    assert "as_published = true" in shown.stdout
    result = vehnav("run", drive, "--config", config, "--json", "--out-dir", tmp_path / "o")
    assert json.loads(result.stdout)["config"]["as_published"] is True
    config.write_text("[stops]\nstop_dwel = 2.0\n")
    wrong = vehnav("run", drive, "--config", config, "--out-dir", tmp_path / "o")
    assert wrong.exit_code == 2
    assert "stop_dwell" in wrong.stderr
