"""The yardsticks of `make bench` measure the same thing as the code they judge."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import bench_filter
import bench_kernel
import numpy as np
import pytest
from drives import trajectory_of

from vehnav.earth import geodetic_from_local_enu


def test_the_recursion_in_c_agrees_with_the_kernel(tmp_path: Path) -> None:
    """An independent twin of the strapdown loop: stops, coasting, uneven steps."""
    by_c = bench_kernel.compiled_c(tmp_path)
    if by_c is None:
        pytest.skip("no C compiler")
    data = bench_kernel.drive(60_000)
    assert data["stops"] == 3
    names = ("position", "velocity", "attitude", "velocity before the reset", "tilt")
    for name, a, b in zip(names, bench_kernel.by_numba(data), by_c(data), strict=True):
        assert np.abs(b).max() > 0.0, name
        assert np.abs(a - b).max() <= bench_kernel.ROUNDING * np.abs(b).max(), name


def test_the_filter_is_judged_by_the_way_and_by_its_sigmas() -> None:
    """30 m east and 40 m north after 5 km, sigmas of 15 and 10 m: 1 %, and the root of 4 + 16."""
    t = np.arange(0.0, 500.5)
    east = np.column_stack([10.0 * t, 0.0 * t, 0.0 * t])
    v = np.column_stack([10.0 + 0.0 * t, 0.0 * t, 0.0 * t])
    truth = trajectory_of(t, east, v, 0.0 * t + np.pi / 2.0)
    there = (truth.lat[-1], truth.lon[-1], truth.height[-1])
    end = np.stack(geodetic_from_local_enu(np.array([[30.0, 40.0, 0.0]]), origin=there), axis=1)
    outcome = SimpleNamespace(position=end, sigma_pos=np.array([[15.0, 10.0, 1.0]]))
    share, sigmas, way = bench_filter.off_at_the_end(outcome, truth)
    assert way == pytest.approx(5000.0)
    assert share == pytest.approx(0.01, rel=1e-5)  # plane and ellipsoid over 50 m
    assert sigmas == pytest.approx(np.sqrt(20.0), rel=1e-4)
