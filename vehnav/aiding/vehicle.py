"""What a land vehicle adds to the error model: states, noise figures, presets.

A car moves along its own forward axis, up to small constants that the filter finds on the way. In
body axes right-forward-up, at the sensor, with the speed v along the body's forward axis::

    v_right = mu v - l omega_up + k v^2 omega_up
    v_up    = (p + q f) v

mu, p: the direction of travel lies to the right and above of the forward axis of the body frame as
it was mounted; l: the sensor sits in front of the axle that does not slide; k: tyre slip; q: the
sprung body rises at the nose under the forward specific force f (squat; negative q), and the way
does not follow it. What remains is correlated over seconds; as white noise at 10 Hz it gets a
larger sigma that carries the same information. The odometer reads ``(1 + kappa) v``. The gyro
reads, besides its biases, ``c s`` about each axis, s the skew of its vibration
(:mod:`vehnav.aiding.vibration`) and c the share that it loses of it (negative). As everywhere the
error states are estimate minus truth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from vehnav.units import DEG

Array = npt.NDArray[np.float64]

ODO_SCALE: Final = 15
MOUNT_YAW: Final = 16
MOUNT_PITCH: Final = 17
LEVER: Final = 18
GYRO_SCALE: Final = 19
SLIP: Final = 20
ACCEL_SCALE: Final = 21
SQUAT: Final = 22
CUT: Final = 23
SIZE: Final = 24
"""Number of states: 15 of the error model, kappa, mu, p, l, gyro z scale, k, the scale of the
forward accelerometer, q, and the share that the gyro loses of lopsided vibration."""


class Noise(NamedTuple):
    """Noise figures of the filter, one standard deviation, SI.

    Attributes
    ----------
    gyro, accel : float
        White noise while driving, rad/s/sqrt(Hz), m/s2/sqrt(Hz).
    accel_share : float
        Added to ``accel`` per m/s2 of horizontal force: what scale errors, cross axes and
        jittering stamps do.
    gyro_shaken, accel_shaken : float
        Share of the vibration near half the sampling rate that adds to the white noise
        (:mod:`vehnav.aiding.vibration`).
    gyro_walk, accel_walk : float
        Random walk of the biases, rad/s/sqrt(s), m/s2/sqrt(s).
    zero_velocity : float
        m/s, of each 10 Hz zero-velocity update.
    zero_rate : float
        rad/s, of a 0.1 s mean at rest.
    side, up : float
        m/s, white part of the non-holonomic constraint.
    turn, speed : float
        Added to both: m/s per rad/s of turning, and share of the speed.
    odometer, odometer_share : float
        m/s and share of the speed, white.
    huber : float
        Normalised innovations beyond this are weighed down (R inflated).
    gate : float
        Normalised innovations beyond this are rejected.
    """

    gyro: float
    accel: float
    accel_share: float
    gyro_shaken: float
    accel_shaken: float
    gyro_walk: float
    accel_walk: float
    zero_velocity: float
    zero_rate: float
    side: float
    up: float
    turn: float
    speed: float
    odometer: float
    odometer_share: float
    huber: float = 2.0
    gate: float = 30.0


@dataclass(frozen=True)
class Prior:
    """Standard deviations of what is not known at the start.

    Attributes
    ----------
    tilt, heading : float
        rad
    velocity : float
        m/s per axis.
    position : (3,)
        m, wander axes.
    gyro, accel : float
        rad/s, m/s2, of the biases that remain.
    odometer, mount, lever, gyro_scale, accel_scale, slip, squat, cut : float
        1, rad, m, 1, 1, s2/m, rad per m/s2 (0.3 deg: a soft car), 1.
    """

    tilt: float
    heading: float
    velocity: float
    position: tuple[float, float, float]
    gyro: float
    accel: float
    odometer: float = 0.03
    mount: float = 4.0 * DEG
    lever: float = 1.0
    gyro_scale: float = 0.005
    accel_scale: float = 0.02
    slip: float = 0.004
    squat: float = 0.005
    cut: float = 0.15

    def covariance(self) -> Array:
        """P (24, 24) at the start."""
        sigma = np.array(
            [
                *self.position,
                *[self.velocity] * 3,
                self.tilt,
                self.tilt,
                self.heading,
                *[self.accel] * 3,
                *[self.gyro] * 3,
                self.odometer,
                self.mount,
                self.mount,
                self.lever,
                self.gyro_scale,
                self.slip,
                self.accel_scale,
                self.squat,
                self.cut,
            ]
        )
        return np.asarray(np.diag(sigma**2))


MEMS: Final = Noise(
    gyro=0.015 * DEG,
    accel=0.01,
    accel_share=0.025,
    gyro_shaken=0.15,
    accel_shaken=0.5,
    gyro_walk=7e-4 * DEG,
    accel_walk=1.5e-3,
    zero_velocity=0.2,
    zero_rate=0.1 * DEG,
    side=0.09,
    up=0.06,
    turn=0.5,
    speed=0.004,
    odometer=0.1,
    odometer_share=0.01,
)
"""Consumer and industrial MEMS.

Gyro, accelerometer and bias walks: near those of spec C section 4. Shares of vibration: on the car
whose gyro shakes most the error of the pitch over 10 s follows its fastest vibration with a factor
of 0.2 to 0.5, about each axis, of whose square half is found by its skew. Constraint: residuals of
two GPS-aided drives have 0.03 to 0.1 m/s, correlated over seconds; 0.09 and 0.06 m/s at 10 Hz, with
the shares of turning and speed, carry the information of such noise. Judged by the share of errors
inside 1, 2, 3 sigma after GPS ends, at many times of two drives; the README has the figures.
"""
TACTICAL: Final = MEMS._replace(
    gyro=0.006 * DEG,
    accel=0.003,
    accel_share=0.012,
    gyro_walk=5e-5 * DEG,
    accel_walk=2.5e-4,
    zero_rate=0.03 * DEG,
)
"""Tactical grade (fibre-optic, ring laser, the best MEMS): gyro and accelerometer better.

Judged as above, on two drives with one such sensor.
"""
