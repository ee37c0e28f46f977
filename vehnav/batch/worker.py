"""A worker process: takes tasks as lines of JSON from stdin, answers in lines of JSON.

It is started by :class:`vehnav.batch.fence.Fence`, which ends it where a log takes too long; what
a log does to this process, it does to no other. Ends by itself when the process that started it is
gone.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import sys
import threading
import time
import traceback
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final

from vehnav.batch.model import metric_value
from vehnav.batch.task import Task, code_digest, task_key
from vehnav.errors import VehnavError

if TYPE_CHECKING:
    from vehnav.pipeline import Run

TROUBLE: Final = "trouble.txt"
"""In the folder of a log that failed: traceback, or the last words of the process."""
OUTPUTS: Final = ("report.html", "report.json", "trajectory.csv", TROUBLE)
BUG: Final = 70
IDLE_SECONDS: Final = 600.0
"""A worker without work leaves; the fence starts another when there is some."""
KINDS: Final = ("method", "frame", "azimuth")
"""Options that decide which kernels run."""


def main() -> None:
    """Serve until stdin ends."""
    try:
        _serve()
    except BaseException:  # an interpreter without memory may hang in its own end
        traceback.print_exc()
        os._exit(1)
    os._exit(0)


def _serve() -> None:
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what a library prints is no answer
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that started it decides
    lines: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(lines,), daemon=True).start()
    _import_all()
    _answer(answers, {"ready": code_digest()})
    while True:
        try:
            message = json.loads(lines.get(timeout=IDLE_SECONDS))
        except queue.Empty:
            return
        if "warm" in message:
            warm(message["warm"])
            limit_memory(message["memory"])
            _answer(answers, {"warm": True})
        else:
            _answer(answers, score(Task(**message)))


def _listen(lines: queue.SimpleQueue[str]) -> None:
    """Pass on the lines of stdin; at its end the process that started this one is gone."""
    for line in sys.stdin:
        lines.put(line)
    os._exit(0)


def _answer(answers: IO[str], content: Mapping[str, Any]) -> None:
    answers.write(json.dumps(content, allow_nan=False) + "\n")
    answers.flush()


def _import_all() -> None:
    """What every log needs: imported before memory and time count, by all workers at once."""
    import vehnav.logs.mcap
    import vehnav.pipeline
    import vehnav.report.document
    import vehnav.report.html
    import vehnav.simulate.mcap_file  # noqa: F401
    from vehnav.earth import WGS84, normal_gravity

    normal_gravity(0.0, 0.0, WGS84)  # the first call of a kernel sets numba up


def limit_memory(size: int) -> None:
    """Refuse more than ``size`` bytes above what the process has now; Linux only, 0: no limit."""
    if size <= 0 or sys.platform != "linux":
        return
    import resource

    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    total = pages * resource.getpagesize() + size
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    if hard == resource.RLIM_INFINITY or total < hard:
        resource.setrlimit(resource.RLIMIT_AS, (total, hard))


def memory_mb() -> float | None:
    """Largest resident memory of this process so far; None where the system does not say."""
    if sys.platform == "win32":
        return None
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(peak) / (1024.0 if sys.platform == "linux" else 1024.0**2)


def warm(options: list[dict[str, Any]]) -> None:
    """Compile the kernels of these configurations by a short drive; what fails, fails later."""
    from vehnav.batch.options import records
    from vehnav.pipeline import run
    from vehnav.simulate import simulate

    log = simulate("city,duration=60,first_stop=15,last_stop=5,stop_every=20", rate_hz=50.0).log()
    for row in options:
        try:
            run(log, records(row)[1])
        except VehnavError:
            continue


# ---- a log -------------------------------------------------------------------------------------


def score(task: Task) -> dict[str, Any]:
    """Run one log with one configuration; whatever happens becomes the fields of a result.

    Returns
    -------
    dict
        ``same``: the earlier result still holds. Else fields of
        :class:`vehnav.batch.model.Result`, and ``seconds``, ``memory_mb``; ``retire``: this process
        should do no more.
    """
    start = time.perf_counter()
    try:
        answer = _scored(task)
    except MemoryError:
        answer = {"status": "crash", "error": "out of memory; see the memory limit", "retire": True}
    except VehnavError as error:
        answer = {"status": "error", "exit_status": 2, "error": _plain(error, task)}
    except OSError as error:
        where = "" if error.filename is None else f"{Path(error.filename).name}: "
        text = f"{task.shown}: {where}{error.strerror or error}"
        answer = {"status": "error", "exit_status": 2, "error": text}
        with suppress(OSError):
            remove_outputs(task)  # half of them would look like all
    except Exception as error:
        text = f"internal error: {type(error).__name__}: {_plain(error, task)}"
        answer = {"status": "error", "exit_status": BUG, "error": text}
        write_trouble(task, traceback.format_exc())
    seconds = time.perf_counter() - start
    return {**answer, "seconds": round(seconds, 3), "memory_mb": memory_mb()}


def _plain(error: Exception, task: Task) -> str:
    """Its text in one line, with the log called as in the suite wherever its folder is."""
    text = " ".join(str(error).split())
    names = [task.source, task.options.get("gps_file"), task.options.get("speed_file")]
    for name in names:
        if name:
            text = text.replace(name, task.shown if name == task.source else Path(name).name)
    return text.replace(str(Path(task.out)) + os.sep, "")


def _scored(task: Task) -> dict[str, Any]:
    from vehnav.batch.fetching import on_this_machine, simulated

    with on_this_machine(task) as here:
        key = task_key(here, None if here.source is None else Path(here.source))
        kept = task.keep == "figures" or (Path(task.out) / task.report).is_file()
        if key == task.previous and kept:
            return {"same": True}
        remove_outputs(task)
        try:
            with simulated(here) as source:
                return {**_ran(task, here, source), "key": key}
        except VehnavError as error:
            # the log has another name on this machine than in the suite
            text = str(error).replace(str(here.source), str(task.source))
            raise type(error)(text) from error


def _ran(task: Task, here: Task, source: str) -> dict[str, Any]:
    """Read, run and report a log, as ``vehnav run`` does."""
    from vehnav.batch.options import records
    from vehnav.logs.read import read_log
    from vehnav.pipeline import run, run_at_found_offset
    from vehnav.report.document import document

    reading, config, auto = records(here.options)
    found = (run_at_found_offset if auto else run)(read_log(source, reading), config)
    content = document(found)
    if task.keep != "figures":
        _write(task, found, content)
    return {
        "status": "ok",
        "exit_status": 3 if found.log.damaged else 0,
        "damaged": found.log.damaged,
        "metrics": {name: metric_value(content, name) for name in task.metrics},
        "report": None if task.keep == "figures" else task.report,
    }


def _write(task: Task, found: Run, content: Mapping[str, Any]) -> None:
    from vehnav.export.formats import write_trajectory
    from vehnav.report.document import write_document
    from vehnav.report.html import write_html

    folder = task.folder
    folder.mkdir(parents=True, exist_ok=True)
    if task.keep == "trajectory":
        write_trajectory(
            found.trajectory,
            folder / "trajectory.csv",
            unix_clock=found.log.unix_clock,
            errors=found.errors,
            gnss=found.log.gnss,
        )
    write_document(content, folder / "report.json")
    write_html(found, content, folder / "report.html")


def remove_outputs(task: Task) -> None:
    """Take away what an earlier run left: a page beside a failed log would lie."""
    for name in OUTPUTS:
        (task.folder / name).unlink(missing_ok=True)


def write_trouble(task: Task, text: str) -> None:
    """Keep the details of a failure beside where the report would be, if the disk lets us."""
    try:
        task.folder.mkdir(parents=True, exist_ok=True)
        (task.folder / TROUBLE).write_text(text, encoding="utf-8")
    except OSError:
        return
