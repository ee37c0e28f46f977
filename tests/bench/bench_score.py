"""A suite of short drives by one worker and by two: parallel efficiency, memory, same results.

The two take turns, so that a machine that is slow for a while slows both; each is judged by the
best of its turns, and how far its worst lies off says how quiet the machine was. The clock is fair
only where two workers had two cores. Processor time shows our own cost where others share them:
what the suite costs with one worker over what it costs with two. Wanted: an efficiency of at least
0.85, and memory of the workers flat. About five minutes.

``python tests/bench/bench_score.py LOGS ROUNDS`` takes other numbers than 200 and 2;
``python tests/bench/bench_score.py --many 1000`` runs that many one-minute drives on all cores.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

LOGS = 200
ROUNDS = 2
DRIVE = "city,duration=60,first_stop=15,last_stop=8,stop_every=20"
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
class Turn:
    """What a run of the suite took: s by the clock, s of processor, s until the first log is done;
    MB along the way.
    """

    wall: float
    cpu: float
    first: float
    memory: list[float]
    results: Any


def run(folder: Path, *, logs: int, jobs: int | None) -> Turn:
    """Run the suite; the memory is the largest of a worker so far, in the order of the logs."""
    from vehnav.batch.runner import run_suite, save
    from vehnav.batch.suite import load_suite

    folder.mkdir()
    path = folder / "suite.toml"
    path.write_text(SUITE.format(drive=DRIVE, logs=logs))
    done: list[float] = []
    before, clock = os.times(), time.perf_counter()
    results = run_suite(
        load_suite(path), folder / "out", jobs=jobs,
        advance=lambda _: done.append(time.perf_counter() - clock),
    )  # fmt: skip
    wall, after = time.perf_counter() - clock, os.times()
    save(results, folder / "out")
    cpu = sum(after[:4]) - sum(before[:4])
    return Turn(wall, cpu, done[0], list(results.run.memory_mb.values()), results)


def growth(memory: Sequence[float]) -> str:
    """Memory after a tenth of the logs, after a half, and at the end."""
    places = (len(memory) // 10, len(memory) // 2, len(memory) - 1)
    return " -> ".join(f"{max(memory[: k + 1]):.0f}" for k in places)


def row(what: str, times: Sequence[Sequence[float]], efficiency: float | None = None) -> str:
    """The best turn of one worker and of two, and how far the worst lies above it."""
    cells = [f"{min(x):8.2f} +{100.0 * (max(x) / min(x) - 1.0):3.0f} %" for x in times]
    last = "" if efficiency is None else f"{efficiency:12.2f}"
    return f"{what:30}{cells[0]:>20}{cells[1]:>20}{last}"


def main(logs: int = LOGS, rounds: int = ROUNDS) -> bool:
    """Print the figures; whether all logs ran and one worker finds what two find."""
    one: list[Turn] = []
    two: list[Turn] = []
    with tempfile.TemporaryDirectory() as name:
        run(Path(name, "first"), logs=2, jobs=1)  # kernels and files are in their caches
        for k in range(rounds):
            one.append(run(Path(name, f"one-{k}"), logs=logs, jobs=1))
            two.append(run(Path(name, f"two-{k}"), logs=logs, jobs=2))
    clock, processor, first = (
        [[getattr(turn, key) for turn in turns] for turns in (one, two)]
        for key in ("wall", "cpu", "first")
    )
    by_clock = min(clock[0]) / (2.0 * min(clock[1]))
    by_processor = min(processor[0]) / min(processor[1])
    print(f"{logs} logs of 60 s at 100 Hz, {rounds} turns each: the best, and the worst above it")
    print(f"{'':30}{'one worker':>20}{'two workers':>20}{'efficiency':>12}  (wanted: 0.85)")
    print(row("by the clock, s", clock, by_clock))
    print(row("by processor time, s", processor, by_processor))
    had = [max(turn.cpu / turn.wall for turn in turns) for turns in (one, two)]
    print(f"{'cores that it had':30}{had[0]:20.2f}{had[1]:20.2f}    others take the rest")
    print(row("until the first log is done, s", first))
    print(f"{'memory of a worker, MB':30}{growth(one[-1].memory):>20}{growth(two[-1].memory):>20}")
    turns = [*one, *two]
    figures = [[r.metrics for r in turn.results.results] for turn in turns]
    same = all(found == figures[0] for found in figures)
    print("results agree" if same else "RESULTS DIFFER between one worker and two")
    return same and all(r.status == "ok" for turn in turns for r in turn.results.results)


def many(logs: int) -> bool:
    """That many one-minute drives on all cores; whether all ran."""
    with tempfile.TemporaryDirectory() as name:
        found = run(Path(name, "many"), logs=logs, jobs=None)
        size = Path(name, "many", "out", "results.json").stat().st_size
    seconds = np.array(list(found.results.run.seconds.values()))
    parent = os.times()[0] + os.times()[1]
    print(f"logs of 60 s at 100 Hz                   {logs:8}")
    print(f"by the clock                             {found.wall:8.1f} s")
    print(f"processor time for each log              {found.cpu / logs * 1e3:8.0f} ms")
    print(f"of it in the process that hands out      {parent / logs * 1e3:8.2f} ms")
    print(f"slowest log / median                     {seconds.max() / np.median(seconds):8.2f}")
    print(f"memory of a worker                       {growth(found.memory)} MB")
    print(f"results.json                             {size / logs:8.0f} bytes for each log")
    return all(r.status == "ok" for r in found.results.results)


def command(arguments: Sequence[str]) -> bool:
    """``[LOGS [ROUNDS]]`` or ``--many LOGS``."""
    if arguments[:1] == ["--many"]:
        return many(int(arguments[1]))
    return main(*map(int, arguments))


if __name__ == "__main__":
    sys.exit(0 if command(sys.argv[1:]) else 1)
