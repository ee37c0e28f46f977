"""``vehnav score``: many logs and configurations against bars and a baseline."""

from __future__ import annotations

import shlex
import shutil
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from vehnav.cli.common import (
    NumberType,
    command,
    finish,
    json_option,
    print_json,
    progress,
    quiet_option,
)
from vehnav.cli.types import ParamType
from vehnav.errors import ConfigError

if TYPE_CHECKING:
    from vehnav.batch.baseline import Baseline
    from vehnav.batch.model import Results
    from vehnav.batch.regression import Comparison
    from vehnav.batch.suite import Suite


INDEX_NAME: Final = "index.html"
LEFT_OUT: Final = 20
"""Files that are no logs, named one by one; a folder of pictures would fill the screen."""


class SizeType(ParamType):
    """Bytes: ``500M``, ``2G``."""

    name = "SIZE"

    def convert(self, value: Any, param: Any, ctx: Any) -> int:
        """Read a size."""
        from vehnav.batch.fields import size_of

        return size_of(value, "--memory-limit")


class ShareType(ParamType):
    """A share: ``5%`` or ``0.05``."""

    name = "SHARE"

    def convert(self, value: Any, param: Any, ctx: Any) -> float:
        """Read a share."""
        from vehnav.batch.fields import fraction_of

        return fraction_of(value, "--max-regression")


@command(
    "score",
    examples=[
        "vehnav score --init drives/",
        "vehnav score suite.toml",
        "vehnav score suite.toml --junit junit.xml --max-regression 5%",
        "vehnav score suite.toml --update-baseline",
        "vehnav score suite.toml -o nightly --resume --jobs 8 --timeout 300 --memory-limit 2G",
        "vehnav score fleet.toml --scheduler tcp://10.0.0.1:8786 -o /mnt/shared/nightly",
    ],
    config=False,
)
@click.argument("suite", required=False, metavar="SUITE.toml")
@click.option(
    "-o", "--output", metavar="DIR",
    help="Folder of results.json and the reports.  [default: SUITE-stem.vehnav]",
)  # fmt: skip
@click.option(
    "--jobs", type=click.IntRange(min=1), metavar="N",
    help="Worker processes.  [default: one for each core]",
)  # fmt: skip
@click.option(
    "--timeout", type=NumberType(min=0, min_open=True), metavar="S",
    help="Longest time for a log and configuration.  [default: of the suite, else any]",
)  # fmt: skip
@click.option(
    "--memory-limit", type=SizeType(),
    help="Memory that a log may take, e.g. 2G (Linux).  [default: of the suite, else any]",
)  # fmt: skip
@click.option(
    "--resume", is_flag=True,
    help="Keep the results in the folder whose log, options and code are the same.",
)  # fmt: skip
@click.option(
    "--baseline", metavar="FILE",
    help="Compare with this results.json or baseline.  [default: of the suite]",
)  # fmt: skip
@click.option(
    "--max-regression", type=ShareType(),
    help="Fail where the median got worse by more, e.g. 5%.  [default: of the suite]",
)  # fmt: skip
@click.option("--update-baseline", is_flag=True, help="Make these results the baseline.")
@click.option(
    "--keep", type=click.Choice(["figures", "report", "trajectory"]),
    help="What to write of each log: figures only, its report, or its trajectory as well.  "
    "[default: of the suite, else report]",
)  # fmt: skip
@click.option(
    "--scheduler", metavar="ADDRESS",
    help="Run on the Dask cluster of this scheduler (pip install vehnav[fleet]).",
)  # fmt: skip
@click.option("--junit", metavar="FILE", help="Also write JUnit XML: a test case for each bar.")
@click.option(
    "--table", "tables", multiple=True, metavar="FILE",
    help="Also write all figures as a table: .csv or .parquet. Repeatable.",
)  # fmt: skip
@click.option(
    "--markdown", metavar="FILE",
    help="Also write the summary as Markdown; in GitHub Actions the job shows it anyway.",
)  # fmt: skip
@click.option(
    "--init", metavar="DIR",
    help="Write an example suite.toml of the logs in DIR, with what it can hold, and stop.",
)  # fmt: skip
@json_option
@quiet_option
def score(suite: str | None, as_json: bool, quiet: bool, **options: Any) -> None:
    """Score logs against bars and a baseline, on all cores.

    SUITE.toml names the logs, the configurations, and the bars that their errors must keep. Writes
    results.json, index.html and a report of every log. Exit status 1 if a bar was missed, a log
    failed, or the figures got worse than the baseline allows. A log that crashes, hangs or eats
    memory fails alone. Ctrl-C leaves what there is; --resume goes on.
    """
    if options["init"]:
        _init(options["init"], as_json=as_json)
        return
    if suite is None:
        raise click.UsageError("SUITE.toml is needed; --init DIR writes the first one")
    loaded, out = _suite(suite, options)
    baseline = _baseline(loaded, options)
    _check_files(loaded, out, options)
    _say_absent(loaded)
    results = _run(loaded, out, options, quiet=quiet or as_json)
    comparison = _compared(baseline, results, loaded, options)
    if as_json:
        compared = {} if comparison is None else {"comparison": comparison.to_dict()}
        print_json({**results.to_dict(), **compared})
    elif not quiet:
        from vehnav.cli.score_screen import screen

        width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
        click.echo(screen(results, comparison, width=width))
    _write(results, comparison, out, options)
    _leave(results, comparison, loaded, out, options, quiet=quiet or as_json)


