"""Options of ``vehnav budget``, in groups."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from vehnav.cli.common import NumberType, option
from vehnav.cli.types import ParamType

F = TypeVar("F", bound=Callable[..., Any])

METRIC_NAMES = ("drms", "cep50", "cep95", "east", "north")
_ABOVE_ZERO = NumberType(min=0, min_open=True)


class TimesType(ParamType):
    """Positive numbers joined by commas, in order."""

    name = "S,S,..."

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[float, ...]:
        """Read them; sorted, each once."""
        if isinstance(value, list | tuple):
            value = ",".join(str(x) for x in value)
        try:
            numbers = sorted({float(x) for x in str(value).split(",")})
        except ValueError:
            numbers = []
        if not numbers or not all(0.0 < x < float("inf") for x in numbers):
            return self.fail(f"{value!r}: expected seconds above zero, as 60,300,600", param, ctx)
        return tuple(numbers)


class StopsType(ParamType):
    """``auto``, ``none`` or ``every:S``."""

    name = "auto|none|every:S"

    def convert(self, value: Any, param: Any, ctx: Any) -> str | float:
        """``auto``, ``none``, or the seconds."""
        if value in ("auto", "none") or isinstance(value, float):
            return value  # type: ignore[no-any-return]
        head, _, tail = str(value).partition(":")
        try:
            seconds = float(tail) if head == "every" else 0.0
        except ValueError:
            seconds = 0.0
        if not 0.0 < seconds < float("inf"):
            return self.fail(f"{value!r}: expected auto, none or every:S (seconds)", param, ctx)
        return seconds


def _applied(func: F, options: list[Callable[[F], F]]) -> F:
    for decorate in reversed(options):
        func = decorate(func)
    return func


def model_options(func: F) -> F:
    """Sensor, start, stops, model."""
    return _applied(
        func,
        [
            option(
                "method", "--sensor", metavar="NAME|FILE|all",
                help="Grade of the catalogue, sensor file (TOML), or all: the catalogue ranked.  "
                "[default: all; hg1700 with --solve, --mc and --stop-intervals; the log's own "
                "rest with --legs]",
            ),
            option(
                "method", "--init", metavar="levelled|given|FILE",
                help="Start: tilt from the accelerometers (levelled) or an error of its own "
                "(given: 0.02 deg); both heading 0.1 deg, 0.05 m/s, 1 m. FILE: TOML with "
                "[initial].  [default: levelled where the drive begins standing]",
            ),
            option(
                "stops", "--stops", type=StopsType(), default="auto", show_default=True,
                metavar="auto|none|every:S",
                help="Stops at which velocity is reset and the platform levelled: those of the "
                "drive, none, or those at least S seconds apart.",
            ),
            option(
                "stops", "--levelling-window", type=_ABOVE_ZERO, default=3.0, metavar="S",
                show_default=True, help="Seconds at the end of a stop that give the level.",
            ),
            option(
                "stops", "--gyro-bias-from-stops/--no-gyro-bias-from-stops", "gyro_from_stops",
                default=False, show_default=True,
                help="Take off at every stop the gyro bias that it shows, as `vehnav run` does by "
                "default.",
            ),
            click.option(  # a config file's vertical is that of `vehnav run`
                "--vertical", type=click.Choice(["held", "free"]), default="held",
                show_default=True, help="Height from outside, or integrated.",
            ),
            option(
                "method", "--model", type=click.Choice(["full", "paper", "simplified"]),
                default="full", show_default=True,
                help="Error equations: all terms; those that paper 001 keeps; without the rate of "
                "the frame.",
            ),
            option("method", "--at", type=TimesType(), help="Seconds from the start.  "
                   "[default: the end]"),
        ],
    )  # fmt: skip


def question_options(func: F) -> F:
    """Monte Carlo, requirement, intervals, legs."""
    return _applied(
        func,
        [
            click.option(
                "--mc", type=click.IntRange(min=1), metavar="N",
                help="Check by N runs of the nonlinear mechanization with drawn errors.",
            ),
            click.option(
                "--seed", type=click.IntRange(min=0), default=0, show_default=True, metavar="N",
                help="Of the drawn errors.",
            ),
            click.option(
                "--require", type=_ABOVE_ZERO, metavar="M",
                help="Metres allowed at the last --at; alone: exit status 1 where exceeded.",
            ),
            click.option(
                "--metric", type=click.Choice(METRIC_NAMES), default="cep95", show_default=True,
                help="What --require is about, and what ranks.",
            ),
            click.option(
                "--solve", metavar="equal|scale|PARAM",
                help="What may the sensor have for --require: equal shares of all classes, the "
                "sensor times one factor, or one parameter (gyro_bias, arw, heading, ...).",
            ),
            click.option(
                "--stop-intervals", type=TimesType(),
                help="Error against the interval between corrections: stops at least so far "
                "apart.",
            ),
            click.option(
                "--legs", is_flag=True,
                help="Of a log with GPS: predicted and real error of every leg between stops.",
            ),
        ],
    )  # fmt: skip
