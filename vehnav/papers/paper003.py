"""Paper 003 (free azimuth, quasi-coordinates): navigation over the pole, its filter, its forms.

The paper prints no figure. Its claims are that things are regular, exact or the same everywhere:
each is measured here, with a bar where "accurate" has to mean something.
"""

from __future__ import annotations

from functools import partial

import numpy as np
import numpy.typing as npt

from vehnav.aiding.blocks import ROW
from vehnav.aiding.gnss_forms import Form
from vehnav.earth import WGS84, ecef_from_geodetic
from vehnav.papers.claims import Row, about, at_least, at_most, between
from vehnav.papers.displaced import displace
from vehnav.papers.drawn_runs import Judged, Way, draw_run
from vehnav.parallel import by_threads
from vehnav.rotation import angles_from_c_nb
from vehnav.strapdown.enu import mechanize_enu
from vehnav.strapdown.quasi import (
    geocentric_latitude_approximation,
    gyro_heading,
    quasi_approximation,
    quasi_from_geodetic,
    quasi_heading,
    wander_along,
)
from vehnav.strapdown.wander import WanderSolution, c_we_from_geodetic, mechanize_wander
from vehnav.units import DEG

Array = npt.NDArray[np.float64]

REGULAR = 1e-5
"""m after a crossing of the pole: rounding of some ten thousand steps."""
FAILS = 50.0
"""m from which a mechanization has failed at a pole."""
ACCURATE = 100.0
"""times smaller than what it corrects: what an approximation "of high accuracy" must be."""
SAME = 1e-9
"""m/s: what is the same in a measurement model."""
HONEST = 3.0
"""Standard deviations of the mean of a chi-square of 13 degrees of freedom over the runs."""
STATES = 13


def rows(*, fast: bool = False) -> list[Row]:
    """The claims of paper 003; ``fast`` takes shorter ways and fewer runs."""
    duration, runs = (100.0, 16) if fast else (600.0, 40)
    return [
        *_crossing(200.0 if fast else 600.0),
        _azimuth_law(),
        *_approximations(),
        *_filter(duration, runs),
        _log_model(),
    ]


# ---- mechanization -----------------------------------------------------------------------------


def _crossing(duration: float) -> list[Row]:
    """(22)-(25) past the pole, and the headings there."""
    way = Way.of(f"polar,miss=1,v=30,duration={duration:g}", rate=100.0)
    truth, increments = way.truth, way.increments()
    place = float(truth.lat[0]), float(truth.lon[0]), float(truth.height[0])
    v_e, v_n, v_up = (float(x) for x in truth.v_n[0])
    free = mechanize_wander(
        increments, c_we=c_we_from_geodetic(*place[:2]), height=place[2], v_w=(v_e, v_n, v_up),
        c_wb=truth.c_nb[0],
    )  # fmt: skip
    enu = mechanize_enu(increments, position=place, v_n=(v_e, v_n, v_up), c_nb=truth.c_nb[0])
    true = ecef_from_geodetic(truth.lat, truth.lon, truth.height)
    solution = free.enu()
    off = _largest(solution.position, true)
    off_enu = _largest(enu.position, true)
    how = f"30 m/s, closest approach 1 m after {duration / 2:g} s, perfect sensors, 0.01 s"
    return [
        Row(
            "003",
            "pole",
            "the equations in axes free in azimuth are regular in every region (22)-(25)",
            how,
            f"{_under(off)} m off at most",
            at_most(off, REGULAR, same_size=np.inf),
            f"bar {REGULAR:g} m",
            {"error_m": off},
        ),
        Row(
            "003",
            "pole-enu",
            "in geographic axes they are not",
            how,
            f"{off_enu:.0f} m off with east, north, up and latitude, longitude",
            at_least(off_enu, FAILS),
            f"bar {FAILS:g} m; an exact hit of the pole would be harmless, a miss of 1 km too",
            {"error_m": off_enu},
        ),
        _headings(free, how),
    ]


def _under(x: float) -> str:
    """What is left by rounding differs between machines: the next power of ten.

    >>> _under(1.8e-9)
    'under 1e-08'
    """
    return f"under {10.0 ** np.ceil(np.log10(max(x, 1e-300))):.0e}"


def _largest(position: Array, true: Array) -> float:
    """Largest distance, m, of positions (n, 3) from the Earth-fixed truth."""
    r_e = ecef_from_geodetic(*position.T)
    return float(np.linalg.norm(r_e - true, axis=1).max())


