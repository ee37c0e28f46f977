"""What happens in body axes over one step: the same for every mechanization.

Kernels on the increments of the step and of the one before, scaled to its length.
"""

from __future__ import annotations

from vehnav.kernel import kernel
from vehnav.rotation import Vec3, add, cross, rotation_coefficients, scale


@kernel
def coning_factor(dt: float, dt_prev: float) -> float:
    """Factor on the cross products of neighbouring increments: 1/12 for even steps.

    dt_n / (6 (dt_n + dt_prev)), for previous increments scaled to dt_n; exact for a rate that is
    linear in time over two uneven steps (spec A 3.2).
    """
    return dt / (6.0 * (dt + dt_prev))


@kernel
def rotation_vector(dtheta: Vec3, dtheta_prev: Vec3, c: float) -> Vec3:
    """Phi, rad: rotation of the body over the step, with coning (000 eq. 12; spec A 5.4)."""
    return add(dtheta, scale(c, cross(dtheta_prev, dtheta)))


@kernel
def rotated_velocity_increment(dtheta: Vec3, dvel: Vec3) -> Vec3:
    """Velocity increment resolved in the body axes of the START of the step (000 eq. 16).

    Exact for a specific force and a rate that are constant in body axes over the step.
    """
    theta2 = dtheta[0] * dtheta[0] + dtheta[1] * dtheta[1] + dtheta[2] * dtheta[2]
    _, c, d = rotation_coefficients(theta2)
    once = cross(dtheta, dvel)
    twice = cross(dtheta, once)
    return add(dvel, add(scale(c, once), scale(d, twice)))


@kernel
def sculling(dtheta: Vec3, dvel: Vec3, dtheta_prev: Vec3, dvel_prev: Vec3, c: float) -> Vec3:
    """Velocity correction for rate and force that vary together, m/s (spec A 5.4)."""
    return scale(c, add(cross(dtheta_prev, dvel), cross(dvel_prev, dtheta)))
