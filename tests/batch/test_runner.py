"""Suites that run: the same as `vehnav run`, however many workers; and what goes wrong."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from vehnav.batch import runner
from vehnav.batch.model import metric_value, read_results
from vehnav.batch.runner import run_suite, save
from vehnav.batch.simulation import Simulation
from vehnav.batch.suite import Suite, load_suite
from vehnav.batch.task import Task, code_digest
from vehnav.batch.worker import score
from vehnav.cli.main import cli
from vehnav.errors import ConfigError

DRIVE = "city,duration=90,first_stop=20,last_stop=10,stop_every=25"
needs_pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
needs_linux = pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are of Linux")


def written(folder: Path, text: str) -> Path:
    path = folder / "suite.toml"
    path.write_text('[suite]\nname = "made"\n' + text)
    return path


def loaded(folder: Path, text: str) -> Suite:
    return load_suite(written(folder, text))


def simulated(runs: int = 1, more: str = "") -> str:
    return f"[[log]]\nscenario = '{DRIVE}'\nrate = 50\ngroup = 'sim'\nruns = {runs}\n{more}\n"


def listed(path: str, more: str = "") -> str:
    return f"[[log]]\npath = '{path}'\ngroup = 'files'\n{more}\n"


QUICK = "[[config]]\nname = 'quick'\ngps_start_seconds = 15\n"


def without_run(path: Path) -> bytes:
    """The file up to the run block, byte by byte."""
    before, found, _ = path.read_bytes().partition(b'\n"run": {')
    assert found
    return before


# ---- what it finds -----------------------------------------------------------------------------


def one_after_the_other(tasks, limits, *, jobs):
    """Without worker processes: what they do is the same."""
    for task in tasks:
        yield task, json.loads(json.dumps(score(Task(**json.loads(json.dumps(task.to_dict()))))))


@pytest.fixture
def in_this_process(monkeypatch) -> None:
    monkeypatch.setattr(runner, "local_answers", one_after_the_other)


@pytest.fixture(scope="module")
def matrix(tmp_path_factory) -> tuple[Suite, Path, Path]:
    """Good logs and a bad one, two configurations; one after the other, and by two workers."""
    folder = tmp_path_factory.mktemp("matrix")
    (folder / "broken.csv").write_text("this,is\nno,log\n")
    Simulation(DRIVE, rate=50.0).write(folder / "city.mcap")
    suite = loaded(
        folder,
        simulated(1, "name = 'made'")
        + listed("broken.csv")
        + listed("city.mcap")
        + listed(f"file://{folder / 'city.mcap'}", "name = 'from-a-store'")
        + QUICK
        + "[[config]]\nname = 'published'\nas_published = true\ngps_start_seconds = 15\n"
        + "[[bar]]\nmetric = 'errors.horizontal_m.max'\nmax = 20.0\n"
        + "[[bar]]\nlog = 'city'\nmetric = 'findings.gap'\nmax = 0\n",
    )
    code = code_digest.__wrapped__()
    one, two = folder / "one", folder / "two"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runner, "local_answers", one_after_the_other)
        save(run_suite(suite, one), one)
    save(run_suite(suite, two, jobs=2), two)
    if code != code_digest.__wrapped__():
        pytest.skip("somebody edited vehnav while the suite ran")
    return suite, one, two


def test_the_number_of_workers_changes_nothing(matrix) -> None:
    _, one, two = matrix
    assert without_run(one / "results.json") == without_run(two / "results.json")
    run = read_results(two / "results.json").run
    assert run.complete
    assert run.jobs == 2
    assert len(run.seconds) == 8


def test_figures_are_those_of_vehnav_run(matrix, tmp_path) -> None:
    suite, one, _ = matrix
    log = str(suite.path.parent / "city.mcap")
    arguments = ["run", log, "--as-published", "--json", "--gps-start-seconds", "15",
                 "--out-dir", str(tmp_path / "x")]  # fmt: skip
    report = json.loads(CliRunner().invoke(cli, arguments).stdout)
    results = {r.name: r for r in read_results(one / "results.json").results}
    metrics = results["city/published"].metrics
    assert metrics["errors.horizontal_m.max"] == report["errors"]["horizontal_m"]["max"]
    assert metrics["stops.count"] == len(report["stops"])
    for name, value in metrics.items():
        assert value == metric_value(report, name), name
    made = results["made/published"].metrics  # the same drive and seed, by way of the suite
    assert dict(made) == {name: metrics[name] for name in made}


def test_the_broken_log_fails_alone_and_bars_are_judged(matrix) -> None:
    _, one, _ = matrix
    results = {r.name: r for r in read_results(one / "results.json").results}
    assert len(results) == 8
    for config in ("quick", "published"):
        broken = results[f"broken/{config}"]
        assert (broken.status, broken.exit_status) == ("error", 2)
        assert broken.error is not None
        assert broken.error.startswith("broken.csv")  # as in the suite, not where it lies
        assert str(one) not in broken.error
        assert [bar.passed for bar in broken.bars] == [False]
    good = results["city/quick"]
    assert (good.status, good.exit_status) == ("ok", 0)
    assert {bar.metric: bar.passed for bar in good.bars} == {
        "errors.horizontal_m.max": True, "findings.gap": True,
    }  # fmt: skip
    for result in results.values():
        for bar in result.bars:
            assert bar.passed == (bar.value is not None and bar.value <= bar.limit)


def test_reports_lie_where_the_results_say(matrix) -> None:
    _, one, _ = matrix
    for result in read_results(one / "results.json").results:
        if result.status == "ok":
            page = one / str(result.report)
            assert page.is_file()
            assert (page.parent / "report.json").is_file()
        else:
            assert result.report is None


@pytest.mark.usefixtures("in_this_process")
def test_resume_does_only_what_is_new(matrix, tmp_path) -> None:
    """A bar that changed, a log that failed, a log that changed, a page that is gone."""
    log = tmp_path / "drive.mcap"
    shutil.copy(matrix[0].path.parent / "city.mcap", log)
    (tmp_path / "empty.mcap").write_bytes(b"")
    text = simulated(2) + listed("drive.mcap") + listed("empty.mcap") + QUICK
    out = tmp_path / "out"
    first = run_suite(loaded(tmp_path, text), out)
    save(first, out)
    assert first.run.resumed == 0
    text += "[[bar]]\nmetric = 'errors.horizontal_m.max'\nmax = 0.001\n"
    again = run_suite(loaded(tmp_path, text), out, resume=True)
    assert again.run.resumed == 3
    assert [r.key for r in again.results] == [r.key for r in first.results]
    assert [r.metrics for r in again.results] == [r.metrics for r in first.results]
    assert not any(r.passed for r in again.results)
    Simulation(DRIVE, rate=50.0, seed=5).write(log)
    (out / str(first.results[-1].report)).unlink()
    third = run_suite(loaded(tmp_path, text), out, resume=True)
    assert third.run.resumed == 1
    assert {r.name for r in third.results if r.metrics != {x.name: x.metrics for x in
            first.results}[r.name]} == {"drive/quick"}  # fmt: skip
    assert [r.status for r in third.results] == [r.status for r in first.results]


@pytest.mark.usefixtures("in_this_process")
def test_resume_from_what_is_no_result(tmp_path) -> None:
    (tmp_path / "results.json").write_text("{}")
    with pytest.raises(ConfigError, match=r"results\.json.*leave --resume out"):
        run_suite(loaded(tmp_path, simulated() + QUICK), tmp_path, resume=True)


@pytest.mark.usefixtures("in_this_process")
def test_what_is_kept(tmp_path) -> None:
    suite = loaded(tmp_path, simulated() + QUICK)
    kept = {}
    for keep in ("trajectory", "report", "figures"):
        out = tmp_path / keep
        results = run_suite(replace(suite, keep=keep), out)
        kept[keep] = sorted(x.name for x in out.rglob("*") if x.is_file())
        assert (results.results[0].report is None) == (keep == "figures")
    simulation = next(x for x in kept["report"] if x.endswith(".mcap"))
    assert kept["report"] == [simulation, "report.html", "report.json"]
    assert kept["trajectory"] == [*kept["report"], "trajectory.csv"]
    assert kept["figures"] == []


@pytest.mark.usefixtures("in_this_process")
def test_an_internal_error_is_a_failed_log_with_its_traceback(tmp_path, monkeypatch) -> None:
    import vehnav.pipeline

    def broken(*_: object) -> None:
        raise ZeroDivisionError("made by the test")

    monkeypatch.setattr(vehnav.pipeline, "run", broken)
    out = tmp_path / "out"
    (result,) = run_suite(loaded(tmp_path, simulated() + QUICK), out).results
    assert (result.status, result.exit_status) == ("error", 70)
    assert result.error == "internal error: ZeroDivisionError: made by the test"
    assert "in broken" in (out / "logs" / "city" / "quick" / "trouble.txt").read_text()


def test_options_and_code_are_in_the_key(tmp_path, monkeypatch) -> None:
    from vehnav.batch import task

    suite = loaded(tmp_path, simulated() + QUICK + "[[config]]\nname = 'other'\nmax_gap = 0.4\n")
    one, other = task.tasks_of(suite, tmp_path)
    assert task.task_key(one, None) == task.task_key(one, None)
    assert task.task_key(one, None) != task.task_key(other, None)
    key = task.task_key(one, None)
    monkeypatch.setattr(task, "code_digest", lambda: "edited")
    assert task.task_key(one, None) != key


def test_a_log_in_a_store_gives_what_the_file_gives(matrix) -> None:
    results = {r.name: r for r in read_results(matrix[1] / "results.json").results}
    file, store = results["city/quick"], results["from-a-store/quick"]
    assert store.status == "ok", store.error
    assert store.key == file.key
    assert {k: v for k, v in store.metrics.items() if k in file.metrics} == file.metrics


# ---- what goes wrong ---------------------------------------------------------------------------


def children() -> list[int]:
    """Processes that this one started."""
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = status.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == os.getpid():
            found.append(int(status.parent.name))
    return found


@needs_pipes
@needs_linux
def test_killed_hanging_and_greedy_logs_fail_alone(tmp_path) -> None:
    """A named pipe that nobody writes to is a log that never ends; truth, ideal and measured
    samples of a quarter of an hour at 200 Hz are 40 MB alone."""
    os.mkfifo(tmp_path / "hangs.mcap")
    os.mkfifo(tmp_path / "killed.mcap")
    before = set(children())
    long = "[[log]]\nscenario = 'town,duration=900'\nrate = 200\nname = 'greedy'\n"
    text = listed("killed.mcap") + listed("hangs.mcap", "name = 'hangs'") + simulated() + long
    suite = replace(loaded(tmp_path, text + QUICK), time_limit=3.0, memory_limit=40 * 2**20)

    def kill_the_first() -> None:
        """The only worker, as soon as it has opened the log."""
        writer = opened_by_a_reader(tmp_path / "killed.mcap")
        for pid in set(children()) - before:
            os.kill(pid, signal.SIGKILL)
        os.close(writer)

    killer = threading.Thread(target=kill_the_first)
    killer.start()
    results = run_suite(suite, tmp_path / "out", jobs=1)
    killer.join()
    found = {r.log: (r.status, r.error) for r in results.results}
    assert found == {
        "killed": ("crash", "its process was ended by SIGKILL (out of memory?)"),
        "hangs": ("timeout", "over the time limit of 3 s"),
        "greedy": ("crash", "out of memory; see the memory limit"),
        "city": ("ok", None),
    }
    assert results.run.complete
    assert set(children()) <= before  # no worker is left behind


def opened_by_a_reader(pipe: Path) -> int:
    """Wait until somebody reads a named pipe; the writing end."""
    for _ in range(1200):
        try:
            return os.open(pipe, os.O_WRONLY | os.O_NONBLOCK)
        except OSError:
            time.sleep(0.05)
    raise TimeoutError(pipe)


def command(*arguments: str, **options: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "vehnav", "score", *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options,
    )  # fmt: skip


@needs_pipes
@pytest.mark.parametrize(
    "stop", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)]
)
def test_ctrl_c_leaves_a_valid_part(tmp_path, stop) -> None:
    os.mkfifo(tmp_path / "z.mcap")
    path = written(tmp_path, simulated(1) + listed("z.mcap") + QUICK)
    out = tmp_path / "out"
    process = command(str(path), "-o", str(out), "--jobs", "1")
    writer = opened_by_a_reader(tmp_path / "z.mcap")
    process.send_signal(stop)
    printed, said = process.communicate(timeout=30)
    os.close(writer)
    assert process.returncode == 130
    assert "1 of 2 are done" in said
    assert "--resume" in said
    assert "not finished" in printed
    results = read_results(out / "results.json")
    assert {r.log: r.status for r in results.results} == {"city": "ok", "z": "interrupted"}
    assert not results.run.complete
    assert sorted(x.name for x in out.iterdir() if x.suffix != ".html") == [
        "logs", "results.json", "simulated",
    ]  # fmt: skip


@pytest.mark.slow
@needs_linux
def test_a_full_disk_is_said_and_leaves_no_half_file(tmp_path) -> None:
    """No file may grow over 512 bytes: neither a report nor results.json can be written."""
    import resource

    path = written(tmp_path, simulated(1) + QUICK)
    out = tmp_path / "out"
    out.mkdir()
    (out / "results.json").write_text("of an earlier run")

    def full() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (512, 512))

    process = command(str(path), "-o", str(out), "--jobs", "1", preexec_fn=full)
    printed, said = process.communicate(timeout=60)
    assert process.returncode == 2
    assert "results.json: cannot be written: File too large" in said
    assert "city seed 0: File too large" in printed or "File too large" in printed
    assert (out / "results.json").read_text() == "of an earlier run"
    assert [x for x in out.rglob("*") if ".part" in x.name or ".tmp" in x.name] == []
