"""The whole of ``vehnav run`` on an hour at 200 Hz (720 000 samples), split into its steps."""

from __future__ import annotations

import contextlib
import functools
import io
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

SCENARIO = "city,duration=3600"
RATE_HZ = 200.0

STEPS = {
    "read": ["vehnav.logs.read:read_log"],
    "prepare": ["vehnav.prepare:prepare_samples"],
    "stops": ["vehnav.stops:stop_statistics", "vehnav.stops:stops_from_statistics"],
    "integrate": ["vehnav.classic:mechanize"],
    "correct": ["vehnav.offline:run_stops"],
    "errors": ["vehnav.evaluation:compare"],
    "write": [
        "vehnav.export.formats:write_trajectory",
        "vehnav.report.document:write_document",
        "vehnav.report.html:write_html",
    ],
}
"""Step -> functions whose time it is, without that of other steps inside them."""


class Stopwatch:
    """Adds up the time inside functions, wherever they have been imported to."""

    def __init__(self) -> None:
        self.seconds = dict.fromkeys(STEPS, 0.0)
        self.calls = dict.fromkeys(STEPS, 0)
        self.stack: list[str] = []
        self.since = 0.0

    def turn(self) -> None:
        """Book the time since the last turn on the step that is running."""
        now = time.perf_counter()
        if self.stack:
            self.seconds[self.stack[-1]] += now - self.since
        self.since = now

    def timed(self, step: str, func: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(func)
        def wrapper(*args: Any, **kwargs: Any) -> Any:
            self.turn()
            self.stack.append(step)
            try:
                return func(*args, **kwargs)
            finally:
                self.turn()
                self.stack.pop()
                self.calls[step] += 1

        return wrapper

    @contextlib.contextmanager
    def running(self) -> Iterator[None]:
        """Put the timed functions in the place of the plain ones."""
        replaced = []
        for step, targets in STEPS.items():
            for target in targets:
                module, _, name = target.partition(":")
                plain = getattr(__import__(module, fromlist=[name]), name)
                replaced.append((plain, self.timed(step, plain)))
        modules = [m for name, m in sys.modules.items() if name.startswith("vehnav")]
        places = [
            (module, name, plain, timed)
            for module in modules
            for name, value in list(vars(module).items())
            for plain, timed in replaced
            if value is plain
        ]
        for module, name, _, timed in places:
            setattr(module, name, timed)
        try:
            yield
        finally:
            for module, name, plain, _ in places:
                setattr(module, name, plain)


def make_log(folder: Path) -> Path:
    from vehnav.simulate import simulate, write_log

    path = folder / "hour.mcap"
    made = simulate(SCENARIO, sensor="mems-industrial", seed=1, rate_hz=RATE_HZ)
    write_log(made, path, truth_every=200)
    return path


def call(path: Path, folder: Path) -> float:
    """Seconds of one ``vehnav run`` in this process."""
    import vehnav.cli.run  # so that the stopwatch finds what it has imported
    import vehnav.pipeline  # noqa: F401
    from vehnav.cli.main import cli

    start = time.perf_counter()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        cli.main(["run", str(path), "--out-dir", str(folder), "--quiet"], standalone_mode=False)
    return time.perf_counter() - start


def main() -> bool:
    """Print the split of a run in this process, and the wall time of the command."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = make_log(folder)
        size = path.stat().st_size / 1e6
        print(f"log: {SCENARIO} at {RATE_HZ:g} Hz, {size:.0f} MB")
        call(path, folder / "warm")
        watch = Stopwatch()
        with watch.running():
            whole = call(path, folder / "timed")
        rest = whole - sum(watch.seconds.values())
        for step, seconds in {**watch.seconds, "the rest": rest}.items():
            times = f"{watch.calls[step]:3d} calls" if step in watch.calls else ""
            print(f"{step:10s}{seconds:8.2f} s{100 * seconds / whole:7.0f} %  {times}")
        print(f"{'in all':10s}{whole:8.2f} s    {3600 / whole:.0f} times faster than the drive")
        start = time.perf_counter()
        command = [sys.executable, "-m", "vehnav", "run", str(path), "--quiet", "--out-dir"]
        subprocess.run([*command, str(folder / "command")], check=True, stderr=subprocess.DEVNULL)
        print(
            f"as a command of its own, kernels compiled before: {time.perf_counter() - start:.2f} s"
        )
        csv = (folder / "timed" / "trajectory.csv").stat().st_size
        print(f"written: trajectory.csv of {csv / 1e6:.0f} MB; {os.cpu_count()} cores")
    return all(watch.calls.values())


if __name__ == "__main__":
    sys.exit(0 if main() else 1)
