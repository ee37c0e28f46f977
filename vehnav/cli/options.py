"""Options that several commands share, with the table of a config file that each belongs to.

:func:`option` is ``click.option`` plus the name of the table (``input``, ``method``, ``stops``,
``gps``, ``output``): an option made with it can be set in a config file and is shown by
``--print-config``. The groups (:func:`input_options`, ...) are decorators made of such options.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, Literal, TypeVar

import click

from vehnav.cli.types import (
    AxesType,
    InstantType,
    NumbersType,
    NumberType,
    OffsetType,
    PairsType,
)
from vehnav.errors import ConfigError

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
        type=OffsetType(),
        default=0.0,
        show_default=True,
        metavar="S|auto",
        help="Seconds to add to the stamps of the GPS; auto (run): what the motion says.",
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
        if fields["gps_time_offset"] == "auto":
            ctx = click.get_current_context()
            if ctx.info_name != "run":
                raise ConfigError("--gps-time-offset auto needs a track: give seconds here")
            ctx.meta["vehnav.offset_auto"] = True
            fields["gps_time_offset"] = 0.0
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


_CALIBRATED = {"axes", "accel_axes", "mount", "accel_scale"}


def _use_calibration(ctx: click.Context, param: click.Parameter, value: str | None) -> None:
    """Take axes and mounting from a file; options on the command line still count more."""
    from vehnav.cli.settings import load_config

    if value is None or ctx.resilient_parsing:
        return
    values = load_config(ctx, value)
    if not values or set(values) - _CALIBRATED:
        raise ConfigError(
            f"{value}: not a calibration: expected [input] with axes, accel_axes, mount and "
            "accel_scale, as 'vehnav info LOG --save-calibration FILE' writes it"
        )
    ctx.default_map = {**(ctx.default_map or {}), **values}


def axes_options(func: F) -> F:
    """``axes`` (letters, ``auto`` or None), ``accel_axes``, ``mount`` (deg), ``accel_scale``."""
    return _apply(
        [
            click.option(
                "--calibration", metavar="FILE", is_eager=True, expose_value=False,
                callback=_use_calibration,
                help="Axes, mounting and scale of this car, as 'vehnav info --save-calibration' "
                "wrote them; --axes, --accel-axes, --mount and --accel-scale count more.",
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
            option(
                "input", "--accel-scale", type=NumberType(min=0, min_open=True), default=1.0,
                metavar="FACTOR", show_default=True,
                help="Multiply the accelerometer by this: gravity over its reading at rest.",
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
