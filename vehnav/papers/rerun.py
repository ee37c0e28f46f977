"""All papers, or some: rows in the order of the papers; and the table for Markdown."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from typing import Final

from vehnav.errors import ConfigError
from vehnav.papers.claims import Row

PAPERS: Final = {
    "000": "Uspensky, Bagmut: navigation in inertial axes by quaternion",
    "001": "Rudyk: error model and its inverse",
    "002": "Mkrtchyan: levelling and velocity reset at stops",
    "003": "Free azimuth and quasi-coordinates, 13 states",
    "004": "Langevin model of vehicle motion by Poisson's equation",
}
"""Number -> what it is about."""


def run_papers(
    ids: Sequence[str] = (),
    *,
    fast: bool = False,
    progress: Callable[[str], None] | None = None,
) -> list[Row]:
    """Rerun the experiments.

    Parameters
    ----------
    ids : sequence of str
        Numbers of the papers; all by default.
    fast : bool
        Fewer runs and steps, for a look in seconds.
    progress : callable, optional
        Called with the number of each paper before it is rerun.

    Raises
    ------
    ConfigError
        There is no such paper.
    """
    for number in ids:
        if number not in PAPERS:
            raise ConfigError(f"no paper {number!r}; there are {', '.join(PAPERS)}")
    rows: list[Row] = []
    for number in PAPERS:
        if ids and number not in ids:
            continue
        if progress is not None:
            progress(number)
        rows += importlib.import_module(f"vehnav.papers.paper{number}").rows(fast=fast)
    return rows


def markdown(rows: Sequence[Row]) -> str:
    """The rows as a Markdown table.

    >>> print(markdown([Row("000", "k", "a | b", "", "1 m", "waits")]).splitlines()[2])
    | 000 | a \\| b |  | 1 m | waits |  |
    """
    head = ("paper", "the paper says", "assumed", "vehnav", "verdict", "why")
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    for row in rows:
        cells = (row.paper, row.claim, row.assumed, row.figure, row.verdict, row.why)
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines)
