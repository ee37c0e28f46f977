"""Output files appear whole or not at all: written under another name, then renamed."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A name beside ``path`` to write to; renamed to ``path`` at the end, removed after an error.

    The suffix is kept (writers choose the format by it) and a link is followed (the file it points
    to is replaced, not the link). A device or a pipe is written directly. OSError where the folder
    does not exist or cannot be written; it names ``path``, not the other name.

    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> with atomic_path(folder / "a.csv") as temporary:
    ...     _ = temporary.write_text("1,2")
    >>> sorted(item.name for item in folder.iterdir())
    ['a.csv']
    """
    final = Path(os.path.realpath(path))
    if final.exists() and not final.is_file():
        yield final
        return
    temporary = final.with_name(f".{final.stem}-{uuid.uuid4().hex[:8]}.part{final.suffix}")
    try:
        yield temporary
        temporary.replace(final)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink()
        if isinstance(error, OSError) and str(error.filename) == str(temporary):
            reason = error.strerror if final.parent.is_dir() else "its folder does not exist"
            raise OSError(error.errno, reason, os.fspath(path)) from error
        raise
