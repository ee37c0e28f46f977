"""``@kernel``: compile a per-sample formula with numba, or run the same source as plain Python.

A kernel is written on scalars and tuples only: no arrays inside, no ``@``, no fastmath, so that the
compiled result equals the plain one bit for bit. :func:`kernel` is for the small formulas, one per
equation; :func:`entry_kernel` for the loop that Python calls, whose machine code is kept on disk.

numba's own disk cache looks at the file of the outermost function only: an edited constant or
callee in a sibling file would give the OLD result silently. The cache here lives in a folder named
by a digest of every source that the loop can depend on, so it can never be stale; where no folder
can be written, the code is compiled in memory. Folders of older sources are removed, but for the
newest few.

``NUMBA_DISABLE_JIT=1`` runs everything as plain Python; without numba at all that is what happens,
with one warning.
"""

from __future__ import annotations

import functools
import hashlib
import os
import re
import shutil
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])

KEPT_FOLDERS = 32
"""Folders of compiled code that stay on disk: one per module with a loop, some versions of each."""

try:
    import numba as _numba

    numba: Any = _numba
except ImportError:
    numba = None
    warnings.warn(
        "numba cannot be imported: vehnav integrates as plain Python, about 180 times slower",
        RuntimeWarning,
        stacklevel=2,
    )


def source_digest(module: str) -> str:
    """Hexadecimal digest of every source that compiled code of a module can depend on.

    The sources are those of the module and of what it imports from its own package, directly or by
    others; an edit anywhere else does not cost a compilation.
    """
    root = Path(__file__).parent
    digest = hashlib.sha256(sys.version.encode())
    wanted, seen = [module], set()
    while wanted:
        name = wanted.pop()
        path = root.joinpath(*name.split(".")[1:])
        path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
        if path in seen or not path.is_file():
            continue
        seen.add(path)
        for found in _IMPORT.finditer(path.read_text(encoding="utf-8")):
            source, names = found["source"], re.findall(r"\w+", found["names"] or "")
            wanted += [source, *(f"{source}.{x}" for x in names)]
    for path in sorted(seen):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:20]


_IMPORT = re.compile(
    r"^\s*(?:from|import) (?P<source>vehnav[\w.]*)(?: import (?P<names>\([^)]*\)|[^\n]*))?",
    re.MULTILINE,
)


def cache_root() -> Path:
    """The folder that holds compiled kernels: ``VEHNAV_CACHE_DIR`` or the user's cache folder."""
    if set_by_user := os.environ.get("VEHNAV_CACHE_DIR"):
        return Path(set_by_user)
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData/Local"))
    elif sys.platform == "darwin":
        base = Path.home() / "Library/Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "vehnav"


@functools.cache
def _cache_folder(module: str) -> Path | None:
    """A writable folder for the code of a module as its sources are now, or None."""
    try:
        folder = cache_root() / f"kernels-{source_digest(module)}"
        if not folder.is_dir():
            folder.mkdir(parents=True, exist_ok=True)
            _prune(folder)
        probe = folder / f".probe-{os.getpid()}"
        probe.touch()
        probe.unlink()
    except (OSError, RuntimeError):  # RuntimeError: no home folder
        return None
    return folder


def _prune(current: Path) -> None:
    """Remove the folders of older sources, the least recently used first."""

    def used(folder: Path) -> float:
        try:
            return folder.stat().st_mtime
        except OSError:  # another process removed it
            return 0.0

    others = [folder for folder in current.parent.glob("kernels-*") if folder != current]
    for folder in sorted(others, key=used, reverse=True)[KEPT_FOLDERS - 1 :]:
        shutil.rmtree(folder, ignore_errors=True)


def kernel(func: F) -> F:
    """Compile one formula; inlined by the compiler into the loop that calls it."""
    if numba is None:
        return func
    compiled: F = numba.njit(func, nogil=True)
    return compiled


def entry_kernel(func: F) -> F:
    """Compile a loop over samples that Python calls; its machine code is cached on disk."""
    if numba is None or numba.config.DISABLE_JIT:
        return func
    dispatcher = numba.njit(func, nogil=True)
    if _cache_folder(func.__module__) is not None:
        dispatcher._cache = _digest_cache(func)
    compiled: F = dispatcher
    return compiled


def _digest_cache(func: Callable[..., Any]) -> Any:
    """The function cache of numba, looking in the folder of :func:`source_digest`."""
    from numba.core import caching as numba_caching

    caching: Any = numba_caching

    class Locator(caching._CacheLocator):  # type: ignore[misc]
        """Where the machine code lies: the digest is in the path, so the stamp can be constant."""

        def get_cache_path(self) -> str:
            return str(_cache_folder(func.__module__))

        def get_source_stamp(self) -> str:
            return "digest-in-path"

        def get_disambiguator(self) -> str:
            return str(func.__code__.co_firstlineno)

        @classmethod
        def from_function(cls, py_func: Any, py_file: str) -> Locator:
            return cls()

    class Impl(caching.CompileResultCacheImpl):  # type: ignore[misc]
        _locator_classes = (Locator,)

    class DigestCache(caching.FunctionCache):  # type: ignore[misc]
        _impl_class = Impl

    return DigestCache(func)
