"""Paper 001 (Rudyk): error model and its inverse."""

from __future__ import annotations

from vehnav.papers.claims import Row, waiting


def rows(*, fast: bool = False) -> list[Row]:
    """The claims of paper 001."""
    del fast
    needs = "the error budget"
    return [
        waiting(
            "001", "forward", "sensor errors become navigation errors by the linear model", needs
        ),
        waiting("001", "inverse", "accuracy wanted becomes requirements on the sensors", needs),
    ]
