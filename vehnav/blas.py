"""How many threads the linear algebra under NumPy takes: one.

Its matrices are small here; with threads, half of the processor time of a run on two cores went
into their waiting for each other. Read once, when NumPy is loaded.
"""

from __future__ import annotations

import os
from typing import Final

ONE_THREAD: Final = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "VECLIB_MAXIMUM_THREADS": "1",
}
"""Environment of a process whose linear algebra stays on one core."""


def stay_on_one_thread() -> None:
    """For this process and its children, where the user says nothing else."""
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)
