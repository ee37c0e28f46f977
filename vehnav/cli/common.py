"""What every command needs: its shape, exit status, JSON, findings, progress.

A command is written as::

    @command("stops", examples=["vehnav stops city.mcap", "vehnav stops city.mcap --json"])
    @click.argument("log")
    @input_options
    @json_option
    @strict_option
    def stops(log: str, read_options: ReadOptions, as_json: bool, strict: bool) -> None:
        '''First line: the short help. The rest: what a reader has to know.'''
        ...                             # one call of a library function
        finish(damaged=log.damaged, strict=strict, findings=log.findings)

Errors are raised, never printed: :mod:`vehnav.cli.main` turns them into an exit status.
"""

from __future__ import annotations

import copy
import json
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NoReturn

import click

from vehnav.cli.options import (
    axes_options,
    input_options,
    json_option,
    option,
    quiet_option,
    span_options,
    stops_options,
    strict_option,
)
from vehnav.cli.settings import config_in_force, load_config, render_config
from vehnav.cli.status import exit_status
from vehnav.cli.types import AxesType, Instant, InstantType, NumbersType, NumberType, PairsType
from vehnav.errors import Finding, Level

__all__ = [
    "AxesType",
    "Instant",
    "InstantType",
    "NumberType",
    "NumbersType",
    "PairsType",
    "axes_options",
    "command",
    "config_in_force",
    "exit_status",
    "finding_line",
    "finish",
    "input_options",
    "json_option",
    "option",
    "print_findings",
    "print_json",
    "progress",
    "quiet_option",
    "span_options",
    "stops_options",
    "strict_option",
]


def finish(
    *,
    damaged: bool = False,
    strict: bool = False,
    findings: Iterable[Finding] = (),
    bar_missed: bool = False,
) -> NoReturn:
    """Leave the command with the status of :func:`exit_status`."""
    status = exit_status(damaged=damaged, strict=strict, findings=findings, bar_missed=bar_missed)
    click.get_current_context().exit(status)


# ---- commands ----------------------------------------------------------------------------------


class Command(click.Command):
    """A command with examples in its help, ``--config`` and ``--print-config``."""

    def __init__(self, *args: Any, examples: Sequence[str] = (), **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.examples = tuple(examples)

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """The parameters; with ``--print-config`` no argument is required."""
        params = super().get_params(ctx)
        if not ctx.meta.get("vehnav.print_config"):
            return params
        relaxed = [copy.copy(p) if isinstance(p, click.Argument) else p for p in params]
        for param in relaxed:
            if isinstance(param, click.Argument):
                param.required = False
        return relaxed

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse; remember first whether the config is to be printed."""
        ctx.meta["vehnav.print_config"] = "--print-config" in args
        return super().parse_args(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        """Print the options in force if asked to, else run."""
        if ctx.meta.get("vehnav.print_config"):
            click.echo(render_config(ctx))
            return None
        return super().invoke(ctx)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The examples, one on a line."""
        if self.examples:
            with formatter.section("Examples"):
                for line in self.examples:
                    formatter.write(f"  {line}\n")
        super().format_epilog(ctx, formatter)


def _use_config(ctx: click.Context, param: click.Parameter, value: str | None) -> None:
    if value is not None and not ctx.resilient_parsing:
        ctx.default_map = {**(ctx.default_map or {}), **load_config(ctx, value)}


def command(
    name: str, *, examples: Sequence[str], config: bool = True
) -> Callable[[Callable[..., Any]], click.Command]:
    """``click.command`` whose help ends in examples.

    ``config`` adds ``--config`` and ``--print-config``.
    """

    def decorate(func: Callable[..., Any]) -> click.Command:
        if config:
            func = click.option(
                "--print-config",
                is_flag=True,
                expose_value=False,
                help="Print the options in force, as a config file, and do nothing.",
            )(func)
            func = click.option(
                "--config",
                metavar="FILE",
                is_eager=True,
                expose_value=False,
                callback=_use_config,
                help="TOML file with options; what is given here counts more.",
            )(func)
        return click.command(name, cls=Command, examples=examples)(func)

    return decorate


# ---- results on stdout -------------------------------------------------------------------------


def print_json(document: dict[str, Any]) -> None:
    """Print one document on stdout; ``"version": 1`` is put in front unless it has its own.

    Arrays and NumPy numbers are written as lists and numbers; ValueError for a NaN.
    """
    document = {"version": 1, **document}
    click.echo(
        json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False, default=_as_plain)
    )


def _as_plain(value: Any) -> Any:
    if hasattr(value, "tolist"):
        return value.tolist()
    if hasattr(value, "keys"):
        return {key: value[key] for key in value}
    if hasattr(value, "__fspath__"):
        return str(value)
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")


# ---- the rest on stderr ------------------------------------------------------------------------

_LEVELS: tuple[Level, ...] = ("info", "warning", "error")


def finding_line(finding: Finding, start_ns: int = 0) -> str:
    """``warning: [gap] 12.0-19.4 s: text``, times from the start of the log."""
    when = ""
    if finding.start_ns is not None:
        first = (finding.start_ns - start_ns) * 1e-9
        when = f" {first:z.1f}"
        if finding.end_ns is not None and finding.end_ns != finding.start_ns:
            when += f"-{(finding.end_ns - start_ns) * 1e-9:z.1f}"
        when += " s:"
    return f"{finding.level}: [{finding.code}]{when} {finding.text}"


def print_findings(findings: Iterable[Finding], *, start_ns: int, least: Level = "info") -> None:
    """Print findings of level ``least`` and above on stderr, one a line, in their order."""
    for finding in findings:
        if _LEVELS.index(finding.level) >= _LEVELS.index(least):
            click.echo(finding_line(finding, start_ns), err=True)


@contextmanager
def progress(
    label: str, *, total: int | None = None, quiet: bool = False, after_s: float = 1.0
) -> Iterator[Callable[[int], None]]:
    """A line on stderr for work that takes over a second: the label, the time, and how far.

    Who can count calls the yielded function with the number done. Nothing is printed unless stderr
    is a terminal; the line is taken away at the end.
    """
    done: list[int] = []

    def advance(number: int) -> None:
        done[:] = [number]

    if quiet or not sys.stderr.isatty():
        yield advance
        return
    start = time.monotonic()
    finished = threading.Event()

    def show() -> None:
        shown = not finished.wait(after_s)
        while not finished.is_set():
            part = "" if not done else f" {100 * done[0] // total} %" if total else f" {done[0]}"
            sys.stderr.write(f"\r\x1b[K{label}{part}  {time.monotonic() - start:.0f} s")
            sys.stderr.flush()
            finished.wait(0.2)
        if shown:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()

    thread = threading.Thread(target=show, daemon=True)
    thread.start()
    try:
        yield advance
    finally:
        finished.set()
        thread.join()
