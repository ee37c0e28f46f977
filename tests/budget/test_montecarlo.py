"""Linear budget against the nonlinear mechanization with drawn errors, on frozen drives.

The bar is 10 %: 200 runs have a sampling error of 4 to 5 % (spec B 7), the linear equations 2 %.
The quick versions take 40 runs, so three times sqrt(5) less sure.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from budget_drives import TOWN, drive

from vehnav.budget import Budget, Initial, Procedure, processes_of, sensitivity
from vehnav.budget.montecarlo import _Experiment, monte_carlo, stop_control
from vehnav.earth import position_difference
from vehnav.sensors import Triad, load_sensor
from vehnav.units import MILLI_G

START = Initial(velocity=0.0, position=0.0)


def both(grade, *, stops, runs, levelled=False, gyro_from_stops=False):
    ideal, sensor = drive(TOWN), load_sensor(grade)
    procedure = Procedure(
        stops=ideal.stops if stops else (), levelled=levelled, gyro_from_stops=gyro_from_stops
    )
    found = sensitivity(ideal, procedure, processes=processes_of(sensor), at=(600.0,))
    linear = Budget(found, sensor, START).totals(600.0)
    drawn = monte_carlo(ideal, sensor, START, procedure, at=(600.0,), runs=runs, seed=1)
    return linear, drawn.totals(600.0)


@pytest.mark.slow
@pytest.mark.parametrize("grade", ["hg1700", "mems-tactical"])
@pytest.mark.parametrize("stops", [False, True])
def test_linear_and_drawn_agree(grade, stops):  # T18, T19
    linear, drawn = both(grade, stops=stops, runs=200)
    assert linear["drms"] == pytest.approx(drawn["drms"], rel=0.10)
    assert linear["cep50"] == pytest.approx(drawn["cep50"], rel=0.15)
    assert linear["cep95"] == pytest.approx(drawn["cep95"], rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("grade", ["mems-tactical", "mems-industrial"])
def test_levelled_start_and_gyro_bias_from_the_stops(grade):
    linear, drawn = both(grade, stops=True, runs=200, levelled=True, gyro_from_stops=True)
    assert linear["drms"] == pytest.approx(drawn["drms"], rel=0.10)


def test_a_quick_look_at_the_same():
    linear, drawn = both("hg1700", stops=True, runs=30)
    assert linear["drms"] == pytest.approx(drawn["drms"], rel=0.3)
    assert linear["drms"] < 0.05 * both("hg1700", stops=False, runs=1)[0]["drms"]


def test_runs_do_not_depend_on_their_number():
    ideal, sensor = drive(TOWN, 75.0), load_sensor("mems-tactical")
    few, more = (
        monte_carlo(ideal, sensor, START, Procedure(), at=(30.0, 75.0), runs=runs, seed=5).errors
        for runs in (2, 3)
    )
    np.testing.assert_array_equal(few, more[:2])
    assert not np.array_equal(more[0], more[2])


def test_an_ideal_sensor_makes_no_error():
    ideal = drive(TOWN, 150.0)
    none = Initial(0.0, 0.0, 0.0, 0.0)
    found = monte_carlo(
        ideal, load_sensor("ideal"), none, Procedure(stops=ideal.stops), at=(150.0,), runs=1
    )
    assert np.abs(found.errors).max() < 1e-6


def test_a_levelled_start_balances_the_accelerometers():
    ideal = drive("static", 60.0)
    sensor = replace(load_sensor("ideal"), accel=Triad(bias=MILLI_G))
    none = Initial(0.0, 0.0, 0.0, 0.0)
    size = {
        levelled: monte_carlo(
            ideal, sensor, none, Procedure(levelled=levelled), at=(60.0,), runs=3
        ).totals(60.0)["drms"]
        for levelled in (False, True)
    }
    assert size[True] < 0.01 * size[False]


def test_the_ideal_algorithm_keeps_to_the_drive():
    """With the gyro bias of perfect gyros taken from the stops, which is none."""
    ideal = drive(TOWN, 150.0).thinned(0.02)
    procedure = Procedure(stops=ideal.stops, gyro_from_stops=True)
    index = np.array([ideal.t.size - 1])
    found = _Experiment(ideal, load_sensor("ideal"), START, procedure, index, False).positions(None)
    off = position_difference(found[0, 0], found[0, 1], ideal.lat[-1], ideal.lon[-1])
    assert np.hypot(*off) < 0.5


def test_levels_settle_at_the_end_of_every_stop():
    ideal = drive(TOWN, 150.0)
    control = stop_control(ideal, Procedure(stops=ideal.stops, window=3.0))
    assert control.count == 2
    working = np.flatnonzero(control.gain)
    assert ideal.t[working[0]] == pytest.approx(ideal.stops[0][1] - 3.0, abs=0.011)
    assert np.all(control.gain * np.diff(ideal.t) < 1.0)


def test_summed_steps_keep_the_sums():
    ideal = drive(TOWN, 75.0)
    thin = ideal.thinned(0.05)
    assert thin.increments.dt.max() == pytest.approx(0.05)
    for name in ("dtheta", "dvel"):
        fine, coarse = (getattr(d.increments, name).sum(axis=0) for d in (ideal, thin))
        np.testing.assert_allclose(coarse, fine, rtol=1e-12)
    assert thin.t[-1] == ideal.t[-1]


def test_no_runs_are_refused():
    with pytest.raises(ValueError, match="at least 1"):
        monte_carlo(drive(TOWN, 75.0), load_sensor("hg1700"), START, Procedure(), at=(1.0,), runs=0)
