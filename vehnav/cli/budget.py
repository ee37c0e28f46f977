"""``vehnav budget``: sensor errors to navigation errors along a drive, and back."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NoReturn

import click

from vehnav.cli.budget_options import model_options, question_options
from vehnav.cli.common import (
    axes_options,
    command,
    finish,
    input_options,
    json_option,
    print_findings,
    print_json,
    progress,
    quiet_option,
    span_options,
    stops_options,
    strict_option,
)
from vehnav.errors import ConfigError

if TYPE_CHECKING:
    from vehnav.budget.drive import IdealDrive
    from vehnav.budget.study import Study
    from vehnav.logs.log import ReadOptions
    from vehnav.pipeline import Run
    from vehnav.sensors import Sensor


SOON = 2.0
"""s after its start at which a drive that begins standing is seen to stand."""
NO_CSV = (
    "csv is the table of sources of one sensor (--sensor NAME); this answer goes to .json or .txt"
)

Question = Literal["forward", "solved", "swept", "ranked", "legs"]


@command(
    "budget",
    examples=[
        "vehnav budget scenario:town,T=600 --sensor hg1700 --at 60,300,600",
        "vehnav budget city.mcap --sensor all",
        "vehnav budget city.mcap --sensor ours.toml --mc 200",
        "vehnav budget city.vehnav/trajectory.csv --require 100 --solve equal",
        "vehnav budget city.mcap --sensor mems-tactical --require 50 --metric drms",
        "vehnav budget city.mcap --stop-intervals 60,120,300 -o intervals.html",
    ],
)
@click.argument("source")
@model_options
@question_options
@click.option(
    "-o", "--out", "outputs", multiple=True, metavar="PATH",
    help="Also write the result: .json, .csv, .txt, or a page or picture of it: .html, .svg, "
    ".png, .pdf (the last two with the extra plots). Repeatable.",
)  # fmt: skip
@click.option(
    "--format", "form", type=click.Choice(["table", "csv", "json"]), default="table",
    show_default=True, help="What is printed.",
)  # fmt: skip
@input_options
@span_options
@axes_options
@stops_options
@json_option
@strict_option
@quiet_option
def budget(
    source: str,
    read_options: ReadOptions,
    form: str,
    as_json: bool,
    strict: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """How far off a sensor is on a drive and why, and what sensor a required accuracy needs.

    SOURCE is a log (its drive is found by `vehnav run` first), a trajectory file, or
    scenario:NAME,KEY=VALUE,... of `vehnav simulate`. Every source of error of the linear model of
    paper 001 gets a row: what one sigma of it does along this drive, with its stops. All figures
    are one sigma; CEP95 is the circle that holds 95 %.
    """
    form = "json" if as_json else form
    _check(options)
    if options["sensor"] is None and not options["legs"]:
        single = any(options[name] is not None for name in ("solve", "mc", "stop_intervals"))
        options["sensor"] = "hg1700" if single else "all"
    _check_outputs(options, form)
    found, drive = _drive(source, read_options, options, quiet=quiet or form != "table")
    study = _study(drive, options)
    result = _answer(study, found, options, quiet=quiet or form != "table")
    findings = list(found.findings) if found is not None else []
    if form == "json":
        print_json(result.document)
    elif form == "csv":
        click.echo(result.csv, nl=False)
    elif not quiet:
        click.echo("\n".join(result.lines))
    for path in options["outputs"]:
        result.write(Path(path))
    if found is not None:
        print_findings(findings, start_ns=found.start_ns, least="warning")
    _finish(found, strict, findings, result.missed)


def _finish(found: Run | None, strict: bool, findings: list[Any], missed: str) -> NoReturn:
    if missed:
        click.echo(f"missed: {missed}", err=True)
    damaged = found is not None and found.log.damaged
    finish(damaged=damaged, strict=strict, findings=findings, bar_missed=bool(missed))


def _check(options: Mapping[str, Any]) -> None:
    """ConfigError for questions that exclude each other."""
    asked = [
        name
        for name, given in (
            ("--sensor all", options["sensor"] == "all"),
            ("--solve", options["solve"] is not None),
            ("--stop-intervals", options["stop_intervals"] is not None),
            ("--legs", options["legs"]),
        )
        if given
    ]
    if len(asked) > 1:
        raise ConfigError(f"{' and '.join(asked)}: one question at a time")
    if options["solve"] is not None and options["require"] is None:
        raise ConfigError("--solve needs --require M: the error that is allowed")
    if options["mc"] is not None and asked and asked != ["--solve"]:
        raise ConfigError(f"--mc checks one sensor on one drive; not with {asked[0]}")


def _question(options: Mapping[str, Any]) -> Question:
    """What is asked."""
    if options["legs"]:
        return "legs"
    if options["sensor"] == "all":
        return "ranked"
    if options["stop_intervals"] is not None:
        return "swept"
    return "forward" if options["solve"] is None else "solved"


def _check_outputs(options: Mapping[str, Any], form: str) -> None:
    """ConfigError for what this answer cannot be written as, before anything is made."""
    from vehnav.report.budget_page import PICTURES, check_output

    question = _question(options)
    if form == "csv" and question != "forward":
        raise ConfigError(NO_CSV)
    for path in options["outputs"]:
        check_output(path)
        suffix = Path(path).suffix.lower()
        if suffix == ".csv" and question != "forward":
            raise ConfigError(f"{path}: {NO_CSV}")
        if suffix in PICTURES and question in ("solved", "legs"):
            raise ConfigError(f"{path}: there is no picture of this answer")


def _drive(
    source: str, read_options: ReadOptions, options: dict[str, Any], *, quiet: bool
) -> tuple[Run | None, IdealDrive]:
    """The drive of the source, and the run that found it where the source is a log."""
    from vehnav.budget_source import SCENARIO, file_drive, run_drive, scenario_drive

    if source.startswith(SCENARIO):
        return None, scenario_drive(source.removeprefix(SCENARIO))
    drive = file_drive(source)
    if drive is not None:
        return None, drive
    from vehnav.cli.run import config_from
    from vehnav.logs.read import read_log
    from vehnav.pipeline import run

    with progress(f"{source}: reading", quiet=quiet):
        log = read_log(source, read_options)
    mine = ("sensor", "vertical")
    config = config_from(log, {k: v for k, v in options.items() if k not in mine})
    with progress(f"{source}: integrating", quiet=quiet):
        found = run(log, config)
    return found, run_drive(found)


def _study(drive: IdealDrive, options: Mapping[str, Any]) -> Study:
    from vehnav.budget.linear import Procedure, chosen_stops
    from vehnav.budget.sources import Initial
    from vehnav.budget.study import Study, load_initial

    window, stops = options["levelling_window"], options["stops"]
    standing = bool(drive.stops) and drive.stops[0][0] <= SOON <= drive.stops[0][1] - window
    initial, levelled = Initial(), standing
    said = options["init"]
    if said in ("levelled", "given"):
        levelled = said == "levelled"
    elif said is not None:
        found = load_initial(said)
        if found is None:
            raise ConfigError(f"{said}: no table [initial]")
        initial, levelled = found
    elif str(options["sensor"]).lower().endswith(".toml"):
        initial, levelled = load_initial(options["sensor"]) or (initial, levelled)
    every = None if stops == "auto" else stops
    procedure = Procedure(
        stops=() if stops == "none" else chosen_stops(drive, every),
        levelled=levelled,
        window=window,
        gyro_from_stops=options["gyro_from_stops"],
    )
    times = options["at"] or (drive.duration,)
    if times[-1] > drive.duration + 1e-6:
        raise ConfigError(f"--at {times[-1]:g}: the drive ends after {drive.duration:.1f} s")
    return Study(
        drive, procedure, initial, tuple(times), options["model"], options["vertical"] == "held"
    )


class Result:
    """An answer in every form that it has, and the bar that it missed."""

    def __init__(
        self,
        lines: list[str],
        document: dict[str, Any],
        *,
        csv: str = "",
        picture: Any = None,
        missed: str = "",
    ) -> None:
        self.lines, self.document, self.missed = lines, document, missed
        self.picture, self.csv = picture, csv

    def write(self, path: Path) -> None:
        """Write a file; the suffix decides."""
        import json

        from vehnav.export.atomic import atomic_path
        from vehnav.report.budget_page import PICTURES, write_picture

        if path.suffix.lower() in PICTURES:
            write_picture(self.picture, path)
            return
        text = {
            ".json": lambda: json.dumps({"version": 1, **self.document}, indent=2) + "\n",
            ".csv": lambda: self.csv,
            ".txt": lambda: "\n".join(self.lines) + "\n",
        }[path.suffix.lower()]()
        with atomic_path(path) as temporary:
            temporary.write_text(text, encoding="utf-8")


def _answer(study: Study, found: Run | None, options: Mapping[str, Any], *, quiet: bool) -> Result:
    from vehnav.sensors import load_sensor

    question = _question(options)
    if question == "legs":
        return _legs(found, options)
    if question == "ranked":
        return _ranked(study, options)
    sensor = load_sensor(options["sensor"])
    if question == "swept":
        return _swept(study, sensor, options)
    if question == "solved":
        return _solved(study, sensor, options, quiet=quiet)
    return _forward(study, sensor, options, quiet=quiet)


def _forward(study: Study, sensor: Sensor, options: Mapping[str, Any], *, quiet: bool) -> Result:
    from vehnav.budget.document import budget_csv, budget_document, drawn_document
    from vehnav.cli.budget_screen import drawn_lines, forward_lines
    from vehnav.report.budget_picture import growth_picture

    made = study.budget(sensor)
    lines, document = forward_lines(study, made), budget_document(study, made)
    if options["mc"] is not None:
        with progress(f"{options['mc']} runs", quiet=quiet):
            drawn = study.monte_carlo(
                sensor, study.initial, runs=options["mc"], seed=options["seed"]
            )
        lines += drawn_lines(drawn, made, study.times)
        document["mc"] = drawn_document(drawn, made, study.times)
    missed = ""
    if options["require"] is not None:
        metric, bar = options["metric"], options["require"]
        value = made.totals(study.time)[metric]
        if value > bar:
            missed = f"{metric} {value:.4g} m at {study.time:g} s, required {bar:g} m"
        document["require"] = {"metric": metric, "m": bar, "found_m": value, "met": not missed}
    return Result(
        lines, document, csv=budget_csv(study, made),
        picture=growth_picture(study, [made], "cep95"), missed=missed,
    )  # fmt: skip


def _solved(study: Study, sensor: Sensor, options: Mapping[str, Any], *, quiet: bool) -> Result:
    from dataclasses import replace

    from vehnav.budget.document import drawn_document, inverse_document, study_document
    from vehnav.budget.inverse import Requirement, solve
    from vehnav.cli.budget_screen import drawn_lines, inverse_lines

    need = Requirement(options["require"], options["metric"], study.time)
    made = study.budget(sensor)
    solution = solve(made, need, options["solve"])
    lines = inverse_lines(study, solution, sensor.name)
    document = {**study_document(study), "sensor": sensor.name,
                "inverse": inverse_document(solution)}  # fmt: skip
    if options["mc"] is not None and solution.feasible:
        with progress(f"{options['mc']} runs", quiet=quiet):
            drawn = study.monte_carlo(
                solution.sensor, solution.initial, runs=options["mc"], seed=options["seed"]
            )
        again = replace(made, sensor=solution.sensor, initial=solution.initial)
        lines += drawn_lines(drawn, again, study.times)
        document["mc"] = drawn_document(drawn, again, study.times)
    return Result(lines, document, missed="" if solution.feasible else solution.text)


def _ranked(study: Study, options: Mapping[str, Any]) -> Result:
    from vehnav.budget.document import rank_document
    from vehnav.cli.budget_screen import rank_lines
    from vehnav.report.budget_picture import growth_picture
    from vehnav.sensors import CATALOGUE

    grades = [sensor for name, sensor in CATALOGUE.items() if name != "ideal"]
    ranked = study.ranked(grades, options["metric"])
    lines = rank_lines(study, ranked, options["metric"])
    document = rank_document(study, ranked)
    missed = ""
    if options["require"] is not None:
        metric, bar = options["metric"], options["require"]
        good = [b.sensor.name for b in ranked if b.totals(study.time)[metric] <= bar]
        lines.append(f"{metric} of {bar:g} m at {study.time:g} s: {', '.join(good) or 'none'}")
        missed = "" if good else f"no grade has {metric} of {bar:g} m at {study.time:g} s"
        document["require"] = {"metric": metric, "m": bar, "met_by": good}
    picture = growth_picture(study, ranked, options["metric"])
    return Result(lines, document, picture=picture, missed=missed)


def _swept(study: Study, sensor: Sensor, options: Mapping[str, Any]) -> Result:
    from vehnav.budget.document import sweep_document
    from vehnav.budget.study import interval_sweep
    from vehnav.cli.budget_screen import sweep_lines
    from vehnav.report.budget_picture import sweep_picture

    if not study.drive.stops:
        raise ConfigError(f"{study.drive.name}: no stop, so no interval between stops")
    sweep = interval_sweep(study, sensor, options["stop_intervals"])
    return Result(
        sweep_lines(study, sweep), sweep_document(study, sweep),
        picture=sweep_picture(study, sweep, options["metric"]),
    )  # fmt: skip


def _legs(found: Run | None, options: Mapping[str, Any]) -> Result:
    from vehnav.budget_legs import check_legs
    from vehnav.cli.budget_screen import legs_lines
    from vehnav.sensors import load_sensor

    if found is None:
        raise ConfigError("--legs compares with GPS: give a log")
    named = options["sensor"]
    check = check_legs(found, None if named is None else load_sensor(named))
    return Result(legs_lines(check), check.to_dict())
