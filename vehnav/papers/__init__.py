"""The published experiments, rerun: for each claim what was assumed, our figure, the verdict.

One module per paper. A verdict is computed from the figure, never written down: see
:mod:`vehnav.papers.claims`.
"""

from __future__ import annotations

from vehnav.papers.claims import Row, Verdict
from vehnav.papers.rerun import PAPERS, run_papers

__all__ = ["PAPERS", "Row", "Verdict", "run_papers"]
