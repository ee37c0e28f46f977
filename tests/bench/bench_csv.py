"""Reading 720 000 rows of CSV (1 h at 200 Hz) over the pandas C parser alone, by processor time."""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

ROWS = 720_000
LIMIT = 1.5
REPEATS = 5
NAMES = "gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"


def write(path: Path, time_name: str, form: str, t: list[object]) -> None:
    """One table with int stamps or decimals, and six columns of nine digits."""
    rng = np.random.default_rng(1)
    values = (rng.normal(size=(ROWS, 6)) + [0, 0, 0, 0, 0, 9.8]).tolist()
    with path.open("w") as stream:
        stream.write(f"{time_name},{NAMES}\n")
        row = form + ",%.9g" * 6 + "\n"
        stream.writelines(row % (stamp, *six) for stamp, six in zip(t, values, strict=True))


def seconds(work: Callable[[], object]) -> float:
    """Processor time of a call, which a busy machine does not stretch as it does wall time."""
    start = time.process_time()
    work()
    return time.process_time() - start


def main() -> bool:
    """Print the ratios; processor time, and the two alternate.

    Returns whether both read the same numbers.
    """
    import pandas as pd

    from vehnav.logs.read import read_log

    t0, step = 1_700_000_000_000_000_000, 5_000_000
    kinds: dict[str, tuple[str, str, list[object]]] = {
        "t_ns, integers": ("t_ns", "%d", [t0 + k * step for k in range(ROWS)]),
        "time_s, 9 decimals": (
            "time_s",
            "%s",
            [f"{1_700_000_000 + k // 200}.{k % 200 * step:09d}" for k in range(ROWS)],
        ),
    }
    print(f"{'720 000 rows':24}{'pandas C':>12}{'read_log':>12}{'ratio':>8}  (wanted: {LIMIT})")
    good = True
    with tempfile.TemporaryDirectory() as folder:
        for title, (name, form, stamps) in kinds.items():
            path = Path(folder) / "log.csv"
            write(path, name, form, stamps)
            frame, imu = pd.read_csv(path), read_log(str(path)).imu
            assert imu is not None
            columns = np.column_stack([*imu.gyro.T, *imu.accel.T])
            good &= np.array_equal(columns, frame[NAMES.split(",")].to_numpy())
            pairs = [
                (seconds(lambda p=path: pd.read_csv(p)), seconds(lambda p=path: read_log(str(p))))
                for _ in range(REPEATS)
            ]
            alone, ours = (statistics.median(pair[k] for pair in pairs) for k in (0, 1))
            ratio = statistics.median(pair[1] / pair[0] for pair in pairs)
            print(f"{title:24}{alone:10.2f} s{ours:10.2f} s{ratio:8.2f}")
    return good


if __name__ == "__main__":
    sys.exit(0 if main() else 1)
