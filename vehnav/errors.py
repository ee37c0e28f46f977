"""What can go wrong, in two kinds.

An *error* stops the program::

    VehnavError
    ├── LogError      the recording cannot be used (missing, wrong kind, no IMU, too slow, ...)
    ├── FormatError   a file or a record in it does not follow its format
    └── ConfigError   an option or a field of a configuration file is wrong

A *finding* is trouble that navigation survives: it is printed, stored and shown, never dropped.
``ValueError`` is left for a mistake of the calling program.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Level = Literal["info", "warning", "error"]


class VehnavError(Exception):
    """Base of every error that vehnav raises on purpose; its text says what, where, what to do."""


class LogError(VehnavError):
    """The recording cannot be used."""


class FormatError(VehnavError):
    """A file, or a record in it, does not follow its format."""


class ConfigError(VehnavError):
    """An option or a field of a configuration file is wrong."""


@dataclass(frozen=True)
class Finding:
    """Trouble that navigation survives, or evidence worth keeping.

    Attributes
    ----------
    code : str
        A fixed word that suites match on, e.g. ``gap``, ``axes-contradiction``.
    level : {"info", "warning", "error"}
        ``info`` is evidence; ``warning`` may move the result; ``error``: data was lost.
    text : str
        One sentence for a person: where, what was found, what was done.
    start_ns, end_ns : int or None
        When, on the clock of the log.
    """

    code: str
    level: Level
    text: str
    start_ns: int | None = None
    end_ns: int | None = None
