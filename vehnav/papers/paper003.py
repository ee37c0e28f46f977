"""Paper 003 (free azimuth, quasi-coordinates): navigation over the pole and its filter."""

from __future__ import annotations

from vehnav.papers.claims import Row, waiting


def rows(*, fast: bool = False) -> list[Row]:
    """The claims of paper 003."""
    del fast
    return [
        waiting(
            "003",
            "pole",
            "free azimuth and quasi-coordinates have no singular place",
            "the free-azimuth mechanization over the pole",
        ),
        waiting(
            "003",
            "filter",
            "13 states estimate position, velocity, attitude and biases",
            "the error-state filter",
        ),
    ]
