"""Parameter types of the command line: instants, numbers, pairs, axes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import click

from vehnav.errors import ConfigError

if TYPE_CHECKING:
    ParamType = click.ParamType[Any]
else:
    ParamType = click.ParamType


@dataclass(frozen=True)
class Instant:
    """A moment of a log: seconds from its start, or an absolute one.

    Attributes
    ----------
    text : str
        As it was written.
    offset_ns : int or None
        Nanoseconds from the start of the log.
    unix_ns : int or None
        Unix nanoseconds.
    """

    text: str
    offset_ns: int | None = None
    unix_ns: int | None = None

    def on_clock(self, start_ns: int, *, unix_clock: bool) -> int:
        """Nanoseconds on the clock of a log that starts at ``start_ns``.

        ConfigError for an absolute time in a log without Unix time.
        """
        if self.unix_ns is None:
            return start_ns + (self.offset_ns or 0)
        if not unix_clock:
            raise ConfigError(
                f"{self.text}: this log has no Unix time; give seconds from its start instead"
            )
        return self.unix_ns


class InstantType(ParamType):
    """``12.5`` (seconds from the start of the log) or ``2024-05-01T12:00:00Z``."""

    name = "TIME"

    def convert(self, value: Any, param: Any, ctx: Any) -> Instant:
        """Read an :class:`Instant`; an ISO time without a zone is taken as UTC."""
        if isinstance(value, Instant):
            return value
        text = str(value)
        try:
            return Instant(text, offset_ns=round(float(text) * 1e9))
        except (ValueError, OverflowError):
            pass
        try:
            when = datetime.fromisoformat(text)
        except ValueError:
            self.fail(f"{text!r} is neither seconds from the start nor an ISO time", param, ctx)
        since = when.replace(tzinfo=when.tzinfo or UTC) - datetime(1970, 1, 1, tzinfo=UTC)
        microseconds = (since.days * 86_400 + since.seconds) * 1_000_000 + since.microseconds
        return Instant(text, unix_ns=1000 * microseconds)


class PairsType(ParamType):
    """``a=b,c=d``: a mapping of text to text; a table in a config file."""

    name = "A=B,..."

    def convert(self, value: Any, param: Any, ctx: Any) -> dict[str, str]:
        """Read the mapping; a repeated or empty key is an error."""
        if isinstance(value, Mapping):
            return {str(key): str(item) for key, item in value.items()}
        pairs: dict[str, str] = {}
        for part in filter(None, (piece.strip() for piece in str(value).split(","))):
            key, equals, item = (piece.strip() for piece in part.partition("="))
            if not (key and equals and item):
                self.fail(f"{part!r}: expected NAME=COLUMN", param, ctx)
            if key in pairs:
                self.fail(f"{key!r} is given twice", param, ctx)
            pairs[key] = item
        return pairs


class NumberType(click.FloatRange):
    """A finite number in a range."""

    name = "number"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """Refuse nan and inf, which ``float`` would take."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number", param, ctx)
        return number


class OffsetType(ParamType):
    """Seconds, or ``auto``."""

    name = "S|auto"

    def convert(self, value: Any, param: Any, ctx: Any) -> float | str:
        """Read a finite number or the word."""
        if value == "auto":
            return "auto"
        number: float = NumberType().convert(value, param, ctx)
        return number


class NumbersType(ParamType):
    """A fixed count of numbers: ``1.5,0,-90``; an array in a config file."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.count = name.count(",") + 1

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[float, ...]:
        """Read the numbers; all must be finite."""
        parts = value.split(",") if isinstance(value, str) else list(value)
        try:
            numbers = tuple(float(part) for part in parts)
        except (TypeError, ValueError):
            numbers = ()
        if len(numbers) != self.count or not all(abs(x) < float("inf") for x in numbers):
            self.fail(f"{value!r}: expected {self.count} numbers {self.name}", param, ctx)
        return numbers


class AxesType(ParamType):
    """Three letters of F B L R U D, one for each of the sensor's x, y, z."""

    name = "XYZ"

    def __init__(self, *, auto: bool) -> None:
        self.auto = auto

    def convert(self, value: Any, param: Any, ctx: Any) -> str:
        """Upper case letters, or ``auto``."""
        text = str(value)
        if self.auto and text.lower() == "auto":
            return "auto"
        along = [next((i for i, pair in enumerate(("FB", "LR", "UD")) if c in pair), -1)
                 for c in text.upper()]  # fmt: skip
        if sorted(along) != [0, 1, 2]:
            self.fail(
                f"{text!r}: expected three letters that say where x, y, z point, one of F B, "
                "one of L R, one of U D, e.g. FLU (ROS), FRD, RFU",
                param,
                ctx,
            )
        return text.upper()
