"""Fixed-interval smoother over the epochs of the filter, correct with closed-loop feedback.

The adjoint form of Bryson and Frazier: backward in time a vector lambda and a matrix Lambda gather
what later measurements say; the smoothed error of the state that the filter held is
``-P lambda``, its covariance ``P - P Lambda P``, never larger than the filter's. No matrix is
inverted. Feedback only moves the point about which the errors are counted, so it needs no term:
each epoch's smoothed error refers to the state after that epoch's own feedback.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vehnav.aiding.blocks import blend_corrections, take_off_parameters
from vehnav.aiding.error_model import NAVIGATION
from vehnav.aiding.filter import Aids, Filtered
from vehnav.aiding.kalman import adjoint_propagate, adjoint_update
from vehnav.aiding.vehicle import SIZE
from vehnav.earth import Ellipsoid
from vehnav.kernel import entry_kernel
from vehnav.strapdown.increments import Increments

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Smoothed:
    """The solution that uses all measurements; as :class:`vehnav.aiding.filter.Filtered`.

    Attributes
    ----------
    rows : (n, 22)
    parameters : (m, 15)
    covariance : (m, 9, 9)
        Of position, velocity and attitude.
    parameter_sigmas : (15,)
        At the last epoch.
    errors : (m, 24)
        Smoothed error of the filter's states, as taken off.
    """

    rows: Array
    parameters: Array
    covariance: Array
    parameter_sigmas: Array
    errors: Array


@entry_kernel
def run_back(
    covariance: Array,
    phi: Array,
    rows: Array,
    gains: Array,
    numbers: Array,
    until: IntArray,
    errors: Array,
    smoothed: Array,
) -> None:
    """The loop back over the epochs: errors (m, n), smoothed covariance (m, 9, 9) of the first."""
    n, few = covariance.shape[1], smoothed.shape[1]
    lam, big = np.zeros(n), np.zeros((n, n))
    work, vector = np.zeros((n, n)), np.zeros(n)
    for e in range(covariance.shape[0] - 1, -1, -1):
        p = covariance[e]
        for a in range(n):
            total = 0.0
            for b in range(n):
                total -= p[a, b] * lam[b]
            errors[e, a] = total
        for a in range(few):  # work = P Lambda
            for b in range(n):
                total = 0.0
                for c in range(n):
                    total += p[a, c] * big[c, b]
                work[a, b] = total
        for a in range(few):
            for b in range(a + 1):
                total = p[a, b]
                for c in range(n):
                    total -= work[a, c] * p[c, b]
                smoothed[e, a, b] = total
                smoothed[e, b, a] = total
        first = until[e - 1] if e > 0 else 0
        for k in range(until[e] - 1, first - 1, -1):
            adjoint_update(lam, big, rows[k], gains[k], numbers[k, 0], numbers[k, 1], vector)
        if e > 0:
            adjoint_propagate(lam, big, phi[e], work)


def smoothed_errors(forward: Filtered) -> tuple[Array, Array]:
    """Run back: errors (m, 24) of the filter's states, covariance (m, 9, 9) of what remains."""
    m = forward.until.size
    errors, covariance = np.zeros((m, SIZE)), np.zeros((m, NAVIGATION, NAVIGATION))
    run_back(
        forward.covariance, forward.phi, *forward.measurements, forward.until,
        errors, covariance,
    )  # fmt: skip
    return errors, covariance


def take_errors_off(
    increments: Increments,
    aids: Aids,
    forward: Filtered,
    errors: Array,
    covariance: Array,
    *,
    earth: Ellipsoid,
) -> Smoothed:
    """The solution without the errors that :func:`smoothed_errors` found.

    ``forward`` may have been relieved of its covariances (:meth:`Filtered.light`).
    """
    rows, parameters = forward.rows.copy(), forward.parameters.copy()
    after = np.ascontiguousarray(errors[:, :NAVIGATION])
    blend_corrections(
        np.require(increments.t, np.float64, ["C", "W"]), aids.epochs, rows, after,
        after + forward.fed_back, earth,
    )  # fmt: skip
    for par, x in zip(parameters, errors, strict=True):
        take_off_parameters(par, x)
    return Smoothed(rows, parameters, covariance, forward.parameter_sigmas, errors)
