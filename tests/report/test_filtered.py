"""What a filter run says besides its track: constants that the simulator put in, innovations."""

from __future__ import annotations

from dataclasses import replace

import jsonschema
import numpy as np
import pytest

from vehnav.config import Config
from vehnav.pipeline import run
from vehnav.report.document import document
from vehnav.report.filtered import filter_lines, filter_tree
from vehnav.report.html import render_html
from vehnav.report.schema import schema
from vehnav.rotation import c_nb_from_angles
from vehnav.simulate import GnssModel, WheelModel, simulate

TOWN = "city,duration=240,seed=4,first_stop=30,stop_every=60"
SCALE, YAW, PITCH = 2.0, 1.5, -1.0
"""%, deg: the wheel reads too much; the sensor is turned in the vehicle."""


@pytest.fixture(scope="module")
def turned():
    """A drive whose sensor is mounted askew and whose wheel reads too much."""
    made = simulate(
        TOWN, sensor="mems-industrial", seed=3, rate_hz=50.0, gnss=GnssModel(),
        wheel=WheelModel(scale=0.01 * SCALE),
    )  # fmt: skip
    log = made.log()
    # a sensor turned to the right sees the vehicle travel left of its own forward axis
    turn = c_nb_from_angles(np.radians(YAW), np.radians(PITCH), 0.0)
    imu = replace(log.imu, gyro=log.imu.gyro @ turn, accel=log.imu.accel @ turn)
    log = replace(log, imu=imu, gnss=replace(log.gnss, sigma_pos=None))
    return run(log, Config(method="filter", axes="RFU", gps="aid", outage=("150:200",)))


def test_constants_of_the_vehicle_are_found(turned):
    """Within three of their sigmas, which are far below those of the start (4 deg, 3 %)."""
    found = filter_tree(turned)["estimates"]
    truth = {"odometer_scale": SCALE, "travel_right": -YAW, "travel_up": -PITCH}
    for key, value in truth.items():
        assert found[key]["value"] == pytest.approx(value, abs=3.0 * found[key]["sigma"])
        assert found[key]["sigma"] < 0.5


def test_document_fits_its_schema_and_says_what_was_used(turned):
    content = document(turned)
    jsonschema.validate(content, schema())
    assert content["filter"]["grade"] == "mems"
    assert content["filter"]["gps_sigma_m"] == turned.aided.fix_sigma
    assert content["filter"]["noise"]["gyro"] == turned.aided.tuning.noise.gyro > 0.0
    used = content["filter"]["innovations"]
    assert set(used) == {"zupt", "zaru", "nhc", "odometer", "gnss"}
    later = content["gps"]["fixes_used"] - 1  # the first one is where the drive starts
    assert used["gnss"]["used"] + used["gnss"]["rejected"] == 3 * later
    page = render_html(turned, content)
    assert "What the filter found" in page
    assert "odometer reads too much" in page
    text = "\n".join(filter_lines(turned))
    assert "m by innovations" in text
    assert "travel right of forward -1." in text


def test_without_a_filter_there_is_nothing_to_say():
    log = simulate("city,duration=100,first_stop=30", rate_hz=50.0).log()
    found = run(log, Config())
    assert filter_lines(found) == []
    assert document(found)["filter"] is None
    assert "What the filter found" not in render_html(found, document(found))


def test_what_nothing_shows_is_not_reported():
    """Without an odometer its scale is that of the start, a figure of nothing."""
    log = simulate("city,duration=100,first_stop=30", rate_hz=50.0).log()
    found = filter_tree(run(log, Config(method="filter", aid=("zupt", "zaru"))))["estimates"]
    assert "odometer_scale" not in found
    assert "travel_right" not in found
    assert "gyro_bias_up" in found
