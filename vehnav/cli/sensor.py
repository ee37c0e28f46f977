"""``vehnav sensor``: the noise of the sensor from the log's own rest, and a file of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from vehnav.cli.common import (
    axes_options,
    command,
    finish,
    input_options,
    json_option,
    option,
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
    "sensor",
    examples=[
        "vehnav sensor city.mcap",
        "vehnav sensor bench.mcap -o ours.toml --plot ours.html",
        "vehnav run city.mcap --sensor ours.toml",
        "vehnav simulate city --sensor ours.toml -o like_ours.mcap",
    ],
)
@click.argument("log")
@click.option("--sensor-name", metavar="NAME", help="Name of the sensor.  [default: of the log]")
@option(
    "output", "-o", "--output", metavar="FILE.toml",
    help="Write a sensor file, for --sensor of run, simulate and budget; what the rest does not "
    "tell is of the nearest grade of the catalogue, and marked.",
)  # fmt: skip
@option(
    "output", "--plot", metavar="FILE",
    help="Write the Allan deviation with the fit: .svg, .html, or .png and .pdf (extra plots).",
)  # fmt: skip
@input_options
@span_options
@axes_options
@stops_options
@json_option
@strict_option
def sensor(
    log: str,
    sensor_name: str | None,
    output: str | None,
    plot: str | None,
    read_options: ReadOptions,
    as_json: bool,
    strict: bool,
    **options: Any,
) -> None:
    """Noise, bias instability and random walk of the sensor, from the rest in a log.

    Every stop counts, each by itself (overlapping Allan deviation); the mean rates of the stops
    tell of the gyro bias beyond them. A figure comes with one sigma; < is a 95 % limit, - cannot
    be told, and the screen says why. Axes are the sensor's own, as logged.
    """
    from vehnav.cli.run import config_from
    from vehnav.logs.read import read_log
    from vehnav.noise import estimate, rest_noise, write_sensor
    from vehnav.noise.sensor import check_suffix
    from vehnav.report.allan_plot import check_plot, write_allan_plot
    from vehnav.report.sensor_text import document, screen

    if output is not None:
        check_suffix(output)
    if plot is not None:
        check_plot(plot)
    with progress(f"{log}: reading", quiet=as_json):
        recording = read_log(log, read_options)
    with progress(f"{log}: rest", quiet=as_json):
        noise = rest_noise(recording, config_from(recording, options))
    found = estimate(noise, name=sensor_name)
    written = [path for path in (output, plot) if path is not None]
    if output is not None:
        write_sensor(found, output)
    if plot is not None:
        write_allan_plot(noise, found, plot)
    if as_json:
        print_json({**document(noise, found), "written": written})
    else:
        click.echo(screen(noise, found))
        for path in written:
            click.echo(f"written    {path}")
    print_findings(noise.findings, start_ns=recording.start_ns, least="warning")
    finish(damaged=recording.damaged, strict=strict, findings=noise.findings)
