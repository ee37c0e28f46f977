"""The land filter and its smoother per IMU sample, against a dense NumPy filter at every sample.

The yardstick does what filters in plain NumPy do: F, Phi and the covariance of 15 states at the
rate of the IMU, without strapdown and without a single measurement. (pyins, which the project
compares itself with elsewhere, is not on the package index.)
"""

from __future__ import annotations

import resource
import time
from dataclasses import replace

import numpy as np

from vehnav.aiding.coarse import coarse_start
from vehnav.aiding.error_model import error_matrix, transition
from vehnav.aiding.fixes import Fixes
from vehnav.aiding.land import run_land, tuning_from_log
from vehnav.classic import Drive
from vehnav.config import Config
from vehnav.earth import WGS84, position_difference
from vehnav.pipeline import search_stops
from vehnav.simulate import simulate
from vehnav.units import NS

SECONDS, RATE = 600, 200.0
AGREES = 0.03
"""Of the distance: the filtered drive may be off by this much."""


def drive() -> tuple[Drive, Fixes, object]:
    """A simulated town drive at 200 Hz with fixes for its first two minutes."""
    made = simulate(f"city,duration={SECONDS},seed=3", sensor="mems-industrial", rate_hz=RATE)
    search = search_stops(made.log(), Config())
    s = search.samples
    fixes = Fixes(
        (made.gnss.t_ns - made.imu.t_ns[0]) * NS, made.gnss.lat, made.gnss.lon, made.gnss.height
    )
    return Drive(s.t, s.omega, s.f, s.increments, search.stops, WGS84), fixes.take(
        fixes.t < 120.0
    ), made.truth  # fmt: skip


def timed(call: object, repeat: int = 3) -> float:
    """Median seconds."""
    times = []
    for _ in range(repeat):
        begin = time.perf_counter()
        call()  # type: ignore[operator]
        times.append(time.perf_counter() - begin)
    return float(np.median(times))


def numpy_covariance(samples: int) -> None:
    """Error matrix, transition and covariance at every sample."""
    p, q = np.eye(15), 1e-8 * np.eye(15)
    c_we, c_wb, v = np.eye(3), np.eye(3), np.array([10.0, 5.0, 0.0])
    for _ in range(samples):
        phi = np.eye(15)
        phi[:9] = transition(error_matrix(c_we=c_we, height=0.0, v_w=v, c_wb=c_wb), 0.005)[:9]
        p = phi @ p @ phi.T + q


def main() -> bool:
    """Print the ratios; whether the solution is one."""
    work, fixes, truth = drive()
    start, tuning = coarse_start(work, fixes), tuning_from_log(work)
    n = work.t.size
    found = run_land(work, start, tuning, fixes=fixes, smooth=True)  # compiles
    forward = timed(lambda: run_land(work, start, tuning, fixes=fixes)) / n
    both = timed(lambda: run_land(work, start, tuning, fixes=fixes, smooth=True)) / n
    numpy_covariance(10)
    plain = timed(lambda: numpy_covariance(1000)) / 1000
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    hour = 3600.0 * RATE
    print(f"filter           {forward * 1e6:6.2f} us/sample, {plain / forward:5.0f} times faster")
    print(f"and smoother     {both * 1e6:6.2f} us/sample, {plain / both:5.0f} times faster")
    print(f"dense NumPy      {plain * 1e6:6.2f} us/sample, covariance alone")
    print(f"1 h at 200 Hz    {both * hour:6.1f} s; peak memory here {peak:.2f} GB for 10 minutes")
    p, t = found.outcome.position, work.t[found.outcome.first :]
    true = replace(truth)  # type: ignore[type-var]
    d = position_difference(p[-1, 0], p[-1, 1], true.lat[-1], true.lon[-1])
    return bool(np.hypot(*d) < AGREES * 10.0 * t[-1])
