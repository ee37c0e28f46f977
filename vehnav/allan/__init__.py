"""Allan deviation of a sensor at rest, where the rest comes in pieces between stretches of driving.

:mod:`curve` the deviation itself, :mod:`processes` what each kind of noise does to it,
:mod:`spread` how sure it is, :mod:`between` what the means of the pieces say beyond them,
:mod:`fit` the figures of a sensor from all that.
"""

from __future__ import annotations

from vehnav.allan.between import PieceMeans
from vehnav.allan.curve import Curve, allan_curve, octaves
from vehnav.allan.fit import AxisFit, Figure, fit_axes
from vehnav.allan.processes import Powers, allan_form

__all__ = [
    "AxisFit",
    "Curve",
    "Figure",
    "PieceMeans",
    "Powers",
    "allan_curve",
    "allan_form",
    "fit_axes",
    "octaves",
]
