"""Fixes of a receiver as the filter takes them: seconds, radians, metres, plain arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.aiding.gnss_forms import FORMS, Form
from vehnav.earth import Ellipsoid, c_en, ecef_from_geodetic, local_enu

Array = npt.NDArray[np.float64]

DEFAULT_SIGMA: Final = 1.0
"""m per horizontal axis at 1 Hz of a receiver that logs none. What is slower in its error than a
minute or two is common to start and judge and does not count."""
HEIGHT_SIGMA: Final = 10.0
"""m at 1 Hz of the height of such a receiver: some 5 m that last for a minute. Believed more, a
height that wanders by 10 m in a minute becomes a climb of the vehicle in its own axes, for good."""
LEAST_SIGMA: Final = 0.01
"""m: stamps and swaying leave this even with a phase solution."""
DEFAULT_VELOCITY_SIGMA: Final = 0.2
"""m/s, where velocities are logged without one."""
SPEED_SPAN: Final = 3.0
"""s: positions this far apart give the speed where none is logged (spec C 1)."""


@dataclass(frozen=True)
class Fixes:
    """Fixes on the clock of the drive.

    Attributes
    ----------
    t : (k,)
        s
    lat, lon, height : (k,)
    v_n : (k, 3) or None
    sigma_pos, sigma_vel : (k, 3) or None
        East, north, up.
    form : {"direct", "normal", "quasi"}
        How the filter compares them with its state (:mod:`vehnav.aiding.gnss_forms`).
    arm : (right, forward, up)
        m from the IMU to the antenna, body axes.
    """

    t: Array
    lat: Array
    lon: Array
    height: Array
    v_n: Array | None = None
    sigma_pos: Array | None = None
    sigma_vel: Array | None = None
    form: Form = "direct"
    arm: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def take(self, index: npt.NDArray[np.bool_]) -> Fixes:
        """Some of the fixes."""

        def some(x: Array | None) -> Array | None:
            return None if x is None else x[index]

        return replace(
            self,
            t=self.t[index],
            lat=self.lat[index],
            lon=self.lon[index],
            height=self.height[index],
            v_n=some(self.v_n),
            sigma_pos=some(self.sigma_pos),
            sigma_vel=some(self.sigma_vel),
        )

    def sigmas(self) -> Array:
        """(k, 3) m: those of the log, not below :data:`LEAST_SIGMA`, else the default."""
        if self.sigma_pos is None:
            span = float(self.t[-1] - self.t[0]) if self.t.size > 1 else 0.0
            crowd = max(1.0, (self.t.size - 1) / span) if span > 0.0 else 1.0
            # fixes closer than a second share their errors
            default = np.array([DEFAULT_SIGMA, DEFAULT_SIGMA, HEIGHT_SIGMA]) * np.sqrt(crowd)
            return np.asarray(np.broadcast_to(default, (self.t.size, 3)))
        return np.maximum(self.sigma_pos, LEAST_SIGMA)

    def velocity(self, earth: Ellipsoid) -> Array:
        """(k, 2) m/s east and north: as logged, else central differences of the positions.

        Never across a hole; a fix without another one near it has none (zero).
        """
        if self.v_n is not None:
            return self.v_n[:, :2]
        origin = (float(self.lat[0]), float(self.lon[0]), float(self.height[0]))
        place = local_enu(self.lat, self.lon, self.height, origin=origin, earth=earth)[:, :2]
        step = float(np.median(np.diff(self.t))) if self.t.size > 1 else 0.0
        half = max(0.5 * (SPEED_SPAN + step), 1.5 * step)
        a = np.searchsorted(self.t, self.t - half)
        b = np.searchsorted(self.t, self.t + half, side="right") - 1
        span = np.maximum(self.t[b] - self.t[a], 1e-3)
        return np.asarray((place[b] - place[a]) / span[:, None])

    def table(self, earth: Ellipsoid) -> Array:
        """(k, 13): Earth-fixed position and velocity (NaN: none), variances of both, the form."""
        out = np.full((self.t.size, 13), np.nan)
        out[:, 12] = FORMS.index(self.form)
        out[:, :3] = ecef_from_geodetic(self.lat, self.lon, self.height, earth=earth)
        out[:, 6:9] = self.sigmas() ** 2
        if self.v_n is not None:
            out[:, 3:6] = np.einsum("kij,kj->ki", c_en(self.lat, self.lon), self.v_n)
            sigma = DEFAULT_VELOCITY_SIGMA if self.sigma_vel is None else self.sigma_vel
            out[:, 9:12] = np.maximum(sigma, LEAST_SIGMA) ** 2
        return out
