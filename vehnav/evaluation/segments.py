"""Relative errors over fixed lengths of road: the segments of the KITTI odometry benchmark."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

KITTI_LENGTHS: Final = (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)
SHORT_LENGTHS: Final = (5.0, 10.0, 20.0, 50.0)
"""m: taken as well when fewer than three of the benchmark's lengths fit into the drive."""
START_EVERY: Final = 1.0
"""s between the starts of segments: every tenth frame of 10 Hz in the benchmark."""


@dataclass(frozen=True)
class Segment:
    """Mean relative error over all segments of one length.

    Attributes
    ----------
    length_m : float
    percent : float
        Displacement error over the length, percent.
    deg_per_m : float or None
        Rotation error over the length; None where the reference has no attitude.
    count : int
        Number of segments.
    """

    length_m: float
    percent: float
    deg_per_m: float | None
    count: int

    def to_dict(self) -> dict[str, float | int | None]:
        """The fields by name."""
        return asdict(self)


def lengths_for(distance: float) -> tuple[float, ...]:
    """The segment lengths that fit into a drive of ``distance`` m."""
    fit = tuple(x for x in KITTI_LENGTHS if x < distance)
    if len(fit) < 3:
        fit = tuple(x for x in SHORT_LENGTHS if x < distance) + fit
    return fit


def segment_ends(t: Array, distance: Array, length: float) -> tuple[Index, Index]:
    """Indices (first, last) of the segments: from one start a second to the first fix beyond.

    As in the benchmark: the last frame is the first whose distance exceeds that of the first
    frame by more than ``length``; segments that the drive is too short for do not count.
    """
    first = np.unique(np.searchsorted(t, np.arange(t[0], t[-1], START_EVERY) - 1e-6))
    last = np.searchsorted(distance, distance[first] + length, side="right")
    keep = last < t.size
    return first[keep], last[keep]


def segment_errors(
    t: Array,
    distance: Array,
    position: Array,
    reference: Array,
    *,
    c_nb: Array | None = None,
    c_nb_reference: Array | None = None,
) -> tuple[Segment, ...]:
    """Segments of all lengths that fit.

    With both attitudes the benchmark's definition, in space: the error of the pose of the last
    frame in the axes of the first, E = (P1^-1 P2)^-1 (Q1^-1 Q2) with Q the reference; percent is
    its translation over the length, deg_per_m its angle. Without a reference attitude percent is
    the horizontal difference of the displacements in East-North axes: it then contains the
    heading error, too.

    Parameters
    ----------
    t, distance : (m,)
        s; m along the reference.
    position, reference : (m, 3)
        m, East-North-Up in one plane.
    c_nb, c_nb_reference : (m, 3, 3) or None
    """
    if t.size < 2:
        return ()
    out = []
    for length in lengths_for(float(distance[-1])):
        a, b = segment_ends(t, distance, length)
        if a.size == 0:
            continue
        d_est, d_ref = position[b] - position[a], reference[b] - reference[a]
        turn = None
        if c_nb is None or c_nb_reference is None:
            miss = np.hypot(*(d_est - d_ref)[:, :2].T)
        else:
            # the translation of E is turned by (P1^-1 P2)^-1, which keeps its length
            miss = np.linalg.norm(
                _turned(c_nb[a], d_est) - _turned(c_nb_reference[a], d_ref), axis=1
            )
            r_est = np.swapaxes(c_nb[a], 1, 2) @ c_nb[b]
            r_ref = np.swapaxes(c_nb_reference[a], 1, 2) @ c_nb_reference[b]
            turn = float(np.degrees(np.mean(angle_between(r_est, r_ref)))) / length
        out.append(Segment(length, 100.0 * float(np.mean(miss)) / length, turn, int(a.size)))
    return tuple(out)


def _turned(c_nb: Array, d_n: Array) -> Array:
    """C_nb^T d: displacements (k, 3) in body axes."""
    return np.asarray(np.einsum("kji,kj->ki", c_nb, d_n))


def angle_between(c_a: Array, c_b: Array) -> Array:
    """(k,) rad: angle of the rotation C_a^T C_b, without loss of digits near 0.

    The Frobenius distance of two rotations is 2 sqrt(2) sin(angle / 2).
    """
    chord = np.sqrt(np.sum((c_a - c_b) ** 2, axis=(-2, -1))) / np.sqrt(8.0)
    return np.asarray(2.0 * np.arcsin(np.minimum(chord, 1.0)))
