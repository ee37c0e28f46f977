"""``vehnav info``: what is in a log, on one screen."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vehnav.cli.common import (
    axes_options,
    command,
    finish,
    input_options,
    json_option,
    print_findings,
    print_json,
    progress,
    span_options,
    stops_options,
    strict_option,
)

if TYPE_CHECKING:
    from vehnav.logs.log import ReadOptions


@command(
    "info",
    examples=[
        "vehnav info city.mcap",
        "vehnav info city.mcap --json > ticket.json",
        "vehnav info city.mcap --save-calibration car.toml",
    ],
)
@click.argument("log")
@click.option(
    "--save-calibration", metavar="FILE",
    help="Write axes, mounting and scale to a TOML file, for --calibration with other logs of "
    "this car.",
)  # fmt: skip
@input_options
@span_options
@axes_options
@stops_options
@json_option
@strict_option
def info(
    log: str,
    save_calibration: str | None,
    read_options: ReadOptions,
    as_json: bool,
    strict: bool,
    **options: Any,
) -> None:
    """Show what is in a log: topics, rates, gaps, clocks, GPS, stops, units, axes and mounting.

    Units, axes and mounting are established from the physics, and the evidence is printed: up from
    gravity at rest, forward from departures and arrivals at stops, turns and GPS.
    """
    from vehnav.cli.run import config_from
    from vehnav.logs.read import read_log
    from vehnav.report.inspection import document, inspect_log, screen, write_calibration

    with progress(f"{log}: reading", quiet=as_json):
        recording = read_log(log, read_options)
    inspection = inspect_log(recording, config_from(recording, options))
    if as_json:
        print_json(document(inspection))
    else:
        click.echo(screen(inspection))
    shown = [finding for finding in inspection.findings if finding.code != "not-navigable"]
    print_findings(shown, start_ns=recording.start_ns, least="warning")
    if save_calibration is not None:
        write_calibration(inspection, Path(save_calibration))
        click.echo(f"written    {save_calibration}", err=as_json)
    finish(damaged=recording.damaged, strict=strict, findings=inspection.findings)
