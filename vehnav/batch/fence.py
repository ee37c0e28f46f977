"""A worker process with a fence around it: a log that crashes, hangs or eats memory fails alone.

Why not a pool of a library: a limit on time and memory for each log, and the exit status of a
process that died, need one process for each place anyway, with a pipe of its own, so that a dead
one holds no lock of the others. It is started as a command, not forked: the same on every system,
and allowed inside the workers of a cluster.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, Final

from vehnav.batch.task import Task
from vehnav.batch.worker import write_trouble
from vehnav.blas import ONE_THREAD
from vehnav.errors import VehnavError

START_SECONDS: Final = 300.0
"""For the imports and the compilation of the kernels."""


class WorkerError(VehnavError):
    """A worker process cannot be started."""


class Fence:
    """One worker process; replaced when it dies.

    Parameters
    ----------
    memory_limit : int or None
        Bytes that a log may take; Linux only.
    warm : sequence of mapping
        Configurations that are tried on a short drive before the first log and before the limits
        hold: kernels are compiled, and libraries are loaded that hang where memory is refused
        (OpenBLAS).

    Attributes
    ----------
    code : str
        Digest of the code that the worker runs.
    closed : bool
    """

    def __init__(
        self, *, memory_limit: int | None = None, warm: Sequence[Mapping[str, Any]] = ()
    ) -> None:
        self._first = {"memory": memory_limit or 0, "warm": list(warm)}
        self._process: subprocess.Popen[str] | None = None
        self.closed = False
        self._warm = False
        self._words: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 as long as the fence
        self._start()

    def score(self, task: Task, seconds: float | None) -> dict[str, Any]:
        """What :func:`vehnav.batch.worker.score` answers, or what became of the process.

        WorkerError where no process can be started.
        """
        try:
            answer = self._asked(task, seconds)
        except _Ended as ended:
            if ended.idle and not self.closed:  # it left as the task came
                self._end()
                return self.score(task, seconds)
            answer = self._failure(task, ended, seconds)
        if answer.pop("retire", False):
            self._end()
        return answer

    def warm(self) -> None:
        """Load and compile what every log needs; the limits hold from then on.

        WorkerError where the process does not survive that.
        """
        if self._process is None or self._process.poll() is not None:
            self._start()
        if not self._warm:
            try:
                self._ask(self._first, START_SECONDS)
            except _Ended as ended:
                raise self._no_start(ended) from None
            self._warm = True

    def _asked(self, task: Task, seconds: float | None) -> dict[str, Any]:
        self.warm()
        return self._ask(task.to_dict(), seconds)

    def close(self) -> None:
        """End the process; may be called from another thread while it works."""
        self.closed = True
        self._end()

    # ---- the process -----------------------------------------------------------------------

    def _start(self) -> None:
        if self.closed:
            raise WorkerError("the suite was stopped")
        self._words.seek(0)
        self._words.truncate()
        package = str(Path(__file__).resolve().parent.parent.parent)
        paths = [package, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
        code = "from vehnav.batch.worker import main; main()"
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-X", "faulthandler", "-c", code],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._words,
            encoding="utf-8",
            env={
                **os.environ,
                **ONE_THREAD,
                "NUMBA_NUM_THREADS": "1",
                "PYTHONPATH": os.pathsep.join(paths),
            },
        )
        try:
            self.code = str(self._read(START_SECONDS)["ready"])
        except _Ended as ended:
            raise self._no_start(ended) from None
        self._warm = False

    def _no_start(self, ended: _Ended) -> WorkerError:
        return WorkerError(f"a worker cannot start: {self._last_words() or ended}")

    def _ask(self, message: Mapping[str, Any], seconds: float | None) -> dict[str, Any]:
        process = self._process
        if process is None or process.stdin is None:
            raise _Ended(None, timed_out=False)
        try:
            process.stdin.write(json.dumps(message) + "\n")
            process.stdin.flush()
        except (OSError, ValueError):  # it died; ValueError: closed by another thread
            raise _Ended(process.wait(), timed_out=False) from None
        return self._read(seconds)

    def _read(self, seconds: float | None) -> dict[str, Any]:
        """Its next line; the process is ended where that takes longer than ``seconds``."""
        process = self._process
        if process is None or process.stdout is None:
            raise _Ended(None, timed_out=False)
        late = threading.Event()

        def stop() -> None:
            late.set()
            process.kill()

        timer = threading.Timer(seconds, stop) if seconds is not None else None
        if timer is not None:
            timer.daemon = True
            timer.start()
        try:
            line = process.stdout.readline()
        except (OSError, ValueError):
            line = ""
        finally:
            if timer is not None:
                timer.cancel()
        if not line.endswith("\n"):
            raise _Ended(process.wait(), timed_out=late.is_set())
        answer: dict[str, Any] = json.loads(line)
        return answer

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with suppress(OSError, ValueError):
                    pipe.close()

    def _failure(self, task: Task, ended: _Ended, seconds: float | None) -> dict[str, Any]:
        """The fields of a result whose process is gone."""
        if self.closed:
            return {"status": "interrupted", "error": "the suite was stopped"}
        words = self._last_words()
        self._end()
        if ended.timed_out:
            return {"status": "timeout", "error": f"over the time limit of {seconds:g} s"}
        write_trouble(task, words)
        return {"status": "crash", "error": f"its process {ended}"}

    def _last_words(self) -> str:
        """The end of what the process said on stderr."""
        with suppress(OSError, ValueError):
            size = self._words.seek(0, os.SEEK_END)
            self._words.seek(max(0, size - 4000))
            return self._words.read().decode("utf-8", errors="replace").strip()
        return ""


class _Ended(Exception):
    """The process is gone."""

    def __init__(self, status: int | None, *, timed_out: bool) -> None:
        super().__init__(_how(status))
        self.timed_out = timed_out
        self.idle = status == 0


def _how(status: int | None) -> str:
    """In words, how a process ended."""
    if status is None or status >= 0:
        return f"ended with status {status}"
    try:
        name = signal.Signals(-status).name
    except ValueError:
        name = f"signal {-status}"
    hint = " (out of memory?)" if name == "SIGKILL" else ""
    return f"was ended by {name}{hint}"
