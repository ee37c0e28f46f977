"""How far off the track is expected to be, for a user without GPS.

Along each leg the errors that its two ends leave open (:mod:`vehnav.legs`); from leg to leg their
sum; and the heading error, which turns all that follows about where it arose: the covariance of
(east, north, heading) is carried over the legs with the displacement as the lever.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vehnav.legs import LegErrors

Array = npt.NDArray[np.float64]


class ExpectedErrors:
    """Accumulates sigmas leg by leg, forward from the start of the drive.

    Parameters
    ----------
    position_sigma : float
        m, of the start on each axis.
    heading_sigma : float
        rad, of the heading at the start.
    """

    def __init__(self, *, position_sigma: float, heading_sigma: float) -> None:
        self.covariance = np.diag([position_sigma**2, position_sigma**2, heading_sigma**2])

    def still(self, count: int) -> tuple[Array, Array]:
        """((count, 3) m, (count,) rad): sigmas while standing."""
        p = self.covariance
        row = np.sqrt([p[0, 0], p[1, 1], 0.0])
        return np.tile(row, (count, 1)), np.full(count, np.sqrt(p[2, 2]))

    def along(self, t: Array, displacement: Array, errors: LegErrors) -> tuple[Array, Array]:
        """((m, 3) m, (m,) rad): sigmas at the instants of a leg; the leg is added up after it.

        Parameters
        ----------
        t : (m,)
            s since the start of the leg.
        displacement : (m, 2)
            East, north from the start of the leg, m.
        errors : LegErrors
        """
        p = self.covariance
        own = np.stack([np.interp(t, errors.t, errors.variance[:, k]) for k in (5, 6, 2)], axis=1)
        east, north = displacement[:, 0], displacement[:, 1]
        # a heading error psi turns the displacement: dr = psi x d = psi (-north, east)
        variance_e = p[0, 0] - 2.0 * north * p[0, 2] + north**2 * p[2, 2] + own[:, 0]
        variance_n = p[1, 1] + 2.0 * east * p[1, 2] + east**2 * p[2, 2] + own[:, 1]
        sigma = np.sqrt(np.maximum(np.stack([variance_e, variance_n], axis=1), 0.0))
        heading = np.sqrt(p[2, 2] + own[:, 2])
        turn = np.array([[1.0, 0.0, -north[-1]], [0.0, 1.0, east[-1]], [0.0, 0.0, 1.0]])
        p = turn @ p @ turn.T
        p[:2, :2] += errors.end_covariance
        p[2, 2] += own[-1, 2]
        self.covariance = p
        return np.concatenate([sigma, np.zeros((t.size, 1))], axis=1), heading
