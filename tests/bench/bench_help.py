"""``vehnav --help`` over bare Python: what a user waits before anything happens."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

LIMIT_S = 0.15
REPEATS = 15


def seconds(*args: str) -> float:
    start = time.perf_counter()
    subprocess.run([sys.executable, *args], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


def main() -> bool:
    """Print the medians; alternating, so that a busy machine slows both."""
    pairs = [(seconds("-c", "pass"), seconds("-m", "vehnav", "--help")) for _ in range(REPEATS)]
    bare = statistics.median(pair[0] for pair in pairs)
    extra = statistics.median(pair[1] - pair[0] for pair in pairs)
    print(f"bare python                       {bare:8.3f} s")
    print(f"vehnav --help, more than that     {extra:8.3f} s  (wanted: at most {LIMIT_S})")
    return True


if __name__ == "__main__":
    sys.exit(0 if main() else 1)