def _headings(free: WanderSolution, how: str) -> Row:
    """Largest change of heading and quasi-heading over 0.1 s."""
    every = slice(None, None, 10)
    heading, _, _ = angles_from_c_nb(free.enu().c_nb[every])
    quasi = quasi_heading(free.c_we[every], free.c_wb[every])
    gyro = gyro_heading(free.c_wb[every])
    steps = [float(np.abs(np.diff(np.unwrap(x))).max()) / DEG for x in (heading, quasi, gyro)]
    return Row(
        "003",
        "heading",
        "quasi-heading (17) and gyro heading have no singular place near the pole",
        how,
        f"largest step over 0.1 s on a straight way: heading {steps[0]:.0f} deg, quasi-heading "
        f"{_under(steps[1])} deg, gyro heading {_under(steps[2])} deg",
        at_most(max(steps[1:]), 1e-3, same_size=np.inf),
        "bar 0.001 deg",
        dict(zip(("heading_deg", "quasi_deg", "gyro_deg"), steps, strict=True)),
    )


def _azimuth_law() -> Row:
    """(4) and (5) on the parallel of 55 degrees, where they have a closed form."""
    lat, speed, t = 55.0 * DEG, 30.0, np.arange(0.0, 600.05, 0.1)
    radius = WGS84.a / np.sqrt(1.0 - WGS84.e2 * np.sin(lat) ** 2)
    lon = speed * t / (radius * np.cos(lat))
    apart = 0.0
    for azimuth, rate in (("relative", 0.0), ("absolute", WGS84.omega_ie)):
        law = -(speed / radius * np.tan(lat) + rate * np.sin(lat)) * t
        way = wander_along(t, np.full(t.size, lat), lon, azimuth=azimuth)  # type: ignore[arg-type]
        apart = max(apart, float(np.abs(way - law).max()))
    return Row(
        "003",
        "azimuth",
        "the azimuth angle follows (4), relative-free, or (5), absolute-free",
        "600 s east on the parallel of 55 deg at 30 m/s",
        f"{_under(apart)} rad from the closed forms (-0.00402 and -0.03986 rad at the end)",
        at_most(apart, 1e-8, same_size=np.inf),
        "bar 1e-8 rad",
        {"apart_rad": apart},
    )


# ---- approximations ----------------------------------------------------------------------------


def _approximations() -> list[Row]:
    """(13) and (14) against the exact path (9)-(12)."""
    lat = np.linspace(0.0, 90.0, 9001) * DEG
    _, _, r = quasi_from_geodetic(lat, 0.0, 0.0)
    exact = np.arctan2((1.0 - WGS84.e2) * np.sin(lat), np.cos(lat))
    off = r * np.abs(geocentric_latitude_approximation(lat) - exact)
    corrected = float((r * np.abs(lat - exact)).max())
    worst = int(np.argmax(off))
    everywhere, polar = _quasi_error(-80.0, 80.0), _quasi_error(89.0, 90.0)
    assumed = "the coefficient e^2/2, which the text has lost"
    return [
        Row(
            "003",
            "geocentric",
            "(13) gives the geocentric latitude with high accuracy",
            assumed,
            f"{off[worst]:.1f} m off at {lat[worst] / DEG:.1f} deg, of {corrected / 1000.0:.1f} km "
            "that it corrects",
            at_least(corrected / float(off[worst]), ACCURATE),
            f"bar: {ACCURATE:g} times smaller; vehnav takes the exact path, which costs no more",
            {"error_m": float(off[worst]), "corrected_m": corrected},
        ),
        Row(
            "003",
            "quasi",
            "(14) gives quasi-coordinates from the direction cosines with high accuracy",
            assumed,
            f"{everywhere:.0f} m off between 80 S and 80 N, {polar:.1f} m within 1 deg of a pole",
            at_least(corrected / everywhere, ACCURATE),
            f"bar: {ACCURATE:g} times smaller than the {corrected / 1000.0:.1f} km between "
            "geodetic and geocentric; regular in every region, as said",
            {"error_m": everywhere, "polar_m": polar},
        ),
    ]


def _quasi_error(low: float, high: float) -> float:
    """Largest error of (14), m, between two latitudes, 10 degrees and more from the quasi-poles."""
    lat, lon = np.meshgrid(np.linspace(low, high, 161) * DEG, np.linspace(-180.0, 180.0, 181) * DEG)
    found = quasi_approximation(c_we_from_geodetic(lat, lon))
    true = quasi_from_geodetic(lat, lon, 0.0)
    d_lon = np.remainder(found[1] - true[1] + np.pi, 2.0 * np.pi) - np.pi
    off = true[2] * np.hypot(found[0] - true[0], np.cos(true[0]) * d_lon)
    return float(off[np.abs(true[0]) < 80.0 * DEG].max())


