"""Monte Carlo of the strapdown recursion on all cores, against the C recursion on one.

The recursion alone: the draws are made before, and every thread writes into its own arrays. Wanted:
at most 60 ns per sample and run on 2 cores where the C recursion takes 92 ns serially, a ratio of
0.65.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from bench_kernel import START, compiled_c, drive, outputs, seconds

RUNS = 8
SAMPLES = 180_000
"""Of each run: 15 minutes at 200 Hz."""


def noisy(data: dict[str, Any], seed: int) -> dict[str, Any]:
    """The drive with other errors of the sensors."""
    rng = np.random.default_rng(seed)
    dtheta = data["dtheta"] + 1e-6 * rng.normal(size=data["dtheta"].shape)
    dvel = data["dvel"] + 1e-4 * rng.normal(size=data["dvel"].shape)
    return {**data, "dtheta": dtheta, "dvel": dvel}


def cpu_seconds(run: Callable[[], Any]) -> float:
    """Processor time of all threads: on a busy machine the wall clock shows the others' work."""
    start = time.process_time()
    run()
    return time.process_time() - start


def main() -> bool:
    """Print the figures; whether runs on threads equal the same runs one after the other."""
    from vehnav.earth import WGS84
    from vehnav.parallel import cores
    from vehnav.strapdown.enu import integrate_enu

    runs = [noisy(drive(SAMPLES), seed) for seed in range(RUNS)]
    buffers = [outputs(SAMPLES, runs[0]["stops"]) for _ in runs]

    def one(k: int) -> None:
        data = runs[k]
        integrate_enu(
            data["t"], data["dtheta"], data["dvel"], data["coast"], data["gain"], data["stop_id"],
            True, *START, True, START[0][2], WGS84, *buffers[k],
        )  # fmt: skip

    one(0)
    serial_end = buffers[0][0][-1].copy()
    with ThreadPoolExecutor(cores()) as pool:

        def all_threads() -> None:
            list(pool.map(one, range(RUNS)))

        def serially() -> None:
            for k in range(RUNS):
                one(k)

        all_threads()
        with tempfile.TemporaryDirectory() as folder:
            by_c = compiled_c(Path(folder))
            figures = []
            for _ in range(7):
                c = seconds(lambda: by_c(runs[0])) if by_c else float("nan")
                figures.append(
                    (seconds(all_threads), seconds(serially), c, cpu_seconds(all_threads))
                )
    threads, serial, c, cpu = np.min(figures, axis=0) / SAMPLES * 1e9
    print(f"cores                                    {cores()}")
    print(f"threads                                  {threads / RUNS:8.1f} ns/sample and run")
    print(f"serially                                 {serial / RUNS:8.1f} ns/sample and run")
    print(f"serially / threads                       {serial / threads:8.2f}")
    if by_c is not None:
        print(f"C -O3, one core                          {c:8.1f} ns/sample")
        print(f"threads / C  (wanted: at most 0.65 on 2) {threads / RUNS / c:8.2f}")
        print(f"the same by processor time, cores idle   {cpu / RUNS / c / cores():8.2f}")
    same = bool(np.array_equal(buffers[0][0][-1], serial_end))
    print("runs agree" if same else "RUNS DIFFER between threads and one after the other")
    return same


if __name__ == "__main__":
    sys.exit(0 if main() else 1)
