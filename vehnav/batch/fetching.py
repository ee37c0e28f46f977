"""A log comes to the worker: downloaded from a store, or simulated."""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from vehnav.batch.places import is_url, store_of
from vehnav.batch.simulation import Simulation
from vehnav.batch.task import Task, code_digest
from vehnav.errors import LogError

SIMULATED: Final = "simulated"
"""Folder of the simulated logs beside ``results.json``."""


@contextmanager
def on_this_machine(task: Task) -> Iterator[Task]:
    """The task with local files in the place of URLs; what was fetched is removed at the end.

    LogError where something cannot be fetched.
    """
    urls = {key: name for key in ("gps_file", "speed_file") if is_url(name := _name(task, key))}
    if (task.source is None or not is_url(task.source)) and not urls:
        yield task
        return
    with tempfile.TemporaryDirectory(prefix="vehnav-") as folder:
        source = task.source
        if source is not None and is_url(source):
            source = str(_fetched(source, Path(folder) / "log"))
            for beside in ("gps", "speed"):
                _fetch_beside(str(task.source), beside, Path(source).parent)
        options = dict(task.options)
        for key, name in urls.items():
            options[key] = str(_fetched(name, Path(folder) / key))
        yield replace(task, source=source, options=options)


def _name(task: Task, key: str) -> str:
    return str(task.options.get(key) or "")


def _fetched(url: str, folder: Path) -> Path:
    """The local copy of a file, or of a folder with all that is in it."""
    store, path = store_of(url)
    folder.mkdir()
    target = folder / path.rstrip("/").rpartition("/")[2]
    try:
        store.get(path, str(target), recursive=bool(store.isdir(path)))
    except OSError as error:
        raise LogError(f"{url}: cannot be fetched: {error.strerror or error}") from error
    return target


def _fetch_beside(url: str, what: str, folder: Path) -> None:
    """What vehnav keeps beside a CSV, if it is there."""
    stem, dot, suffix = url.rpartition(".")
    if dot and suffix.lower() == "csv":
        store, path = store_of(f"{stem}.{what}.csv")
        if store.exists(path):
            store.get(path, str(folder / path.rpartition("/")[2]))


@contextmanager
def simulated(task: Task) -> Iterator[str]:
    """The path of the log; one that is simulated is made first.

    It stays beside the results, so that a report can be followed by hand; where no reports are
    kept, it is removed at the end.
    """
    if task.source is not None:
        yield task.source
        return
    simulation = Simulation(**_as_tuples(task.simulation or {}))
    if task.keep == "figures":
        with tempfile.TemporaryDirectory(prefix="vehnav-") as folder:
            path = Path(folder) / f"{task.log}.mcap"
            simulation.write(path)
            yield str(path)
        return
    path = simulated_path(task)
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        simulation.write(path)
    yield str(path)


def simulated_path(task: Task) -> Path:
    """Where the simulated log of a task is kept; the name says whether it is still the same."""
    text = json.dumps([task.simulation, code_digest()], sort_keys=True)
    digest = hashlib.sha256(text.encode()).hexdigest()[:10]
    return Path(task.out) / SIMULATED / f"{task.log}-{digest}.mcap"


def _as_tuples(simulation: dict[str, Any]) -> dict[str, Any]:
    """JSON knows no tuples."""
    return {key: tuple(x) if isinstance(x, list) else x for key, x in simulation.items()}
