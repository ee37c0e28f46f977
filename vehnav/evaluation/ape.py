"""Absolute and relative pose errors (APE, RPE) under the names that evo made common.

APE (Sturm et al. 2012, eq. 2 and its form per pose): E_k = Q_k^-1 P_k; RPE: E_k = (Q_a^-1 Q_b)^-1
(P_a^-1 P_b) over pairs (a, b) of poses; P the estimate, Q the reference. Without attitudes the
distances between points are all that can be judged.
"""

from __future__ import annotations

from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from vehnav.evaluation.segments import angle_between

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]
Relation = Literal[
    "translation_part",
    "rotation_part",
    "full_transformation",
    "rotation_angle_deg",
    "point_distance",
]
Unit = Literal["frames", "meters"]

NEEDS_ATTITUDE: Final = frozenset({"rotation_part", "full_transformation", "rotation_angle_deg"})


def evo_statistics(error: Array) -> dict[str, float]:
    """``rmse mean median std min max sse`` of a series, as evo names them."""
    return {
        "rmse": float(np.sqrt(np.mean(error * error))),
        "mean": float(np.mean(error)),
        "median": float(np.median(error)),
        "std": float(np.std(error)),
        "min": float(np.min(error)),
        "max": float(np.max(error)),
        "sse": float(np.sum(error * error)),
    }


def ape(
    position: Array,
    reference: Array,
    *,
    c_nb: Array | None = None,
    c_nb_reference: Array | None = None,
    relation: Relation = "translation_part",
) -> Array:
    """(n,) absolute error of every pose.

    Parameters
    ----------
    position, reference : (n, 3)
        m, in one frame.
    c_nb, c_nb_reference : (n, 3, 3) or None
        Attitudes; for the relations that judge them.
    relation : str
        ``translation_part`` and ``point_distance`` m, ``rotation_angle_deg`` deg,
        ``rotation_part`` and ``full_transformation`` without unit.

    Raises
    ------
    ValueError
        The relation needs attitudes.
    """
    distance = np.linalg.norm(position - reference, axis=1)
    if relation in ("translation_part", "point_distance"):
        return np.asarray(distance)
    if c_nb is None or c_nb_reference is None:
        raise ValueError(f"{relation} needs the attitudes of both sides")
    return _relation(distance, c_nb, c_nb_reference, relation)


def _relation(distance: Array, r_est: Array, r_ref: Array, relation: Relation) -> Array:
    """The norm asked for, from the translation's length and the two rotations of E."""
    if relation == "rotation_angle_deg":
        return np.asarray(np.degrees(angle_between(r_est, r_ref)))
    # |R_ref^T R_est - I| is |R_est - R_ref|, for a rotation keeps the Frobenius norm
    turn2 = np.sum((r_est - r_ref) ** 2, axis=(1, 2))
    if relation == "rotation_part":
        return np.asarray(np.sqrt(turn2))
    return np.asarray(np.sqrt(turn2 + distance**2))


def pairs(track: Array, delta: float, *, unit: Unit, all_pairs: bool = False) -> Index:
    """(k, 2) indices of the poses that are compared.

    ``frames``: every ``delta`` poses, one pair after the other, or from every pose (``all_pairs``).
    ``meters``: one pair after the other, each as soon as the path of ``track`` (n, 3)
    between its ends has reached ``delta``.
    """
    n = track.shape[0]
    if unit == "frames":
        step = int(delta)
        first = np.arange(n - step) if all_pairs else np.arange(0, n - step, step)
        return np.column_stack([first, first + step])
    if all_pairs:
        raise ValueError("all_pairs is for frames")
    step_length = np.linalg.norm(np.diff(track, axis=0), axis=1)
    ends, path = [0], 0.0
    for k, length in enumerate(step_length.tolist(), start=1):
        path += length
        if path >= delta:
            ends.append(k)
            path = 0.0
    return np.column_stack([ends[:-1], ends[1:]]).astype(np.intp)


def rpe(
    position: Array,
    reference: Array,
    *,
    c_nb: Array | None = None,
    c_nb_reference: Array | None = None,
    relation: Relation = "translation_part",
    delta: float = 1.0,
    unit: Unit = "frames",
    all_pairs: bool = False,
    pairs_from_reference: bool = False,
) -> Array:
    """(k,) relative error over every pair of poses; arguments as in :func:`ape` and :func:`pairs`.

    The path that makes pairs in metres is the estimate's, as in evo, or the reference's.
    ``point_distance`` compares the straight distances between the two points of a pair.
    ValueError for a relation that needs attitudes (all but ``point_distance``), or no pair.
    """
    track = reference if pairs_from_reference else position
    a, b = pairs(track, delta, unit=unit, all_pairs=all_pairs).T
    if a.size == 0:
        raise ValueError(f"no pair of poses is {delta:g} {unit} apart")
    d_est, d_ref = position[b] - position[a], reference[b] - reference[a]
    if relation == "point_distance":
        off = np.linalg.norm(d_est, axis=1) - np.linalg.norm(d_ref, axis=1)
        return np.asarray(np.abs(off))
    if c_nb is None or c_nb_reference is None:
        raise ValueError(f"{relation} needs the attitudes of both sides")
    # (Q_a^-1 Q_b)^-1 (P_a^-1 P_b): the rotation in front keeps the length of the translation
    moved = np.einsum("kji,kj->ki", c_nb[a], d_est) - np.einsum(
        "kji,kj->ki", c_nb_reference[a], d_ref
    )
    distance = np.linalg.norm(moved, axis=1)
    if relation == "translation_part":
        return np.asarray(distance)
    r_est = np.swapaxes(c_nb[a], 1, 2) @ c_nb[b]
    r_ref = np.swapaxes(c_nb_reference[a], 1, 2) @ c_nb_reference[b]
    return _relation(distance, r_est, r_ref, relation)
