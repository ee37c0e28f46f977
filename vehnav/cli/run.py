"""``vehnav run``: the main job."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vehnav.cli.common import (
    Instant,
    NumbersType,
    NumberType,
    axes_options,
    command,
    finish,
    input_options,
    json_option,
    option,
    print_findings,
    print_json,
    progress,
    quiet_option,
    span_options,
    stops_options,
    strict_option,
)
from vehnav.cli.types import ParamType
from vehnav.errors import ConfigError

if TYPE_CHECKING:
    from vehnav.config import Config
    from vehnav.errors import Finding
    from vehnav.logs.log import Log, ReadOptions
    from vehnav.pipeline import Run


class AidsType(ParamType):
    """Names of aids, joined by commas."""

    name = "names"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[str, ...]:
        """Read the names; the library says which there are."""
        if isinstance(value, str):
            value = value.split(",")
        return tuple(str(name).strip() for name in value)


RESULTS = ("trajectory.csv", "report.json", "report.html")
"""What every run writes into its folder."""
RUN_FIELDS = (
    "axes", "accel_axes", "mount", "accel_scale", "stamps", "max_gap", "split", "method",
    "as_published",
    "levelling", "reset", "causal", "frame", "coords", "vertical", "ellipsoid", "levelling_rate",
    "stop_threshold",
    "stop_statistic", "stop_window", "stop_dwell", "gps", "gps_start_seconds", "start_position",
    "start_heading", "start_attitude", "lever_arm", "aid", "sensor", "sensor_grade", "azimuth",
    "outage", "gnss_form",
)  # fmt: skip


@command(
    "run",
    examples=[
        "vehnav run city.mcap",
        "vehnav run drive.csv --gps-file gps.pos --axes FRD -o track.gpx",
        "vehnav run log.mcap --as-published --json",
        "vehnav run log.csv --columns time_s=t,gyro_x=wx,... --gyro-unit deg/s",
    ],
)
@click.argument("logs", nargs=-1, required=True, metavar="LOG...")
@click.option(
    "-o", "--output", "outputs", multiple=True, metavar="PATH",
    help="Also write the trajectory here; the suffix decides the format: .csv .parquet .tum "
    ".kitti .gpx .kml .geojson .mcap, or .json .html for the report. Repeatable.",
)  # fmt: skip
@option(
    "output", "--out-dir", metavar="DIR",
    help="Folder of the results.  [default: LOG-stem.vehnav]",
)  # fmt: skip
@option(
    "output", "--output-rate", type=NumberType(min=0, min_open=True), metavar="HZ",
    help="Rows a second in the trajectory files.  [default: every IMU sample]",
)  # fmt: skip
@click.option(
    "--plots", metavar="DIR",
    help="Also draw the figures of the report here, as PNG and PDF (pip install vehnav[plots]).",
)  # fmt: skip
@option(
    "method", "--method", type=click.Choice(["stops", "free", "filter", "smooth"]),
    default="stops", show_default=True,
    help="stops: corrections at stops, offline; free: no correction; filter: error-state filter; "
    "smooth: filter and backward smoother.",
)  # fmt: skip
@option(
    "method", "--aid", type=AidsType(), metavar="NAMES",
    help="Aids of the filter: zupt,zaru,nhc,odometer,gnss.  [default: all that the log has except "
    "gnss]",
)  # fmt: skip
@option(
    "method", "--sensor", metavar="NAME|FILE",
    help="Sensor of the catalogue (hg1700, mems-industrial, ...) or TOML file ('vehnav sensor' "
    "writes one): its noise weighs the stops, or is that of the filter.  [default: the log's own "
    "rest]",
)  # fmt: skip
@option(
    "method", "--sensor-grade", type=click.Choice(["auto", "mems", "tactical"]), default="auto",
    show_default=True, help="Noise of the filter; auto: by the gyro at rest.",
)  # fmt: skip
@option(
    "method", "--azimuth", type=click.Choice(["relative", "absolute"]), default="relative",
    show_default=True,
    help="Wander axes (filter, --frame wander, --coords quasi) free relative to the Earth or to "
    "inertial space.",
)  # fmt: skip
@option(
    "method", "--as-published", is_flag=True, default=False,
    help="The two procedures of paper 002 alone.",
)  # fmt: skip
@option(
    "method", "--levelling/--no-levelling", default=True, show_default=True,
    help="Procedure 1: level at stops.",
)  # fmt: skip
@option(
    "method", "--reset/--no-reset", default=True, show_default=True,
    help="Procedure 2: velocity to zero at stops.",
)  # fmt: skip
@option(
    "method", "--causal", is_flag=True, default=False,
    help="Use nothing that looks ahead: no distribution over legs.",
)  # fmt: skip
@option(
    "method", "--frame", type=click.Choice(["enu", "eci", "wander"]), default="enu",
    show_default=True,
    help="Frame of the mechanization: local East-North-Up (paper 004), inertial (paper 000) or "
    "wander (paper 003; what the filter uses anyway).",
)  # fmt: skip
@option(
    "method", "--coords", type=click.Choice(["auto", "normal", "quasi"]), default="auto",
    show_default=True,
    help="quasi: also write quasi-latitude, quasi-longitude and headings that stay regular at a "
    "pole (paper 003); auto: with wander axes beyond 85 degrees of latitude.",
)  # fmt: skip
@option(
    "method", "--vertical", type=click.Choice(["clamp", "free"]), default="clamp",
    show_default=True,
    help="Stop methods: hold the height, or integrate it. The filter always estimates it and "
    "refuses free.",
)  # fmt: skip
@option(
    "method", "--ellipsoid", type=click.Choice(["wgs84", "krasovsky"]), default="wgs84",
    show_default=True, help="Figure of the Earth.",
)  # fmt: skip
@option(
    "stops", "--levelling-rate", type=NumberType(min=0, min_open=True), metavar="RATE",
    help="k g of the levelling, 1/s.  [default: the running mean, 1/(t + 0.5 s)]",
)  # fmt: skip
@option(
    "gps", "--gps", type=click.Choice(["start", "none", "aid"]), default="start",
    show_default=True,
    help="What GPS may be used for: the start, nothing, or aiding all the way (filter, smooth).",
)  # fmt: skip
@option(
    "gps", "--gnss-form", type=click.Choice(["direct", "normal", "quasi"]), default="direct",
    show_default=True,
    help="How the filter compares fixes with its state: Earth-fixed vectors, or paper 003's forms "
    "in latitude and longitude (fails near the poles) or in quasi-coordinates (near 0 N 0 E).",
)  # fmt: skip
@option(
    "gps", "--outage", multiple=True, metavar="A:B|every=...",
    help="Seconds A:B whose fixes do not aid; or every=180,length=60,from=60. Repeatable.",
)  # fmt: skip
@option(
    "gps", "--gps-start-seconds", type=NumberType(min=0), default=60.0, show_default=True,
    metavar="S", help="Driving after the first departure that gives the heading.",
)  # fmt: skip
@option(
    "gps", "--start-position", type=NumbersType("LAT,LON,HEIGHT"),
    help="Where the first stop is: deg, deg, m.",
)  # fmt: skip
@option(
    "gps", "--lever-arm", type=NumbersType("RIGHT,FORWARD,UP"),
    help="The antenna from the IMU, m in the vehicle's axes.",
)  # fmt: skip
@option(
    "gps", "--start-heading", type=NumberType(), metavar="DEG",
    help="Heading at the first stop, clockwise from north.",
)  # fmt: skip
@option(
    "gps", "--start-attitude", type=NumbersType("HEADING,PITCH,ROLL"),
    help="Attitude at the start, deg, for a log without a stop.",
)  # fmt: skip
@option(
    "input", "--split", is_flag=True, default=False,
    help="One result for each part between holes of over 10 s.",
)  # fmt: skip
@input_options
@span_options
@axes_options
@stops_options
@json_option
@strict_option
@quiet_option
def run(
    logs: tuple[str, ...],
    read_options: ReadOptions,
    as_json: bool,
    strict: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Find where the vehicle went, from the IMU of a log.

    Finds IMU, GPS and speed by type, the stops by the angular rate, levels and resets the velocity
    there, integrates between them and judges the track by GPS, which was used for nothing but the
    start. Writes LOG-stem.vehnav/ with trajectory.csv, report.json and report.html.
    """
    if len(logs) > 1 and (options["outputs"] or options["out_dir"]):
        raise ConfigError("-o and --out-dir name one result; give one log at a time with them")
    _check_outputs(options["outputs"])
    documents: list[dict[str, Any]] = []
    findings: list[Finding] = []
    damaged = False
    for path in logs:
        for folder, result in _results(path, read_options, options, quiet=quiet or as_json):
            content = _write(result, folder, options, quiet=quiet or as_json)
            print_findings(result.findings, start_ns=result.start_ns, least="warning")
            if not as_json and not quiet:
                _print(result, folder)
            documents.append(content)
            findings += result.findings
            damaged |= result.log.damaged
    if as_json:
        print_json(documents[0] if len(documents) == 1 else {"runs": documents})
    finish(damaged=damaged, strict=strict, findings=findings)


