"""Paper 000 (Uspensky, Bagmut): navigation in inertial axes by quaternion, ideal sensors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vehnav.earth import ecef_from_geodetic, position_difference
from vehnav.papers.claims import Row, at_most, between
from vehnav.simulate.scenarios import make_scenario
from vehnav.simulate.truth import march
from vehnav.strapdown.eci import PUBLISHED, SECOND_ORDER, EciForm, EciSolution, mechanize_eci
from vehnav.strapdown.enu import mechanize_enu
from vehnav.strapdown.increments import Increments

Array = npt.NDArray[np.float64]

FLIGHT = "the flight of 2050 s (its figures are lost): take-off, turns, climbs as simulated"
AGREEMENT = 1e-3
"""m between the two mechanizations over the flight at 0.01 s."""


@dataclass(frozen=True)
class Flight:
    """Ideal increments of the flight and its truth.

    Attributes
    ----------
    increments : Increments
    start : (position, v_n, c_nb)
        At the first instant.
    r_i : (n, 3)
        True radius vector in inertial axes, m.
    """

    increments: Increments
    start: tuple[tuple[float, float, float], tuple[float, float, float], Array]
    r_i: Array

    def eci(self, form: EciForm) -> EciSolution:
        """Integrated in inertial axes, the height free."""
        position, v_n, c_nb = self.start
        return mechanize_eci(
            self.increments,
            position=position,
            v_n=v_n,
            c_nb=c_nb,
            form=form,
            vertical="free",
            gravity_at="height",
        )

    def error(self, form: EciForm) -> float:
        """The paper's measure: largest |R2 - R1|, m."""
        return float(np.linalg.norm(self.eci(form).r_i - self.r_i, axis=1).max())

    def disagreement(self) -> float:
        """Largest distance of the ENU and the ECI mechanization, m, height included."""
        position, v_n, c_nb = self.start
        enu = mechanize_enu(
            self.increments, position=position, v_n=v_n, c_nb=c_nb,
            vertical="free", gravity_at="height",
        ).position  # fmt: skip
        eci = self.eci(SECOND_ORDER).position
        across = position_difference(enu[:, 0], enu[:, 1], eci[:, 0], eci[:, 1], eci[:, 2])
        return float(np.hypot(np.hypot(*across.T), enu[:, 2] - eci[:, 2]).max())


def fly(dt: float) -> Flight:
    """The flight with increments over steps of ``dt`` s."""
    motion = make_scenario("flight").motion
    t: Array = np.arange(round(motion.duration / dt) + 1, dtype=np.float64) * dt
    dtheta, dvel, r_i, start = [], [], [], None
    done = 0
    for block in march(motion, t, increments=True):
        s = block.states
        fresh = slice(0 if start is None else 1, None)
        if start is None:
            v_e, v_n, v_h = (float(x) for x in s.v_n[0])
            place = float(s.lat[0]), float(s.lon[0]), float(s.height[0])
            start = place, (v_e, v_n, v_h), s.c_nb[0]
        inertial_lon = s.lon + motion.earth.omega_ie * t[done : done + s.lon.size]
        r_i.append(ecef_from_geodetic(s.lat, inertial_lon, s.height, earth=motion.earth)[fresh])
        dtheta.append(block.dtheta)
        dvel.append(block.dvel)
        done += s.lon.size - 1
    if start is None:
        raise ValueError(f"a step of {dt} s is longer than the flight")
    steps = np.concatenate(dtheta), np.concatenate(dvel)
    coast = np.zeros(t.size - 1, dtype=np.bool_)
    return Flight(Increments(t, *steps, coast), start, np.concatenate(r_i))


def rows(*, fast: bool = False, published: EciForm = PUBLISHED) -> list[Row]:
    """The claims of paper 000; ``fast`` leaves the step of 0.001 s out."""
    found = {0.1: fly(0.1).error(published)} if fast else {}
    flight = fly(0.01)
    found[0.01] = flight.error(published)
    ours = flight.error(SECOND_ORDER)
    apart = flight.disagreement()
    del flight
    if not fast:
        found[0.001] = fly(0.001).error(published)
    out = [_linear(found), *(_bound(dt, found[dt], ours) for dt in (0.001, 0.01) if dt in found)]
    out.append(
        Row(
            "all",
            "enu-eci",
            "the mechanizations solve one problem",
            f"same increments and gravity, 0.01 s, {FLIGHT}",
            f"{apart:.1e} m between ENU direction cosines and ECI quaternion",
            at_most(apart, AGREEMENT, same_size=np.inf),
            f"bar {AGREEMENT:g} m",
            {"distance_m": apart, "eci_error_m": ours},
        )
    )
    return out


def _linear(found: dict[float, float]) -> Row:
    """Error against step: the paper's 5.5 and 55 m."""
    fine, coarse = sorted(found)
    ratio = found[coarse] / found[fine]
    slack = 0.2 if fine < 0.005 else 1.0  # at 0.1 s the second order of (17) shows as well
    return Row(
        "000",
        "linear",
        "the error is proportional to the step (5.5 m, 55 m)",
        FLIGHT,
        f"ratio {ratio:.2f} between steps of {coarse:g} and {fine:g} s",
        between(ratio, 10.0 - slack, 10.0 + slack),
        "gravitation of the start of the step (17) is half a step late: dt/2 V (1 - cos w t)",
        {"ratio": ratio, **{f"error_{dt:g}_m": e for dt, e in found.items()}},
    )


def _bound(dt: float, error: float, ours: float) -> Row:
    published = 5.5 * dt / 0.001
    better = f"; our second-order form has {ours:.1e} m at 0.01 s" if dt == 0.01 else ""
    return Row(
        "000",
        f"step-{dt:g}",
        f"largest error {published:g} m at a step of {dt:g} s",
        FLIGHT,
        f"{error:.3g} m with (13), (17)-(20) as printed",
        at_most(error, published),
        "the printed algorithm is better than the published figure by a factor of "
        f"{published / error:.0f}; why theirs is larger cannot be told from the text{better}",
        {"error_m": error, "published_m": published},
    )
