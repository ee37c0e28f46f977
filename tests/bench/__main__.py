"""``make bench``: speed, printed as ratios within one run; times are never asserted.

``python tests/bench`` runs all, ``python tests/bench kernel`` one.
"""

from __future__ import annotations

import importlib
import platform
import sys
from pathlib import Path

BENCHES = sorted(
    path.stem.removeprefix("bench_") for path in Path(__file__).parent.glob("bench_*.py")
)
"""Every ``bench_NAME.py`` here; its ``main`` prints, and returns whether the results agree."""


def main() -> int:
    """Run the benches that are named, or all; 1 if any disagreed with its yardstick."""
    print(f"python {platform.python_version()}, {platform.machine()} {platform.system()}")
    good = True
    for name in sys.argv[1:] or BENCHES:
        bench = importlib.import_module(f"bench_{name}")
        print(f"\n{name}: {(bench.__doc__ or '').splitlines()[0]}")
        good = bench.main() and good
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
