"""``vehnav budget``: every question once, its exit status, its files."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from vehnav.cli.main import cli, status_of

DRIVE = "scenario:town,T=150"


def call(*args: str) -> Result:
    return CliRunner().invoke(cli, ["budget", *args])


def document(*args: str) -> dict:
    found = call(*args, "--json")
    assert found.exit_code == 0, found.output
    return json.loads(found.stdout)


def test_forward_table_and_totals():
    found = call(DRIVE, "--sensor", "hg1700", "--at", "60,150")
    assert found.exit_code == 0, found.output
    lines = found.stdout.splitlines()
    assert lines[0] == "town,T=150: 150 s, 1.44 km; 2 of 2 stops with reset and levelling"
    assert any(line.startswith("arw ") for line in lines)
    head = next(k for k, line in enumerate(lines) if "TOTAL at" in line)
    assert [line.split()[0] for line in lines[head + 1 : head + 3]] == ["60", "150"]
    assert lines[-1].startswith("linear: attitude error 0.00")


def test_document_adds_up():
    found = document(DRIVE, "--sensor", "hg1700", "--at", "60,150")
    assert found["version"] == 1
    assert (found["time_s"], found["model"], found["vertical"]) == (150.0, "full", "held")
    assert sum(row["share"] for row in found["sources"]) == pytest.approx(1.0)
    squares = sum(row["radial_m"] ** 2 for row in found["sources"])
    assert squares**0.5 == pytest.approx(found["total"]["drms_m"])
    assert len(found["sources"]) == 31 + 2
    assert found["validity"]["linear_ok"] is True
    assert found["curve"]["cep95_m"][-1] == pytest.approx(found["total"]["cep95_m"])
    assert [at["time_s"] for at in found["at"]] == [60.0, 150.0]


def test_csv_holds_every_source():
    found = call(DRIVE, "--sensor", "hg1700", "--format", "csv")
    rows = [line.split(",") for line in found.stdout.splitlines()]
    assert rows[0][:4] == ["time_s", "source", "sigma", "unit"]
    assert rows[0][4:] == ["east_m", "north_m", "radial_m", "share"]
    total = next(row for row in rows if row[1] == "TOTAL")
    squares = sum(float(row[6]) ** 2 for row in rows[1:] if row[1] != "TOTAL")
    assert squares**0.5 == pytest.approx(float(total[6]), rel=1e-5)


def test_the_readme_shows_what_the_command_prints(sample_logs: Path, monkeypatch):
    root = sample_logs.parent
    monkeypatch.chdir(root)
    text = (root / "README.md").read_text(encoding="utf-8")
    command = "$ vehnav budget sample_logs/city.mcap --at 60,150,300\n"
    shown = text.split(command)[1].split("```")[0].rstrip().splitlines()
    printed = call("sample_logs/city.mcap", "--at", "60,150,300").stdout.splitlines()
    number = re.compile(r"\d+\.?\d*")
    for ours, theirs in zip(printed[: len(shown)], shown, strict=True):
        assert number.sub("#", ours).split() == number.sub("#", theirs).split()
        numbers = [[float(x) for x in number.findall(line)] for line in (ours, theirs)]
        assert numbers[0] == pytest.approx(numbers[1], rel=0.02)


def test_models_and_vertical_channel_differ():
    drms = {
        (model, vertical): document(
            DRIVE, "--sensor", "hg1700", "--model", model, "--vertical", vertical
        )["total"]["drms_m"]
        for model, vertical in (("full", "held"), ("full", "free"), ("simplified", "held"))
    }
    assert len({round(x, 6) for x in drms.values()}) == 3


def test_monte_carlo_stands_beside_the_linear_totals():
    found = document(DRIVE, "--sensor", "mems-tactical", "--mc", "30", "--seed", "4")
    assert found["mc"]["runs"] == 30
    assert found["mc"]["at"][0]["linear_over_mc"] == pytest.approx(1.0, abs=0.35)
    same = document(DRIVE, "--sensor", "mems-tactical", "--mc", "30", "--seed", "4")
    assert same["mc"] == found["mc"]


def test_require_is_a_gate():
    assert call(DRIVE, "--sensor", "hg1700", "--require", "1000").exit_code == 0
    found = call(DRIVE, "--sensor", "hg1700", "--require", "1")
    assert found.exit_code == 1
    assert "missed: cep95" in found.stderr


def test_solve_and_its_check():
    found = document(DRIVE, "--sensor", "hg1700", "--require", "40", "--solve", "equal")
    inverse = found["inverse"]
    assert inverse["feasible"] is True
    assert inverse["achieved_m"] == pytest.approx(40.0, rel=1e-6)
    rows = {row["parameter"]: row for row in inverse["allowed"]}
    assert set(rows) >= {"gyro_bias", "arw", "heading"}
    assert rows["gyro_bias"]["value"] > 1.0  # deg/h, what the hg1700 has
    assert "hg1700" in rows["gyro_bias"]["grades"]
    shown = call(DRIVE, "--require", "40", "--solve", "equal").stdout
    assert "every other source and start error is none" in shown
    assert "l3g4200d" not in rows["gyro_bias"]["grades"]
    text = call(DRIVE, "--require", "40", "--solve", "scale", "--mc", "5").stdout
    assert "start error is none" not in text
    assert "achieved: cep95 40 m at 150 s" in text
    assert "Monte Carlo: 5 runs" in text


def test_infeasible_is_a_missed_bar():
    found = call(DRIVE, "--stops", "none", "--require", "1", "--solve", "arw")
    assert found.exit_code == 1
    assert "infeasible: the other sources alone make" in found.stdout


def test_catalogue_ranked_with_a_picture(tmp_path: Path):
    page, picture = tmp_path / "which.html", tmp_path / "which.svg"
    found = call(DRIVE, "-o", str(page), "-o", str(picture), "--require", "100")
    assert found.exit_code == 0, found.output
    names = [line.split()[0] for line in found.stdout.splitlines() if line[:4] in ("hg17", "mems")]
    assert names[0] == "hg1700"
    assert "mems-industrial" in names
    assert "cep95 of 100 m at 150 s: hg1700" in found.stdout
    assert page.read_text().startswith("<!doctype html>")
    assert picture.read_text().startswith("<svg")
    grades = document(DRIVE)["grades"]
    assert grades[0]["sensor"] == "hg1700"


def test_intervals_of_stops(tmp_path: Path):
    table = tmp_path / "sweep.txt"
    found = document(DRIVE, "--stop-intervals", "100", "-o", str(table))
    assert [item["every_s"] for item in found["intervals"]] == [0.0, 100.0, None]
    drms = [item["total"]["drms_m"] for item in found["intervals"]]
    assert drms == sorted(drms)
    assert "longest leg s" in table.read_text()


def test_start_and_stops_by_option(tmp_path: Path):
    start = tmp_path / "start.toml"
    start.write_text("[initial]\nheading = 2\nposition = 0\nvelocity = 0\n")
    found = document(DRIVE, "--sensor", "hg1700", "--init", str(start), "--stops", "every:100")
    assert found["initial"] == {
        "levelled": True, "heading_deg": pytest.approx(2.0), "velocity_m_s": 0.0, "position_m": 0.0,
    }  # fmt: skip
    assert len(found["stops"]) == 1
    given = document(DRIVE, "--sensor", "hg1700", "--init", "given", "--stops", "none")
    assert given["initial"]["tilt_deg"] == pytest.approx(0.02)
    assert given["stops"] == []


def test_a_log_is_run_first(sample_logs: Path):
    found = document(str(sample_logs / "city.mcap"), "--sensor", "mems-industrial")
    assert found["duration_s"] == pytest.approx(300.0, abs=1.0)
    assert found["distance_m"] == pytest.approx(1840.0, rel=0.03)
    assert len(found["stops"]) == 5
    assert found["initial"]["levelled"] is True


def test_one_config_file_serves_run_and_budget(tmp_path: Path):
    config = tmp_path / "both.toml"
    config.write_text('[method]\nvertical = "clamp"\nsensor = "hg1700"\n')
    found = document(DRIVE, "--config", str(config))
    assert (found["vertical"], found["sensor"]) == ("held", "hg1700")


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (("--at", "200"), "the drive ends after 150.0 s"),
        (("--at", "0"), "expected seconds above zero"),
        (("--stops", "every:x"), "expected auto, none or every:S"),
        (("--solve", "equal"), "--solve needs --require"),
        (("--solve", "equal", "--require", "5", "--legs"), "one question at a time"),
        (("--sensor", "all", "--mc", "3"), "--mc checks one sensor"),
        (("--sensor", "hg17000"), "did you mean 'hg1700'"),
        (("--sensor", "hg1700", "-o", "budget.xlsx"), "expected one of .json"),
        (("--format", "csv"), "csv is the table of sources"),
        (("--legs",), "--legs compares with GPS: give a log"),
        (("--init", "nowhere.toml"), "no such file"),
    ],
)
def test_bad_questions_say_what_to_do(args, words, capsys):
    assert status_of(lambda: cli.main(["budget", DRIVE, *args], standalone_mode=False)) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("args", "written", "refused", "words"),
    [
        ((), "b.html", "b.csv", "csv is the table of sources of one sensor"),
        (("--stop-intervals", "100"), "b.svg", "b.csv", "csv is the table of sources"),
        (("--solve", "equal", "--require", "40"), "b.txt", "b.CSV", "csv is the table of sources"),
        (("--solve", "equal", "--require", "40"), "b.txt", "b.html", "there is no picture of this"),
        (("--sensor", "hg1700"), "b.html", "b.xlsx", "expected one of .json"),
    ],
)
def test_what_cannot_be_written_is_refused_before_anything_is(
    args, written, refused, words, tmp_path: Path, capsys
):
    out = [str(tmp_path / written), str(tmp_path / refused)]
    line = ["budget", DRIVE, *args, "-o", out[0], "-o", out[1]]
    assert status_of(lambda: cli.main(line, standalone_mode=False)) == 2
    said = capsys.readouterr()
    assert f"{refused}: {words}" in said.err
    assert said.out == ""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("source", ["town", "town,T=600"])
def test_the_bare_name_of_a_scenario_is_recognised(source, tmp_path: Path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert status_of(lambda: cli.main(["budget", source], standalone_mode=False)) == 2
    assert f"{source}: no such file; did you mean scenario:{source}?" in capsys.readouterr().err


def test_a_drive_that_is_too_long_is_refused(capsys):
    line = ["budget", "scenario:town,T=1e9"]
    assert status_of(lambda: cli.main(line, standalone_mode=False)) == 2
    assert "town: duration must be at most 604800 s (a week)" in capsys.readouterr().err
