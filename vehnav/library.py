"""The library's own door: keyword options instead of records (``from vehnav import read_log``)."""

from __future__ import annotations

from os import PathLike
from typing import Any

from vehnav.logs import read
from vehnav.logs.log import Log, ReadOptions


def read_log(path: str | PathLike[str], **options: Any) -> Log:
    """Read a recording of any supported kind.

    Parameters
    ----------
    path : path
    **options
        Fields of :class:`vehnav.logs.log.ReadOptions`, e.g. ``gps_file="gps.pos"``.

    Returns
    -------
    Log

    Raises
    ------
    LogError, FormatError, ConfigError
        What is wrong, where, and what to do.
    TypeError
        An option of another name.

    Examples
    --------
    >>> from vehnav import read_log, run  # doctest: +SKIP
    >>> found = run(read_log("city.mcap"))  # doctest: +SKIP
    >>> found.errors.horizontal[-1]  # doctest: +SKIP
    """
    return read.read_log(str(path), ReadOptions(**options))
