"""``vehnav compare``: trajectories against GPS or truth."""

from __future__ import annotations

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
from vehnav.cli.options import ParamType
from vehnav.errors import ConfigError

if TYPE_CHECKING:
    from vehnav.evaluation import Errors
    from vehnav.export.load import Track

ROWS = (
    ("horizontal", "m", "horizontal_m"),
    ("east", "m", "east_m"),
    ("north", "m", "north_m"),
    ("up", "m", "up_m"),
    ("along", "m", "along_m"),
    ("cross", "m", "cross_m"),
    ("velocity", "m/s", "velocity_m_s"),
    ("heading", "deg", "heading_deg"),
)
FIGURES = ("rms", "mean", "median", "p95", "max", "end")
WIDE = (
    ("rms m", "horizontal_m.rms"),
    ("p95 m", "horizontal_m.p95"),
    ("max m", "horizontal_m.max"),
    ("end m", "horizontal_m.end"),
    ("along rms", "along_m.rms"),
    ("cross rms", "cross_m.rms"),
    ("v rms m/s", "velocity_m_s.rms"),
    ("head rms", "heading_deg.rms"),
    ("end %", "percent_of_distance.end"),
    ("max %", "percent_of_distance.max"),
)


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
    ],
)
@click.argument("files", nargs=-1, required=True, metavar="TRAJECTORY... GPS")
@option(
    "input",
    "--gps-time-offset",
    type=NumberType(),
    default=0.0,
    show_default=True,
    metavar="S",
    help="Seconds to add to the stamps of the GPS.",
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
    "--max",
    "bars",
    type=BarType(),
    multiple=True,
    help="Exit status 1 if the metric is larger, for any of the trajectories. Repeatable.",
)
@json_option
@strict_option
def compare(files: tuple[str, ...], as_json: bool, strict: bool, **options: Any) -> None:
    """Errors of trajectories against GPS or truth.

    The last file judges the others; each may be a trajectory of vehnav (CSV, Parquet, TUM, KITTI,
    JSON) or anything that holds fixes. The trajectory is interpolated to the fixes; nothing is
    aligned. Errors are estimate minus reference.
    """
    if len(files) < 2:
        raise click.UsageError(
            "two files are needed: TRAJECTORY... GPS", click.get_current_context()
        )
    tracks = [_load(path, options) for path in files]
    results = [_judge(track, tracks[-1], options) for track in tracks[:-1]]
    documents = [_document(path, errors) for path, errors in zip(files[:-1], results, strict=True)]
    missed = _missed_bars(documents, options["bars"])
    if as_json:
        print_json({"reference": files[-1], "trajectories": documents, "missed": missed})
    else:
        click.echo(_screen(files, results, documents))
    findings = [f for t in tracks for f in t.findings] + [f for r in results for f in r.findings]
    print_findings(findings, start_ns=int(tracks[-1].trajectory.t_ns[0]), least="warning")
    for bar in missed:
        click.echo(f"missed: {bar['text']}", err=True)
    finish(strict=strict, findings=findings, bar_missed=bool(missed))


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
            lever_arm=options["lever_arm"],
            c_nb_reference=c_nb,
        )
    except LogError as error:
        raise LogError(f"{track.path} against {reference.path}: {error}") from error


def _document(path: str, errors: Errors) -> dict[str, Any]:
    return {
        "file": path,
        "fixes": dict(errors.counts),
        "time_offset_s": errors.time_offset,
        "start_unix_ns": int(errors.t_ns[0]),
        "duration_s": float(errors.t_ns[-1] - errors.t_ns[0]) * 1e-9,
        "errors": errors.to_dict(),
        "findings": [{"code": f.code, "level": f.level, "text": f.text} for f in errors.findings],
    }


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


# ---- what is printed -----------------------------------------------------------------------------


def _screen(files: tuple[str, ...], results: list[Errors], documents: list[dict[str, Any]]) -> str:
    """One screen: one trajectory in full, several as one table."""
    if len(results) == 1:
        lines = [f"{files[0]} against {files[-1]}", *_matched(results[0])]
        return "\n".join([*lines, "", *_table(documents[0]["errors"])])
    lines = [f"{len(results)} trajectories against {files[-1]}"]
    for path, errors in zip(files[:-1], results, strict=True):
        lines += [f"  {path}", *(f"  {line}" for line in _matched(errors))]
    return "\n".join([*lines, "", *_wide_table(documents)])


def _matched(errors: Errors) -> list[str]:
    counts = errors.counts
    left_out = {
        "outside the trajectory": counts["outside"],
        "before judging starts": counts["before"],
        "excluded": counts["excluded"],
        "in gaps of the trajectory": counts["in_gaps"],
    }
    why = ", ".join(f"{n} {name}" for name, n in left_out.items() if n)
    span = float(errors.t_ns[-1] - errors.t_ns[0]) * 1e-9
    lines = [
        f"  fixes     {counts['judged']} of {counts['total']} judged"
        + (f" ({why})" if why else ""),
        f"  driven    {errors.distance[-1]:.0f} m in {span:.1f} s",
        f"  offset    {errors.time_offset:+.3f} s added to the GPS",
    ]
    sigma = errors.reference_sigma_m()
    if sigma is not None:
        lines.append(f"  GPS       {_number(sigma)} m uncertain (its own sigma)")
    return lines


def _table(tree: dict[str, Any]) -> list[str]:
    """The error table of one trajectory."""
    lines = [" " * 18 + "".join(f"{name:>10}" for name in FIGURES)]
    for name, unit, key in ROWS:
        if tree[key] is not None:
            figures = "".join(f"{_number(tree[key][f]):>10}" for f in FIGURES)
            lines.append(f"{name + ' ' + unit:<18}{figures}")
    share = tree["percent_of_distance"]
    lines += [
        "",
        f"percent of distance  end {_number(share['end'])}  max {_number(share['max'])}    "
        f"CEP50 {_number(tree['cep50_m'])} m  CEP95 {_number(tree['cep95_m'])} m",
    ]
    if tree["segments"]:
        parts = [f"{s['length_m']:.0f} m {_number(s['percent'])} %" for s in tree["segments"]]
        lines.append("segments  " + "  ".join(parts))
    return lines


def _wide_table(documents: list[dict[str, Any]]) -> list[str]:
    """One line a trajectory."""
    from vehnav.evaluation.metrics import metric

    names = [document["file"] for document in documents]
    width = min(max(len(name) for name in names), 40)
    lines = [" " * width + "".join(f"{title:>11}" for title, _ in WIDE)]
    for name, document in zip(names, documents, strict=True):
        shown = name if len(name) <= width else "..." + name[3 - width :]
        figures = "".join(f"{_number(metric(document['errors'], key)):>11}" for _, key in WIDE)
        lines.append(f"{shown:<{width}}{figures}")
    return lines


def _number(value: float | None) -> str:
    """Three or four digits."""
    if value is None:
        return "-"
    size = abs(value)
    if size >= 1e7:
        return f"{value:.2e}"
    decimals = 0 if size >= 1000.0 else 1 if size >= 100.0 else 2 if size >= 1.0 else 3
    return f"{round(value, decimals) + 0.0:.{decimals}f}"  # + 0.0: no minus before a zero