def _check_outputs(paths: Sequence[str]) -> None:
    """Refuse before the work what could not be written after it."""
    from vehnav.export.formats import format_of

    for path in paths:
        if Path(path).suffix == "" or Path(path).is_dir():
            raise ConfigError(f"-o {path}: is no file name with a suffix; a folder is --out-dir")
        if Path(path).suffix not in (".json", ".html"):
            format_of(path)
        if not Path(path).parent.is_dir():
            raise ConfigError(f"-o {path}: there is no folder {Path(path).parent}")


def _results(
    path: str, read_options: ReadOptions, options: dict[str, Any], *, quiet: bool
) -> list[tuple[Path, Run]]:
    """The runs of a log with the folder of each: one, or one per part with ``--split``."""
    from vehnav.logs.read import read_log
    from vehnav.pipeline import run as run_log
    from vehnav.pipeline import run_at_found_offset
    from vehnav.prepare import split_log

    if click.get_current_context().meta.get("vehnav.offset_auto"):
        run_log = run_at_found_offset

    with progress(f"{path}: reading", quiet=quiet):
        log = read_log(path, read_options)
    config = config_from(log, options)
    folder = Path(options["out_dir"] or Path(path).with_suffix(".vehnav").name)
    parts = split_log(log) if config.split else [log]
    results = []
    for k, part in enumerate(parts):
        with progress(f"{path}: integrating", quiet=quiet):
            found = run_log(part, config)
        results.append((folder if len(parts) == 1 else folder / f"part{k + 1}", found))
    return results


