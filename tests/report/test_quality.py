"""The tables that judge: numbers from closed forms or from the document, never from the table."""

from __future__ import annotations

import dataclasses
import re
from typing import Any

import numpy as np
import pytest

from vehnav.evaluation.outages import Outage
from vehnav.pipeline import Run
from vehnav.report import quality


def cells(markup: str) -> list[list[str]]:
    """The rows of a table as text."""
    rows = re.findall(r"<tr[^>]*>(.*?)</tr>", markup)
    return [re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row) for row in rows]


@pytest.mark.parametrize("sampling", ["rates", "increments"])
def test_sensor_noise_is_the_noise_that_was_put_in(city: Run, sampling: str) -> None:
    """White noise of known density: 0.3 °/√h and 0.06 m/s/√h; a bias that steps at each stop."""
    imu = city.log.imu
    assert imu is not None
    rng = np.random.default_rng(11)
    dt = 0.01
    t = (imu.t_ns - city.start_ns) * 1e-9
    gyro = rng.normal(scale=np.radians(0.3) / 60.0 / np.sqrt(dt), size=imu.gyro.shape)
    accel = rng.normal(scale=0.06 / 60.0 / np.sqrt(dt), size=imu.accel.shape)
    accel[:, 2] += 9.81
    steps = np.radians(100.0 / 3600.0) * np.array([(-1.0) ** k for k in range(len(city.stops))])
    for stop, step in zip(city.stops, steps, strict=True):
        gyro[(t >= stop.start) & (t <= stop.end), 1] += step
    if sampling == "increments":
        gyro, accel = gyro * dt, accel * dt
    known = dataclasses.replace(imu, gyro=gyro, accel=accel, sampling=sampling)
    run = dataclasses.replace(city, log=dataclasses.replace(city.log, imu=known))
    rows = cells(quality.sensor_table(run))
    n = sum(int(stop.duration) - 3 for stop in city.stops)  # differences of one-second means
    sigma = 1.0 / np.sqrt(2.0 * n) * np.sqrt(1.5)  # neighbours share a mean: 1.5 times the variance
    for axis in (1, 2, 3):
        assert float(rows[axis][1]) == pytest.approx(0.3, rel=4.0 * sigma)
        assert float(rows[axis][3]) == pytest.approx(0.06, rel=4.0 * sigma)
    expected = float(np.std(steps, ddof=1)) / np.radians(1.0 / 3600.0)
    assert float(rows[2][2]) == pytest.approx(expected, rel=0.05)
    assert float(rows[3][4]) == pytest.approx(9.81, abs=0.001)


def test_no_stop_no_sensor_table(city: Run) -> None:
    assert quality.sensor_table(dataclasses.replace(city, stops=[])) == ""


def test_tables_say_what_the_document_says(city: Run, city_document: dict[str, Any]) -> None:
    errors = city_document["errors"]
    drift = cells(quality.drift_table(city))
    first = errors["drift"]["by_time"][0]
    assert drift[1][0] == f"{first['after_s']:g} s"
    assert drift[1][1] == str(first["legs"])
    segments = cells(quality.segments_table(city))
    assert segments[1][0] == f"{errors['segments'][0]['length_m']:g} m"
    assert segments[1][2] == f"{errors['segments'][0]['percent']:.2f} %"
    honest = cells(quality.calibration_table(city))
    share = errors["calibration"]["inside"]["east"][1]
    assert honest[2][0] == "east"
    assert honest[2][2] == f"{100.0 * share:.0f} %"
    methods = cells(quality.methods_table(city))
    assert [row[0] for row in methods[1:]] == [
        "free (no correction)", "levelling only", "velocity reset only", "both, as published",
        "default",
    ]  # fmt: skip
    end = errors["methods"]["as_published"]["horizontal_m"]["end"]
    assert methods[4][4] == f"{end:.1f} m"


def test_an_outage_without_fixes_has_dashes(city: Run) -> None:
    assert city.errors is not None
    outages = (
        Outage(60.0, 30.0, 250.0, 30, 4.0, 12.5, 12.0, 5.0),
        Outage(200.0, 5.0, 0.0, 0, None, None, None, None),
    )
    run = dataclasses.replace(city, errors=dataclasses.replace(city.errors, outages=outages))
    rows = cells(quality.outages_table(run))
    assert rows[1] == ["60.0 s", "30.0 s", "250 m", "4.0 m", "12.5 m", "12.0 m", "5.0 %"]
    assert rows[2][3:] == ["–", "–", "–", "–"]
    assert quality.outages_table(city) == ""
