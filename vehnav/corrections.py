"""What is done at a stop (paper 002): levelling and velocity reset, as kernels.

The platform is the computed East-North-Up frame. Its small error alpha is the rotation of the
computed frame about true east, north and up. At rest the computed horizontal specific force is
proportional to the tilt, ``n_E = -g alpha_N``, ``n_N = +g alpha_E``; turning the computed frame
with the control rate below makes it decay as ``d alpha/dt = -(k g) alpha`` for both axes. The
heading error is not seen at rest and is left alone.
"""

from __future__ import annotations

from vehnav.kernel import kernel

Vec3 = tuple[float, float, float]


@kernel
def levelling_rate(f_n: Vec3, gain: float, gravity: float) -> Vec3:
    """Control rate of the platform, rad/s, in ENU: procedure 1 of paper 002 (spec A 4.1).

    ``Delta omega_E = -k n_N``, ``Delta omega_N = +k n_E``, ``Delta omega_h = 0`` with
    k = gain / gravity; the tilt decays with the time constant 1 / gain (s).
    """
    k = gain / gravity
    return (-k * f_n[1], k * f_n[0], 0.0)


@kernel
def velocity_reset() -> Vec3:
    """V := 0 at a stop: procedure 2 of paper 002."""
    return (0.0, 0.0, 0.0)
