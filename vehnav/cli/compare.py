"""``vehnav compare``: trajectories against GPS or truth."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vehnav.cli.common import (
    InstantType,
    NumbersType,
    NumberType,
    PairsType,
    command,
    finish,
    json_option,
    option,
    print_findings,
    print_json,
    strict_option,
)
from vehnav.cli.compare_screen import screen
from vehnav.cli.types import OffsetType, ParamType
from vehnav.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from vehnav.errors import Finding
    from vehnav.evaluation import Errors
    from vehnav.export.load import Track


class SpanType(ParamType):
    """``A:B``: seconds from the start."""

    name = "A:B"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[float, float]:
        """Read both; the second must be later."""
        if isinstance(value, tuple):
            return value
        first, colon, last = str(value).partition(":")
        if not colon:
            self.fail(f"{value!r}: expected A:B, e.g. 120:180", param, ctx)
        start: float = NumberType().convert(first, param, ctx)
        end: float = NumberType().convert(last, param, ctx)
        if end <= start:
            self.fail(f"{value!r}: ends before it starts", param, ctx)
        return start, end


class BarType(ParamType):
    """``METRIC=VALUE``: a dotted path of the report and the largest value allowed."""

    name = "METRIC=VALUE"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[str, float]:
        """Read name and limit; ``errors.`` in front may be left out."""
        if isinstance(value, tuple):
            return value
        name, equals, limit = str(value).partition("=")
        if not equals:
            self.fail(f"{value!r}: expected METRIC=VALUE, e.g. horizontal_m.max=50", param, ctx)
        number: float = NumberType().convert(limit, param, ctx)
        return name.strip().removeprefix("errors."), number


@command(
    "compare",
    examples=[
        "vehnav compare city.vehnav/trajectory.csv city.mcap",
        "vehnav compare a.csv b.tum gnss.pos --max horizontal_m.max=50",
        "vehnav compare a.csv gps.csv --gps-time-offset -0.6 --json",
        "vehnav compare a.csv b.csv gps.csv --html compare.html",
    ],
)
@click.argument("files", nargs=-1, required=True, metavar="TRAJECTORY... GPS")
@option(
    "input",
    "--gps-time-offset",
    type=OffsetType(),
    default=0.0,
    show_default=True,
    metavar="S|auto",
    help="Seconds to add to the stamps of the GPS; auto: what the motion says (always reported).",
)
@option("input", "--gps-topic", metavar="TOPIC", help="Topic of the GPS.  [default: by type]")
@option("input", "--preset", metavar="NAME", help="Known layout of a CSV with fixes.")
@option(
    "input",
    "--columns",
    type=PairsType(),
    default={},
    help="Columns of a CSV with fixes, e.g. time_s=t,lat=latitude,lon=longitude.",
)
@click.option(
    "--from",
    "start",
    type=InstantType(),
    help="Judge from here: seconds from the start of the trajectory, or an ISO time.",
)
@click.option("--to", "end", type=InstantType(), help="Judge up to here.")
@click.option(
    "--lever-arm",
    type=NumbersType("RIGHT,FORWARD,UP"),
    help="The antenna from the vehicle's point, m in the vehicle's axes.",
)
@click.option(
    "--outage",
    "outages",
    type=SpanType(),
    multiple=True,
    help="Judge this interval by itself, too: seconds from the start of the trajectory. "
    "Repeatable.",
)
@click.option(
    "--align",
    type=click.Choice(["none", "yaw", "yaw+translation", "full"]),
    default="none",
    show_default=True,
    help="Fit the trajectory to the GPS first; the result is then no longer dead reckoning.",
)
@click.option(
    "--max",
    "bars",
    type=BarType(),
    multiple=True,
    help="Exit status 1 if the metric is larger, for any of the trajectories. Repeatable.",
)
@click.option(
    "--html", metavar="FILE", help="Write one page with map, plots and tables; it opens offline."
)
@click.option(
    "--plots", metavar="DIR",
    help="Also draw the figures of that page here, as PNG and PDF (pip install vehnav[plots]).",
)  # fmt: skip
@json_option
@strict_option
def compare(files: tuple[str, ...], as_json: bool, strict: bool, **options: Any) -> None:
    """Errors of trajectories against GPS or truth.

    The last file judges the others; each may be a trajectory of vehnav (CSV, Parquet, TUM, KITTI,
    JSON) or anything that holds fixes. The trajectory is interpolated to the fixes; nothing is
    aligned unless --align asks for it. Errors are estimate minus reference.
    """
    if len(files) < 2:
        raise click.UsageError(
            "two files are needed: TRAJECTORY... GPS", click.get_current_context()
        )
    if options["html"] or options["plots"]:
        _check_picture(files)
    tracks = [_load(path, options) for path in files]
    results = [_judge(track, tracks[-1], options) for track in tracks[:-1]]
    documents = [_document(path, errors) for path, errors in zip(files[:-1], results, strict=True)]
    missed = _missed_bars(documents, options["bars"])
    _write(tracks, results, [bar["text"] for bar in missed], options)
    if as_json:
        reference = {"file": files[-1], "findings": _plain(tracks[-1].findings)}
        print_json({"reference": reference, "trajectories": documents, "missed": missed})
    else:
        click.echo(screen(files, results, documents))
    findings = [f for t in tracks for f in t.findings] + [f for r in results for f in r.findings]
    print_findings(findings, start_ns=int(tracks[-1].trajectory.t_ns[0]), least="warning")
    for bar in missed:
        click.echo(f"missed: {bar['text']}", err=True)
    finish(strict=strict, findings=findings, bar_missed=bool(missed))


def _check_picture(files: tuple[str, ...]) -> None:
    from vehnav.report.comparison import check_number

    check_number(len(files) - 1)


def _write(
    tracks: Sequence[Track], results: Sequence[Errors], missed: list[str], options: dict[str, Any]
) -> None:
    """The page and the figures, where they are asked for."""
    if not (options["html"] or options["plots"]):
        return
    from vehnav.report.comparison import comparison
    from vehnav.report.comparison_page import write_comparison
    from vehnav.report.plots import write_comparison_plots

    item = comparison(tracks, results)
    if options["html"]:
        command = shlex.join(["vehnav", *sys.argv[1:]])
        write_comparison(item, Path(options["html"]), command=command, missed=missed)
    if options["plots"]:
        write_comparison_plots(item, Path(options["plots"]))


def _load(path: str, options: dict[str, Any]) -> Track:
    from vehnav.export.load import load_track
    from vehnav.logs.log import ReadOptions

    return load_track(
        path,
        ReadOptions(
            gps_topic=options["gps_topic"], preset=options["preset"], columns=options["columns"]
        ),
    )


def _judge(track: Track, reference: Track, options: dict[str, Any]) -> Errors:
    """One trajectory against the reference, with the options of the command."""
    from vehnav.errors import LogError
    from vehnav.evaluation import compare as compare_with

    gnss, c_nb = reference.reference()
    start = int(track.trajectory.t_ns[0])
    first, last = (
        None if at is None else at.on_clock(start, unix_clock=track.unix_clock)
        for at in (options["start"], options["end"])
    )
    try:
        return compare_with(
            track.trajectory,
            gnss,
            judge_from_ns=first,
            exclude=() if last is None else [(last + 1, 2**62)],
            time_offset=options["gps_time_offset"],
            estimate_offset=True,
            lever_arm=options["lever_arm"],
            align=options["align"],
            c_nb_reference=c_nb,
            outages=[
                (start + round(a * 1e9), start + round(b * 1e9)) for a, b in options["outages"]
            ],
        )
    except LogError as error:
        raise LogError(f"{track.path} against {reference.path}: {error}") from error


def _document(path: str, errors: Errors) -> dict[str, Any]:
    return {
        "file": path,
        "fixes": dict(errors.counts),
        "time_offset_s": errors.time_offset,
        "found_offset": None if errors.found_offset is None else errors.found_offset.to_dict(),
        "start_unix_ns": int(errors.t_ns[0]),
        "duration_s": float(errors.t_ns[-1] - errors.t_ns[0]) * 1e-9,
        "errors": errors.to_dict(),
        "findings": _plain(errors.findings),
    }


def _plain(findings: Sequence[Finding]) -> list[dict[str, str]]:
    return [{"code": f.code, "level": f.level, "text": f.text} for f in findings]


def _missed_bars(
    documents: list[dict[str, Any]], bars: tuple[tuple[str, float], ...]
) -> list[dict[str, Any]]:
    """The bars that were missed; an undefined metric misses its bar."""
    from vehnav.evaluation.metrics import metric

    missed = []
    for document in documents:
        for name, limit in bars:
            try:
                value = metric(document["errors"], name)
            except ConfigError as error:
                raise ConfigError(f"--max {name}: {error}") from error
            if value is None or value > limit:
                shown = "undefined" if value is None else f"{value:.6g}"
                text = f"{document['file']}: errors.{name} is {shown}, the bar is {limit:g}"
                row = {"file": document["file"], "metric": f"errors.{name}", "value": value}
                missed.append({**row, "max": limit, "text": text})
    return missed
