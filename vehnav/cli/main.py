"""``vehnav``: the table of commands, and the only place where exceptions become an exit status.

A command is imported when it is called, so that ``vehnav --help`` costs little. Shell completion is
click's: ``eval "$(_VEHNAV_COMPLETE=bash_source vehnav)"`` (or ``zsh_source``, ``fish_source``).
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import click

from vehnav._version import __version__
from vehnav.blas import stay_on_one_thread
from vehnav.cli.status import BROKEN_PIPE, BUG, INTERRUPTED, OK, UNUSABLE
from vehnav.errors import VehnavError

COMMANDS: dict[str, tuple[str, str]] = {
    "run": ("vehnav.cli.run:run", "Where the vehicle went: a log to trajectory, errors, report."),
    "compare": ("vehnav.cli.compare:compare", "Errors of trajectories against GPS or truth."),
    "score": ("vehnav.cli.score:score", "Many logs and configurations against bars."),
    "info": ("vehnav.cli.info:info", "What is in a log."),
    "check": ("vehnav.cli.check:check", "What is wrong with a log."),
    "stops": ("vehnav.cli.stops:stops", "When the vehicle stood still."),
    "sensor": ("vehnav.cli.sensor:sensor", "Noise of the sensor, from the log's own rest."),
    "simulate": ("vehnav.cli.simulate:simulate", "Make a log of a named scenario."),
    "papers": ("vehnav.cli.papers:papers", "Rerun the experiments of the five papers."),
    "budget": ("vehnav.cli.budget:budget", "Sensor errors to navigation errors, and back."),
    "convert": ("vehnav.cli.convert:convert", "One format of trajectory or log to another."),
}
"""Name -> (module:object, short help). A row is listed when its module exists."""


class OutputClosed(Exception):
    """The reader of stdout went away."""


class LazyGroup(click.Group):
    """Commands from :data:`COMMANDS`; exit status as README and ``--help`` document it."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in the order of the table."""
        return [
            name
            for name, (target, _) in COMMANDS.items()
            if importlib.util.find_spec(target.partition(":")[0]) is not None
        ]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the module of one command."""
        if cmd_name not in self.list_commands(ctx):
            return None
        module, _, attribute = COMMANDS[cmd_name][0].partition(":")
        found = getattr(importlib.import_module(module), attribute)
        return found if isinstance(found, click.Command) else None

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, or suggest the nearest name."""
        if args and not args[0].startswith("-") and args[0] not in self.list_commands(ctx):
            import difflib

            close = difflib.get_close_matches(args[0], self.list_commands(ctx), n=1, cutoff=0.5)
            hint = f"; did you mean {close[0]!r}?" if close else ""
            ctx.fail(f"no command {args[0]!r}{hint}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands without importing them."""
        rows = [(name, COMMANDS[name][1]) for name in self.list_commands(ctx)]
        if rows:
            with formatter.section("Commands"):
                formatter.write_dl(rows)

    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:
        """Parse; ``--help`` and ``--version`` print here."""
        with _closed_output():
            return super().make_context(*args, **kwargs)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        with _closed_output():
            return super().invoke(ctx)

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,
    ) -> Any:
        """Run, and leave with the exit status."""

        def work() -> Any:
            return super(LazyGroup, self).main(
                args=args,
                prog_name=prog_name or "vehnav",
                complete_var=complete_var,
                standalone_mode=False,
                windows_expand_args=windows_expand_args,
                **extra,
            )

        if not standalone_mode:
            return work()
        sys.exit(status_of(work))


def status_of(work: Callable[[], Any]) -> int:
    """Exit status of a call; what went wrong is printed on stderr."""
    try:
        status = work()
        sys.stdout.flush()
        return status if isinstance(status, int) and not isinstance(status, bool) else OK
    except click.exceptions.Abort:
        return _say("interrupted", INTERRUPTED)
    except click.UsageError as error:
        where = f" (see '{error.ctx.command_path} --help')" if error.ctx else ""
        return _say(f"error: {error.format_message().rstrip('.')}{where}", UNUSABLE)
    except click.ClickException as error:
        return _say(f"error: {error.format_message()}", UNUSABLE)
    except VehnavError as error:
        return _say(f"error: {error}", UNUSABLE)
    except (OutputClosed, BrokenPipeError):
        return _broken_pipe()
    except OSError as error:
        if error.filename is None:
            return _bug()
        return _say(f"error: {error.filename}: {error.strerror}", UNUSABLE)
    except Exception:
        return _bug()


def _say(text: str, status: int) -> int:
    click.echo(f"vehnav: {text}", err=True)
    return status


@contextlib.contextmanager
def _closed_output() -> Iterator[None]:
    """Keep a broken pipe from click, which would leave with 1."""
    try:
        yield
    except BrokenPipeError as error:
        raise OutputClosed from error


def _broken_pipe() -> int:
    """Point stdout at nothing, so that the flush of the dying interpreter is silent too."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, sys.__stdout__.fileno())  # type: ignore[union-attr]
    return BROKEN_PIPE


def _bug() -> int:
    import importlib.metadata
    import traceback

    traceback.print_exc()
    try:
        urls = importlib.metadata.metadata("vehnav").get_all("Project-URL") or []
    except importlib.metadata.PackageNotFoundError:
        urls = []
    tracker = next((url.split(", ")[1] for url in urls if url.startswith("Issues, ")), None)
    place = tracker or "the issue tracker of the repository it came from"
    return _say(
        f"internal error: this is a bug in vehnav {__version__}, not in your log. Please report it "
        f"at {place}, with the lines above and the output of 'vehnav info LOG --json'.",
        BUG,
    )


@click.group(
    "vehnav",
    cls=LazyGroup,
    no_args_is_help=False,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="""\b
Exit status: 0 done; 1 a bar was missed, or --strict and something was found; 2 could not run;
3 ran, but from a damaged log; 70 a bug in vehnav; 130 interrupted.
Results go to stdout, everything else to stderr.

\b
Examples:
  vehnav run city.mcap                  trajectory, errors and report in city.vehnav/
  vehnav run --help                     all options of a command
  eval "$(_VEHNAV_COMPLETE=bash_source vehnav)"      shell completion (also zsh, fish)""",
)
@click.version_option(__version__, prog_name="vehnav", message="%(prog)s %(version)s")
@click.pass_context
def cli(ctx: click.Context) -> None:
    """Vehicle dead reckoning: where a vehicle went without GPS, how far off, and why."""
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help(), err=True)
        ctx.exit(UNUSABLE)


def main() -> None:
    """Entry point of the console command."""
    stay_on_one_thread()
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    cli.main(prog_name="vehnav")
