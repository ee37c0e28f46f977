"""A suite of 200 short drives by one worker and by two: parallel efficiency, memory, same results.

``python tests/bench/bench_score.py 1000`` runs that many one-minute drives on all cores instead.
Wanted: efficiency of at least 0.85 on two cores; memory of the workers flat. On a machine with
other work the clock shows the others; processor time shows ours: what the suite costs with one
worker over what it costs with two.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

LOGS = 200
DRIVE = "city,duration={seconds},first_stop=15,last_stop=8,stop_every=20"
SUITE = """
[suite]
name = "bench"
[[log]]
scenario = "{drive}"
rate = 100
runs = {logs}
[[config]]
name = "default"
gps_start_seconds = 15
"""


@dataclass(frozen=True)
class Figures:
    """What a run of the suite took: s by the clock, s of processor, MB along the way."""

    wall: float
    cpu: float
    memory: list[float]
    results: Any


def run(folder: Path, *, logs: int, jobs: int | None, seconds: int) -> Figures:
    """Run the suite; the memory is the largest of a worker so far, in the order of the logs."""
    from vehnav.batch.runner import run_suite, save
    from vehnav.batch.suite import load_suite

    path = folder / "suite.toml"
    path.write_text(SUITE.format(drive=DRIVE.format(seconds=seconds), logs=logs))
    before, clock = os.times(), time.perf_counter()
    results = run_suite(load_suite(path), folder / f"out-{jobs}", jobs=jobs)
    wall, after = time.perf_counter() - clock, os.times()
    save(results, folder / f"out-{jobs}")
    cpu = sum(after[:4]) - sum(before[:4])
    return Figures(wall, cpu, list(results.run.memory_mb.values()), results)


def growth(memory: list[float]) -> str:
    """Memory after a tenth of the logs, after a half, and at the end."""
    places = (len(memory) // 10, len(memory) // 2, len(memory) - 1)
    return " -> ".join(f"{max(memory[: k + 1]):.0f}" for k in places)


def main(logs: int = LOGS) -> bool:
    """Print the figures; whether all logs ran and one worker finds what two find."""
    with tempfile.TemporaryDirectory() as name:
        run(Path(name), logs=2, jobs=1, seconds=60)  # kernels and files are in their caches
        one = run(Path(name), logs=logs, jobs=1, seconds=60)
        two = run(Path(name), logs=logs, jobs=2, seconds=60)
    print(f"logs of 60 s at 100 Hz                    {logs}")
    print(f"one worker                               {one.wall / logs * 1e3:8.0f} ms for each log")
    print(f"efficiency of two, by the clock          {one.wall / (2.0 * two.wall):8.2f}")
    print(f"efficiency of two, by processor time     {one.cpu / two.cpu:8.2f}  (wanted: 0.85)")
    print(f"memory, one worker                       {growth(one.memory)} MB")
    print(f"memory, two workers                      {growth(two.memory)} MB")
    same = [r.metrics for r in one.results.results] == [r.metrics for r in two.results.results]
    ran = all(r.status == "ok" for r in (*one.results.results, *two.results.results))
    print("results agree" if same else "RESULTS DIFFER between one worker and two")
    return same and ran


def many(logs: int) -> bool:
    """That many one-minute drives on all cores; whether all ran."""
    with tempfile.TemporaryDirectory() as name:
        found = run(Path(name), logs=logs, jobs=None, seconds=60)
        size = (Path(name) / "out-None" / "results.json").stat().st_size
    seconds = np.array(list(found.results.run.seconds.values()))
    parent = os.times()[0] + os.times()[1]
    print(f"logs of 60 s at 100 Hz                    {logs}")
    print(f"by the clock                             {found.wall:8.1f} s")
    print(f"processor time for each log              {found.cpu / logs * 1e3:8.0f} ms")
    print(f"of it in the process that hands out      {parent / logs * 1e3:8.2f} ms")
    print(f"slowest log / median                     {seconds.max() / np.median(seconds):8.2f}")
    print(f"memory of a worker                       {growth(found.memory)} MB")
    print(f"results.json                             {size / logs:8.0f} bytes for each log")
    return all(r.status == "ok" for r in found.results.results)


if __name__ == "__main__":
    sys.exit(0 if (many(int(sys.argv[1])) if len(sys.argv) > 1 else main()) else 1)