def _init(folder: str, *, as_json: bool) -> None:
    """Write the example, and say what is in it and what is not."""
    from vehnav.batch.example import write_example

    made = write_example(Path(folder))
    if as_json:
        found = [{"path": row.path, "group": row.group, "gps": row.gps} for row in made.found]
        left_out = [{"path": row.path, "reason": row.reason} for row in made.left_out]
        print_json({"suite": str(made.path), "logs": found, "left_out": left_out})
        return
    for row in made.left_out[:LEFT_OUT]:
        click.echo(f"left out: {row.path}: {row.reason}", err=True)
    if len(made.left_out) > LEFT_OUT:
        more = len(made.left_out) - LEFT_OUT
        click.echo(f"left out: {more} more, all named by --json", err=True)
    count = len(made.found)
    click.echo(
        f"{made.path}: {count} log{'s' if count > 1 else ''}; next: vehnav score {made.path}"
    )


def _suite(path: str, options: dict[str, Any]) -> tuple[Suite, Path]:
    """The suite with what the command line says of it, and where its results go."""
    from vehnav.batch.suite import load_suite

    loaded = load_suite(path)
    given = {
        "time_limit": options["timeout"],
        "memory_limit": options["memory_limit"],
        "keep": options["keep"],
    }
    loaded = replace(loaded, **{key: x for key, x in given.items() if x is not None})
    return loaded, Path(options["output"] or Path(path).with_suffix(".vehnav").name)


def _baseline_path(suite: Suite, options: dict[str, Any]) -> Path | None:
    return Path(options["baseline"]) if options["baseline"] else suite.baseline.file


def _baseline(suite: Suite, options: dict[str, Any]) -> Baseline | None:
    """The baseline, read before anything runs; one that is to be made need not be there."""
    from vehnav.batch.baseline import read_baseline

    path = _baseline_path(suite, options)
    if path is None and (options["update_baseline"] or options["max_regression"] is not None):
        raise ConfigError(
            f"{suite.path}: no baseline: give --baseline FILE, or [baseline] file in the suite"
        )
    if path is None or (options["update_baseline"] and not path.exists()):
        return None
    return read_baseline(path)


def _check_files(suite: Suite, out: Path, options: dict[str, Any]) -> None:
    """ConfigError for a file that could not be written when everything has run."""
    from vehnav.batch.tables import check_table

    for path in options["tables"]:
        check_table(Path(path))
    files = [options["junit"], options["markdown"], *options["tables"]]
    if options["update_baseline"]:
        files.append(_baseline_path(suite, options))
    for file in map(Path, filter(None, files)):
        if not file.parent.is_dir() and file.parent.resolve() != out.resolve():
            raise ConfigError(f"{file}: there is no folder {file.parent}; make it first")


