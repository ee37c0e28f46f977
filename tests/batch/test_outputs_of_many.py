"""A thousand logs through every output: memory and time grow with the results, no faster."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from batch_for_tests import ok, suite

from vehnav.batch.baseline import read_baseline, write_baseline
from vehnav.batch.index import write_index
from vehnav.batch.junit import write_junit
from vehnav.batch.markdown import write_markdown
from vehnav.batch.model import METRICS, Results, write_results
from vehnav.batch.regression import compare_with
from vehnav.batch.tables import write_table

MEGABYTE = 1e6


def fleet(count: int) -> Results:
    """Every log with every figure that is kept."""
    size = 20.0 * np.exp(np.random.default_rng(7).standard_normal(count))
    rows = []
    for k in range(count):
        figures = {name: float(size[k]) * (0.3 + 0.05 * j) for j, name in enumerate(METRICS)}
        rows.append(ok(f"fleet-{k:06d}", float(size[k]), group=f"city {k % 5}", more=figures))
    return suite(rows)


def outputs(results: Results, folder: Path) -> None:
    write_baseline(results, folder / "baseline.json")
    before = read_baseline(folder / "baseline.json")
    comparison = compare_with(before, results, max_regression=0.05)
    write_results(results, folder / "results.json")
    write_junit(results, folder / "junit.xml", comparison=comparison)
    write_table(results, folder / "table.csv", comparison=comparison)
    write_markdown(results, folder / "summary.md", comparison=comparison)
    write_index(results, folder / "index.html", comparison=comparison)


def fastest(work: Callable[[], None]) -> float:
    times = []
    for _ in range(3):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def test_memory_of_a_thousand_logs(tmp_path: Path) -> None:
    """Python's own allocations at their highest: a few times the 1.3 MB of results.json."""
    results = fleet(1000)
    tracemalloc.start()
    try:
        outputs(results, tmp_path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 30 * MEGABYTE
    sizes = {path.name: path.stat().st_size / MEGABYTE for path in tmp_path.iterdir()}
    assert sizes["junit.xml"] < 0.5  # GitLab takes 30 MB: 60 000 logs with a bar each
    assert sizes["index.html"] < 1.0
    assert sizes["baseline.json"] < 1.0
    assert sizes["summary.md"] < 0.1


@pytest.mark.slow
def test_time_grows_with_the_logs(tmp_path: Path) -> None:
    """Eight times the logs cost about eight times as much, not 64 times."""
    few, many = fleet(500), fleet(4000)
    outputs(few, tmp_path)
    ratio = fastest(lambda: outputs(many, tmp_path)) / fastest(lambda: outputs(few, tmp_path))
    assert ratio < 16.0
