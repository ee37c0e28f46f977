"""Predicted against real error of every leg, on a simulated log and on two real ones."""

from __future__ import annotations

import numpy as np
import pytest

from vehnav.budget_legs import check_legs
from vehnav.config import Config
from vehnav.errors import ConfigError, LogError
from vehnav.library import read_log
from vehnav.pipeline import run
from vehnav.sensors import load_sensor
from vehnav.simulate import simulate


@pytest.mark.slow
def test_simulated_legs_hold_the_prediction_of_their_own_sensor():
    """Six drives with known errors: about 95 % inside, and the prediction is not far too wide."""
    inside, strain = [], []
    for seed in range(6):
        made = simulate("town,first_stop=40,idle=1,road=1", sensor="mems-tactical", seed=seed)
        check = check_legs(run(made.log()), load_sensor("mems-tactical"))
        inside += [leg.inside for leg in check.legs]
        strain += [leg.real / leg.predicted95 for leg in check.legs]
    assert len(inside) >= 40
    assert np.mean(inside) >= 0.9
    assert np.quantile(strain, 0.95) > 0.3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "axes", "least", "outside"),
    [
        ("boston_apan/driving.mcap", "FRD", 0.9, []),
        # its one leg of 264 s: the gyros drift under way as no rest of the log shows
        ("drive_0708/drive_0708.mcap", "BRU", 0.8, ["gyro_bias right"]),
    ],
)
def test_real_legs(shared_data, name, axes, least, outside):
    found = run(read_log(str(shared_data / name)), Config(axes=axes))
    check = check_legs(found, None)
    assert check.inside >= least
    lacking = [leg.lacks.rsplit(" ", 2)[0] for leg in check.legs if not leg.inside]
    assert lacking == outside
    driven = check.driven()
    assert len(driven) >= 3
    assert all(leg.predicted95 > 0.0 for leg in driven)
    # not so wide that it says nothing: the median real error is over a twentieth of it
    assert np.median([leg.real / leg.predicted95 for leg in driven]) > 0.05
    assert check.to_dict()["legs"][0]["real_m"] == check.legs[0].real


def test_what_legs_cannot_be_judged(sample_logs):
    log = read_log(str(sample_logs / "city.mcap"))
    found = run(log)
    check = check_legs(found, load_sensor("mems-industrial"))
    assert len(check.legs) + check.unjudged == len(found.stops) - 1
    assert check.sensor == "mems-industrial"
    assert check.inside >= 0.75
    from dataclasses import replace

    with pytest.raises(LogError, match="no GPS"):
        check_legs(replace(found, log=replace(log, gnss=None)), None)
    with pytest.raises(ConfigError, match="take --method stops"):
        check_legs(replace(found, config=Config(method="filter")), None)
