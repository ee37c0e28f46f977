"""``vehnav --help`` over bare Python: what a user waits before anything happens."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time

LIMIT_S = 0.15
REPEATS = 15


def clock() -> float:
    """Processor time of the finished children, which a busy machine does not stretch."""
    used = os.times()
    children = used.children_user + used.children_system
    return children if children else time.perf_counter()  # Windows does not tell


def seconds(*args: str) -> float:
    start = clock()
    subprocess.run([sys.executable, *args], check=True, stdout=subprocess.DEVNULL)
    return clock() - start


def main() -> bool:
    """Print the medians; alternating, so that what slows one slows the other."""
    seconds("-m", "vehnav", "--help")
    pairs = [(seconds("-c", "pass"), seconds("-m", "vehnav", "--help")) for _ in range(REPEATS)]
    bare = statistics.median(pair[0] for pair in pairs)
    extra = statistics.median(pair[1] - pair[0] for pair in pairs)
    print(f"bare python                       {bare:8.3f} s of processor time")
    print(f"vehnav --help, more than that     {extra:8.3f} s  (wanted: at most {LIMIT_S})")
    return True


if __name__ == "__main__":
    sys.exit(0 if main() else 1)
