"""``vehnav papers``: the published experiments, rerun."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import click

from vehnav.cli.common import command, finish, json_option, print_json, progress, quiet_option

if TYPE_CHECKING:
    from vehnav.papers import Row

_WIDTH = 100


@command(
    "papers",
    examples=[
        "vehnav papers --fast",
        "vehnav papers 004",
        "vehnav papers --markdown > papers.md",
        "vehnav papers --json",
    ],
    config=False,
)
@click.argument("papers", nargs=-1, metavar="[ID]...")
@click.option("--fast", is_flag=True, help="Fewer runs and steps: seconds instead of minutes.")
@click.option("--markdown", is_flag=True, help="Print a Markdown table.")
@json_option
@quiet_option
def papers(papers: tuple[str, ...], fast: bool, markdown: bool, as_json: bool, quiet: bool) -> None:
    """Rerun the experiments of the five papers on this machine.

    ID is one of 000 to 004; all by default. For every claim: what the paper says, what was assumed
    where it is silent, our figure, and the verdict computed from it: reproduced, within the bar
    (better than a published bound), not reproduced, or waits.
    """
    from vehnav.papers import run_papers
    from vehnav.papers.rerun import PAPERS
    from vehnav.papers.rerun import markdown as as_markdown

    if markdown and as_json:
        raise click.UsageError("--markdown and --json exclude each other")
    with progress("papers", total=len(papers) or len(PAPERS), quiet=quiet) as advance:
        done = 0

        def begin(_: str) -> None:
            nonlocal done
            advance(done)
            done += 1

        rows = run_papers(papers, fast=fast, progress=begin)
    if as_json:
        print_json({"fast": fast, "papers": [row.to_dict() for row in rows]})
    elif markdown:
        click.echo(as_markdown(rows))
    else:
        _print(rows, PAPERS)
    finish()


def _print(rows: list[Row], titles: dict[str, str]) -> None:
    shown = ""
    for row in rows:
        if row.paper != shown:
            shown = row.paper
            click.echo(f"\n{shown}  {titles.get(shown, 'all mechanizations')}")
        click.echo(f"  {row.verdict.upper():15s} {row.claim}")
        for label, text in (("here", row.figure), ("assumed", row.assumed), ("why", row.why)):
            if text:
                lines = textwrap.wrap(text, _WIDTH - 28)
                click.echo(f"{'':18s}{label:8s} {lines[0]}")
                for line in lines[1:]:
                    click.echo(f"{'':27s}{line}")
    counts = {verdict: sum(row.verdict == verdict for row in rows) for verdict in
              ("reproduced", "within the bar", "not reproduced", "waits")}  # fmt: skip
    click.echo("\n" + ", ".join(f"{n} {verdict}" for verdict, n in counts.items() if n))
