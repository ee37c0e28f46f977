"""A published claim beside our figure, and the rules by which verdicts are computed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal

Verdict = Literal["reproduced", "within the bar", "not reproduced", "waits"]

SAME_SIZE: Final = 5.0
"""A figure under a published bound, but by less than this factor, is of the published size."""


@dataclass(frozen=True)
class Row:
    """One claim, rerun.

    Attributes
    ----------
    paper : str
        Number of the paper, or ``all``.
    key : str
        Name of the claim within its paper.
    claim : str
        What the paper says.
    assumed : str
        What had to be chosen where the paper is silent; empty if nothing.
    figure : str
        Our figure, for reading.
    verdict : {"reproduced", "within the bar", "not reproduced", "waits"}
    why : str
        What the verdict rests on, or why it is not better.
    values : mapping of str to float
        The numbers behind the figure.
    """

    paper: str
    key: str
    claim: str
    assumed: str
    figure: str
    verdict: Verdict
    why: str = ""
    values: Mapping[str, float] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """As plain data, for ``--json``."""
        return {
            "paper": self.paper, "key": self.key, "claim": self.claim, "assumed": self.assumed,
            "figure": self.figure, "values": dict(self.values), "verdict": self.verdict,
            "why": self.why,
        }  # fmt: skip


def at_most(figure: float, bound: float, *, same_size: float = SAME_SIZE) -> Verdict:
    """Of an upper bound: reproduced near it, within the bar far below, else not reproduced.

    ``same_size``: how many times smaller still counts as near.

    >>> at_most(1.4, 2.0), at_most(0.1, 2.0), at_most(2.1, 2.0)
    ('reproduced', 'within the bar', 'not reproduced')
    """
    if not figure <= bound:
        return "not reproduced"
    return "reproduced" if figure * same_size >= bound else "within the bar"


def near(figure: float, published: float, *, relative: float) -> Verdict:
    """Of a number: reproduced within the relative tolerance.

    >>> near(8100.0, 8000.0, relative=0.15)
    'reproduced'
    """
    return "reproduced" if abs(figure - published) <= relative * published else "not reproduced"


def between(figure: float, low: float, high: float) -> Verdict:
    """Of a range: reproduced inside."""
    return "reproduced" if low <= figure <= high else "not reproduced"


def at_least(figure: float, bound: float) -> Verdict:
    """Of a lower bound: reproduced at or above it."""
    return "reproduced" if figure >= bound else "not reproduced"


def about(x: float) -> str:
    """One decimal, or how large it is where no digit means anything.

    >>> about(13.44), about(41234.0)
    ('13.4', 'over 10000')
    """
    return f"{x:.1f}" if x < 100.0 else f"over {10 ** math.floor(math.log10(x))}"


def waiting(paper: str, key: str, claim: str, needs: str) -> Row:
    """A claim whose experiment this version cannot run."""
    return Row(paper, key, claim, "", "", "waits", f"needs {needs}, not rerun by this version")
