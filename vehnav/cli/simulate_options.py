"""Options of ``vehnav simulate``, in groups."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from vehnav.cli.common import NumberType
from vehnav.cli.types import ParamType

F = TypeVar("F", bound=Callable[..., Any])

_ABOVE_ZERO = NumberType(min=0, min_open=True)
_NOT_NEGATIVE = NumberType(min=0)


class OutageType(ParamType):
    """``A:B``, or ``every=180,length=60,from=60``: stretches without GPS, seconds."""

    name = "A:B|every=..."

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[float, float] | dict[str, float]:
        """Read one stretch, or the rule of a row of them."""
        if not isinstance(value, str):
            return value  # type: ignore[no-any-return]
        try:
            if "=" not in value:
                start, end = (float(x) for x in value.split(":"))
                if 0.0 <= start < end < float("inf"):
                    return start, end
            else:
                rule = {k.strip(): float(x) for k, x in (p.split("=") for p in value.split(","))}
                if set(rule) == {"every", "length", "from"} and 0 < rule["length"] < rule["every"]:
                    return rule
        except ValueError:
            pass
        return self.fail(
            f"{value!r}: expected START:END or every=S,length=S,from=S (seconds)", param, ctx
        )


def _number(
    name: str, kind: click.ParamType[Any], default: float | None, unit: str, help: str
) -> Callable[[F], F]:
    shown = default is not None
    return click.option(
        name, type=kind, default=default, metavar=unit, show_default=shown, help=help
    )


def _applied(func: F, options: list[Callable[[F], F]]) -> F:
    for decorate in reversed(options):
        func = decorate(func)
    return func


def drive_options(func: F) -> F:
    """What is measured, how often, by which sensor."""
    return _applied(
        func,
        [
            click.option("-o", "--output", metavar="LOG", help="Log to write: .mcap or .csv."),
            click.option("--list", "listing", is_flag=True, help="List scenarios and sensors."),
            click.option(
                "--sensor",
                metavar="NAME|FILE",
                default="mems-industrial",
                show_default=True,
                help="Grade of the catalogue, or a sensor file (TOML).",
            ),
            click.option(
                "--seed",
                type=click.IntRange(min=0),
                default=0,
                show_default=True,
                metavar="N",
                help="Of the sensor errors; the way has a seed of its own (city,seed=3).",
            ),
            click.option(
                "--runs",
                type=click.IntRange(min=1),
                default=1,
                show_default=True,
                metavar="N",
                help="Logs of the same drive with other errors: LOG-001, LOG-002, ...",
            ),
            click.option(
                "--sampling",
                type=click.Choice(["rates", "increments"]),
                default="rates",
                show_default=True,
                help="Samples of the rates, or their integrals over each step.",
            ),
            _number("--rate", _ABOVE_ZERO, 100.0, "HZ", "IMU samples per second."),
            _number(
                "--duration",
                _ABOVE_ZERO,
                None,
                "S",
                "Length of the drive.  [default: the scenario's]",
            ),
            click.option(
                "--ellipsoid",
                type=click.Choice(["wgs84", "krasovsky"]),
                help="Ellipsoid and gravity.  [default: wgs84]",
            ),
            _number(
                "--truth-rate",
                _ABOVE_ZERO,
                None,
                "HZ",
                "Rows of the truth per second.  [default: the IMU's]",
            ),
        ],
    )


def gps_options(func: F) -> F:
    """Everything about the receiver."""
    return _applied(
        func,
        [
            click.option("--gps/--no-gps", default=True, help="Whether the log has fixes."),
            _number("--gps-rate", _ABOVE_ZERO, 1.0, "HZ", "Fixes per second."),
            _number("--gps-noise", _NOT_NEGATIVE, 0.7, "M", "White noise of a fix, m."),
            _number(
                "--gps-drift",
                _NOT_NEGATIVE,
                1.2,
                "M",
                "Slow error of the fixes (first-order Markov), m.",
            ),
            _number(
                "--gps-drift-time", _ABOVE_ZERO, 120.0, "S", "Time constant of the slow error, s."
            ),
            _number(
                "--gps-velocity-noise",
                _NOT_NEGATIVE,
                None,
                "M_S",
                "The fixes carry a velocity with this noise, m/s.  [default: no velocity]",
            ),
            _number(
                "--gps-latency",
                _NOT_NEGATIVE,
                0.0,
                "S",
                "A fix is stamped this much later than it was true.",
            ),
            click.option(
                "--outage",
                "outages",
                type=OutageType(),
                multiple=True,
                help="No fixes from A to B seconds; or every=180,length=60,from=60. Repeatable.",
            ),
        ],
    )


def wheel_options(func: F) -> F:
    """Everything about the wheel speed."""
    return _applied(
        func,
        [
            click.option("--wheel/--no-wheel", default=False, help="Whether there is wheel speed."),
            _number("--wheel-rate", _ABOVE_ZERO, 10.0, "HZ", "Wheel speeds per second."),
            _number("--wheel-noise", _NOT_NEGATIVE, 0.03, "M_S", "Noise of the wheel speed, m/s."),
            _number(
                "--wheel-scale",
                NumberType(min=-50, max=50),
                0.4,
                "PERCENT",
                "Scale error of the wheel speed.",
            ),
        ],
    )
