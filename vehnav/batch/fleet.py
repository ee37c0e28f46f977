"""A suite over a Dask cluster: the same tasks, the same fences, another place.

Each thread of a cluster's worker keeps a fence of its own, so that a log cannot take the worker
with it; where a whole worker goes, Dask gives its tasks to others. Few tasks are with the scheduler
at a time, so that a suite of any size is no burden for it.
"""

from __future__ import annotations

import logging
import os
import threading
import uuid
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from vehnav.batch.fence import Fence, WorkerError
from vehnav.batch.task import Task, code_digest
from vehnav.errors import ConfigError

CONNECT_SECONDS: Final = 30.0
"""To find the scheduler, and its first worker."""
WATCH_SECONDS: Final = 10.0
"""Between two questions to the scheduler whether it is still there."""
ANSWER_SECONDS: Final = 60.0
"""For its answer; it may be busy."""
LOUD: Final = ("distributed.client", "distributed.core", "distributed.comm")
"""Their tracebacks of a lost connection would hide the sentence that says it."""
IN_FLIGHT: Final = 3
"""Tasks for each thread of the cluster that the scheduler knows of at a time."""

Answers = Iterator[tuple[Task, dict[str, Any]]]


def fleet_answers(
    tasks: Sequence[Task],
    address: str,
    *,
    seconds: float | None,
    memory: int | None,
    warm: Sequence[Mapping[str, Any]] = (),
) -> Answers:
    """What the workers of a cluster answer, as it comes; closing takes the rest back.

    Parameters
    ----------
    tasks : sequence of Task
    address : str
        Of the Dask scheduler.
    seconds, memory : float, int or None
        Limits for each log.
    warm : sequence of mapping
        Configurations whose kernels each worker compiles first.

    Raises
    ------
    ConfigError
        No ``distributed``, no scheduler, no worker; a worker with another vehnav, or one that does
        not see the folder of the results.
    WorkerError
        The cluster went away.
    """
    distributed = _distributed()
    with _connected(distributed, address) as client, _token(tasks[0]) as token:
        left = iter(tasks)
        sent: dict[Any, Task] = {}
        options = {"seconds": seconds, "memory": memory, "warm": list(warm), "token": token}
        running = distributed.as_completed(loop=client.loop)

        def send() -> None:
            task = next(left, None)
            if task is not None:
                with _gone():
                    future = client.submit(score_here, task.to_dict(), **options, pure=False)
                sent[future.key] = task
                running.add(future)

        with _gone():
            threads = sum(client.nthreads().values())
        for _ in range(max(1, IN_FLIGHT * threads)):
            send()
        for future in running:
            answer = _answer(future)
            task = sent.pop(future.key)
            future.release()
            send()
            yield task, answer
        with suppress(OSError, TimeoutError):  # they leave by themselves in the end
            client.run(close_fences)


def _distributed() -> Any:
    try:
        import distributed
    except ImportError:
        text = "--scheduler needs dask.distributed: pip install 'vehnav[fleet]'"
        raise ConfigError(text) from None
    return distributed


@contextmanager
def _connected(distributed: Any, address: str) -> Iterator[Any]:
    """A client of the cluster; ConfigError where there is none or it has no worker."""
    for name in LOUD:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        distributed.comm.resolve_address(address)  # a client without an address hangs in its end
        client = distributed.Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise ConfigError(f"{address}: no Dask scheduler answers: {error}") from error
    try:
        try:
            client.wait_for_workers(1, timeout=CONNECT_SECONDS)
        except TimeoutError:
            raise ConfigError(f"{address}: the scheduler has no workers") from None
        with _watched(client):
            yield client
    finally:
        with suppress(TimeoutError, OSError):  # the scheduler may be gone
            client.close(timeout=5)


@contextmanager
def _watched(client: Any) -> Iterator[None]:
    """Where the scheduler answers no more, hang up: all that waits for it ends.

    A scheduler that is stopped, or whose machine is cut off, keeps its connections otherwise.
    """
    done = threading.Event()
    address = client.scheduler.address

    def hang_up() -> None:
        client.rpc.remove(address)
        if client.scheduler_comm is not None:
            client.scheduler_comm.comm.abort()

    def watch() -> None:
        while not done.wait(WATCH_SECONDS):
            try:
                client.sync(client.scheduler.identity, callback_timeout=ANSWER_SECONDS)
            except Exception:
                if not done.is_set():
                    client.loop.add_callback(hang_up)
                return

    threading.Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        done.set()


@contextmanager
def _token(task: Task) -> Iterator[str]:
    """A file in the folder of the results, by which a worker shows that it sees the folder."""
    path = Path(task.out) / f".shared-{uuid.uuid4().hex[:8]}"
    if task.keep == "figures":
        yield ""
        return
    path.write_text("", encoding="utf-8")
    try:
        yield str(path)
    finally:
        path.unlink(missing_ok=True)


def _answer(future: Any) -> dict[str, Any]:
    """What came back; errors of the cluster itself end the suite."""
    if future.status == "error":
        error = future.exception()
        if type(error).__name__ != "KilledWorker":
            raise WorkerError(f"a worker of the cluster failed: {type(error).__name__}: {error}")
        return {"status": "crash", "error": "the workers of the cluster that tried it died"}
    with _gone():
        answer = future.result()  # cancelled, or the line was cut while it was fetched
    return answer_of(answer)


@contextmanager
def _gone() -> Iterator[None]:
    """What fails between here and the scheduler, in one sentence."""
    try:
        yield
    except Exception as error:
        raise WorkerError(
            "the scheduler of the Dask cluster went away or answers no more; what was done is "
            "kept, --resume goes on"
        ) from error


def answer_of(answer: dict[str, Any]) -> dict[str, Any]:
    """The answer of a worker; ConfigError where it is no worker for this suite."""
    if "unseen" in answer:
        raise ConfigError(
            f"the worker {answer['unseen']} of the cluster does not see {answer['folder']}: give "
            "-o a folder that all share, or --keep figures"
        )
    if answer.pop("code") != code_digest():
        raise ConfigError(
            "a worker of the cluster has another vehnav, NumPy or numba than this machine: its "
            "results would not be comparable"
        )
    return answer


# ---- on the workers ----------------------------------------------------------------------------

_mine = threading.local()
_fences: list[Fence] = []


def score_here(
    task: dict[str, Any],
    *,
    seconds: float | None,
    memory: int | None,
    warm: Sequence[Mapping[str, Any]],
    token: str,
) -> dict[str, Any]:
    """Run a task behind the fence of this thread."""
    if token and not Path(token).is_file():
        import platform

        return {"unseen": f"{platform.node()}, process {os.getpid()}", "folder": task["out"]}
    fence = getattr(_mine, "fence", None)
    if fence is None or fence.closed or _mine.memory != memory:
        if fence is not None:
            fence.close()
        fence = Fence(memory_limit=memory, warm=warm)
        _mine.fence, _mine.memory = fence, memory
        _fences.append(fence)
    return {**fence.score(Task(**task), seconds), "code": fence.code}


def close_fences() -> None:
    """End the processes behind the fences of this worker: the suite is done."""
    while _fences:
        with suppress(OSError):
            _fences.pop().close()