# ---- filter ------------------------------------------------------------------------------------


def _filter(duration: float, runs: int) -> list[Row]:
    """13 states with fixes: at 55 degrees, and over the pole in the forms of the paper."""
    slack = HONEST * float(np.sqrt(2.0 * STATES / runs))
    how = f"HG1700, a fix a second (1.5 m, 0.05 m/s), {runs} runs of {duration:g} s"
    town = Way.of(f"town,duration={duration:g},first_stop=15")
    pole = Way.of(f"polar,miss=1,v=30,duration={duration:g}")
    south = _drawn(town, "normal", runs)
    mean = _mean(south, slice(None))
    over = {form: _drawn(pole, form, runs) for form in ("normal", "quasi")}
    t = over["quasi"][0].t
    near = np.abs(t - 0.5 * duration) < 5.0
    nees = {form: _mean(found, near) for form, found in over.items()}
    most = {form: max(float(run.horizontal[t > 0.25 * duration].max()) for run in found)
            for form, found in over.items()}  # fmt: skip
    bar = f"bar {STATES} +- {slack:.1f}: 3 standard deviations of {runs} runs"
    return [
        Row(
            "003",
            "filter",
            "13 states describe the errors: position, velocity, attitude, biases (26)-(28)",
            f"55 deg, town, forms (29)-(31); {how}",
            f"squared errors over their variances: mean {mean:.1f} of 13",
            between(mean, STATES - slack, STATES + slack),
            f"{bar}; the full equations (27), no terms dropped",
            {"nees": mean},
        ),
        Row(
            "003",
            "filter-quasi",
            "the corrections in quasi-coordinates (32)-(35) hold in the polar regions",
            f"over the pole at 30 m/s, closest approach 1 m; {how}",
            f"within 5 s of the pole: mean {nees['quasi']:.1f} of 13; at most "
            f"{most['quasi']:.1f} m off",
            between(nees["quasi"], STATES - slack, STATES + slack),
            bar,
            {"nees": nees["quasi"], "max_m": most["quasi"]},
        ),
        Row(
            "003",
            "filter-normal",
            "the traditional corrections (29)-(31) do not",
            "the same runs",
            f"within 5 s of the pole: mean {about(nees['normal'])} of 13; at most "
            f"{most['normal']:.0f} m off",
            at_least(nees["normal"], 10.0 * STATES),
            "bar: ten times 13; `vehnav run` compares Earth-fixed vectors, regular everywhere",
            {"nees": nees["normal"], "max_m": most["normal"]},
        ),
    ]


def _drawn(way: Way, form: Form, runs: int) -> list[Judged]:
    return by_threads(partial(draw_run, way, form), range(runs))


def _mean(found: list[Judged], looks: slice | npt.NDArray[np.bool_]) -> float:
    return float(np.mean([run.nees[looks] for run in found]))


def _log_model() -> Row:
    """(36), (37): the velocity along the body does not change with the azimuth error."""
    row = np.zeros(ROW)
    row[:9] = c_we_from_geodetic(89.99 * DEG, 0.3, 0.4).ravel()
    row[10:13] = 12.0, -9.0, 0.2
    row[13:] = np.linalg.qr(np.arange(9.0).reshape(3, 3) + np.eye(3))[0].ravel()
    seen = _along_body(row)
    wrong = row.copy()
    x = np.zeros(9)
    x[8] = 1e-3
    displace(wrong, -x, WGS84)  # the azimuth error, the dynamic velocity error held
    change = np.abs(_along_body(wrong) - seen).max()
    total = float(np.abs(wrong[10:13] - row[10:13]).max())
    return Row(
        "003",
        "log",
        "the model of the log (36), (37) holds in any region: it knows no azimuth and no error of "
        "it",
        "1e-3 rad of azimuth error at 15 m/s",
        f"{_under(float(change))} m/s in what the log sees, {1000.0 * total:.0f} mm/s in the "
        "velocity itself",
        at_most(float(change), SAME, same_size=np.inf),
        f"bar {SAME:g} m/s",
        {"change_m_s": float(change), "velocity_m_s": total},
    )


def _along_body(row: Array) -> Array:
    """Velocity of a navigation row (22,) in body axes, m/s."""
    return np.asarray(row[13:].reshape(3, 3).T @ row[10:13])
