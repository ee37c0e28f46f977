"""Axes and mounting angles established from the physics, with the evidence (spec C section 2).

Up is the specific force at rest. Forward, sign included, is where the force points when the vehicle
departs; turns and GPS stand in for that or confirm it. An inverted accelerometer needs GPS: force
is polar and rate is axial, so without it the mirror world is as good as this one.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.clues import (
    MIN_TURNING,
    Events,
    GpsBetween,
    GpsClue,
    Rest,
    Turns,
    at_rest,
    by_gps,
    departures_and_arrivals,
    horizontal,
    turns,
)
from vehnav.mounting import c_bs_from_letters, gravity_contradiction, right_handed_axes
from vehnav.rotation import angles_from_c_nb
from vehnav.stops import Stop
from vehnav.units import DEG

Array = npt.NDArray[np.float64]

GOOD: Final = 0.95
"""Consistency of departures and arrivals from which three of them give forward to 4 degrees."""
FAIR: Final = 0.85
"""and from which they give the letters."""
EVENT_SPEED: Final = 2.0
"""m/s gained and lost in all departures and arrivals, below which noise and slope count more."""
EVENTS_FOR_YAW: Final = 3
"""One departure can be 11 degrees off, three agree to 4 (spec C 2)."""
TURN_SHARE: Final = 0.6
"""of the variance of the force that turns explain, from which they give the letters."""
GPS_FIT: Final = 0.6
"""Correlation of force and GPS acceleration from which GPS gives the letters."""
PARITY: Final = 0.5
"""Correlation of rate of turn and GPS course rate from which their signs are compared."""
ROAD_TILT: Final = 3.0 * DEG
"""rad that the slope of the road may explain; less is no mounting."""
SMALL_YAW: Final = 2.0 * DEG
"""rad that departures and arrivals do not measure; less is no mounting."""
OBLIQUE: Final = 35.0 * DEG
"""rad from the nearest axes, from which the letters say little."""
GROW: Final = 30.0
"""s by which the stretch of GPS grows until it decides."""
OPPOSITE: Final = dict(zip("FBLRUD", "BFRLDU", strict=True))


@dataclass(frozen=True)
class AxesEvidence:
    """How the sensor sits, and why.

    Attributes
    ----------
    axes : str
        Letters of the gyro, right-handed.
    accel_axes : str or None
        Letters of the accelerometer where it is inverted.
    mount : (roll, pitch, yaw)
        rad, what remains, as far as it is established.
    source : str
        What gave forward: ``departures and arrivals``, ``turns``, ``GPS``, ``declaration``.
    certain : bool
        Whether the letters are established; else they are those of the declaration.
    tilt, yaw : float
        rad, from the letters to the measured up and forward, used or not.
    rest : Rest
    events : Events
    turns : Turns or None
    gps : GpsClue or None
        The stretch of GPS that was looked at.
    gps_until : float or None
        s: fixes up to here decided something; None where GPS decided nothing.
    doubts : tuple of str
        What speaks against the result.
    reasons : tuple of str
        What speaks for it, a sentence each.
    """

    axes: str
    accel_axes: str | None
    mount: tuple[float, float, float]
    source: str
    certain: bool
    tilt: float
    yaw: float
    rest: Rest
    events: Events
    turns: Turns | None
    gps: GpsClue | None
    gps_until: float | None
    doubts: tuple[str, ...] = ()
    reasons: tuple[str, ...] = field(default=())

    def to_dict(self) -> dict[str, Any]:
        """Plain data for reports: degrees, m/s2, m/s."""
        return {
            "axes": self.axes,
            "accel_axes": self.accel_axes,
            "mount_deg": [x / DEG for x in self.mount],
            "source": self.source,
            "certain": self.certain,
            "tilt_deg": self.tilt / DEG,
            "yaw_deg": self.yaw / DEG,
            "rest_force_m_s2": self.rest.force.tolist(),
            "rest_spread_deg": self.rest.spread / DEG,
            "stops": self.rest.stops,
            "events": self.events.count,
            "events_consistency": self.events.consistency,
            "events_speed_m_s": self.events.speed,
            "turns_share": None if self.turns is None else self.turns.share,
            "turns_speed_m_s": None if self.turns is None else self.turns.speed,
            "gps_parity": None if self.gps is None else self.gps.parity,
            "gps_fit": None if self.gps is None else self.gps.fit,
            "gps_used_until_s": self.gps_until,
            "reasons": list(self.reasons),
            "doubts": list(self.doubts),
        }


def establish_axes(
    t: Array,
    gyro: Array,
    accel: Array,
    stops: list[Stop],
    *,
    declared: str,
    gps: GpsBetween | None = None,
    gps_seconds: float = 60.0,
) -> AxesEvidence:
    """Axes, mounting and what they rest on.

    Parameters
    ----------
    t : (n,)
        s
    gyro, accel : (n, 3)
        rad/s and m/s2 on the sensor axes.
    stops : list of Stop
        Found on any axes.
    declared : str
        Letters that stand where the evidence does not decide.
    gps : callable or None
        Velocity between two instants, from the fixes between them alone; None: not to be used.
    gps_seconds : float
        s after the first departure that GPS may show before the stretch grows.
    """
    rest = at_rest(t, gyro, accel, stops)
    events = departures_and_arrivals(t, gyro, accel, stops)
    turned = turns(t, gyro, accel, rest, stops)
    decided = events.consistency >= FAIR and events.speed >= EVENT_SPEED
    clue = _gps_clue(t, gyro, accel, rest, stops, gps, gps_seconds, grow=not decided)
    inverted = clue is not None and clue.parity < -PARITY and clue.mirrored
    forward, source = _forward(events, turned, clue)
    sign = -1.0 if inverted else 1.0
    if forward is None:
        c_bs, certain, axes = c_bs_from_letters(declared), False, declared
        forward, source = sign * horizontal(c_bs[1], rest.up), "declaration"
        inverted = inverted and bool((c_bs @ rest.up)[2] < 0.0)
        sign = -1.0 if inverted else 1.0
    else:
        certain, axes = True, _nearest(sign * rest.up, sign * forward)
    tilt, yaw, mount = _angles(axes, sign * rest.up, sign * forward, rest, events, source)
    used = inverted or source == "GPS"
    return AxesEvidence(
        axes=axes,
        accel_axes="".join(OPPOSITE[c] for c in axes) if inverted else None,
        mount=mount,
        source=source,
        certain=certain,
        tilt=tilt,
        yaw=yaw,
        rest=rest,
        events=events,
        turns=turned,
        gps=clue,
        gps_until=clue.until if used and clue is not None else None,
        doubts=tuple(_doubts(axes, sign, rest, forward, events, turned, clue, tilt, yaw)),
        reasons=tuple(_reasons(rest, events, turned, clue, source, inverted=inverted)),
    )


def _gps_clue(
    t: Array,
    gyro: Array,
    accel: Array,
    rest: Rest,
    stops: list[Stop],
    gps: GpsBetween | None,
    seconds: float,
    *,
    grow: bool,
) -> GpsClue | None:
    """GPS over the stretch after the first departure, grown until it compares the signs of turns.

    It grows only where departures and arrivals do not show forward: the fixes beyond the window
    of the heading judge the track, and are not looked at without need. The stretch begins at the
    first stop: fixes before it judge the part integrated backward.
    """
    if gps is None:
        return None
    begin, departure = (stops[0].start, stops[0].end) if stops else (float(t[0]), float(t[0]))
    clue = None
    while True:
        motion = gps(begin, departure + seconds)
        if motion is not None:
            clue = by_gps(t, gyro, accel, rest, motion) or clue
        if clue is not None and clue.turning >= MIN_TURNING and abs(clue.parity) >= PARITY:
            return clue
        if not grow or departure + seconds >= t[-1]:
            return clue
        seconds += GROW


def _forward(
    events: Events, turned: Turns | None, clue: GpsClue | None
) -> tuple[Array | None, str]:
    """(forward on the accelerometer axes, what gave it)."""
    if events.consistency >= FAIR and events.speed >= EVENT_SPEED:
        return events.forward, "departures and arrivals"
    if turned is not None and turned.share >= TURN_SHARE:
        return turned.forward, "turns"
    if clue is not None and clue.fit >= GPS_FIT and clue.mirrored == (clue.parity < 0.0):
        return clue.forward, "GPS"
    return None, ""


def _nearest(up: Array, forward: Array) -> str:
    """The letters nearest to the measured directions."""
    c_bs = np.stack([np.cross(forward, up), forward, up])
    scores = {x: float(np.sum(c_bs_from_letters(x) * c_bs)) for x in right_handed_axes()}
    return max(scores, key=lambda letters: scores[letters])


def _angles(
    axes: str, up: Array, forward: Array, rest: Rest, events: Events, source: str
) -> tuple[float, float, tuple[float, float, float]]:
    """(tilt, yaw, mount) from the letters to the measured directions.

    The mount takes the tilt where it is more than a road's slope, and the yaw where at least three
    departures and arrivals agree that it is not zero. A log of a case that sits straight so gives
    the same track as with its letters given.
    """
    letters = c_bs_from_letters(axes)
    tilt = float(np.arccos(np.clip(letters[2] @ up, -1.0, 1.0)))
    _, _, yaw = _mount(letters, up, forward)
    sure = (
        source == "departures and arrivals"
        and events.count >= EVENTS_FOR_YAW
        and events.consistency >= GOOD
        and abs(yaw) > SMALL_YAW
    )
    used_up = up if rest.stops and tilt > ROAD_TILT else letters[2]
    mount = _mount(letters, used_up, forward if sure else letters[1])
    return tilt, yaw, mount


def _mount(letters: Array, up: Array, forward: Array) -> tuple[float, float, float]:
    """(roll, pitch, yaw), rad: ``C(yaw, pitch, roll) @ letters`` has this up and forward."""
    ahead = horizontal(forward, up)
    ahead = ahead / np.linalg.norm(ahead)
    c_bs = np.stack([np.cross(ahead, up), ahead, up])
    yaw, pitch, roll = (float(x) for x in angles_from_c_nb(c_bs @ letters.T))
    return roll, pitch, float(np.remainder(yaw + np.pi, 2.0 * np.pi) - np.pi)


def _doubts(
    axes: str,
    sign: float,
    rest: Rest,
    forward: Array,
    events: Events,
    turned: Turns | None,
    clue: GpsClue | None,
    tilt: float,
    yaw: float,
) -> list[str]:
    """What speaks against the result."""
    doubts = []
    if turned is not None and turned.share > 0.3 and float(turned.forward @ forward) < -0.3:
        doubts.append("the force in turns points to the outside: forward may be back")
    if events.count and events.speed >= EVENT_SPEED and events.consistency < FAIR:
        doubts.append(
            f"departures and arrivals disagree (consistency {events.consistency:.2f} of 1)"
        )
    if clue is not None and clue.turning >= MIN_TURNING:
        if clue.parity < -PARITY and not clue.mirrored:
            doubts.append(
                "the gyro turns against the GPS course, the force does not: signs of the gyro?"
            )
        slope = float(np.linalg.norm(clue.gyro_slope))
        along = abs(float(clue.gyro_slope @ rest.up)) / max(slope, 1e-12)
        if slope > 0.3 and along < 0.7:
            doubts.append("the gyro turns about another axis than the accelerometer's up")
        elif abs(clue.parity) > 0.97 and not 0.8 < slope < 1.25:
            doubts.append(f"the gyro reads {slope:.2f} of the GPS course rate")
    if max(tilt, abs(yaw)) > OBLIQUE:
        doubts.append(f"the case stands oblique: {tilt / DEG:.0f} deg of tilt, {yaw / DEG:.0f} yaw")
    contradiction = gravity_contradiction(sign * rest.force, axes)
    return doubts if contradiction is None else [*doubts, contradiction]


def _reasons(
    rest: Rest,
    events: Events,
    turned: Turns | None,
    clue: GpsClue | None,
    source: str,
    *,
    inverted: bool,
) -> list[str]:
    """What the result rests on, a sentence each."""
    reading = ", ".join(f"{x:+.2f}" for x in rest.force)
    where = f"over {rest.stops} stops, agreeing to {rest.spread / DEG:.1f} deg"
    if rest.stops < 2:
        where = "over one stop" if rest.stops else "over the whole log (no stop)"
    reasons = [f"up: ({reading}) m/s2 on x, y, z {where}"]
    if events.count:
        reasons.append(
            f"forward: {events.count} departures and arrivals, {events.speed:.1f} m/s in all, "
            f"consistency {events.consistency:.2f}"
        )
    if turned is not None:
        reasons.append(
            f"turns: {np.degrees(turned.turning):.0f} deg explain {100.0 * turned.share:.0f} % of "
            f"the horizontal force, as {turned.speed:.1f} m/s would"
        )
    if clue is not None and (inverted or source == "GPS" or clue.turning >= MIN_TURNING):
        verdict = "inverted" if inverted else "upright" if clue.parity > PARITY else "undecided"
        reasons.append(
            f"GPS up to {clue.until:.0f} s: course rate against gyro {clue.parity:+.2f}, force "
            f"against acceleration {clue.fit:.2f}; accelerometer {verdict}"
        )
    return reasons
