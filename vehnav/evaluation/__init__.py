"""Trajectory against GPS or truth: matching, error series, statistics."""

from __future__ import annotations

from vehnav.evaluation.errors import Errors
from vehnav.evaluation.judge import compare
from vehnav.evaluation.statistics import Statistics, statistics

__all__ = ["Errors", "Statistics", "compare", "statistics"]
