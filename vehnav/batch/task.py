"""One log with one configuration, as it is sent to a worker; and what makes two of them equal."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from vehnav.batch.suite import Suite

FOLDER: Final = "logs"
"""Of the outputs, in the folder of ``results.json``: ``logs/LOG/CONFIG/report.html``."""


@dataclass(frozen=True)
class Task:
    """What a worker is told.

    Attributes
    ----------
    log, group, config : str
    source : str or None
        File, folder or URL; None for a simulated log.
    shown : str
        As messages call the log.
    simulation : dict or None
        Fields of :class:`vehnav.batch.simulation.Simulation`.
    options : dict
        Of ``vehnav run``: those of the configuration over those of the log.
    metrics : list of str
    keep : str
    out : str
        Folder of ``results.json``.
    previous : str or None
        Key of an earlier result: where it is still the key, nothing is done.
    """

    log: str
    group: str
    config: str
    source: str | None
    shown: str
    simulation: dict[str, Any] | None
    options: dict[str, Any]
    metrics: list[str]
    keep: str
    out: str
    previous: str | None = None

    @property
    def name(self) -> str:
        """``log/config``."""
        return f"{self.log}/{self.config}"

    @property
    def folder(self) -> Path:
        """Where its outputs go."""
        return Path(self.out) / FOLDER / self.log / self.config

    @property
    def report(self) -> str:
        """Its page, relative to the folder of ``results.json``."""
        return f"{FOLDER}/{self.log}/{self.config}/report.html"

    def to_dict(self) -> dict[str, Any]:
        """As plain data."""
        return asdict(self)


def tasks_of(suite: Suite, out: Path) -> list[Task]:
    """The work of a suite: the first configuration over all logs, then the next."""
    return [
        Task(
            log=log.name,
            group=log.group,
            config=config.name,
            source=log.source,
            shown=log.shown,
            simulation=None if log.simulation is None else log.simulation.to_dict(),
            options={**log.options, **config.options},
            metrics=list(suite.metrics),
            keep=suite.keep,
            out=str(out),
        )
        for log, config in suite.matrix()
    ]


# ---- keys --------------------------------------------------------------------------------------

_WITHOUT: Final = ("cli", "batch", "papers")
"""Rooms whose code moves no result of a run."""


@functools.cache
def code_digest() -> str:
    """Digest of every source that a result hangs on, and of the versions of NumPy and numba."""
    root = Path(__file__).parent.parent
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        inside = path.relative_to(root)
        if inside.parts[0] not in _WITHOUT:
            digest.update(inside.as_posix().encode() + b"\0")
            digest.update(path.read_bytes())
    for name in ("numpy", "numba"):
        try:
            digest.update(importlib.metadata.version(name).encode() + b"\0")
        except importlib.metadata.PackageNotFoundError:
            digest.update(b"-\0")
    return digest.hexdigest()


def task_key(task: Task, source: Path | None) -> str:
    """SHA-256 of content, options and code: equal keys give equal results.

    ``source`` is the log on this machine. OSError where it cannot be read.
    """
    parts = {
        "code": code_digest(),
        "options": {
            key: value
            for key, value in sorted(task.options.items())
            if key not in ("gps_file", "speed_file", "sensor")
        },
        "simulation": _without_folders(task.simulation),
        "name": None if source is None else source.name,  # its suffix decides how it is read
        "content": [[name, file_digest(path)] for name, path in _files(task, source)],
    }
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def _files(task: Task, source: Path | None) -> Iterator[tuple[str, Path]]:
    """Every file that the result hangs on, each with what it is."""
    if source is not None and source.is_dir():
        for path in sorted(path for path in source.rglob("*") if path.is_file()):
            yield path.relative_to(source).as_posix(), path
    elif source is not None:
        yield "log", source
        for beside in ("gps", "speed"):
            path = source.with_suffix(f".{beside}.csv")
            if path.is_file():
                yield beside, path
    for key in ("gps_file", "speed_file", "sensor"):
        name = task.options.get(key)
        if name is not None and Path(name).is_file():
            yield key, Path(name)
        elif name is not None:
            yield f"{key} {name}", Path()
    for name in _simulated_from(task.simulation):
        yield "simulated from", Path(name)


def _without_folders(simulation: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """The fields; of a route or a sensor file its name alone: its content counts by itself."""
    if simulation is None:
        return None
    names = {key: Path(simulation[key]).name for key in ("scenario", "sensor")}
    return {**simulation, **names}


def _simulated_from(simulation: Mapping[str, Any] | None) -> list[str]:
    """Files that a simulation reads: a route, a sensor."""
    if simulation is None:
        return []
    names = (simulation["scenario"].split(",")[0], simulation["sensor"])
    return [name for name in names if Path(name).is_file()]


def file_digest(path: Path) -> str:
    """SHA-256 of a file; "" for the empty path."""
    if path == Path():
        return ""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
