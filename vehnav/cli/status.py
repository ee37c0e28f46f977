"""Exit status: what each number means, and which one a command that ran leaves with."""

from __future__ import annotations

from collections.abc import Iterable

from vehnav.errors import Finding

OK = 0
MISSED = 1
"""Ran, but a bar was missed, or --strict and something was found."""
UNUSABLE = 2
"""Could not run: usage, configuration, unreadable or unusable input."""
DAMAGED = 3
"""Ran, but from a damaged log."""
BUG = 70
INTERRUPTED = 130
BROKEN_PIPE = 141
"""The reader of our output went away (as a shell reports SIGPIPE); nothing is printed."""


def exit_status(
    *,
    damaged: bool = False,
    strict: bool = False,
    findings: Iterable[Finding] = (),
    bar_missed: bool = False,
) -> int:
    """0, 1 or 3 for a command that ran.

    A missed bar counts more than damage; ``strict`` makes damage, and findings of level warning or
    above, count as a missed bar.
    """
    found = damaged or any(finding.level != "info" for finding in findings)
    if bar_missed or (strict and found):
        return MISSED
    return DAMAGED if damaged else OK
