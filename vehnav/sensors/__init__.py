"""Sensor grades: one set of figures for the whole program, their TOML files, and their errors.

Every figure is one standard deviation. Inside, SI and radians; in files the units of the trade
(:data:`FIELDS`). Constant errors are drawn once per run by :func:`draw_errors`; :func:`corrupt`
applies them, with the random processes, to an ideal record of rates or of increments.
"""

from __future__ import annotations

from vehnav.sensors.catalogue import CATALOGUE
from vehnav.sensors.corrupt import Measured, Sampling, corrupt
from vehnav.sensors.draw import SensorErrors, draw_errors, no_errors, run_rngs
from vehnav.sensors.files import load_sensor, sensor_toml
from vehnav.sensors.grade import FIELDS, Sensor, Triad

__all__ = [
    "CATALOGUE",
    "FIELDS",
    "Measured",
    "Sampling",
    "Sensor",
    "SensorErrors",
    "Triad",
    "corrupt",
    "draw_errors",
    "load_sensor",
    "no_errors",
    "run_rngs",
    "sensor_toml",
]