def _say_absent(suite: Suite) -> None:
    """Which optional logs are not there, and how many: a suite of none passes."""
    for text in suite.skipped:
        click.echo(f"skipped: {text}", err=True)
    count = len(suite.skipped)
    if count:
        absent = "1 optional [[log]] is" if count == 1 else f"{count} optional [[log]] are"
        there = len(suite.logs)
        scored = f"; {there} log{'s are' if there > 1 else ' is'} scored"
        rest = scored if there else ": nothing is scored"
        click.echo(f"warning: {absent} absent{rest}", err=True)


def _run(suite: Suite, out: Path, options: dict[str, Any], *, quiet: bool) -> Results:
    from vehnav.batch.runner import run_suite

    total = len(suite.matrix())
    with (
        _stopped_like_ctrl_c(),
        progress(f"{suite.name}: {total} runs", total=total, quiet=quiet) as advance,
    ):
        return run_suite(
            suite,
            out,
            jobs=options["jobs"],
            scheduler=options["scheduler"],
            resume=options["resume"],
            advance=advance,
        )


@contextmanager
def _stopped_like_ctrl_c() -> Iterator[None]:
    """SIGTERM, by which CI stops a job, leaves the results that there are, as Ctrl-C does."""

    def stop(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _compared(
    baseline: Baseline | None, results: Results, suite: Suite, options: dict[str, Any]
) -> Comparison | None:
    """The comparison; a baseline that is being replaced gates nothing."""
    from vehnav.batch.regression import compare_with

    if baseline is None:
        return None
    limit = options["max_regression"]
    limit = suite.baseline.max_regression if limit is None else limit
    gated = not options["update_baseline"]
    return compare_with(
        baseline,
        results,
        max_regression=limit if gated else None,
        max_log_regression=suite.baseline.max_log_regression if gated else None,
    )


def _write(
    results: Results, comparison: Comparison | None, out: Path, options: dict[str, Any]
) -> None:
    """``results.json`` first, then the rest; ConfigError where the disk refuses."""
    from vehnav.batch.index import write_index
    from vehnav.batch.junit import write_junit
    from vehnav.batch.markdown import append_step_summary, write_markdown
    from vehnav.batch.runner import save
    from vehnav.batch.tables import write_table

    save(results, out)
    command = shlex.join(["vehnav", *sys.argv[1:]])
    try:
        write_index(results, out / INDEX_NAME, comparison=comparison, command=command)
        if options["junit"]:
            write_junit(results, Path(options["junit"]), comparison=comparison)
        for path in options["tables"]:
            write_table(results, Path(path), comparison=comparison)
        if options["markdown"]:
            write_markdown(results, Path(options["markdown"]), comparison=comparison, folder=out)
        append_step_summary(results, comparison=comparison)
    except OSError as error:
        raise ConfigError(f"an output cannot be written: {error}") from error


def _leave(
    results: Results,
    comparison: Comparison | None,
    suite: Suite,
    out: Path,
    options: dict[str, Any],
    *,
    quiet: bool,
) -> None:
    """Update the baseline if asked, say where everything is, and leave with the status."""
    from vehnav.batch.baseline import write_baseline

    if not results.run.complete:
        open_ends = sum(result.status == "interrupted" for result in results.results)
        done = len(results.results) - open_ends
        click.echo(
            f"{done} of {len(results.results)} are done and in {out / 'results.json'}; "
            "--resume goes on",
            err=True,
        )
        raise click.Abort
    path = _baseline_path(suite, options)
    if options["update_baseline"] and path is not None:
        write_baseline(results, path)
        failed = sum(result.status != "ok" for result in results.results)
        lacks = f"; {failed} of {len(results.results)} runs have no figures in it, as they failed"
        click.echo(f"baseline: {path}{lacks if failed else ''}", err=True)
    if not quiet:
        click.echo(f"results    {out / INDEX_NAME}, results.json beside it")
    good = results.passed and (comparison is None or comparison.passed)
    finish(damaged=any(result.damaged for result in results.results), bar_missed=not good)
