"""The strapdown recursion against the same recursion in C -O3, and against plain Python."""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
SAMPLES = 720_000
"""One hour at 200 Hz."""
ROUNDING = 1e-9
"""Two compilers may round differently (fused multiply-add); carried through an hour."""


def drive(n: int) -> dict[str, Any]:
    """Increments of a car that turns, shakes and stands for a tenth of the time."""
    rng = np.random.default_rng(0)
    dt = 0.005
    t = np.arange(n) * dt + rng.uniform(-1e-4, 1e-4, n)
    step = np.diff(t)
    rate = 0.02 * rng.normal(size=(n - 1, 3))
    rate[:, 2] += 0.1 * np.sin(0.1 * t[1:])
    force = 0.3 * rng.normal(size=(n - 1, 3)) + [0.0, 0.0, 9.8]
    force[:, 1] += 0.5 * np.sin(0.3 * t[1:])
    block = (np.arange(n) // 2000).astype(np.int64)
    stop_id = np.where(block % 10 == 9, block // 10, -1)
    coast = np.zeros(n - 1, dtype=bool)
    coast[5000::50_000] = True
    return {
        "t": t,
        "dtheta": rate * step[:, None],
        "dvel": force * step[:, None],
        "coast": coast,
        "gain": np.where(stop_id[1:] >= 0, 1.0, 0.0),
        "stop_id": stop_id,
        "stops": int(stop_id.max()) + 1,
    }


START = (0.82, 0.14, 450.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


def outputs(n: int, stops: int) -> list[np.ndarray]:
    """Empty arrays: position, velocity, attitude, velocity before the reset, tilt."""
    return [np.zeros(shape) for shape in ((n, 3), (n, 3), (n, 9), (stops, 3), (stops, 2))]


def by_numba(data: dict[str, Any]) -> list[np.ndarray]:
    from vehnav.earth import WGS84
    from vehnav.strapdown.enu import integrate_enu

    out = outputs(data["t"].size, data["stops"])
    integrate_enu(
        data["t"], data["dtheta"], data["dvel"], data["coast"], data["gain"], data["stop_id"],
        True, *START, True, START[0][2], WGS84, *out,
    )  # fmt: skip
    return out


def compiled_c(folder: Path) -> Callable[[dict[str, Any]], list[np.ndarray]] | None:
    """The recursion in C, or None without a C compiler."""
    compiler = next(filter(None, map(shutil.which, ("gcc", "cc", "clang"))), None)
    if compiler is None:
        return None
    library = folder / "enu_recursion.so"
    source = str(HERE / "enu_recursion.c")
    command = [compiler, "-O3", "-shared", "-fPIC", source, "-o", str(library), "-lm"]
    subprocess.run(command, check=True)
    integrate = ctypes.CDLL(str(library)).integrate
    integrate.restype = None

    from vehnav.earth import WGS84

    earth = np.array(WGS84)
    start = np.array([x for part in START for x in part])

    def pointer(array: np.ndarray) -> ctypes.c_void_p:
        return ctypes.c_void_p(array.ctypes.data)

    def by_c(data: dict[str, Any]) -> list[np.ndarray]:
        out = outputs(data["t"].size, data["stops"])
        names = ("t", "dtheta", "dvel", "coast", "gain", "stop_id")
        integrate(
            ctypes.c_int64(data["t"].size), *(pointer(data[name]) for name in names),
            ctypes.c_int64(1), pointer(start), ctypes.c_int64(1), ctypes.c_double(START[0][2]),
            pointer(earth), *(pointer(array) for array in out),
        )  # fmt: skip
        return out

    return by_c


def seconds(run: Callable[[], Any]) -> float:
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def plain_seconds(n: int) -> float:
    """Of the same source run as plain Python, in its own process."""
    code = (
        "import sys, json; sys.path.insert(0, sys.argv[1])\n"
        "import bench_kernel as b\n"
        f"data = b.drive({n}); print(json.dumps(b.seconds(lambda: b.by_numba(data))))"
    )
    env = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    found = subprocess.run(
        [sys.executable, "-c", code, str(HERE)], env=env, capture_output=True, text=True, check=True
    )
    return float(json.loads(found.stdout))


def main() -> bool:
    """Print the figures; whether the outputs agree."""
    data = drive(SAMPLES)
    first = seconds(lambda: by_numba(drive(10)))
    print(f"first call (compile or load)      {first:8.2f} s")
    with tempfile.TemporaryDirectory() as folder:
        by_c = compiled_c(Path(folder))
        pairs = []
        for _ in range(7):
            pairs.append(
                (seconds(lambda: by_numba(data)), seconds(lambda: by_c(data)) if by_c else None)
            )
        numba = min(pair[0] for pair in pairs)
        print(f"numba                             {1e9 * numba / SAMPLES:8.1f} ns/sample")
        plain = plain_seconds(20_000) / 20_000
        print(f"plain Python, times numba         {plain * SAMPLES / numba:8.0f}")
        if by_c is None:
            print("C: no compiler found")
            return True
        c = min(pair[1] for pair in pairs if pair[1] is not None)
        print(f"C -O3                             {1e9 * c / SAMPLES:8.1f} ns/sample")
        print(f"numba / C  (wanted: at most 1.3)  {numba / c:8.2f}")
        return agreement(by_numba(data), by_c(data))


def agreement(numba: list[np.ndarray], c: list[np.ndarray]) -> bool:
    """Print the largest difference of the two, relative to the size of each output."""
    names = ("position", "velocity", "attitude", "velocity before reset", "tilt")
    worst = 0.0
    for name, a, b in zip(names, numba, c, strict=True):
        off = float(np.abs(a - b).max() / np.abs(b).max())
        worst = max(worst, off)
        print(f"largest difference, {name:22s}{off:8.0e}  of its size")
    good = worst < ROUNDING
    print("outputs agree" if good else "OUTPUTS DIFFER: one of the two recursions has changed")
    return good


if __name__ == "__main__":
    sys.exit(0 if main() else 1)
