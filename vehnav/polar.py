"""What a run says near the poles, where longitude and heading lose their meaning (paper 003)."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from vehnav.config import Config
from vehnav.earth import ELLIPSOIDS, POLAR
from vehnav.errors import Finding, Level
from vehnav.strapdown.quasi import quasi_from_geodetic, wander_along
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
    """What to say where the track comes so near a pole that a choice of options matters."""
    findings = []
    form = singular_form(trajectory, config)
    if form is not None:
        findings.append(Finding("gnss-form", "warning", form))
    highest = float(np.max(np.abs(trajectory.lat)))
    if highest <= NEAR_POLE:
        return findings
    place = f"the track reaches {highest / DEG:.4f} degrees of latitude"
    level: Level = "warning"
    if not config.aided and config.frame == "enu":
        text = f"{place}, where the mechanization in East-North-Up fails: take --frame wander"
    elif trajectory.wander is None:
        text = f"{place}: east, north and heading turn fast there; take --coords quasi"
    else:
        level = "info"
        text = (
            f"{place}: east, north and heading turn fast there; the columns qlat_deg, qlon_deg "
            "and qheading_deg do not"
        )
    return [*findings, Finding("near-pole", level, text)]


def singular_form(trajectory: Trajectory, config: Config) -> str | None:
    """Advice where the form of the GNSS measurements fails on the track, else None.

    The forms in angles fail at the poles of their coordinates: the geographic ones, and the
    quasi-poles at 0 N 0 E and 0 N 180 E.
    """
    if not config.aided or config.gnss_form == "direct":
        return None
    angle = trajectory.lat
    if config.gnss_form == "quasi":
        angle, _, _ = quasi_from_geodetic(trajectory.lat, trajectory.lon, trajectory.height)
    nearest = 90.0 - float(np.max(np.abs(angle))) / DEG
    if nearest > 90.0 - NEAR_POLE / DEG:
        return None
    pole = "a pole" if config.gnss_form == "normal" else "a quasi-pole (0 N 0 E, 0 N 180 E)"
    return (
        f"the track comes within {nearest:.4f} degrees of {pole}, where --gnss-form "
        f"{config.gnss_form} fails: take direct"
    )
