"""``compare`` of 90 000 poses with GPS at 10 Hz, against evo's APE and RPE of the same arrays."""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from drives import Circle, trajectory_of

from vehnav.earth import local_enu
from vehnav.evaluation import compare
from vehnav.export.load import as_gnss
from vehnav.export.poses import C_B_FLU
from vehnav.logs.log import Gnss
from vehnav.trajectory import Trajectory

POSES = 90_000
RATE_HZ = 100
GPS_HZ = 10
ROUNDS = 5
BAR = 5.0
"""Times faster than evo, at least."""
AGREEMENT_M = 1e-6


def inputs() -> tuple[Trajectory, Gnss, np.ndarray]:
    """A drive that drifts, and the truth at 10 Hz with its attitude."""
    circle = Circle()
    t = np.arange(POSES) / RATE_HZ
    drift = np.column_stack([1e-3 * t**1.5, 5e-4 * t**1.6, 0.01 * np.sin(t)])
    truth = trajectory_of(t, circle.enu(t), circle.v(t), circle.heading(t))
    estimate = trajectory_of(t, circle.enu(t) + drift, circle.v(t), circle.heading(t) + 0.01)
    fixes = truth.rows(slice(0, None, RATE_HZ // GPS_HZ))
    return estimate, as_gnss(fixes), fixes.c_nb


def evo_input(states: Trajectory | Gnss, c_nb: np.ndarray, origin: Any) -> Any:
    """evo's own class, from positions in metres and quaternions."""
    from evo.core.trajectory import PoseTrajectory3D

    from vehnav.rotation import quaternion_from_c

    xyz = local_enu(states.lat, states.lon, states.height, origin=origin)
    return PoseTrajectory3D(xyz, quaternion_from_c(c_nb @ C_B_FLU), states.t_ns * 1e-9)


def evo_errors(reference: Any, estimate: Any) -> tuple[float, float]:
    """What ``evo_ape`` and ``evo_rpe`` do after reading: associate, then both metrics."""
    from evo.core import metrics, sync

    ref, est = sync.associate_trajectories(reference, estimate, max_diff=0.001)
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data((ref, est))
    rpe = metrics.RPE(metrics.PoseRelation.translation_part, 1, metrics.Unit.frames)
    rpe.process_data((ref, est))
    return float(ape.get_all_statistics()["rmse"]), float(rpe.get_all_statistics()["rmse"])


def median_time(work: Callable[[], Any]) -> float:
    times = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def main() -> bool:
    """Print the ratio and the agreement."""
    try:
        import evo.core.metrics  # noqa: F401
    except ImportError:
        print("  evo is not installed (pip install 'vehnav[test]'): nothing to compare with")
        return True
    estimate, gnss, c_ref = inputs()
    origin = (float(gnss.lat[0]), float(gnss.lon[0]), float(gnss.height[0]))
    reference_evo = evo_input(gnss, c_ref, origin)
    estimate_evo = evo_input(estimate, estimate.c_nb, origin)
    theirs = evo_errors(reference_evo, estimate_evo)
    poses = compare(estimate, gnss, c_nb_reference=c_ref).poses
    ours = (poses["ape"]["translation_part"]["rmse"], poses["rpe"]["translation_part"]["rmse"])
    t_evo = median_time(lambda: evo_errors(reference_evo, estimate_evo))
    t_own = median_time(lambda: compare(estimate, gnss, c_nb_reference=c_ref))
    ratio = t_evo / t_own
    print(f"  evo, APE and RPE                     {t_evo:8.3f} s   1.0")
    print(f"  vehnav, all metrics of a comparison  {t_own:8.3f} s   {ratio:.1f} times faster")
    apart = max(abs(a - b) for a, b in zip(ours, theirs, strict=True))
    print(f"  rmse of APE {ours[0]:.6f} m, of RPE {ours[1]:.6f} m; apart by {apart:.1e} m")
    good = apart < AGREEMENT_M
    fast = "ok" if good and ratio >= BAR else "MISSED"
    print(f"  {fast}: at least {BAR:.0f} times faster, within {AGREEMENT_M} m")
    return good


if __name__ == "__main__":
    sys.exit(0 if main() else 1)
