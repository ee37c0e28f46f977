"""``vehnav convert``: one format of trajectory or log to another."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vehnav.cli.common import (
    NumberType,
    axes_options,
    command,
    finish,
    input_options,
    json_option,
    option,
    print_findings,
    print_json,
    quiet_option,
    strict_option,
)

if TYPE_CHECKING:
    from vehnav.errors import Finding
    from vehnav.logs.log import Imu, Log, ReadOptions

LOG_SUFFIXES = (".mcap", ".csv")


@command(
    "convert",
    examples=[
        "vehnav convert city.vehnav/trajectory.csv city.gpx",
        "vehnav convert trajectory.csv for_evo.tum --output-rate 10",
        "vehnav convert old_log.csv clean.mcap --axes FRD --gyro-unit deg/s",
        "vehnav convert drive.mcap drive.csv",
    ],
)
@click.argument("source", metavar="IN")
@click.argument("target", metavar="OUT")
@option(
    "output",
    "--output-rate",
    type=NumberType(min=0, min_open=True),
    metavar="HZ",
    help="States a second of a trajectory.  [default: all; maps are thinned to 0.2 m]",
)
@input_options
@axes_options
@json_option
@strict_option
@quiet_option
def convert(
    source: str,
    target: str,
    output_rate: float | None,
    read_options: ReadOptions,
    axes: str | None,
    accel_axes: str | None,
    mount: tuple[float, float, float],
    accel_scale: float,
    as_json: bool,
    strict: bool,
    quiet: bool,
) -> None:
    """One format of trajectory or log to another; the suffix of OUT decides.

    A trajectory (CSV, Parquet, JSON, TUM, KITTI) becomes any of .csv .parquet .json .tum .kitti
    .gpx .kml .geojson .mcap. A log with an IMU becomes a clean log: .mcap with standard ROS 2
    messages in SI on forward-left-up axes, or .csv on right-forward-up with GPS and speed beside
    it; both read back bit for bit. Axes and units are those that the drive shows, as for run. A
    log becomes one of the other formats by its GPS track.
    """
    from vehnav.export.load import is_trajectory

    if is_trajectory(source, read_options):
        log, files = None, _convert_track(source, target, output_rate, read_options)
        said: list[str] = []
    else:
        from vehnav.logs.read import read_log

        log = read_log(source, read_options)
        if log.imu is not None and accel_scale != 1.0:
            log = replace(log, imu=replace(log.imu, accel=log.imu.accel * accel_scale))
        sensor = {"axes": axes, "accel_axes": accel_axes, "mount": mount}
        files, said = _convert_log(log, target, output_rate, sensor)
    findings: tuple[Finding, ...] = () if log is None else log.findings
    if as_json:
        rows = [{"code": f.code, "level": f.level, "text": f.text} for f in findings]
        print_json({"source": source, "files": files, "notes": said, "findings": rows})
    elif not quiet:
        for path in files:
            click.echo(f"{path}  {Path(path).stat().st_size / 1e6:.2f} MB")
    for text in said:
        click.echo(f"note: {text}", err=True)
    print_findings(findings, start_ns=0 if log is None else log.start_ns, least="warning")
    finish(damaged=log is not None and log.damaged, strict=strict, findings=findings)


def _convert_track(
    source: str, target: str, rate_hz: float | None, read_options: ReadOptions
) -> list[str]:
    from vehnav.export.formats import write_trajectory
    from vehnav.export.load import load_track

    track = load_track(source, read_options)
    write_trajectory(track.trajectory, target, unix_clock=track.unix_clock, rate_hz=rate_hz)
    return [target]


def _convert_log(
    log: Log, target: str, rate_hz: float | None, sensor: dict[str, Any]
) -> tuple[list[str], list[str]]:
    """A clean log where the suffix is one of a log, else the GPS track; files and notes."""
    from vehnav.errors import LogError
    from vehnav.export.formats import format_of, write_trajectory
    from vehnav.export.load import as_trajectory

    if log.imu is not None and Path(target).suffix.lower() in LOG_SUFFIXES:
        return _clean_log(log, log.imu, target, sensor)
    format_of(target)
    if log.gnss is None or log.gnss.t_ns.size < 2:
        raise LogError(
            f"{log.path}: {Path(target).suffix} holds a track, but there is no GPS track in this "
            "log; 'vehnav run' makes one from its IMU"
        )
    track = as_trajectory(log.gnss)
    write_trajectory(track, target, unix_clock=log.unix_clock, rate_hz=rate_hz)
    note = f"{target} is the GPS track of {log.path}; 'vehnav run' makes one from its IMU"
    return [target], [note] if log.imu is not None else []


def _clean_log(
    log: Log, imu: Imu, target: str, sensor: dict[str, Any]
) -> tuple[list[str], list[str]]:
    from vehnav.export.recording import (
        lost,
        on_body_axes,
        on_established_axes,
        write_recording,
    )
    from vehnav.units import DEG

    letters = None if sensor["axes"] == "auto" else sensor["axes"]
    roll, pitch, yaw = (angle * DEG for angle in sensor["mount"])
    notes: list[str] = []
    if letters is None and sensor["accel_axes"] is None:
        turned, notes = on_established_axes(log, imu, mount=(roll, pitch, yaw))
    else:
        turned = on_body_axes(
            imu,
            axes=letters,
            accel_axes=sensor["accel_axes"],
            mount=(roll, pitch, yaw),
            path=log.path,
        )
    files = write_recording(replace(log, imu=turned), target)
    notes += [f"not written: {what}" for what in lost(log, target)]
    return [str(path) for path in files], notes
