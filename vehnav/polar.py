"""What a run says near the poles, where longitude and heading lose their meaning (paper 003)."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from vehnav.config import Config
from vehnav.earth import ELLIPSOIDS, POLAR
from vehnav.errors import Finding
from vehnav.strapdown.quasi import wander_along
from vehnav.trajectory import Trajectory
from vehnav.units import DEG, NS

NEAR_POLE: Final = 89.9 * DEG
"""rad of latitude beyond which the axes east and north turn too fast to be of use."""


def with_coordinates(trajectory: Trajectory, config: Config) -> Trajectory:
    """With the wander angle along the track where quasi-coordinates are wanted (``--coords``).

    It belongs to axes that point east and north at the start of the trajectory and are carried
    along it, whatever frame the track was computed in.
    """
    polar = config.free_azimuth and bool(np.any(np.abs(trajectory.lat) > POLAR))
    if config.coords == "normal" or (config.coords == "auto" and not polar):
        return trajectory
    wander = wander_along(
        (trajectory.t_ns - trajectory.t_ns[0]) * NS, trajectory.lat, trajectory.lon,
        azimuth=config.azimuth, earth=ELLIPSOIDS[config.ellipsoid],
    )  # fmt: skip
    return replace(trajectory, wander=wander)


def polar_findings(trajectory: Trajectory, config: Config) -> list[Finding]:
    """A warning where the track comes so near a pole that a choice of options matters."""
    highest = float(np.max(np.abs(trajectory.lat)))
    if highest <= NEAR_POLE:
        return []
    place = f"the track reaches {highest / DEG:.4f} degrees of latitude"
    if not config.aided and config.frame == "enu":
        text = f"{place}, where the mechanization in East-North-Up fails: take --frame wander"
        return [Finding("near-pole", "warning", text)]
    if trajectory.wander is None:
        text = f"{place}: east, north and heading turn fast there; take --coords quasi"
        return [Finding("near-pole", "warning", text)]
    text = (
        f"{place}: east, north and heading turn fast there; the columns qlat_deg, qlon_deg and "
        "qheading_deg do not"
    )
    return [Finding("near-pole", "info", text)]
