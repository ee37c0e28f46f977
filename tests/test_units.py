"""Unit factors against scipy.constants."""

from __future__ import annotations

import math

import pytest
from scipy import constants

from vehnav import units

WANTED = {
    "DEG": constants.degree,
    "DEG_PER_HOUR": constants.degree / constants.hour,
    "DEG_PER_SQRT_HOUR": constants.degree / math.sqrt(constants.hour),
    "M_S_PER_SQRT_HOUR": 1.0 / math.sqrt(constants.hour),
    "STANDARD_GRAVITY": constants.g,
    "MILLI_G": constants.milli * constants.g,
    "PPM": constants.micro,
    "MRAD": constants.milli,
    "NS": constants.nano,
}


@pytest.mark.parametrize(("name", "wanted"), WANTED.items())
def test_factor(name: str, wanted: float) -> None:
    assert getattr(units, name) == pytest.approx(wanted, rel=1e-15, abs=0.0)


def test_units_of_the_options() -> None:
    turn = {"rad/s": 2 * math.pi, "deg/s": 360.0, "deg/h": 360.0 * 3600.0, "mrad/s": 2000 * math.pi}
    assert set(turn) == set(units.GYRO_UNITS)
    for unit, rate in turn.items():  # one turn per second in every unit
        assert rate * units.GYRO_UNITS[unit] == pytest.approx(2 * math.pi, rel=1e-15, abs=0.0)
    one_g = {"m/s2": constants.g, "g": 1.0, "mg": 1000.0}
    assert set(one_g) == set(units.ACCEL_UNITS)
    for unit, force in one_g.items():
        assert force * units.ACCEL_UNITS[unit] == pytest.approx(constants.g, rel=1e-15, abs=0.0)
