"""The grades that vehnav knows: one set of figures for the whole program, each with its source."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from vehnav.sensors.grade import Sensor, assemble

_SHEET = "Honeywell data sheet, as quoted by the NavToolkit hg1700_model"
_ST_GYRO = "STMicroelectronics data sheet of the L3G4200D, +-250 deg/s range"
_ST_ACCEL = "STMicroelectronics data sheet of the LSM303DLH, +-2 g range"
_GRADE = "order of the grade, assumed; the figures of our error-budget tables"
_PHONE = "order of the data sheets of phone and hobby IMUs (BMI160, MPU-6050), assumed"
_ASSUMED = "assumed; not in a data sheet"

_GRADES: Final[Mapping[str, Mapping[str, tuple[float, str]]]] = {
    "ideal": {},
    "hg1700": {
        "gyro_bias": (1.0, _SHEET),
        "arw": (0.125, _SHEET),
        "accel_bias": (1.0, _SHEET),
        "vrw": (0.02, "0.065 ft/s/sqrt(h) rounded; " + _SHEET),
        "gyro_sf": (150.0, "Honeywell brochure of the HG1700"),
        "accel_sf": (300.0, "Honeywell brochure of the HG1700"),
        "gyro_misalignment": (0.1, _ASSUMED),
        "accel_misalignment": (0.1, _ASSUMED),
        "gyro_range": (1000.0, "Honeywell brochure of the HG1700"),
        "accel_range": (37.0, "Honeywell brochure of the HG1700"),
    },
    "l3g4200d": {
        "gyro_bias": (36000.0, "zero-rate level +-10 deg/s; " + _ST_GYRO),
        "gyro_bias_instability": (36.0, _ASSUMED),
        "arw": (1.8, "0.03 deg/s/sqrt(Hz), the figure of paper 004; " + _ST_GYRO),
        "gyro_sf": (10000.0, _ASSUMED),
        "gyro_misalignment": (10.0, _ASSUMED),
        "gyro_quantisation": (0.00875, "8.75 mdps per digit; " + _ST_GYRO),
        "gyro_range": (250.0, _ST_GYRO),
        "accel_bias": (20.0, "zero-g level +-20 mg; " + _ST_ACCEL),
        "accel_bias_instability": (0.1, _ASSUMED),
        "vrw": (0.12827, "218 ug/sqrt(Hz), the figure of paper 004; " + _ST_ACCEL),
        "accel_sf": (10000.0, _ASSUMED),
        "accel_misalignment": (10.0, _ASSUMED),
        "accel_quantisation": (1.0, "1 mg per digit; " + _ST_ACCEL),
        "accel_range": (2.0, _ST_ACCEL),
    },
    "mems-tactical": {
        "gyro_bias": (10.0, _GRADE),
        "arw": (0.25, _GRADE),
        "gyro_sf": (1000.0, _GRADE),
        "gyro_misalignment": (0.5, _GRADE),
        "accel_bias": (2.0, _GRADE),
        "vrw": (0.05, _GRADE),
        "accel_sf": (1000.0, _GRADE),
        "accel_misalignment": (0.5, _GRADE),
    },
    "mems-industrial": {
        "gyro_bias": (200.0, _GRADE),
        "arw": (0.5, _GRADE),
        "gyro_sf": (3000.0, _GRADE),
        "gyro_misalignment": (1.0, _GRADE),
        "accel_bias": (5.0, _GRADE),
        "vrw": (0.1, _GRADE),
        "accel_sf": (3000.0, _GRADE),
        "accel_misalignment": (1.0, _GRADE),
    },
    "mems-consumer": {
        "gyro_bias": (3600.0, _PHONE),
        "gyro_bias_instability": (15.0, _PHONE),
        "arw": (0.6, _PHONE),
        "gyro_sf": (10000.0, _PHONE),
        "gyro_misalignment": (5.0, _PHONE),
        "g_sensitivity": (0.05, _PHONE),
        "gyro_quantisation": (0.0076294, "250 deg/s over 15 bits and sign"),
        "gyro_range": (250.0, _PHONE),
        "accel_bias": (20.0, _PHONE),
        "accel_bias_instability": (0.1, _PHONE),
        "vrw": (0.12, _PHONE),
        "accel_sf": (5000.0, _PHONE),
        "accel_misalignment": (5.0, _PHONE),
        "accel_quantisation": (0.12207, "4 g over 15 bits and sign"),
        "accel_range": (4.0, _PHONE),
    },
}

CATALOGUE: Final[Mapping[str, Sensor]] = MappingProxyType(
    {name: assemble(Sensor(name), name, figures) for name, figures in _GRADES.items()}
)
"""Name -> grade. ``ideal`` has no errors at all."""
