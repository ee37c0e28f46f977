"""An error put on a navigation row, from Python: compiled once, kept on disk."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vehnav.aiding.blocks import take_off
from vehnav.earth import Ellipsoid
from vehnav.kernel import entry_kernel


@entry_kernel
def displace(row: npt.NDArray[np.float64], x: npt.NDArray[np.float64], earth: Ellipsoid) -> None:
    """Take the error states ``x`` (9,) off a navigation row (22,), in place."""
    take_off(row, x, earth)
