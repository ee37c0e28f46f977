"""Options that several commands share, with the table of a config file that each belongs to.

:func:`option` is ``click.option`` plus the name of the table (``input``, ``method``, ``stops``,
``gps``, ``output``): an option made with it can be set in a config file and is shown by
``--print-config``. The groups (:func:`input_options`, ...) are decorators made of such options.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import click

from vehnav.errors import ConfigError

if TYPE_CHECKING:
    ParamType = click.ParamType[Any]
else:
    ParamType = click.ParamType

F = TypeVar("F", bound=Callable[..., Any])
Table = Literal["input", "method", "stops", "gps", "output"]
TABLES: tuple[Table, ...] = ("input", "method", "stops", "gps", "output")


class TableOption(click.Option):
    """An option that a config file can set.

    Attributes
    ----------
    table : str
        The table of the config file.
    """

    def __init__(self, *args: Any, table: Table, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.table = table

    @property
    def key(self) -> str:
        """Its key in the table: the long name with underscores."""
        return _as_key(next(name for name in self.opts if name.startswith("--")))

    @property
    def off_keys(self) -> list[str]:
        """Keys that switch it off: ``no_levelling = true`` for ``--no-levelling``."""
        return [_as_key(name) for name in self.secondary_opts if name.startswith("--")]


def _as_key(long_name: str) -> str:
    return long_name.removeprefix("--").replace("-", "_")


def option(table: Table, *declarations: str, help: str, **kwargs: Any) -> Callable[[F], F]:
    """``click.option`` whose value may also come from ``[table]`` of a config file."""
    return click.option(*declarations, cls=TableOption, table=table, help=help, **kwargs)


# ---- types -------------------------------------------------------------------------------------


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


# ---- groups ------------------------------------------------------------------------------------


def _apply(options: list[Callable[[F], F]], func: F) -> F:
    for decorate in reversed(options):
        func = decorate(func)
    return func


_READ_OPTIONS: list[Callable[[Any], Any]] = [
    option("input", "--gps-file", metavar="FILE", help="GPS kept beside the recording."),
    option("input", "--speed-file", metavar="FILE", help="Wheel speed kept beside the recording."),
    option("input", "--imu-topic", metavar="TOPIC", help="Topic of the IMU.  [default: by type]"),
    option("input", "--gps-topic", metavar="TOPIC", help="Topic of the GPS.  [default: by type]"),
    option(
        "input", "--speed-topic", metavar="TOPIC", help="Topic of the speed.  [default: by type]"
    ),
    option(
        "input",
        "--time",
        type=click.Choice(["header", "log"]),
        help="Stamps that count: of the sensor (header) or of the recorder (log).  "
        "[default: header, where it is sound]",
    ),
    option(
        "input",
        "--gps-time-offset",
        type=NumberType(),
        default=0.0,
        show_default=True,
        metavar="S",
        help="Seconds to add to the stamps of the GPS.",
    ),
    option("input", "--preset", metavar="NAME", help="Known layout of a CSV log."),
    option(
        "input",
        "--columns",
        type=PairsType(),
        default={},
        help="Columns of a CSV log, e.g. time_s=t,gyro_x=wx,gyro_y=wy.",
    ),
    option(
        "input",
        "--gyro-unit",
        type=click.Choice(["rad/s", "deg/s", "deg/h", "mrad/s"]),
        help="Unit of the gyros.  [default: as the format declares]",
    ),
    option(
        "input",
        "--accel-unit",
        type=click.Choice(["m/s2", "g", "mg"]),
        help="Unit of the accelerometers.  [default: as the format declares]",
    ),
]
_READ_FIELDS = (
    "gps_file", "speed_file", "imu_topic", "gps_topic", "speed_topic", "time", "gps_time_offset",
    "preset", "columns", "gyro_unit", "accel_unit",
)  # fmt: skip


def input_options(func: F) -> F:
    """Options of how a log is read; the command gets ``read_options: ReadOptions``."""

    @functools.wraps(func)
    def with_read_options(*args: Any, **kwargs: Any) -> Any:
        from vehnav.logs.log import ReadOptions

        fields = {name: kwargs.pop(name) for name in _READ_FIELDS}
        return func(*args, read_options=ReadOptions(**fields), **kwargs)

    return _apply(_READ_OPTIONS, with_read_options)  # type: ignore[return-value]


def span_options(func: F) -> F:
    """``start``, ``end`` (:class:`Instant` or None), ``stamps`` and ``max_gap`` (s)."""
    return _apply(
        [
            option(
                "input", "--stamps", type=click.Choice(["auto", "raw"]), default="auto",
                show_default=True,
                help="auto: jittered stamps of an IMU that samples evenly are regressed.",
            ),
            option(
                "input", "--start", type=InstantType(),
                help="Begin here: seconds from the start of the log, or an ISO time.",
            ),
            option(
                "input", "--end", type=InstantType(),
                help="End here: seconds from the start of the log, or an ISO time.",
            ),
            option(
                "input", "--max-gap", type=NumberType(min=0), default=0.5, metavar="S",
                show_default=True, help="Longest hole in the IMU that is bridged by its edges.",
            ),
        ],
        func,
    )  # fmt: skip


_CALIBRATED = {"axes", "accel_axes", "mount"}


def _use_calibration(ctx: click.Context, param: click.Parameter, value: str | None) -> None:
    """Take axes and mounting from a file; options on the command line still count more."""
    from vehnav.cli.settings import load_config

    if value is None or ctx.resilient_parsing:
        return
    values = load_config(ctx, value)
    if not values or set(values) - _CALIBRATED:
        raise ConfigError(
            f"{value}: not a calibration: expected [input] with axes, accel_axes and mount, as "
            "'vehnav info LOG --save-calibration FILE' writes it"
        )
    ctx.default_map = {**(ctx.default_map or {}), **values}


def axes_options(func: F) -> F:
    """``axes`` (letters, ``auto`` or None), ``accel_axes`` (letters or None), ``mount`` (deg)."""
    return _apply(
        [
            click.option(
                "--calibration", metavar="FILE", is_eager=True, expose_value=False,
                callback=_use_calibration,
                help="Axes and mounting of this car, as 'vehnav info --save-calibration' wrote "
                "them; --axes, --accel-axes and --mount count more.",
            ),
            option(
                "input", "--axes", type=AxesType(auto=True),
                help="Where the sensor's x, y, z point in the vehicle: three letters of F B L R U "
                "D; FLU is ROS.  [default: auto, from gravity, departures, turns and GPS]",
            ),
            option(
                "input", "--accel-axes", type=AxesType(auto=False),
                help="The same for an accelerometer that differs from the gyro.",
            ),
            option(
                "input", "--mount", type=NumbersType("ROLL,PITCH,YAW"), default=(0.0, 0.0, 0.0),
                help="Small attitude of the case that remains after --axes, deg: roll right side "
                "down, pitch nose up, yaw clockwise.",
            ),
        ],
        func,
    )  # fmt: skip


def stops_options(func: F) -> F:
    """``stop_threshold`` (deg/s), ``stop_statistic``, ``stop_window``, ``stop_dwell`` (s).

    None where the option is not given: the sensor file or the library decides.
    """
    return _apply(
        [
            option(
                "stops", "--stop-threshold", type=NumberType(min=0, min_open=True),
                metavar="DEG_S",
                help="Angular rate under which the vehicle stands, deg/s.  "
                "[default: of the sensor file, else built in]",
            ),
            option(
                "stops", "--stop-statistic", type=click.Choice(["slow", "rms"]),
                help="slow: vehnav's rule; rms: the statistic of the paper.  [default: slow]",
            ),
            option(
                "stops", "--stop-window", type=NumberType(min=0, min_open=True), metavar="S",
                help="Window of the statistic, s.  [default: built in]",
            ),
            option(
                "stops", "--stop-dwell", type=NumberType(min=0), metavar="S",
                help="Shortest stop, s.  [default: built in]",
            ),
        ],
        func,
    )  # fmt: skip


def json_option(func: F) -> F:
    """``as_json``: one document on stdout and nothing else."""
    return click.option(
        "--json", "as_json", is_flag=True, help="Print one JSON document and nothing else."
    )(func)


def strict_option(func: F) -> F:
    """``strict``: findings of level warning or above, or damage, make the exit status 1."""
    return click.option(
        "--strict", is_flag=True, help="Exit status 1 if anything was found (warning or above)."
    )(func)


def quiet_option(func: F) -> F:
    """``quiet``: no summary, no progress; findings and errors stay."""
    return click.option(
        "--quiet", "-q", is_flag=True, help="Print no summary and no progress; warnings stay."
    )(func)
