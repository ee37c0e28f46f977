"""How the sensor sits in the vehicle: axes by letters, small mounting angles, gravity as evidence.

Frames: s the sensor as logged, b the vehicle body (right-forward-up). Three letters say where the
sensor's x, y and z point in the vehicle: F forward, B back, L left, R right, U up, D down.
"""

from __future__ import annotations

from itertools import permutations, product
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.errors import ConfigError
from vehnav.rotation import c_nb_from_angles

Array = npt.NDArray[np.float64]

DIRECTIONS: Final = {
    "R": (1.0, 0.0, 0.0),
    "L": (-1.0, 0.0, 0.0),
    "F": (0.0, 1.0, 0.0),
    "B": (0.0, -1.0, 0.0),
    "U": (0.0, 0.0, 1.0),
    "D": (0.0, 0.0, -1.0),
}
"""Body components (right, forward, up) of the direction that a letter names."""

MAX_TILT: Final = np.radians(45.0)
"""rad between gravity at rest and the up axis that the letters state: beyond it they are wrong.
Cases are mounted within 20 degrees, roads are level within 15."""


def c_bs_from_letters(letters: str) -> Array:
    """C_bs (3, 3) of axis letters: turns sensor components into right-forward-up.

    The matrix may be left-handed (an inverted sensor); the caller decides whether that is allowed.

    >>> c_bs_from_letters("FLU") @ [1.0, 0.0, 0.0]  # the sensor's x points forward
    array([0., 1., 0.])
    """
    try:
        c_bs = np.array([DIRECTIONS[c] for c in letters.upper()]).T
    except KeyError:
        c_bs = np.zeros((0, 0))
    if c_bs.shape != (3, 3) or abs(np.linalg.det(c_bs)) < 0.5:
        raise ConfigError(
            f"axes {letters!r}: expected three letters, one of F B, one of L R, one of U D, that "
            "say where the sensor's x, y, z point, e.g. FLU (ROS), FRD, RFU"
        )
    return c_bs


def right_handed_axes() -> list[str]:
    """The 24 letter triples of right-handed sensors, in alphabetic order."""
    pairs = permutations(("FB", "LR", "UD"))
    triples = ("".join(p) for pair in pairs for p in product(*pair))
    return sorted(x for x in triples if np.linalg.det(c_bs_from_letters(x)) > 0.0)


def sensor_to_body(
    axes: str, *, accel_axes: str | None = None, mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> tuple[Array, Array]:
    """(C_bs of the gyro, C_bs of the accelerometer), (3, 3) each.

    Parameters
    ----------
    axes : str
        Letters of the gyro, right-handed.
    accel_axes : str, optional
        Letters of the accelerometer where they differ: right-handed, or all three signs turned.
    mount : (roll, pitch, yaw), rad
        The small attitude of the case that remains, ``f_b = C(yaw, pitch, roll) f_s`` with the
        matrix and senses of :func:`vehnav.rotation.c_nb_from_angles`.

    Raises
    ------
    ConfigError
        For letters that do not name three different axes, or a left-handed gyro.
    """
    gyro = c_bs_from_letters(axes)
    accel = gyro if accel_axes is None else c_bs_from_letters(accel_axes)
    if np.linalg.det(gyro) < 0.0:
        raise ConfigError(
            f"--axes {axes}: left-handed; a gyro cannot be. If it is the accelerometer that is "
            "inverted, give the gyro's axes here and its own by --accel-axes"
        )
    if np.linalg.det(accel) < 0.0 and not np.array_equal(accel, -gyro):
        raise ConfigError(
            f"--accel-axes {accel_axes}: left-handed; only all three signs of --axes {axes} turned "
            "is a sensor that exists"
        )
    roll, pitch, yaw = mount
    turn = c_nb_from_angles(yaw, pitch, roll)
    return turn @ gyro, turn @ accel


def gravity_contradiction(f_rest_s: Array, axes: str) -> str | None:
    """Why gravity at rest contradicts the axis letters, with the letters that fit; None if not.

    Parameters
    ----------
    f_rest_s : (3,)
        Mean specific force, m/s2, on the sensor axes, at rest (or over the whole log).
    axes : str
        The letters that are assumed.
    """
    size = float(np.linalg.norm(f_rest_s))
    if size == 0.0:
        return "the accelerometer reads zero at rest: gravity is missing"
    up_b = c_bs_from_letters(axes) @ f_rest_s / size
    tilt = float(np.degrees(np.arccos(np.clip(up_b[2], -1.0, 1.0))))
    if tilt <= np.degrees(MAX_TILT):
        return None
    axis = int(np.argmax(np.abs(f_rest_s)))
    sign = "+" if f_rest_s[axis] > 0 else "-"
    fitting = [x for x in right_handed_axes() if _up_letter_fits(x, axis, sign)]
    usual = [x for x in ("FRD", "FLU", "RFU", "BRU", "LBU", "RBD") if x in fitting]
    listed = usual + [x for x in fitting if x not in usual]
    reading = ", ".join(f"{x:+.2f}" for x in f_rest_s)
    return (
        f"at rest the accelerometer reads ({reading}) m/s2 on x, y, z: up is the sensor's "
        f"{sign}{'xyz'[axis]}, {tilt:.0f} deg from the up of axes {axes}. Axes that fit gravity: "
        f"{', '.join(listed)}"
    )


def _up_letter_fits(letters: str, axis: int, sign: str) -> bool:
    return letters[axis] == ("U" if sign == "+" else "D")