def config_from(log: Log, options: Mapping[str, Any]) -> Config:
    """The options that are there as a Config; instants become seconds from the log's start."""
    from vehnav.config import Config

    def seconds(instant: Instant | None) -> float | None:
        if instant is None:
            return None
        clock = instant.on_clock(log.start_ns, unix_clock=log.unix_clock)
        return (clock - log.start_ns) * 1e-9

    fields = {name: options[name] for name in RUN_FIELDS if name in options}
    fields["stop_statistic"] = fields["stop_statistic"] or "slow"
    return Config(**fields, start=seconds(options["start"]), end=seconds(options["end"]))


def _write(result: Run, folder: Path, options: dict[str, Any], *, quiet: bool) -> dict[str, Any]:
    """Write the three files and what ``-o`` names; returns the document."""
    from vehnav.export.formats import write_trajectory
    from vehnav.report.document import document, write_document
    from vehnav.report.html import write_html

    content = document(result)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{folder}: cannot be made: {error.strerror}") from error
    command = shlex.join(["vehnav", *sys.argv[1:]])
    paths = [folder / name for name in RESULTS] + [Path(path) for path in options["outputs"]]
    with progress(f"{folder}: writing", quiet=quiet):
        for path in paths:
            if path.suffix == ".json":
                write_document(content, path)
            elif path.suffix == ".html":
                write_html(result, content, path, command=command)
            else:
                write_trajectory(
                    result.trajectory,
                    path,
                    unix_clock=result.log.unix_clock,
                    rate_hz=options["output_rate"],
                    errors=result.errors,
                    gnss=result.log.gnss,
                )
        if options["plots"]:
            from vehnav.report.plots import write_plots

            write_plots(result, Path(options["plots"]))
    return content


def _print(result: Run, folder: Path) -> None:
    from vehnav.report.summary import summary

    click.echo(summary(result))
    click.echo(f"report     {folder / RESULTS[-1]}, {RESULTS[0]} and {RESULTS[1]} beside it")
