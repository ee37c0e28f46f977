"""What a filter method found besides the track: constants of sensors and vehicle, innovations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from vehnav.aiding import vehicle
from vehnav.aiding.error_model import NAVIGATION
from vehnav.aiding.fix_noise import FLOOR
from vehnav.aiding.land import LandResult
from vehnav.pipeline import Run
from vehnav.report.markup import esc, table
from vehnav.units import DEG, DEG_PER_HOUR

PERCENT: Final = 0.01


@dataclass(frozen=True)
class Quantity:
    """A parameter of the filter in the words and units of a person.

    Attributes
    ----------
    state : int
        Of the filter (:mod:`vehnav.aiding.vehicle`).
    key, name, unit : str
    scale : float
        SI of one unit.
    aid : str
        Without which it is not seen at all: a key of the innovations; "": any.
    """

    state: int
    key: str
    name: str
    unit: str
    scale: float
    aid: str = ""


QUANTITIES: Final = (
    Quantity(12, "gyro_bias_right", "gyro bias, right", "deg/h", DEG_PER_HOUR),
    Quantity(13, "gyro_bias_forward", "gyro bias, forward", "deg/h", DEG_PER_HOUR),
    Quantity(14, "gyro_bias_up", "gyro bias, up", "deg/h", DEG_PER_HOUR),
    Quantity(9, "accel_bias_right", "accelerometer bias, right", "m/s2", 1.0),
    Quantity(10, "accel_bias_forward", "accelerometer bias, forward", "m/s2", 1.0),
    Quantity(11, "accel_bias_up", "accelerometer bias, up", "m/s2", 1.0),
    Quantity(vehicle.GYRO_SCALE, "gyro_scale_up", "gyro scale error, up", "%", PERCENT),
    Quantity(
        vehicle.ACCEL_SCALE, "accel_scale_forward", "accelerometer scale error, forward", "%",
        PERCENT,
    ),
    Quantity(vehicle.CUT, "vibration_lost", "share of lopsided vibration lost", "%", -PERCENT),
    Quantity(vehicle.MOUNT_YAW, "travel_right", "travel right of forward", "deg", DEG, "nhc"),
    Quantity(vehicle.MOUNT_PITCH, "travel_up", "travel above forward", "deg", DEG, "nhc"),
    Quantity(vehicle.LEVER, "lever", "sensor before the rear axle", "m", 1.0, "nhc"),
    Quantity(vehicle.SLIP, "slip", "tyre slip, of speed squared and turning", "s2/m", 1.0, "nhc"),
    Quantity(vehicle.SQUAT, "squat", "nose up per forward force", "deg/(m/s2)", -DEG, "nhc"),
    Quantity(vehicle.ODO_SCALE, "odometer_scale", "odometer reads too much", "%", PERCENT,
             "odometer"),
)  # fmt: skip
"""In the order of the page."""
OF_THE_SCREEN: Final = ("travel_right", "travel_up", "lever", "odometer_scale")


def estimates(found: LandResult) -> dict[str, tuple[Quantity, float, float]]:
    """Key: (quantity, value, sigma) at the end of the drive, in its unit; only what is seen."""
    rows = {}
    for quantity in QUANTITIES:
        if quantity.aid and quantity.aid not in found.innovations:
            continue
        k = quantity.state - NAVIGATION
        value = float(found.parameters[k]) / quantity.scale
        rows[quantity.key] = quantity, value, float(found.parameter_sigmas[k] / abs(quantity.scale))
    return rows


def filter_tree(run: Run) -> dict[str, Any] | None:
    """``filter`` of the document: noise in force (SI), innovations, what was found."""
    found = run.aided
    if found is None:
        return None
    return {
        "grade": found.tuning.name,
        "reason": found.tuning.reason,
        "noise": found.tuning.noise._asdict(),
        "gps_sigma_m": found.fix_sigma,
        "innovations": {
            name.replace(" ", "_"): {
                "used": row.used,
                "inflated": row.inflated,
                "rejected": row.rejected,
                "mean_nis": row.mean_nis,
            }
            for name, row in found.innovations.items()
        },
        "estimates": {
            key: {"value": value, "sigma": sigma, "unit": quantity.unit}
            for key, (quantity, value, sigma) in estimates(found).items()
        },
    }


def filter_lines(run: Run) -> list[str]:
    """For the screen: noise in force, and what was found of the mounting."""
    found = run.aided
    if found is None:
        return []
    rows = estimates(found)
    shown = [
        f"{quantity.name} {_figures(value, sigma)} {quantity.unit}"
        for quantity, value, sigma in (rows[key] for key in OF_THE_SCREEN if key in rows)
    ]
    fixes = "" if found.fix_sigma is None else f"; fixes {found.fix_sigma:.1f} m by innovations"
    if found.fix_sigma == FLOOR:
        fixes = f"; fixes {FLOOR:g} m, the least that is assumed"
    lines = [f"filter     noise of {found.tuning.name} grade ({found.tuning.reason}){fixes}"]
    return lines + [f"           {'; '.join(shown)}"] * bool(shown)


def filter_table(run: Run) -> str:
    """What was found, with its sigma."""
    if run.aided is None:
        return ""
    rows = [
        [esc(quantity.name), _figures(value, sigma), esc(quantity.unit)]
        for quantity, value, sigma in estimates(run.aided).values()
    ]
    return table(["at the end of the drive", "found ± sigma", "unit"], rows, name="Estimates",
                 left=(0, 2))  # fmt: skip


def innovations_table(run: Run) -> str:
    """How each kind of measurement fared."""
    if run.aided is None:
        return ""
    rows = [
        [esc(name), str(row.used), str(row.inflated), str(row.rejected), f"{row.mean_nis:.2f}"]
        for name, row in run.aided.innovations.items()
    ]
    head = ["measurement", "used", "weighed down", "rejected", "mean NIS"]
    return table(head, rows, name="Innovations")


def _figures(value: float, sigma: float) -> str:
    """Both with two digits of sigma, at most four after the point.

    >>> _figures(1.2345, 0.056), _figures(-310.2, 41.0)
    ('+1.234 ± 0.056', '-310 ± 41')
    """
    digits = 0
    while digits < 4 and sigma * 10.0**digits < 9.5:
        digits += 1
    return f"{value:+.{digits}f} ± {sigma:.{digits}f}"
