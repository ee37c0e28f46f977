"""The attitude and the biases that a stop shows, and the heading that GPS shows.

At rest the specific force is the reaction to gravity, so its mean gives pitch and roll; the mean
angular rate is the Earth rate plus the gyro bias. The heading is not seen at rest by a MEMS gyro:
it comes from the first stretch of GPS or from the user.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vehnav.earth import WGS84, Ellipsoid, earth_rate, normal_gravity
from vehnav.rotation import c_nb_from_angles

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Rest:
    """Means over a stop, in body axes.

    Attributes
    ----------
    omega : (3,)
        rad/s, slope of the angle.
    f : (3,)
        m/s2
    """

    omega: Array
    f: Array

    @property
    def pitch(self) -> float:
        """Nose up, rad (rest: f is along up, so row 3 of C_nb)."""
        return float(np.arctan2(self.f[1], np.hypot(self.f[0], self.f[2])))

    @property
    def roll(self) -> float:
        """Right side down, rad."""
        return float(np.arctan2(-self.f[0], self.f[2]))

    def c_nb(self, heading: float) -> Array:
        """(3, 3) attitude with the level of this rest and the given heading, rad."""
        return c_nb_from_angles(heading, self.pitch, self.roll)


def mean_over_rest(omega: Array, f: Array, first: int, last: int) -> Rest:
    """Means over the samples ``first`` to ``last``, both included.

    The rate is weighed by a parabola that is zero at both ends, which is the least-squares slope
    of the angle. A plain mean is the difference of two angles over the time: a car that rocks by
    0.1 deg at idle would show 6 deg/h over a minute. The weights cost 20 % of variance on white
    noise.
    """
    inside = slice(first, last + 1)
    u = (np.arange(last + 1 - first) + 0.5) / (last + 1 - first)
    weight = u * (1.0 - u)
    slope = weight @ omega[inside] / weight.sum()
    return Rest(np.asarray(slope), f[inside].mean(axis=0))


def gyro_bias(rest: Rest, c_nb: Array, lat: float, *, earth: Ellipsoid = WGS84) -> Array:
    """(3,) rad/s: b = mean omega - C_nb^T omega_ie_n, the Earth rate removed (spec C 3)."""
    return np.asarray(rest.omega - c_nb.T @ np.array(earth_rate(lat, earth)))


def bias_along_gravity(rest: Rest, lat: float, height: float, *, earth: Ellipsoid = WGS84) -> Array:
    """(3,) m/s2: the accelerometer error along gravity at rest, read as a bias.

    One attitude cannot tell it from a scale error |f|/g - 1; both readings are reported. Taken as
    a bias it leaves the horizontal accelerations alone, which was better by 2 to 5 % on real logs.
    """
    size = float(np.linalg.norm(rest.f))
    return np.asarray(rest.f * (1.0 - normal_gravity(lat, height, earth) / size))


def heading_from_tracks(dead_reckoned: Array, reference: Array) -> tuple[float, float]:
    """Rotation, rad clockwise, that turns the dead-reckoned track onto the reference.

    Least squares over all points of one rotation about the common start (Procrustes in the plane).

    Parameters
    ----------
    dead_reckoned, reference : (m, 2)
        East, north, m, from the start of the drive.

    Returns
    -------
    angle : float
        To be added to the heading.
    rms : float
        m, of what remains.
    """
    along = float(np.sum(dead_reckoned * reference))
    across = float(np.sum(_cross(reference, dead_reckoned)))
    angle = float(np.arctan2(across, along))
    c, s = np.cos(angle), np.sin(angle)
    turned = dead_reckoned @ np.array([[c, -s], [s, c]])  # clockwise by the angle
    return angle, float(np.sqrt(np.mean(np.sum((turned - reference) ** 2, axis=1))))


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def track_random_walk(
    t: Array, z: Array, variance: Array, walk: float, *, smooth: bool
) -> tuple[Array, Array]:
    """A slowly walking bias from noisy readings: Kalman filter, and smoother where wanted.

    Each reading is weighed by its own noise against the random walk since the one before, so that
    a good gyro is not spoiled by a short stop (spec C 3).

    Parameters
    ----------
    t : (k,)
        s, times of the readings.
    z : (k, m)
        Readings, e.g. of m gyro axes.
    variance : (k,)
        Of each reading.
    walk : float
        Random walk of the bias, per sqrt(s).
    smooth : bool
        Whether later readings count too (Rauch-Tung-Striebel).

    Returns
    -------
    x : (k, m), p : (k,)
        Estimates and their variances at the times of the readings.
    """
    x, p = z.copy(), variance.copy()
    predicted = p.copy()
    for k in range(1, t.size):
        predicted[k] = p[k - 1] + walk**2 * (t[k] - t[k - 1])
        gain = predicted[k] / (predicted[k] + variance[k])
        x[k] = x[k - 1] + gain * (z[k] - x[k - 1])
        p[k] = (1.0 - gain) * predicted[k]
    if smooth:
        for k in range(t.size - 2, -1, -1):
            gain = p[k] / predicted[k + 1]
            x[k] = x[k] + gain * (x[k + 1] - x[k])
            p[k] = p[k] + gain**2 * (p[k + 1] - predicted[k + 1])
    return x, p
