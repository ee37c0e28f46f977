"""What goes into every mechanization besides increments, and what comes out of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class StopControl:
    """What to do at each instant and step because of stops.

    Attributes
    ----------
    stop_id : (n,) int64
        Number of the stop that an instant lies in, -1 while moving.
    gain : (n-1,)
        Levelling gain over each step, 1/s; 0 where off.
    reset : bool
        Whether V := 0 at the instants of a stop.
    count : int
        Number of stops.
    """

    stop_id: IntArray
    gain: Array
    reset: bool
    count: int

    @classmethod
    def none(cls, n: int) -> StopControl:
        """No stops, for n instants."""
        return cls(np.full(n, -1, dtype=np.int64), np.zeros(n - 1), reset=False, count=0)

    def part(self, first: int, last: int) -> StopControl:
        """For the instants ``first`` to ``last``, both included; stops keep their numbers."""
        return StopControl(
            self.stop_id[first : last + 1], self.gain[first:last], self.reset, self.count
        )

    def reversed(self) -> StopControl:
        """For increments run backward."""
        return StopControl(
            self.stop_id[::-1].copy(), self.gain[::-1].copy(), self.reset, self.count
        )


@dataclass(frozen=True)
class Solution:
    """What the mechanization returns, at the n instants of the increments.

    Attributes
    ----------
    position : (n, 3)
        lat rad, lon rad, h m.
    v_n : (n, 3)
        East, north, up, m/s.
    c_nb : (n, 3, 3)
    v_before_reset : (stops, 3)
        Velocity found on the first instant of each stop, before the reset, m/s.
    tilt_correction : (stops, 2)
        Rotation about east and north that levelling applied in each stop, rad.
    """

    position: Array
    v_n: Array
    c_nb: Array
    v_before_reset: Array
    tilt_correction: Array
