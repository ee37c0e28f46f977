"""The same suite on a Dask cluster: the same results, also where a worker dies."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from vehnav.batch import fleet, runner
from vehnav.batch.fence import WorkerError
from vehnav.batch.model import read_results
from vehnav.batch.runner import run_suite, save
from vehnav.batch.suite import Suite, load_suite
from vehnav.batch.task import Task, code_digest
from vehnav.batch.worker import score
from vehnav.errors import ConfigError

distributed = pytest.importorskip("distributed")

SUITE = """
[suite]
name = "fleet"
[[log]]
scenario = "city,duration=90,first_stop=20,last_stop=10,stop_every=25"
rate = 50
runs = {runs}
[[log]]
path = "broken.csv"
[[config]]
name = "quick"
gps_start_seconds = 15
[[bar]]
metric = "errors.horizontal_m.max"
max = 20.0
"""


def suite_of(folder: Path, runs: int) -> Suite:
    (folder / "broken.csv").write_text("this,is\nno,log\n")
    path = folder / "suite.toml"
    path.write_text(SUITE.format(runs=runs))
    return load_suite(path)


def in_this_process(tasks, limits, *, jobs):
    for task in tasks:
        yield task, score(Task(**json.loads(json.dumps(task.to_dict()))))


def without_run(out: Path) -> bytes:
    return (out / "results.json").read_bytes().partition(b'\n"run": {')[0]


def cluster(workers: int, *, processes: bool):
    return distributed.LocalCluster(
        n_workers=workers, threads_per_worker=1, processes=processes, dashboard_address=None,
        silence_logs=50,
    )  # fmt: skip


def compare_with_this_process(suite: Suite, folder: Path, monkeypatch, code: str) -> None:
    monkeypatch.setattr(runner, "local_answers", in_this_process)
    save(run_suite(suite, folder / "here"), folder / "here")
    if code != code_digest.__wrapped__():
        pytest.skip("somebody edited vehnav while the suite ran")
    assert without_run(folder / "there") == without_run(folder / "here")


def test_a_cluster_gives_the_same(tmp_path, monkeypatch) -> None:
    suite, code = suite_of(tmp_path, 2), code_digest.__wrapped__()
    out = tmp_path / "there"
    with cluster(1, processes=False) as there:
        results = run_suite(suite, out, scheduler=there.scheduler_address)
    assert results.run.complete
    assert [r.status for r in results.results] == ["error", "ok", "ok"]
    assert list(out.glob(".shared-*")) == []
    save(results, out)
    compare_with_this_process(suite, tmp_path, monkeypatch, code)


@pytest.mark.slow
def test_nothing_is_lost_where_a_worker_is_killed(tmp_path, monkeypatch) -> None:
    """Three worker processes; one is killed when two logs are done."""
    suite, code = suite_of(tmp_path, 12), code_digest.__wrapped__()
    out = tmp_path / "there"
    killed: list[int] = []
    with (
        cluster(3, processes=True) as there,
        distributed.Client(there, set_as_default=False) as client,
    ):
        pids = sorted(client.run(os.getpid).values())

        def kill_one(done: int) -> None:
            if done == 2 and not killed:
                killed.append(pids[1])
                os.kill(pids[1], signal.SIGKILL)

        results = run_suite(suite, out, scheduler=there.scheduler_address, advance=kill_one)
        assert killed
        assert pids[1] not in client.run(os.getpid).values()
    assert results.run.complete
    assert [r.status for r in results.results] == ["error"] + ["ok"] * 12
    save(results, out)
    compare_with_this_process(suite, tmp_path, monkeypatch, code)


@pytest.fixture
def fleet_of_processes(tmp_path) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """The address of a scheduler with a worker, and its process."""
    code_digest.cache_clear()  # the worker reads the sources now; somebody may have edited them
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"

    def started(name: str, *arguments: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.{name}", *arguments, "--no-dashboard"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=tmp_path,
        )  # fmt: skip

    host, port = address.removeprefix("tcp://").split(":")
    processes = [
        started("dask_scheduler", "--host", host, "--port", port),
        started("dask_worker", address, "--nthreads", "1", "--no-nanny"),
    ]
    yield address, processes[0]
    for process in processes:
        process.kill()
        process.wait()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="stops a process as Unix does")
@pytest.mark.parametrize("how", ["SIGKILL", "SIGSTOP"])
def test_a_scheduler_that_goes_away_ends_the_suite_soon(
    tmp_path, monkeypatch, fleet_of_processes, how: str
) -> None:
    """Killed, its connections break; stopped, they stay and say nothing."""
    monkeypatch.setattr(fleet, "WATCH_SECONDS", 0.5)
    monkeypatch.setattr(fleet, "ANSWER_SECONDS", 2.0)
    address, scheduler = fleet_of_processes
    out = tmp_path / "there"
    gone: list[float] = []

    def end(done: int) -> None:
        if done == 2:
            scheduler.send_signal(getattr(signal, how))
            gone.append(time.monotonic())

    with pytest.raises(WorkerError, match=r"went away or answers no more.*--resume goes on"):
        run_suite(suite_of(tmp_path, 30), out, scheduler=address, advance=end)
    assert time.monotonic() - gone[0] < 15.0  # a question, its answer, 5 s to hang up; room
    results = read_results(out / "results.json")
    states = [r.status for r in results.results]
    assert not results.run.complete
    assert states.count("interrupted") >= 20
    assert len(states) - states.count("interrupted") >= 2
    assert list(out.glob(".shared-*")) == []


class Lost:
    """A future whose result was there and can no longer be fetched."""

    status = "finished"

    def result(self) -> dict[str, object]:
        raise distributed.comm.CommClosedError("in <TCP>: Stream is closed")


def test_a_connection_that_breaks_while_a_result_is_fetched() -> None:
    with pytest.raises(WorkerError, match="went away"):
        fleet._answer(Lost())


def test_no_scheduler_and_no_worker(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(fleet, "CONNECT_SECONDS", 0.5)
    suite = suite_of(tmp_path, 1)
    with pytest.raises(ConfigError, match=r"tcp://127.0.0.1:9: no Dask scheduler answers"):
        run_suite(suite, tmp_path / "out", scheduler="tcp://127.0.0.1:9")
    for address in ("nohost", "no://where:1"):  # said at once
        with pytest.raises(ConfigError, match=f"{address}: no Dask scheduler answers"):
            run_suite(suite, tmp_path / "out", scheduler=address)
    assert not (tmp_path / "out" / "results.json").exists()
    with cluster(0, processes=False) as there, pytest.raises(ConfigError, match="no workers"):
        run_suite(suite, tmp_path / "out", scheduler=there.scheduler_address)


def test_a_worker_that_does_not_see_the_folder_or_has_other_code(tmp_path) -> None:
    (task,) = runner.tasks_of(suite_of(tmp_path, 1), tmp_path)[:1]
    unseen = fleet.score_here(
        task.to_dict(), seconds=None, memory=None, warm=[], token=str(tmp_path / "no-such-token")
    )
    assert unseen["folder"] == str(tmp_path)
    with pytest.raises(ConfigError, match="does not see"):
        fleet.answer_of(unseen)
    with pytest.raises(ConfigError, match="another vehnav"):
        fleet.answer_of({"status": "ok", "code": "of another version"})
