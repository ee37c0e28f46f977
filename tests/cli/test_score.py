"""``vehnav score``: table, exit status, files, baseline."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from vehnav.batch import runner
from vehnav.batch.model import read_results
from vehnav.batch.simulation import Simulation
from vehnav.batch.task import Task
from vehnav.batch.worker import score
from vehnav.cli.main import cli

DRIVE = "city,duration=90,first_stop=20,last_stop=10,stop_every=25"
CONFIG = "[[config]]\nname = 'quick'\ngps_start_seconds = 15\n"


@pytest.fixture(autouse=True)
def in_this_process(monkeypatch) -> None:
    """Worker processes are tested elsewhere; here is what the command makes of their answers."""

    def answers(tasks, limits, *, jobs):
        for task in tasks:
            yield task, score(Task(**json.loads(json.dumps(task.to_dict()))))

    monkeypatch.setattr(runner, "local_answers", answers)
    monkeypatch.delenv("GITHUB_STEP_SUMMARY", raising=False)


def vehnav(*args: object) -> Result:
    return CliRunner().invoke(cli, ["score", *map(str, args)])


@pytest.fixture
def suite(tmp_path) -> Path:
    Simulation(DRIVE, rate=50.0).write(tmp_path / "drive.mcap")
    return written(tmp_path, "")


def written(folder: Path, more: str) -> Path:
    path = folder / "suite.toml"
    path.write_text(
        "[suite]\nname = 'town'\n[[log]]\npath = 'drive.mcap'\ngroup = 'sim'\n" + CONFIG + more
    )
    return path


def bar(limit: float) -> str:
    return f"[[bar]]\nmetric = 'errors.horizontal_m.max'\nmax = {limit}\n"


def test_bars_decide_the_exit_status(suite, tmp_path) -> None:
    out = tmp_path / "out"
    passed = vehnav(written(tmp_path, bar(1000.0)), "-o", out)
    assert passed.exit_code == 0, passed.output
    assert "town: 1 log: " in passed.stdout
    value = read_results(out / "results.json").results[0].metrics["errors.horizontal_m.max"]
    assert value is not None
    assert f"{value:.2f}" in passed.stdout
    missed = vehnav(written(tmp_path, bar(0.5)), "-o", out, "--resume")
    assert missed.exit_code == 1
    assert "MISSED errors.horizontal_m.max" in missed.stdout
    assert "> 0.5" in missed.stdout
    assert (out / "index.html").is_file()


def test_a_failed_log_is_1_and_a_damaged_one_3(suite, tmp_path) -> None:
    log = tmp_path / "drive.mcap"
    whole = log.read_bytes()
    log.write_bytes(whole[: int(0.98 * len(whole))])  # never closed: recovered by scanning
    damaged = vehnav(suite, "-o", tmp_path / "out", "--json")
    assert damaged.exit_code == 3, damaged.output
    document = json.loads(damaged.stdout)
    assert document["version"] == 1
    assert document["results"][0]["damaged"] is True
    assert document["results"][0]["exit_status"] == 3
    log.write_bytes(b"nothing")
    failed = vehnav(suite, "-o", tmp_path / "out")
    assert failed.exit_code == 1
    assert "failed: drive.mcap" in failed.stdout


def test_baseline_and_every_file(suite, tmp_path, monkeypatch) -> None:
    out = tmp_path / "out"
    summary = tmp_path / "summary.md"
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(summary))
    base = tmp_path / "baseline.json"
    path = written(tmp_path, bar(1000.0) + "[baseline]\nfile = 'baseline.json'\n"
                   "max_regression = '5%'\n")  # fmt: skip
    missing = vehnav(path, "-o", out)
    assert missing.exit_code == 2
    assert "no such baseline; the first one is written by --update-baseline" in missing.stderr
    assert not out.exists()  # said before anything ran
    assert vehnav(path, "-o", out, "--update-baseline").exit_code == 0
    files = {name: tmp_path / name for name in ("junit.xml", "table.csv", "summary2.md")}
    again = vehnav(path, "-o", out, "--resume", "--junit", files["junit.xml"],
                   "--table", files["table.csv"], "--markdown", files["summary2.md"])  # fmt: skip
    assert again.exit_code == 0, again.output
    assert "no regression" in again.stdout
    assert all(file.stat().st_size > 0 for file in [*files.values(), summary])

    content = json.loads(base.read_text())
    for row in content["results"]:
        row["metrics"] = {k: v and v / 2.0 for k, v in row["metrics"].items()}
    base.write_text(json.dumps(content))
    worse = vehnav(path, "-o", out, "--resume")
    assert worse.exit_code == 1
    assert "regression" in worse.stdout
    assert "100 % worse" in worse.stdout
    assert vehnav(path, "-o", out, "--resume", "--max-regression", "150%").exit_code == 0


def test_a_baseline_counts_the_runs_that_failed_and_needs_one_that_did_not(suite, tmp_path) -> None:
    base = tmp_path / "baseline.json"
    (tmp_path / "other.mcap").write_bytes(b"nothing")
    path = written(tmp_path, "[[log]]\npath = 'other.mcap'\n[baseline]\nfile = 'baseline.json'\n")
    some = vehnav(path, "-o", tmp_path / "out", "--update-baseline")
    assert some.exit_code == 1  # a log failed
    assert "baseline.json; 1 of 2 runs have no figures in it, as they failed" in some.stderr
    base.unlink()
    (tmp_path / "drive.mcap").write_bytes(b"nothing")
    none = vehnav(path, "-o", tmp_path / "out", "--update-baseline")
    assert none.exit_code == 2
    assert "baseline.json: not written, all 2 runs failed" in none.stderr
    assert not base.exists()


def test_options_that_do_not_fit_are_said_before_anything_runs(suite, tmp_path) -> None:
    for arguments, text in (
        (["--table", "x.xls"], "a table is written as"),
        (["--max-regression", "5%"], "no baseline"),
        (["--update-baseline"], "no baseline"),
        (["--max-regression", "much"], "--max-regression: expected a share"),
        (["--memory-limit", "much"], "--memory-limit: expected a size"),
        (["--timeout", "0"], "--timeout"),
        (["--jobs", "0"], "--jobs"),
        (["--junit", str(tmp_path / "none" / "x.xml")], "there is no folder"),
        (["--markdown", str(tmp_path / "none" / "x.md")], "there is no folder"),
        (
            ["--baseline", str(tmp_path / "none" / "x.json"), "--update-baseline"],
            "there is no folder",
        ),
    ):
        result = vehnav(suite, "-o", tmp_path / "out", *arguments)
        assert result.exit_code == 2, result.output
        assert text in result.stderr
        assert not (tmp_path / "out" / "results.json").exists()
    assert vehnav().exit_code == 2


def test_files_may_lie_in_the_folder_of_the_results_which_is_new(suite, tmp_path) -> None:
    out = tmp_path / "new" / "out"
    assert vehnav(suite, "-o", out, "--junit", out / "junit.xml").exit_code == 0
    assert (out / "junit.xml").is_file()


def test_absent_logs_are_named_and_counted(suite, tmp_path) -> None:
    absent = "[[log]]\npath = 'real/*.mcap'\noptional = true\n"
    path = tmp_path / "none.toml"
    path.write_text(f"[suite]\nname = 's'\n{absent}")
    result = vehnav(path, "-o", tmp_path / "out", "--quiet")
    assert result.exit_code == 0
    assert "skipped: real/*.mcap: not there" in result.stderr
    assert "warning: 1 optional [[log]] is absent: nothing is scored" in result.stderr
    path.write_text(path.read_text() + absent.replace("real", "other"))
    result = vehnav(path, "-o", tmp_path / "out")
    assert "warning: 2 optional [[log]] are absent: nothing is scored" in result.stderr
    assert "no logs" in result.stdout
    some = vehnav(written(tmp_path, absent), "-o", tmp_path / "out")
    assert "warning: 1 optional [[log]] is absent; 1 log is scored" in some.stderr
    assert "warning" not in vehnav(written(tmp_path, ""), "-o", tmp_path / "out").stderr


def test_init_and_go(suite, tmp_path) -> None:
    suite.unlink()
    made = vehnav("--init", tmp_path)
    assert made.exit_code == 0, made.output
    assert "1 log" in made.stdout
    assert vehnav(tmp_path / "suite.toml", "-o", tmp_path / "out", "--quiet").exit_code in (0, 1)


def test_init_names_some_of_what_it_leaves_out(suite, tmp_path) -> None:
    suite.unlink()
    for k in range(30):
        (tmp_path / f"{k}.jpg").write_bytes(b"\xff\xd8 no log")
    said = vehnav("--init", tmp_path).stderr
    assert said.count(".jpg: ") == 20
    assert "left out: 10 more" in said
