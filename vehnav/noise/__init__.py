"""A sensor from the rest in a log: what it shows (:mod:`rest`), and the file of it (:mod:`sensor`).

``rest_noise(log, config)`` gives the figures of every axis, ``estimate(noise)`` the sensor that
``--sensor`` takes, completed by the nearest grade of the catalogue.
"""

from __future__ import annotations

from vehnav.noise.rest import Instrument, RestNoise, rest_noise
from vehnav.noise.sensor import Estimate, estimate, write_sensor

__all__ = ["Estimate", "Instrument", "RestNoise", "estimate", "rest_noise", "write_sensor"]
