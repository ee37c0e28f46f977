"""APE, RPE and alignment: the same numbers as evo (GPL; a judge here, never imported by vehnav)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vehnav.evaluation.align import fit
from vehnav.evaluation.ape import ape, evo_statistics, rpe

metrics = pytest.importorskip("evo.core.metrics")
trajectory = pytest.importorskip("evo.core.trajectory")

RELATIONS = (
    "translation_part",
    "rotation_part",
    "full_transformation",
    "rotation_angle_deg",
    "point_distance",
)
AGREEMENT = 1e-9


def random_poses(seed: int, n: int = 300) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    position = np.cumsum(rng.normal(0.5, 1.0, (n, 3)), axis=0)
    turn = Rotation.from_rotvec(np.cumsum(rng.normal(0.0, 0.05, (n, 3)), axis=0))
    return position, turn.as_matrix()


def evo_path(position: np.ndarray, c: np.ndarray):
    poses = np.tile(np.eye(4), (position.shape[0], 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = c, position
    return trajectory.PosePath3D(poses_se3=list(poses))


@pytest.fixture(scope="module")
def both() -> dict[str, np.ndarray]:
    """A reference and an estimate that drifts metres and degrees from it."""
    reference, c_ref = random_poses(1)
    rng = np.random.default_rng(2)
    position = reference + np.cumsum(rng.normal(0.0, 0.1, reference.shape), axis=0)
    c = c_ref @ Rotation.from_rotvec(rng.normal(0.0, 0.1, reference.shape)).as_matrix()
    return {"position": position, "reference": reference, "c_nb": c, "c_nb_reference": c_ref}


def paths(both):
    return (
        evo_path(both["reference"], both["c_nb_reference"]),
        evo_path(both["position"], both["c_nb"]),
    )


@pytest.mark.parametrize("relation", RELATIONS)
def test_ape(both, relation: str) -> None:
    theirs = metrics.APE(metrics.PoseRelation[relation])
    theirs.process_data(paths(both))
    ours = ape(**both, relation=relation)
    assert ours == pytest.approx(theirs.error, abs=AGREEMENT)
    assert evo_statistics(ours) == pytest.approx(
        theirs.get_all_statistics(), rel=AGREEMENT, abs=AGREEMENT
    )


@pytest.mark.parametrize("relation", RELATIONS)
@pytest.mark.parametrize(
    "which",
    [
        {"delta": 1, "unit": "frames"},
        {"delta": 10, "unit": "frames"},
        {"delta": 10, "unit": "frames", "all_pairs": True},
        {"delta": 25.0, "unit": "meters"},
        {"delta": 25.0, "unit": "meters", "pairs_from_reference": True},
    ],
    ids=str,
)
def test_rpe(both, relation: str, which: dict[str, object]) -> None:
    options = {key: value for key, value in which.items() if key not in ("delta", "unit")}
    unit = metrics.Unit[which["unit"]]
    theirs = metrics.RPE(metrics.PoseRelation[relation], which["delta"], unit, **options)
    theirs.process_data(paths(both))
    ours = rpe(**both, relation=relation, **which)
    assert ours == pytest.approx(theirs.error, abs=AGREEMENT)
    assert evo_statistics(ours) == pytest.approx(
        theirs.get_all_statistics(), rel=AGREEMENT, abs=AGREEMENT
    )


def test_full_alignment_is_umeyama(both) -> None:
    geometry = pytest.importorskip("evo.core.geometry")
    r, t, _ = geometry.umeyama_alignment(both["position"].T, both["reference"].T)
    c, d = fit(both["position"], both["reference"], "full")
    assert c == pytest.approx(r, abs=AGREEMENT)
    assert d == pytest.approx(t, abs=AGREEMENT * 1e2)  # of hundreds of metres


def test_alignment_by_scipy_and_by_search() -> None:
    """``yaw`` and ``yaw+translation``: no angle nearby is better."""
    rng = np.random.default_rng(3)
    position = np.cumsum(rng.normal(0.0, 1.0, (50, 3)), axis=0)
    turn = Rotation.from_euler("z", 25.0, degrees=True)
    moved = turn.apply(position) + np.array([5.0, -7.0, 2.0])
    c, d = fit(position, moved, "yaw+translation")
    assert c == pytest.approx(turn.as_matrix(), abs=1e-12)
    assert d == pytest.approx([5.0, -7.0, 2.0], abs=1e-12)
    noisy = moved + rng.normal(0.0, 1.0, moved.shape)
    c, d = fit(position, noisy, "yaw")
    assert c @ position[0] + d == pytest.approx(position[0])  # the start stays

    def cost(angle: float) -> float:
        r = Rotation.from_euler("z", angle).as_matrix()
        return float(np.sum((((position - position[0]) @ r.T + position[0]) - noisy)[:, :2] ** 2))

    best = np.arctan2(c[1, 0], c[0, 0])
    assert cost(best) < min(cost(best - 1e-4), cost(best + 1e-4))


def test_what_needs_attitude_says_so(both) -> None:
    with pytest.raises(ValueError, match="attitudes"):
        ape(both["position"], both["reference"], relation="rotation_angle_deg")
    with pytest.raises(ValueError, match="attitudes"):
        rpe(both["position"], both["reference"])
    with pytest.raises(ValueError, match="no pair"):
        rpe(**both, delta=1e6, unit="meters")
    line = np.outer(np.arange(5.0), [1.0, 2.0, 0.0])
    with pytest.raises(ValueError, match="on a line"):
        fit(line, line, "full")
