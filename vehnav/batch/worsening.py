"""One figure before and now: which way is worse, by how much, and what is no change at all."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, Literal

from vehnav.batch.model import Result

Direction = Literal["less", "more", "none"]
"""What is better: less, more, or neither (a figure held from both sides)."""

FLOORS: Final = (
    ("_m_s", 1e-3), ("_deg", 1e-2), ("percent", 1e-2), ("_m", 1e-2),
    ("count", 0.5), ("findings", 0.5), ("fixes", 0.5),
)  # fmt: skip
"""By the end or the beginning of a part of the name: the change in m/s, degrees, percent, m, and
of what is counted, that is none."""
PLAIN_FLOOR: Final = 1e-3
"""Of figures without a unit: shares, scores."""


def floor_of(metric: str) -> float:
    """The change of a figure that is none, in its unit.

    >>> floor_of("errors.horizontal_m.max"), floor_of("errors.velocity_m_s.rms")
    (0.01, 0.001)
    >>> floor_of("errors.percent_of_distance.end"), floor_of("stops.count")
    (0.01, 0.5)
    """
    parts = metric.split(".")
    for unit, floor in FLOORS:
        if any(part.endswith(unit) or part.startswith(unit) for part in parts):
            return floor
    return PLAIN_FLOOR


def worsening(before: float, now: float, *, direction: Direction, floor: float) -> float:
    """Relative, positive is worse; 0 where the figure moved by no more than the floor.

    >>> worsening(10.0, 10.6, direction="less", floor=0.01)
    0.06
    >>> worsening(0.5, 0.25, direction="more", floor=0.001)
    0.5
    >>> worsening(0.001, 0.009, direction="less", floor=0.01)
    0.0
    """
    if direction == "less":
        before, now = abs(before), abs(now)
    moved = now - before if direction != "more" else before - now
    if abs(moved) <= floor:
        return 0.0
    return round(moved / max(abs(before), floor), 9)


def directions(results: Iterable[Result]) -> dict[str, Direction]:
    """What is better of every figure: as its bars say, else less."""
    bounds: dict[str, set[str]] = {}
    for result in results:
        for bar in result.bars:
            bounds.setdefault(bar.metric, set()).add(bar.bound)
    words: dict[frozenset[str], Direction] = {
        frozenset({"min"}): "more",
        frozenset({"max"}): "less",
    }
    return {name: words.get(frozenset(kinds), "none") for name, kinds in bounds.items()}
