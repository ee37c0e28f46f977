"""Sensor errors to navigation errors along a drive, and back (paper 001 and beyond).

:func:`sensitivity` integrates the linear error equations for unit sources once per drive;
:class:`Budget` puts a sensor into them.
"""

from __future__ import annotations

from vehnav.budget.drive import IdealDrive, drive_of_trajectory
from vehnav.budget.forward import Budget, Row, Validity
from vehnav.budget.linear import Procedure, Sensitivity, chosen_stops, sensitivity
from vehnav.budget.metrics import METRICS, cep, drms
from vehnav.budget.sources import Initial, Process, processes_of

__all__ = [
    "METRICS",
    "Budget",
    "IdealDrive",
    "Initial",
    "Procedure",
    "Process",
    "Row",
    "Sensitivity",
    "Validity",
    "cep",
    "chosen_stops",
    "drive_of_trajectory",
    "drms",
    "processes_of",
    "sensitivity",
]
