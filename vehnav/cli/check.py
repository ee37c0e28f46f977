"""``vehnav check``: what is wrong with a log; repairs nothing, loses nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import click

from vehnav.cli.common import (
    axes_options,
    command,
    finding_line,
    finish,
    input_options,
    json_option,
    print_json,
    progress,
    span_options,
    stops_options,
    strict_option,
)

if TYPE_CHECKING:
    from vehnav.logs.log import ReadOptions

LEVELS: Final = {"error": "error", "warning": "warning", "info": "note"}
"""Level of a finding -> what it is called."""


@command(
    "check",
    examples=["vehnav check city.mcap", "vehnav check city.mcap --strict --json"],
)
@click.argument("log")
@input_options
@span_options
@axes_options
@stops_options
@json_option
@strict_option
def check(log: str, read_options: ReadOptions, as_json: bool, strict: bool, **options: Any) -> None:
    """Tell what is wrong with a log: findings only.

    Counts what was declared, read, recovered, read from parts that cannot be trusted (unverified)
    and unusable (bad); then every finding of reading it, of its clocks, units, axes and gaps. The
    last line says whether the log is sound, usable (with warnings), not navigable or damaged.
    Exit status 3 if data was lost, recovered or unverified; 1 with --strict and any warning.
    """
    from vehnav.cli.run import config_from
    from vehnav.logs.read import read_log
    from vehnav.report.inspection import COUNTS, check_document, inspect_log, integrity

    with progress(f"{log}: reading", quiet=as_json):
        recording = read_log(log, read_options)
    inspection = inspect_log(recording, config_from(recording, options))
    findings = inspection.findings
    if as_json:
        print_json(check_document(inspection))
    else:
        counts = integrity(recording)
        click.echo(f"{log}: " + ", ".join(f"{counts[name]} {name}" for name in COUNTS))
        for finding in findings:
            click.echo(finding_line(finding, recording.start_ns))
        found = {level: sum(f.level == level for f in findings) for level in LEVELS}
        texts = [f"{n} {LEVELS[level]}{'' if n == 1 else 's'}" for level, n in found.items()]
        click.echo(f"{inspection.verdict}: {', '.join(texts)}")
    finish(damaged=recording.damaged, strict=strict, findings=findings)
