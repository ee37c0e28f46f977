"""``--init``: the suite file that it writes names what is there, and is accepted."""

from __future__ import annotations

import os
import re
import shutil
import sys
import tomllib
from pathlib import Path
from urllib.parse import unquote

import pytest
from click.testing import CliRunner

from vehnav.batch import example
from vehnav.batch.example import write_example
from vehnav.batch.suite import Suite, load_suite
from vehnav.cli.main import cli
from vehnav.errors import ConfigError

HEAD = "time_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"


def log(path: Path, *, gps: bool = False) -> Path:
    """Two seconds at rest in vehnav's own columns."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [f"{0.01 * k:.2f},0,0,0,0,0,9.81" for k in range(200)]
    path.write_text("\n".join([HEAD, *rows]) + "\n")
    if gps:
        rows = [f"{k},55.75,37.62,150" for k in range(3)]
        beside = path.with_suffix(".gps.csv")
        beside.write_text("\n".join(["time_s,lat_deg,lon_deg,height_m", *rows]) + "\n")
    return path


def sources(suite: Suite) -> set[Path]:
    return {Path(spec.source).resolve() for spec in suite.logs}


def test_the_sample_logs_make_a_suite(sample_logs: Path, tmp_path: Path) -> None:
    folder = tmp_path / "samples"
    shutil.copytree(sample_logs, folder, ignore=shutil.ignore_patterns("*.vehnav"))
    (folder / "city.vehnav").mkdir()
    shutil.copy(folder / "city.csv", folder / "city.vehnav" / "trajectory.csv")
    made = write_example(folder)
    suite = load_suite(made.path)
    assert suite.name == "samples"
    assert {path.name for path in sources(suite)} == {
        "city.csv", "city.mcap", "highway_hg1700.mcap",
    }  # fmt: skip
    assert len({spec.name for spec in suite.logs}) == 3  # city twice, by names of their own
    reasons = {row.path: row.reason for row in made.left_out}
    assert set(reasons) == {"README.md", "city.png"}
    assert all(reasons.values())
    assert [(bar.metric, bar.bound) for bar in suite.bars] == [("errors.horizontal_m.max", "max")]


def test_what_is_commented_out_is_accepted_too(tmp_path: Path) -> None:
    """Every line that the file offers, with its mark taken away."""
    log(tmp_path / "a.csv", gps=True)
    made = write_example(tmp_path)
    lines = made.path.read_text().splitlines()
    offered = [
        line.removeprefix("# ") if line.startswith("# ") and ("=" in line or "[" in line) else line
        for line in lines
    ]
    made.path.write_text("\n".join(offered))
    suite = load_suite(made.path)
    assert [config.name for config in suite.configs] == ["default", "published"]
    assert suite.configs[1].options == {"as_published": True}
    assert (suite.time_limit, suite.memory_limit, suite.keep) == (600.0, 4 << 30, "report")
    assert suite.baseline.file == tmp_path / "baseline.json"
    assert (suite.baseline.max_regression, suite.baseline.max_log_regression) == (0.05, 0.5)


def test_without_gps_the_bar_is_on_the_stops(tmp_path: Path) -> None:
    log(tmp_path / "city" / "a.csv", gps=True)
    log(tmp_path / "city" / "b.csv")
    suite = load_suite(write_example(tmp_path).path)
    assert {spec.name: spec.group for spec in suite.logs} == {
        "a": "city",
        "b": "city without GPS",
    }
    assert {bar.group: bar.metric for bar in suite.bars} == {
        "city": "errors.horizontal_m.max",
        "city without GPS": "stops.count",
    }


def test_many_logs_become_a_pattern(tmp_path: Path) -> None:
    for k in range(30):
        log(tmp_path / "city" / f"{k:02d}.csv", gps=True)
    made = write_example(tmp_path)
    tables = tomllib.loads(made.path.read_text())["log"]
    assert [row["path"] for row in tables] == ["city/*.csv"]
    assert sources(load_suite(made.path)) == {
        (tmp_path / "city" / f"{k:02d}.csv").resolve() for k in range(30)
    }


def test_a_pattern_never_takes_what_is_no_log(tmp_path: Path) -> None:
    for k in range(6):
        log(tmp_path / f"{k}.csv")
    (tmp_path / "notes.csv").write_text("who,what\nme,nothing\n")
    made = write_example(tmp_path)
    assert {path.name for path in sources(load_suite(made.path))} == {f"{k}.csv" for k in range(6)}
    assert [row.path for row in made.left_out] == ["notes.csv"]


def test_only_some_of_many_are_opened(tmp_path: Path, monkeypatch) -> None:
    for k in range(30):
        log(tmp_path / f"{k:02d}.csv")
    opened = []
    real = example.read_log
    monkeypatch.setattr(example, "read_log", lambda path: opened.append(path) or real(path))
    assert len(write_example(tmp_path).found) == 30
    assert len(opened) == example.OPENED


@pytest.mark.skipif(sys.platform == "win32", reason="its file names may not hold these")
def test_names_of_any_kind(tmp_path: Path) -> None:
    names = ['a"b.csv', "a[1].csv", "star*.csv", "back\\slash.csv", "new\nline.csv", "日本 😀.csv"]
    for name in names:
        log(tmp_path / "x [y]" / name)
    log(tmp_path / "${HOME}.csv")
    os.rename(log(tmp_path / "z.csv"), os.fsencode(tmp_path) + b"/z\xff.csv")  # noqa: PTH104
    made = write_example(tmp_path)
    found = sources(load_suite(made.path))
    assert found == {(tmp_path / "x [y]" / name).resolve() for name in names}
    assert len(found) == 6
    assert {row.path: row.reason.split(",")[0] for row in made.left_out} == {
        "${HOME}.csv": "its name holds ${",
        r"z\udcff.csv": "its name is not UTF-8",
    }


def test_few_logs_of_odd_names_are_listed_one_by_one(tmp_path: Path) -> None:
    """As patterns their brackets would mean something else."""
    for name in ("x [y]/a[1].csv", "x [y]/a1.csv", "b.csv"):
        log(tmp_path / name)
    made = write_example(tmp_path)
    assert len(tomllib.loads(made.path.read_text())["log"]) == 3
    assert sources(load_suite(made.path)) == {
        (tmp_path / name).resolve() for name in ("x [y]/a[1].csv", "x [y]/a1.csv", "b.csv")
    }


def test_twins_of_one_stem_get_names(tmp_path: Path) -> None:
    for name in ("a/run.csv", "b/run.csv", "a-run.csv", "a/run.txt"):
        log(tmp_path / name)
    suite = load_suite(write_example(tmp_path).path)
    assert len(sources(suite)) == 4
    assert len({spec.name.lower() for spec in suite.logs}) == 4


def test_folders_that_are_recordings(tmp_path: Path, sample_logs: Path) -> None:
    """A folder of ROS 2 is one log; a folder that just holds MCAP files is not."""
    bag, plain = tmp_path / "bag", tmp_path / "plain"
    for folder in (bag, plain):
        folder.mkdir()
        shutil.copy(sample_logs / "city.mcap", folder / f"{folder.name}_0.mcap")
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information:\n  version: 5\n")
    made = write_example(tmp_path)
    assert [row.path for row in made.found] == ["bag", "plain/plain_0.mcap"]
    with pytest.raises(ConfigError, match=r"it is a recording itself .rosbag2"):
        write_example(bag)


def test_refusals(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such folder"):
        write_example(tmp_path / "none")
    with pytest.raises(ConfigError, match=r"no log with an IMU in it .it is empty"):
        write_example(tmp_path)
    (tmp_path / "a.md").write_text("hello")
    with pytest.raises(ConfigError, match=r"no log with an IMU in it .a.md"):
        write_example(tmp_path)
    (tmp_path / "suite.toml").write_text("mine")
    with pytest.raises(ConfigError, match="nothing is overwritten"):
        write_example(tmp_path)
    assert (tmp_path / "suite.toml").read_text() == "mine"


def test_the_real_logs_make_a_suite(shared_data: Path) -> None:
    found, left_out = example.find_logs(shared_data / "kitti_oxts")
    assert [row.path for row in found if row.gps] == [
        f"2011_{name}.mcap" for name in ("09_30_drive_0018", "09_30_drive_0027", "10_03_drive_0042")
    ]
    truth = [row for row in left_out if row.path.endswith("_truth.csv")]
    assert {row.reason for row in truth} == {"no IMU in it"}


# ---- as a user ---------------------------------------------------------------------------------


def test_the_command_says_what_it_wrote_and_left_out(tmp_path: Path) -> None:
    log(tmp_path / "a.csv")
    (tmp_path / "b.md").write_text("hello")
    result = CliRunner().invoke(cli, ["score", "--init", str(tmp_path)])
    assert result.exit_code == 0
    assert f"{tmp_path / 'suite.toml'}: 1 log; next: vehnav score" in result.stdout
    assert "left out: b.md: " in result.stderr
    assert CliRunner().invoke(cli, ["score"]).exit_code == 2


@pytest.mark.slow
def test_the_suite_runs_and_every_output_is_there(sample_logs: Path, tmp_path: Path) -> None:
    """From a folder of logs to a gate: the example, a baseline, and the same again."""
    folder = tmp_path / "drives"
    folder.mkdir()
    shutil.copy(sample_logs / "city.mcap", folder)
    assert CliRunner().invoke(cli, ["score", "--init", str(folder)]).exit_code == 0
    out = tmp_path / "out"
    baseline = ["--baseline", str(folder / "baseline.json")]
    command = ["score", str(folder / "suite.toml"), "-o", str(out), "--jobs", "1", *baseline]
    first = CliRunner().invoke(cli, [*command, "--update-baseline"])
    assert first.exit_code == 0, first.output
    names = ["junit.xml", "t.csv", "t.parquet", "s.md"]
    junit, *tables, markdown = (str(out / name) for name in names)
    more = ["--junit", junit, "--markdown", markdown, "--max-regression", "0%"]
    summary = tmp_path / "step.md"
    again = CliRunner().invoke(
        cli,
        [*command, *more, *(part for table in tables for part in ("--table", table))],
        env={"GITHUB_STEP_SUMMARY": str(summary)},
    )
    assert again.exit_code == 0, again.output
    assert "no regression against" in again.stdout
    for name in (*names, "index.html", "results.json"):
        assert (out / name).stat().st_size > 100, name
    assert "no regression against" in summary.read_text()
    links = re.findall(r'href="([^"]*report.html)"', (out / "index.html").read_text())
    assert len(links) == 1
    assert (out / unquote(links[0])).is_file()
