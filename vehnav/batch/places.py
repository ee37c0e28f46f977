"""Where the logs of a suite are: files, folders, patterns, URLs; and what their names become."""

from __future__ import annotations

import glob
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from vehnav.errors import ConfigError

_BESIDE: Final = (".gps.csv", ".speed.csv", ".truth.csv", ".vehnav")
"""Endings of what is kept beside a log, or made from it: no logs themselves."""


@dataclass(frozen=True)
class Place:
    """One log: its name, where it is, and what messages call it."""

    name: str
    source: str
    shown: str


def is_url(text: str) -> bool:
    """Whether it is for fsspec: ``s3://...``, ``memory://...``."""
    return re.match(r"[A-Za-z][A-Za-z0-9+.-]+://", text) is not None


def expanded(text: str) -> str:
    """``${NAME}`` and ``${NAME:-default}`` from the environment; ConfigError where it is not set.

    >>> expanded("${NO_SUCH_NAME:-logs}/a.mcap")
    'logs/a.mcap'
    """

    def value(found: re.Match[str]) -> str:
        name, default = found[1], found[2]
        inside = os.environ.get(name) or default
        if inside is None:
            raise ConfigError(f"{text}: the environment has no {name}")
        return inside

    return re.sub(r"\$\{(\w+)(?::-([^}]*))?\}", value, text)


def beside(name: str, folder: Path) -> str:
    """A file named in the suite, relative to it; any other name as it is."""
    path, comma, rest = expanded(name).partition(",")
    if Path(path).suffix.lower() not in (".toml", ".gpx", ".geojson", ".json", ".csv"):
        return name
    return f"{folder / path}{comma}{rest}"


def folder_name(name: str) -> str:
    """A name that every file system takes.

    >>> folder_name("Süd/run 1: a")
    'Süd-run_1_a'
    """
    plain = re.sub(r"[^\w.+-]+", "_", re.sub(r"[/\\]+", "-", name)).strip("_.-")
    return plain or "log"


def find_places(pattern: str, folder: Path, where: str, *, optional: bool) -> list[Place]:
    """The logs of a path, pattern or URL, in the order of their names.

    Raises
    ------
    ConfigError
        Nothing is there, and it is not optional.
    """
    try:
        text = expanded(pattern)
    except ConfigError as error:
        if optional:
            return []
        raise ConfigError(f"{where} path: {error}") from error
    wild = glob.has_magic(text)
    if is_url(text):
        found = _in_store(text, where, wild=wild)
    elif wild:
        matches = glob.glob(text, root_dir=folder, recursive=True)  # noqa: PTH207 absolute as well
        found = sorted(matches)
    else:
        found = [text] if (folder / text).exists() else []
    if wild:
        found = [item for item in found if not item.endswith(_BESIDE)]
    if not found and not optional:
        what = "matches nothing" if wild else "no such file or folder"
        raise ConfigError(
            f"{where} path: {text}: {what} in {folder.resolve()}; optional = true lets it be absent"
        )
    return [
        Place(name, item if is_url(item) else str(folder / item), item)
        for name, item in zip(_names(found), found, strict=True)
    ]


def _names(found: list[str]) -> list[str]:
    """Stems; with as many folders before them as make them different."""
    parts = [Path(item).with_suffix("").parts for item in found]
    for count in range(1, max(map(len, parts), default=0) + 1):
        names = ["-".join(steps[-count:]) for steps in parts]
        if len(set(names)) == len(names):
            return names
    return ["-".join(Path(item).parts) for item in found]


def store_of(url: str) -> tuple[Any, str]:
    """The file system of fsspec that a URL names, and the path in it.

    ConfigError without fsspec, or where it does not know the protocol.
    """
    try:
        import fsspec
    except ImportError:
        raise ConfigError(f"{url}: a URL needs fsspec: pip install 'vehnav[fleet]'") from None
    try:
        store, path = fsspec.core.url_to_fs(url)
    except (ImportError, ValueError) as error:
        raise ConfigError(f"{url}: {error}") from error
    return store, path


def _in_store(url: str, where: str, *, wild: bool) -> list[str]:
    store, path = store_of(url)
    try:
        found = sorted(store.glob(path)) if wild else [path] if store.exists(path) else []
    except OSError as error:
        raise ConfigError(f"{where} path: {url}: {error}") from error
    return [str(store.unstrip_protocol(item)) for item in found]
