"""All logs of a suite with all its configurations, over the cores of this machine or a cluster."""

from __future__ import annotations

import platform
import queue
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from vehnav._version import __version__
from vehnav.batch.fence import Fence
from vehnav.batch.fetching import SIMULATED, simulated_path
from vehnav.batch.model import (
    RESULTS_NAME,
    BarResult,
    Result,
    Results,
    RunBlock,
    read_results,
    write_results,
)
from vehnav.batch.suite import Suite
from vehnav.batch.task import Task, tasks_of
from vehnav.batch.worker import KINDS
from vehnav.errors import ConfigError, FormatError
from vehnav.parallel import cores

SAVE_SECONDS: Final = 10.0
"""Between two writings of the results so far, at least."""
SAVE_SHARE: Final = 0.02
"""Of the time, at most, goes into them."""

Answers = Iterator[tuple[Task, dict[str, Any]]]


@dataclass(frozen=True)
class Limits:
    """What a log may take: s of time, bytes of memory; None: any."""

    seconds: float | None = None
    memory: int | None = None


def run_suite(
    suite: Suite,
    out: Path,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    advance: Callable[[int], None] = lambda done: None,
) -> Results:
    """Score every log of a suite with every configuration.

    The outputs of each log go to ``out``; the results so far are written to ``out/results.json``
    from time to time. An interruption (Ctrl-C) ends the workers and gives what there is, with the
    rest as ``interrupted`` and ``run.complete`` false; the caller writes the final file by
    :func:`save`.

    Parameters
    ----------
    suite : Suite
    out : Path
    jobs : int or None
        Worker processes; None: one for each core.
    scheduler : str or None
        Address of a Dask scheduler, whose workers do the work.
    resume : bool
        Whether results of ``out/results.json`` are kept where log, options and code are the same.
    advance : callable
        Told how many are done.

    Raises
    ------
    ConfigError
        ``out`` cannot be made, or the cluster cannot be used.
    WorkerError
        No worker can be started.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{out}: cannot be made: {error.strerror}") from error
    earlier = _earlier(suite, out) if resume else {}
    tasks = [
        replace(task, previous=earlier[task.name].key) if task.name in earlier else task
        for task in tasks_of(suite, out.resolve())
    ]
    _remove_old_simulations(tasks, out)
    limits = Limits(suite.time_limit, suite.memory_limit)
    count = max(1, min(jobs or cores(), len(tasks)))
    found = Collected(suite, out, tasks, earlier, jobs=count if scheduler is None else 0)
    if not tasks:
        return found.results(complete=True)
    if scheduler is None:
        answers = local_answers(tasks, limits, jobs=count)
    else:
        from vehnav.batch.fleet import fleet_answers

        answers = fleet_answers(
            tasks, scheduler, seconds=limits.seconds, memory=limits.memory, warm=kinds_of(tasks)
        )
    return _collect(found, answers, advance)


def _collect(found: Collected, answers: Answers, advance: Callable[[int], None]) -> Results:
    try:
        with closing(answers):  # type: ignore[type-var]
            for task, answer in answers:
                found.add(task, answer)
                advance(len(found.done))
                found.save_if_due()
    except KeyboardInterrupt:
        return found.results(complete=False)
    except BaseException:
        if found.done:
            save(found.results(complete=False), found.out)
        raise
    return found.results(complete=True)


def save(results: Results, out: Path) -> None:
    """Write ``results.json``, whole or not at all; ConfigError where the disk refuses it."""
    try:
        write_results(results, out / RESULTS_NAME)
    except OSError as error:
        raise ConfigError(
            f"{out / RESULTS_NAME}: cannot be written: {error.strerror or error}"
        ) from error


def _earlier(suite: Suite, out: Path) -> dict[str, Result]:
    """The results in ``out`` that can be kept, by name: those that ran, with all the metrics."""
    path = out / RESULTS_NAME
    if not path.exists():
        return {}
    try:
        earlier = read_results(path)
    except FormatError as error:
        raise ConfigError(f"{error}; remove it, or leave --resume out") from error
    wanted = set(suite.metrics)
    return {
        result.name: result
        for result in earlier.results
        if result.status == "ok" and wanted <= set(result.metrics)
    }


def _remove_old_simulations(tasks: Sequence[Task], out: Path) -> None:
    wanted = {simulated_path(task).name for task in tasks if task.simulation is not None}
    for path in (out / SIMULATED).glob("*.mcap"):
        if path.name not in wanted:
            path.unlink(missing_ok=True)


# ---- what came back ----------------------------------------------------------------------------


@dataclass
class Collected:
    """The results so far."""

    suite: Suite
    out: Path
    tasks: Sequence[Task]
    earlier: Mapping[str, Result]
    jobs: int
    done: dict[str, Result] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    memory_mb: dict[str, float] = field(default_factory=dict)
    resumed: int = 0

    def __post_init__(self) -> None:
        self._started = datetime.now(UTC)
        self._clock = self._saved = time.monotonic()
        self._cost = 0.0

    def add(self, task: Task, answer: Mapping[str, Any]) -> None:
        """Take over what a worker answered."""
        if answer.get("same"):
            result = self._kept(task)
            self.resumed += 1
        else:
            result = self._judged(task, answer)
        self.done[task.name] = result
        for name in ("seconds", "memory_mb"):
            if answer.get(name) is not None:
                getattr(self, name)[task.name] = answer[name]

    def _kept(self, task: Task) -> Result:
        old = self.earlier[task.name]
        answer = {**old.to_dict(), "report": None if task.keep == "figures" else task.report}
        return self._judged(task, answer)

    def _judged(self, task: Task, answer: Mapping[str, Any]) -> Result:
        found = answer.get("metrics") or {}
        metrics = {name: found[name] for name in task.metrics if name in found}
        bars = tuple(
            BarResult.of(bar.metric, bar.bound, bar.limit, metrics.get(bar.metric))
            for bar in self.suite.bars
            if bar.applies(task.group, task.log, task.config)
        )
        return Result(
            log=task.log,
            group=task.group,
            config=task.config,
            status=answer["status"],
            exit_status=answer.get("exit_status"),
            error=answer.get("error"),
            key=answer.get("key", ""),
            damaged=answer.get("damaged", False),
            metrics=metrics,
            bars=bars,
            report=answer.get("report"),
        )

    def results(self, *, complete: bool) -> Results:
        """What there is; what is missing as interrupted."""
        missing = {"status": "interrupted", "error": "not done when the suite was stopped"}
        rows = [
            self.done[task.name] if task.name in self.done else self._judged(task, missing)
            for task in self.tasks
        ]
        block = RunBlock(
            started=self._started.isoformat(timespec="seconds"),
            finished=datetime.now(UTC).isoformat(timespec="seconds"),
            elapsed_s=round(time.monotonic() - self._clock, 3),
            host=platform.node(),
            platform=platform.platform(),
            python=platform.python_version(),
            vehnav=__version__,
            jobs=self.jobs,
            complete=complete and len(self.done) == len(self.tasks),
            resumed=self.resumed,
            seconds=dict(self.seconds),
            memory_mb=dict(self.memory_mb),
        )
        return Results.of(self.suite.name, rows, block)

    def save_if_due(self) -> None:
        """Write the results so far now and then; a full disk is told at the end."""
        now = time.monotonic()
        if now - self._saved < max(SAVE_SECONDS, self._cost / SAVE_SHARE):
            return
        with suppress(ConfigError):
            save(self.results(complete=False), self.out)
        self._saved = time.monotonic()
        self._cost = self._saved - now


# ---- this machine ------------------------------------------------------------------------------


def kinds_of(tasks: Sequence[Task]) -> list[dict[str, Any]]:
    """The different configurations as far as they decide which kernels run."""
    found: list[dict[str, Any]] = []
    for task in tasks:
        kind: dict[str, Any] = {key: task.options[key] for key in KINDS if key in task.options}
        if kind not in found:
            found.append(kind)
    return found


def local_answers(tasks: Sequence[Task], limits: Limits, *, jobs: int) -> Answers:
    """What worker processes of this machine answer, as it comes; closing ends them."""
    todo: queue.SimpleQueue[Task] = queue.SimpleQueue()
    for task in tasks:
        todo.put(task)
    answers: queue.SimpleQueue[tuple[Task, dict[str, Any]] | BaseException] = queue.SimpleQueue()
    warmed, stopped = threading.Event(), threading.Event()
    fences: list[Fence] = []
    kinds = kinds_of(tasks)

    def work(first: bool) -> None:
        try:
            fence = Fence(memory_limit=limits.memory, warm=kinds)
            fences.append(fence)
            if not first:
                warmed.wait()
            fence.warm()  # the first compiles, the others load what it compiled
            warmed.set()
            while not stopped.is_set():
                task = todo.get_nowait()
                answers.put((task, fence.score(task, limits.seconds)))
        except queue.Empty:
            fence.close()
        except BaseException as error:
            answers.put(error)

    threads = [threading.Thread(target=work, args=(k == 0,), daemon=True) for k in range(jobs)]
    for thread in threads:
        thread.start()
    try:
        for _ in tasks:
            item = _next(answers)
            if isinstance(item, BaseException):
                raise item
            yield item
    finally:
        stopped.set()
        warmed.set()
        for fence in fences:
            fence.close()
        for thread in threads:
            thread.join(timeout=5.0)


def _next(answers: queue.SimpleQueue[Any]) -> Any:
    """The next answer; waits in steps, so that Ctrl-C works on every system."""
    while True:
        try:
            return answers.get(timeout=1.0)
        except queue.Empty:
            continue
