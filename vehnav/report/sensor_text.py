"""A measured sensor as one screen and as one document (``vehnav sensor``)."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import Any, Final

from vehnav.allan import AxisFit, Figure
from vehnav.noise import Estimate, Instrument, RestNoise
from vehnav.noise.sensor import KEYS, WORDS, Part, two_digits
from vehnav.report.document import finding_rows
from vehnav.sensors import FIELDS, sensor_toml
from vehnav.sensors.grade import Field
from vehnav.sensors.likeness import Likeness
from vehnav.units import DEG, DEG_PER_HOUR, MILLI_G

NAMES: Final = {"gyro": "gyro", "accel": "accelerometer"}
WIDTH: Final = 100
"""Columns of the screen."""
ROWS: Final = ("noise", "bias instability", "random walk")
KINDS: Final = ("white", "bias", "walk")
SHAKEN: Final = 2.0
"""Times the scatter of the white noise that a sample shows where something shakes the sensor."""
FILTERED: Final = 0.7
"""The same of a sensor whose own filter takes noise out."""
FAR: Final = 3.0
"""Factor from which no grade is near."""


def screen(noise: RestNoise, found: Estimate) -> str:
    """What a person reads."""
    rate = 1.0 / noise.gyro.curve.dt
    count = len(noise.pieces)
    lines = [
        f"{noise.log.path}: {count} rest{'s' if count != 1 else ''}, {noise.total:.1f} s in all, "
        f"the longest {noise.longest:.1f} s, at {rate:.4g} Hz",
    ]
    for part in KEYS:
        lines += ["", *_block(part, noise, found)]
    lines.append("")
    for key, why in found.untold.items():
        lines.append(_item("not told", f"{WORDS[key]}: {why}"))
    lines += [_item("note", text) for text in notes(noise)]
    lines += [_item("looks like", text) for text in _likeness_lines(found.grades)]
    return "\n".join(lines)


def document(noise: RestNoise, found: Estimate) -> dict[str, Any]:
    """What a program reads; SI is left to the units of the sensor file."""
    parts: dict[str, Any] = {
        part: {
            "axes": {
                axis: _axis(part, fit)
                for axis, fit in zip("xyz", getattr(noise, part).fits, strict=True)
            },
            "sample_sigma": _in_unit(part, getattr(noise, part).sample_sigma.tolist()),
        }
        for part in KEYS
    }
    excess = noise.force_excess
    return {
        "file": noise.log.path,
        "rest": {
            "pieces": [{"start_s": a, "end_s": b} for a, b in noise.pieces.tolist()],
            "total_s": noise.total,
            "longest_s": noise.longest,
            "rate_hz": 1.0 / noise.gyro.curve.dt,
        },
        **parts,
        "gyro_bias_dph": (noise.gyro_bias / DEG_PER_HOUR).tolist(),
        "gyro_bias_sigma_dph": (noise.gyro_bias_sigma / DEG_PER_HOUR).tolist(),
        "accel_along_gravity_mg": None if excess is None else excess / MILLI_G,
        "told": {
            key: {"unit": FIELDS[key].unit, **_plain(figure, FIELDS[key])}
            for key, figure in found.told.items()
        },
        "untold": dict(found.untold),
        "grades": [
            {"name": g.name, "factor": g.factor, "ratios": dict(g.ratios)} for g in found.grades
        ],
        "sensor": {"name": found.sensor.name, "toml": sensor_toml(found.sensor)},
        "findings": finding_rows(noise.findings, noise.log.start_ns),
    }


def notes(noise: RestNoise) -> list[str]:
    """What else the rest shows."""
    out = []
    for part, unit, factor in (("gyro", "deg/s", DEG), ("accel", "m/s2", 1.0)):
        item: Instrument = getattr(noise, part)
        ratios = [
            sigma * math.sqrt(item.curve.dt) / fit.white.value if fit.white.value else 1.0
            for fit, sigma in zip(item.fits, item.sample_sigma.tolist(), strict=True)
        ]
        k = max(range(3), key=lambda axis: ratios[axis])
        size = f"{item.sample_sigma[k] / factor:.2g} {unit}"
        if ratios[k] > SHAKEN:
            out.append(
                f"samples of {NAMES[part]} {'xyz'[k]} scatter by {size}, {ratios[k]:.1f} times "
                f"what its noise gives: vibration, as of an idling engine; it is left out below "
                f"{item.fits[k].first_tau:.2g} s"
            )
        elif max(ratios) < FILTERED:
            out.append(
                f"samples of the {NAMES[part]} scatter by {size}, less than the noise gives: the "
                "sensor filters its output"
            )
    if noise.force_excess is not None and noise.gravity is not None:
        out.append(
            f"force at rest {noise.force_excess + noise.gravity:.4f} m/s2, gravity "
            f"{noise.gravity:.4f}: {noise.force_excess / MILLI_G:+.1f} mg as a bias along gravity, "
            f"or {100.0 * noise.force_excess / noise.gravity:+.2f} % of scale"
        )
    if noise.gravity is not None:
        out.append(
            f"Earth rate taken out; the heading is known by GPS in {noise.headings} of "
            f"{len(noise.pieces)} rests"
        )
    if noise.gyro.between is not None:
        out.append(
            f"beyond half of the longest rest the gyro figures rest on the mean rates of the "
            f"{len(noise.pieces)} rests, over {_minutes(noise)}"
        )
    return out


def _minutes(noise: RestNoise) -> str:
    span = float(noise.pieces[-1].mean() - noise.pieces[0].mean())
    return f"{span:.0f} s" if span < 600.0 else f"{span / 60.0:.0f} min"


# ---- rows --------------------------------------------------------------------------------------


def _item(name: str, text: str) -> str:
    indent = 11 * " "
    return textwrap.fill(
        text, WIDTH, initial_indent=f"{name:<11}", subsequent_indent=indent, break_on_hyphens=False
    )


def _block(part: Part, noise: RestNoise, found: Estimate) -> list[str]:
    """Title, and a row for each figure with its axes and what they have in common."""
    item: Instrument = getattr(noise, part)
    lines = [f"{NAMES[part]:<19}{'x':>16}{'y':>16}{'z':>16}{'all':>16}"]
    for row, kind, key in zip(ROWS, KINDS, KEYS[part], strict=True):
        place = FIELDS[key]
        cells = [figure_text(getattr(fit, kind), place.factor) for fit in item.fits]
        cells.append(figure_text(found.told.get(key, Figure()), place.factor))
        lines.append(_row(row, cells, place.unit))
        if kind == "bias" and any(fit.time is not None for fit in item.fits):
            times = ["-" if fit.time is None else f"{fit.time:.0f}" for fit in item.fits]
            lines.append(_row("  its time", [*times, ""], "s"))
    if part == "gyro":
        place = FIELDS["gyro_bias"]
        cells = [
            figure_text(Figure(b, s), place.factor)
            for b, s in zip(noise.gyro_bias.tolist(), noise.gyro_bias_sigma.tolist(), strict=True)
        ]
        both = figure_text(found.told.get("gyro_bias", Figure()), place.factor)
        lines.append(_row("bias in this log", [*cells, both], place.unit))
    return lines


def _power(value: float) -> int:
    """Power of ten of the first digit; 0 of nothing."""
    return math.floor(math.log10(abs(value))) if value else 0


def _row(name: str, cells: Sequence[str], unit: str) -> str:
    return f"  {name:<17}" + "".join(f"{cell:>16}" for cell in cells) + f"  {unit}"


def figure_text(figure: Figure, factor: float) -> str:
    """A figure in the unit of the field, as many digits as its uncertainty leaves.

    >>> figure_text(Figure(0.37123, 0.0039), 1.0), figure_text(Figure(limit=62.6), 1.0)
    ('0.371 ± 0.004', '< 63')
    >>> figure_text(Figure(), 1.0), figure_text(Figure(835.9, 120.0), 1.0)
    ('-', '840 ± 120')
    """
    if figure.value is not None and figure.sigma is not None:
        value, sigma = figure.value / factor, figure.sigma / factor
        if sigma <= 0.0:
            return f"{value:.4g}"
        power = math.floor(math.log10(sigma))
        lead = sigma / 10.0**power
        digits = min(-power + (1 if lead < 1.95 else 0), 3 - _power(value))
        shown = [round(value, digits), max(round(sigma, digits), 10.0**-digits)]
        return " ± ".join(f"{x:.{max(digits, 0)}f}" for x in shown)
    if figure.limit is not None:
        return f"< {two_digits(figure.limit / factor)}"
    return "-"


def _likeness_lines(grades: Sequence[Likeness]) -> list[str]:
    near, following = grades[0], grades[1:2]
    ratios = ", ".join(f"{WORDS[key]} {times_text(ratio)}" for key, ratio in near.ratios.items())
    first = (
        f"{near.name}: {ratios}"
        if near.factor < FAR
        else f"no grade of the catalogue; {near.name} is the nearest: {ratios}"
    )
    rest = [f"next {g.name}, {g.factor:.1f} times away on average" for g in following]
    return ["; ".join([f"{first}; {near.factor:.1f} times away on average", *rest])]


def times_text(ratio: float) -> str:
    """A ratio in words.

    >>> times_text(1.02), times_text(0.0831), times_text(123.0)
    ('1.0 times', '0.083 times', '120 times')
    """
    return f"{ratio:.1f} times" if 0.95 <= ratio < 9.95 else f"{float(f'{ratio:.2g}'):g} times"


# ---- the document ------------------------------------------------------------------------------


def _axis(part: Part, fit: AxisFit) -> dict[str, Any]:
    figures = {
        key: _plain(getattr(fit, kind), FIELDS[key])
        for key, kind in zip(KEYS[part], KINDS, strict=True)
    }
    return {
        **figures,
        "bias_time_s": fit.time,
        "still_growing": fit.still_growing,
        "first_tau_s": fit.first_tau,
        "reach_s": fit.reach,
        "chi_square": fit.chi_square,
        "freedom": fit.freedom,
    }


def _plain(figure: Figure, place: Field) -> dict[str, float | None]:
    row = {"value": figure.value, "sigma": figure.sigma, "limit": figure.limit}
    return {key: None if x is None else x / place.factor for key, x in row.items()}


def _in_unit(part: Part, values: Sequence[float]) -> dict[str, Any]:
    if part == "gyro":
        return {"unit": "deg/s", "xyz": [v / DEG for v in values]}
    return {"unit": "m/s2", "xyz": list(values)}
