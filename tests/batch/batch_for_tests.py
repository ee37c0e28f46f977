"""Made-up results for the tests of what is written from them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from vehnav.batch.model import BarResult, Result, Results, RunBlock

MAX = "errors.horizontal_m.max"
RMS = "errors.horizontal_m.rms"


def ok(
    log: str,
    largest: float | None,
    *,
    group: str = "city",
    config: str = "default",
    limit: float | None = 50.0,
    more: dict[str, float | None] | None = None,
) -> Result:
    """A log that ran, with one bar on its largest error."""
    metrics: dict[str, float | None] = {
        MAX: largest,
        RMS: None if largest is None else 0.5 * largest,
        "trajectory.distance_m": 1500.0,
        "gps.fixes_judged": 200.0,
    }
    bars = () if limit is None else (BarResult.of(MAX, "max", limit, largest),)
    return Result(
        log, group, config, "ok", 0, None, "ab" * 32, False, {**metrics, **(more or {})}, bars,
        f"logs/{log}/{config}/report.html",
    )  # fmt: skip


def broken(log: str, status: str = "crash", error: str = "killed by SIGKILL", **kwargs) -> Result:
    row = ok(log, None, **kwargs)
    return Result(
        row.log, row.group, row.config, status, None, error, "", False, {}, row.bars, None
    )


def suite(results: Iterable[Result], name: str = "fleet") -> Results:
    rows = list(results)
    run = RunBlock(
        started="2026-01-02T03:04:05Z",
        finished="2026-01-02T03:05:05Z",
        elapsed_s=60.0,
        host="a-host",
        platform="Linux",
        python="3.11.9",
        vehnav="0.1.0",
        jobs=2,
        complete=True,
        seconds={r.name: 1.25 for r in rows},
    )
    return Results.of(name, rows, run)


def many(
    count: int, *, configs: Sequence[str] = ("default",), seed: int = 1, spread: float = 0.0
) -> Results:
    """Errors that are log-normal over the logs; ``spread``: a factor between two runs of a log."""
    rng = np.random.default_rng(7)
    size = 20.0 * np.exp(0.8 * rng.standard_normal((count, len(configs))))
    size *= np.exp(spread * np.random.default_rng(seed).standard_normal(size.shape))
    groups = ("city", "highway", "mountain road")
    return suite(
        ok(f"drive_{k:04d}.mcap", float(size[k, j]), group=groups[k % 3], config=config)
        for k in range(count)
        for j, config in enumerate(configs)
    )
