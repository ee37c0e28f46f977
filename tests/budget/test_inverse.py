"""Requirements on the sensor: recomputed forward, by the law of squares, and by Monte Carlo."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from budget_drives import TOWN, drive

from vehnav.budget import Budget, Initial, Procedure, processes_of, sensitivity
from vehnav.budget.inverse import CLASSES, Requirement, solve, with_parameter
from vehnav.budget.montecarlo import monte_carlo
from vehnav.errors import ConfigError
from vehnav.sensors import load_sensor
from vehnav.units import DEG, DEG_PER_HOUR

NEED = Requirement(100.0, "cep95", 600.0)


@cache
def budget(grade="hg1700", *, stops=False):
    ideal, sensor = drive(TOWN), load_sensor(grade)
    procedure = Procedure(stops=ideal.stops if stops else (), levelled=True)
    found = sensitivity(ideal, procedure, processes=processes_of(sensor), at=(600.0,))
    return Budget(found, sensor, Initial(0.1 * DEG, 0.0, 0.0, 0.0))


def forward(solution, of):
    return replace(of, sensor=solution.sensor, initial=solution.initial)


@pytest.mark.parametrize("stops", [False, True])
@pytest.mark.parametrize("metric", ["cep95", "drms", "north"])
def test_equal_shares_meet_the_requirement(stops, metric):  # T20
    of = budget(stops=stops)
    need = Requirement(100.0, metric, 600.0)
    found = solve(of, need, "equal")
    again = forward(found, of)
    assert again.totals(600.0)[metric] == pytest.approx(100.0, rel=1e-6)
    assert found.achieved == pytest.approx(100.0, rel=1e-6)
    parts = again.by_parameter(600.0)
    assert set(parts) == set(CLASSES)
    np.testing.assert_allclose([np.trace(c) for c in parts.values()], np.trace(parts["arw"]))
    assert {a.parameter for a in found.allowed} == set(CLASSES)


def test_stops_allow_a_far_worse_sensor():  # spec B 5.3: 27 times the gyro bias
    alone, with_stops = (
        {a.parameter: a.value for a in solve(budget(stops=s), NEED, "equal").allowed}
        for s in (False, True)
    )
    assert with_stops["gyro_bias"] > 20.0 * alone["gyro_bias"]
    assert with_stops["accel_bias"] > 100.0 * alone["accel_bias"]


def test_the_whole_sensor_times_one_factor():
    of = budget(stops=True)
    found = solve(of, NEED, "scale")
    assert forward(found, of).totals(600.0)["cep95"] == pytest.approx(100.0, rel=1e-6)
    factors = [a.factor for a in found.allowed]
    assert np.ptp(factors) < 1e-12
    # the start stays as it is: in DRMS the law of squares, k^2 = (R^2 - fixed^2) / sensor^2
    need = Requirement(80.0, "drms", 600.0)
    parts = of.by_parameter(600.0)
    fixed = np.trace(parts["heading"])
    sensor = sum(np.trace(c) for name, c in parts.items() if name != "heading")
    expected = np.sqrt((80.0**2 - fixed) / sensor)
    assert solve(of, need, "scale").allowed[0].factor == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("parameter", ["gyro_bias", "arw", "heading", "g_sensitivity"])
def test_one_parameter_takes_what_the_others_leave(parameter):
    of = budget(stops=True)
    need = Requirement(100.0, "drms", 600.0)
    found = solve(of, need, parameter)
    assert forward(found, of).totals(600.0)["drms"] == pytest.approx(100.0, rel=1e-9)
    assert [a.parameter for a in found.allowed] == [parameter]


def test_a_gyro_bias_by_hand():
    of = budget(stops=True)
    found = solve(of, Requirement(100.0, "drms", 600.0), "gyro_bias").allowed[0]
    parts = of.by_parameter(600.0)
    own = np.trace(parts.pop("gyro_bias"))
    rest = sum(np.trace(c) for c in parts.values())
    assert found.given == pytest.approx(1.0)
    assert found.value == pytest.approx(np.sqrt((100.0**2 - rest) / own), rel=1e-9)
    other = with_parameter(of.sensor, "gyro_bias", found.value * DEG_PER_HOUR)
    assert other.accel == of.sensor.accel
    assert other.gyro.noise == of.sensor.gyro.noise


def test_infeasible_is_said():
    found = solve(budget(), NEED, "gyro_bias")  # the accelerometers alone make kilometres
    assert not found.feasible
    assert found.others > 1000.0
    assert "infeasible: the other sources alone make" in found.text
    assert found.allowed == ()


def test_unknown_and_idle_parameters_are_refused():
    with pytest.raises(ConfigError, match="expected equal, scale or one of gyro_bias"):
        solve(budget(), NEED, "gyro_bais")
    with pytest.raises(ConfigError, match="does nothing on this drive"):
        solve(budget(), NEED, "tilt")
    with pytest.raises(ConfigError, match="no errors to scale"):
        solve(budget("ideal"), NEED, "scale")


@pytest.mark.slow
@pytest.mark.parametrize("stops", [False, True])
def test_drawn_sensors_meet_the_requirement(stops):  # T20: 100 +- 12 m
    of = budget(stops=stops)
    found = solve(of, NEED, "equal")
    drawn = monte_carlo(
        drive(TOWN), found.sensor, found.initial, of.sensitivity.procedure, at=(600.0,),
        runs=200, seed=2,
    )  # fmt: skip
    assert drawn.totals(600.0)["cep95"] == pytest.approx(100.0, abs=12.0)
